// SPDX-License-Identifier: Apache-2.0
//
// What becomes of an image's channels, samples and colour space on their way through a transfer.
#include "flow/write/images.h"

#include <algorithm>
#include <bit>
#include <catch2/catch.hpp>
#include <cmath>
#include <fstream>
#include <iterator>
#include <limits>
#include <random>

#include "core/colour_space.h"
#include "core/portable_math.h"
#include "io/image/write.h"
#include "pounce/transfer.h"
#include "shading/pad_seams.h"
#include "support/mesh_files.h"
#include "support/test_data.h"
#include "support/whole_image.h"

namespace pounce::test {
namespace {

constexpr std::uint32_t kWidth = 96, kHeight = 80;

/// A wavy sheet whose UVs fill the unit square.
mesh::Mesh wavy_sheet() {
  constexpr std::uint32_t kCells = 9;
  mesh::Mesh mesh;
  mesh.uv_sets.emplace_back();
  mesh.uv_present.emplace_back();
  for (std::uint32_t j = 0; j <= kCells; ++j) {
    for (std::uint32_t i = 0; i <= kCells; ++i) {
      const double u = 1.0 * i / kCells, v = 1.0 * j / kCells;
      mesh.positions.push_back({static_cast<float>(u), static_cast<float>(-v),
                                static_cast<float>(0.02 * std::sin(5 * u) * std::cos(3 * v))});
      mesh.normals.push_back({0, 0, 1});
      mesh.uv_sets[0].push_back({static_cast<float>(u), static_cast<float>(v)});
    }
  }
  const auto at = [](std::uint32_t i, std::uint32_t j) { return j * (kCells + 1) + i; };
  for (std::uint32_t j = 0; j < kCells; ++j) {
    for (std::uint32_t i = 0; i < kCells; ++i) {
      mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i + 1, j)});
      mesh.triangles.push_back({at(i, j), at(i, j + 1), at(i + 1, j + 1)});
    }
  }
  return mesh;
}

template <class Sample>
void write_samples(const std::string& path, io::ImageWriteSpec spec,
                   const std::vector<Sample>& samples) {
  spec.width = kWidth;
  spec.height = kHeight;
  io::ImageWriter writer(path, spec);
  writer.write_rows(kHeight, reinterpret_cast<const std::byte*>(samples.data()));
  writer.commit();
}

/// An image as it is stored.
struct Stored {
  io::ImageInfo info;
  std::vector<std::byte> bytes;
};

Stored stored(const std::string& path) {
  io::ImageReader reader(path);
  reader.keep_premultiplied();
  Stored out{reader.info(), std::vector<std::byte>(reader.row_bytes() * reader.info().height)};
  reader.read_rows(out.info.height, out.bytes.data());
  return out;
}

std::vector<float> floats(const Stored& image) {
  std::vector<float> out(image.bytes.size() / 4);
  std::memcpy(out.data(), image.bytes.data(), image.bytes.size());
  return out;
}

std::vector<float> noise(std::uint32_t channels, std::uint32_t seed = 7) {
  std::mt19937 random(seed);
  std::vector<float> out(std::size_t{kWidth} * kHeight * channels);
  for (float& v : out) v = static_cast<float>(random() % 65536) / 65536;
  return out;
}

using Names = std::vector<std::string>;

/// The sheet onto itself.
struct Scene {
  TempFolder folder;
  TransferOptions options;

  explicit Scene(const std::string& texture) {
    write_glb(folder.file("sheet.glb"), wavy_sheet());
    options.source = folder.file("sheet.glb");
    options.targets = {folder.file("sheet.glb")};
    options.material.textures = {{Channel::base_color, folder.file(texture)}};
    options.search.max_angle_deg = 89;
    options.resources.use_cache = false;
    options.resources.memory_bytes = 256 << 20;
  }
  std::string texture() const { return options.material.textures.front().path; }
  Report run(const std::string& output) {
    options.output = folder.file(output);
    return transfer(options);
  }
  Stored result() const { return stored(options.output); }
};

/// The warnings that hold this text.
std::size_t warnings(const Report& report, const std::string& text) {
  std::size_t count = 0;
  for (const std::string& warning : report.warnings)
    count += warning.find(text) != std::string::npos ? 1 : 0;
  return count;
}

ErrorKind error_of(Scene& scene, const std::string& output, std::string& message) {
  try {
    scene.run(output);
  } catch (const Error& e) {
    message = e.what();
    return e.kind();
  }
  return ErrorKind::internal;
}

const io::ImageWriteSpec kFloatRgb{0, 0, 3, Depth::float32, true, false};
const io::ImageWriteSpec kFloatData{
    0, 0, 4, Depth::float32, true, false, false, {"R", "G", "B", "disp"}, {}};
const io::ImageWriteSpec kFloatRgba{0, 0, 4, Depth::float32, true, true, true, {}, {}};
const Chromaticities kWide{0.713F, 0.293F, 0.165F, 0.83F, 0.128F, 0.044F, 0.32168F, 0.33767F};

}  // namespace

TEST_CASE("float samples come back bit for bit on the surface they are from", "[flow]") {
  Scene scene("noise.exr");
  std::vector<float> samples = noise(3);
  std::mt19937 random(11);
  for (float& v : samples) {  // every finite float, tiny ones beside huge ones
    do {
      v = std::bit_cast<float>(static_cast<std::uint32_t>(random()));
    } while (!std::isfinite(v));
  }
  samples[0] = std::numeric_limits<float>::max();
  samples[3] = std::numeric_limits<float>::denorm_min();
  samples[6] = -std::numeric_limits<float>::denorm_min();
  write_samples(scene.texture(), kFloatRgb, samples);
  const Report report = scene.run("out.exr");
  REQUIRE(report.target_covered == std::uint64_t{kWidth} * kHeight);
  CHECK(report.warnings.empty());
  const std::vector<float> out = floats(scene.result());
  REQUIRE(out.size() == samples.size());
  CHECK(std::memcmp(out.data(), samples.data(), out.size() * 4) == 0);
}

TEST_CASE("half samples come back bit for bit", "[flow]") {
  Scene scene("noise.exr");
  std::mt19937 random(12);
  std::vector<std::uint16_t> samples(std::size_t{kWidth} * kHeight * 3);
  for (std::uint16_t& v : samples) {
    do {
      v = static_cast<std::uint16_t>(random());
    } while (!std::isfinite(half_to_float(v)));
  }
  write_samples(scene.texture(), {0, 0, 3, Depth::half, true, false}, samples);
  CHECK(scene.run("out.exr").warnings.empty());
  const Stored out = scene.result();
  REQUIRE(out.bytes.size() == samples.size() * 2);
  CHECK(std::memcmp(out.bytes.data(), samples.data(), out.bytes.size()) == 0);
}

TEST_CASE("colours of an EXR with alpha come back bit for bit, even where alpha is 0", "[flow]") {
  Scene scene("noise.exr");
  std::vector<float> samples = noise(4);
  for (std::size_t i = 3; i < samples.size(); i += 12) samples[i] = 0;
  write_samples(scene.texture(), kFloatRgba, samples);
  CHECK(scene.run("out.exr").warnings.empty());
  const Stored out = scene.result();
  CHECK(out.info.has_alpha);
  CHECK(floats(out) == samples);
}

TEST_CASE("NaN and infinite samples become 0, counted", "[flow]") {
  Scene scene("noise.exr");
  std::vector<float> samples = noise(3);
  samples[30] = std::numeric_limits<float>::quiet_NaN();
  samples[31] = std::numeric_limits<float>::infinity();
  write_samples(scene.texture(), kFloatRgb, samples);
  const Report report = scene.run("out.exr");
  CHECK(warnings(report, "2 samples are NaN or infinite and count as 0") == 1);
  samples[30] = samples[31] = 0;
  CHECK(floats(scene.result()) == samples);
}

TEST_CASE("a fourth channel that is no alpha keeps its name and weighs nothing", "[flow]") {
  Scene scene("data.exr");
  const std::vector<float> samples = noise(4);
  write_samples(scene.texture(), kFloatData, samples);
  const Report report = scene.run("out.exr");
  CHECK(report.warnings.empty());
  const Stored out = scene.result();
  CHECK(out.info.names == Names{"R", "G", "B", "disp"});
  CHECK_FALSE(out.info.has_alpha);
  CHECK(floats(out) == samples);
}

TEST_CASE("what a format has no place for is left out and said", "[flow]") {
  Scene scene("data.exr");
  const std::vector<float> samples = noise(4);
  write_samples(scene.texture(), kFloatData, samples);
  const Report png = scene.run("out.png");
  CHECK(warnings(png, "out.png") == 1);
  CHECK(warnings(png, "does not fit into PNG and is left out: disp") == 1);
  CHECK(scene.result().info.channels == 3);
  CHECK(warnings(scene.run("out.jpg"), "does not fit into JPEG and is left out: disp") == 1);
  const Report tiff = scene.run("out.tif");
  CHECK(warnings(tiff, "TIFF does not store channel names: R, G, B, disp") == 1);
  const Stored out = scene.result();
  CHECK(out.info.channels == 4);
  CHECK_FALSE(out.info.has_alpha);
  CHECK(floats(out) == samples);
}

TEST_CASE("a TIFF whose fourth sample is no alpha is data, one with alpha is not", "[flow]") {
  Scene scene("data.tif");
  std::vector<std::uint8_t> samples(std::size_t{kWidth} * kHeight * 4);
  std::mt19937 random(3);
  for (std::uint8_t& v : samples) v = static_cast<std::uint8_t>(random());
  write_samples(scene.texture(), {0, 0, 4, Depth::u8, false, false}, samples);
  CHECK_FALSE(stored(scene.texture()).info.has_alpha);
  CHECK(scene.run("out.tif").warnings.size() == 1);
  Stored out = scene.result();
  CHECK_FALSE(out.info.has_alpha);
  CHECK(std::memcmp(out.bytes.data(), samples.data(), samples.size()) == 0);
  write_samples(scene.texture(), {0, 0, 4, Depth::u8, false, true}, samples);
  CHECK(scene.run("out.tif").warnings.empty());
  out = scene.result();
  CHECK(out.info.has_alpha);
  CHECK(std::memcmp(out.bytes.data(), samples.data(), samples.size()) == 0);
}

TEST_CASE("names of other channels and layers are kept, or said where they cannot be", "[flow]") {
  const auto names = GENERATE(values<Names>(
      {{"Y"}, {"Z"}, {"R", "G"}, {"N.X", "N.Y", "N.Z"}, {"diffuse.R", "diffuse.G", "diffuse.B"}}));
  Scene scene("data.exr");
  io::ImageWriteSpec spec = kFloatRgb;
  spec.channels = static_cast<std::uint32_t>(names.size());
  spec.names = names;
  const std::vector<float> samples = noise(spec.channels);
  write_samples(scene.texture(), spec, samples);
  CHECK(scene.run("out.exr").warnings.empty());
  const Stored out = scene.result();
  CHECK(out.info.names == names);
  CHECK(floats(out) == samples);
  CHECK(scene.run("out.png").warnings.size() == (names == Names{"Y"} ? 0 : 1));
}

TEST_CASE("layers of one file are maps of their own, exact", "[flow]") {
  Scene scene("layers.exr");
  io::ImageWriteSpec spec = kFloatData;
  spec.names = {"diffuse.R", "diffuse.G", "diffuse.B", "disp"};
  const std::vector<float> samples = noise(4);
  write_samples(scene.texture(), spec, samples);
  const std::string file = scene.texture();
  scene.options.channels.other_maps = {{"displacement", std::nullopt}};
  scene.options.material.textures = {{Channel::base_color, file + ":diffuse"},
                                     {other_channel(0), file + ":disp"}};
  scene.options.resources.use_cache = true;  // where both have packs under keys of their own
  scene.options.resources.cache_dir = scene.folder.file("cache");
  CHECK(scene.run("<CHANNEL>.exr").warnings.empty());
  const Stored colour = stored(scene.folder.file("baseColor.exr"));
  const Stored other = stored(scene.folder.file("displacement.exr"));
  CHECK(colour.info.names == Names{"diffuse.R", "diffuse.G", "diffuse.B"});
  CHECK(other.info.names == Names{"disp"});
  const std::vector<float> rgb = floats(colour), disp = floats(other);
  REQUIRE(rgb.size() + disp.size() == samples.size());
  for (std::size_t i = 0; i < samples.size(); ++i)
    if (samples[i] != (i % 4 == 3 ? disp[i / 4] : rgb[i / 4 * 3 + i % 4])) FAIL("sample " << i);
}

TEST_CASE("grey with alpha keeps both", "[flow]") {
  Scene scene("grey.exr");
  const std::vector<float> samples = noise(2);
  write_samples(scene.texture(), {0, 0, 2, Depth::float32, true, true, true, {}, {}}, samples);
  CHECK(scene.run("out.exr").warnings.empty());
  CHECK(scene.result().info.names == Names{"Y", "A"});
  CHECK(scene.result().info.has_alpha);
  CHECK(floats(scene.result()) == samples);
}

/// The one note of a conversion that a job tells, "" if there is none.
std::string note(const Report& report) {
  std::string found;
  for (const std::string& text : report.notes) {
    if (text.find(" is converted from ") == std::string::npos) continue;
    REQUIRE(found.empty());
    found = text;
  }
  return found;
}

TEST_CASE("linear light of other primaries stays in EXR and becomes sRGB elsewhere", "[flow]") {
  Scene scene("wide.exr");
  io::ImageWriteSpec spec = kFloatRgb;
  spec.chromaticities = kWide;
  const std::vector<float> samples = noise(3);
  write_samples(scene.texture(), spec, samples);
  const Report exr = scene.run("out.exr");
  CHECK(exr.warnings.empty());
  CHECK(exr.notes.empty());
  REQUIRE(scene.result().info.colours.primaries);
  CHECK(*scene.result().info.colours.primaries == kWide);
  CHECK(floats(scene.result()) == samples);
  const Report tiff = scene.run("out.tif");  // float, which stays linear: a profile says of what
  CHECK(tiff.notes.empty());
  CHECK(same_primaries(scene.result().info.space().primaries, kWide));
  CHECK(floats(scene.result()) == samples);
  CHECK(note(scene.run("out.png")) == "baseColor is converted from acescg to srgb");
  const Stored png = scene.result();
  CHECK(png.info.depth == Depth::u16);
  std::size_t clipped = 0;
  for (std::size_t i = 0; i < samples.size(); i += 3) {
    // ACES' published matrix, by hand.
    const double r = samples[i], g = samples[i + 1], b = samples[i + 2];
    const std::array<double, 3> linear{1.70505 * r - 0.62179 * g - 0.08326 * b,
                                       -0.13026 * r + 1.14080 * g - 0.01055 * b,
                                       -0.02400 * r - 0.12897 * g + 1.15297 * b};
    for (std::size_t c = 0; c < 3; ++c) {
      const double l = std::clamp(linear[c], 0.0, 1.0);
      const double coded = l <= 0.0031308 ? 12.92 * l : 1.055 * std::pow(l, 1 / 2.4) - 0.055;
      std::uint16_t sample;
      std::memcpy(&sample, png.bytes.data() + 2 * (i + c), 2);
      clipped += linear[c] != l ? 1 : 0;
      if (std::fabs(sample / 65535.0 - coded) > 1e-3) FAIL(i << " " << sample << " " << coded);
    }
  }
  CHECK(clipped > 0);
}

TEST_CASE("coded colours of Display P3 stay so, with a profile", "[flow]") {
  const Chromaticities p3 = colour_space_from_name("display-p3")->primaries;
  Scene scene("p3.png");
  std::vector<std::uint8_t> samples(std::size_t{kWidth} * kHeight * 3);
  std::mt19937 random(5);
  for (std::uint8_t& v : samples) v = static_cast<std::uint8_t>(random());
  io::ImageWriteSpec spec{0, 0, 3, Depth::u8, false, false};
  spec.chromaticities = p3;
  write_samples(scene.texture(), spec, samples);
  for (const char* name : {"out.png", "out.tif"}) {
    CAPTURE(name);
    CHECK(note(scene.run(name)).empty());
    const Stored out = scene.result();
    CHECK(colour_space_name(out.info.space()) == "display-p3");
    CHECK(std::memcmp(out.bytes.data(), samples.data(), samples.size()) == 0);
  }
  CHECK(note(scene.run("out.jpg")).empty());
  CHECK(colour_space_name(scene.result().info.space()) == "display-p3");
  // EXR: the curve alone.
  CHECK(note(scene.run("out.exr")).starts_with("baseColor is converted from display-p3 to linear"));
  REQUIRE(scene.result().info.colours.primaries);
  CHECK(*scene.result().info.colours.primaries == p3);
  // Asked for: its red is out of sRGB.
  std::fill(samples.begin(), samples.end(), std::uint8_t{0});
  for (std::size_t i = 0; i < samples.size(); i += 3) samples[i] = 255;
  write_samples(scene.texture(), spec, samples);
  scene.options.image.colour_space = "lin_rec709";
  CHECK(note(scene.run("out.exr")) == "baseColor is converted from display-p3 to lin_rec709");
  scene.options.image.depth = Depth::float32;
  scene.run("out.exr");
  const std::vector<float> red = floats(scene.result());
  CHECK(red[0] == Approx(1.22494F).epsilon(1e-5));
  CHECK(red[1] == Approx(-0.042057F).epsilon(1e-4));
  CHECK(red[2] == Approx(-0.019638F).epsilon(1e-4));
  // What the file says does not count where the user says otherwise.
  scene.options.colour.source_spaces = {{std::nullopt, "srgb"}};
  scene.run("out.exr");
  CHECK(floats(scene.result())[0] == 1);
  CHECK(floats(scene.result())[1] == 0);
  scene.options.colour.source_spaces = {{std::nullopt, "srgb"}, {Channel::base_color, "acescg"}};
  scene.run("out.exr");
  CHECK(floats(scene.result())[0] == Approx(1.70505F).epsilon(1e-5));
}

TEST_CASE("UDIM tiles of different colour spaces meet in the first one's", "[flow]") {
  Scene scene("set.<UDIM>.exr");
  io::ImageWriteSpec spec = kFloatRgb;
  const std::vector<float> grey(std::size_t{kWidth} * kHeight * 3, 0.25F);
  std::vector<float> red(grey.size());
  for (std::size_t i = 0; i < red.size(); i += 3) red[i] = 1;
  write_samples(scene.folder.file("set.1001.exr"), spec, grey);
  spec.chromaticities = kWide;
  write_samples(scene.folder.file("set.1002.exr"), spec, red);
  mesh::Mesh two = wavy_sheet();
  for (Vec2f& uv : two.uv_sets[0]) uv.x *= 2;
  write_glb(scene.folder.file("sheet.glb"), two);
  const std::string said = note(scene.run("out.<UDIM>.exr"));
  CHECK(said.find("set.1002.exr is converted from acescg to the colour space of") !=
        std::string::npos);
  const std::vector<float> first = floats(stored(scene.folder.file("out.1001.exr")));
  const std::vector<float> second = floats(stored(scene.folder.file("out.1002.exr")));
  const std::size_t middle = 3 * (std::size_t{kHeight} / 2 * kWidth + kWidth / 2);
  CHECK(first[middle] == 0.25F);
  CHECK(first[middle + 1] == 0.25F);
  CHECK(second[middle] == Approx(1.70505F).epsilon(1e-5));
  CHECK(second[middle + 1] == Approx(-0.13026F).epsilon(1e-4));
}

/// Of the first curve of the profile in a TIFF: 2.4 becomes 1.8, in 65536ths.
void change_gamma(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  std::string bytes{std::istreambuf_iterator<char>(in), {}};
  const std::size_t at = bytes.find(std::string("\0\2\x66\x66", 4));
  REQUIRE(at != std::string::npos);
  bytes.replace(at, 4, "\0\1\xCC\xCC", 4);
  std::ofstream(path, std::ios::binary) << bytes;
}

TEST_CASE("a profile that is not known is told", "[flow]") {
  Scene scene("odd.tif");
  io::ImageWriteSpec spec{0, 0, 3, Depth::u8, false, false};
  spec.chromaticities = colour_space_from_name("display-p3")->primaries;
  const std::vector<std::uint8_t> samples(std::size_t{kWidth} * kHeight * 3, 100);
  write_samples(scene.texture(), spec, samples);
  change_gamma(scene.texture());
  const Report report = scene.run("out.png");
  CHECK(warnings(report, "is not applied; its colours are read as srgb") == 1);
  scene.options.colour.source_spaces = {{std::nullopt, "srgb"}};
  CHECK(scene.run("out.png").warnings.empty());
}

TEST_CASE("a half of 40 arrives as 40", "[flow]") {
  Scene scene("hot.exr");
  const std::vector<std::uint16_t> samples(std::size_t{kWidth} * kHeight * 3, float_to_half(40.0F));
  write_samples(scene.texture(), {0, 0, 3, Depth::half, true, false}, samples);
  CHECK(scene.run("out.exr").warnings.empty());
  const Stored out = scene.result();
  REQUIRE(out.bytes.size() == samples.size() * 2);
  CHECK(std::memcmp(out.bytes.data(), samples.data(), out.bytes.size()) == 0);
}

TEST_CASE("samples that the output cannot hold are counted and said once", "[flow]") {
  Scene scene("hdr.exr");
  std::vector<float> samples = noise(3);
  const std::size_t texel = (10 * kWidth + 10) * 3;
  samples[texel] = 4;
  samples[texel + 1] = -2;
  samples[texel + 2] = 1.000005F;  // rounds to 1
  samples[texel + 30] = 70000;
  write_samples(scene.texture(), kFloatRgb, samples);
  for (const char* name : {"out.png", "out.jpg"}) {
    const Report report = scene.run(name);
    CHECK(report.target_clipped == 3);
    CHECK(warnings(report, "3 samples of baseColor were clipped") == 1);
    CHECK(warnings(report, "--depth half or float with .exr") == 1);
  }
  const Report exr = scene.run("out.exr");
  CHECK(exr.target_clipped == 0);
  CHECK(exr.warnings.empty());
  scene.options.image.depth = Depth::half;
  const Report half = scene.run("half.exr");
  CHECK(half.target_clipped == 1);
  CHECK(warnings(half, "use --depth float to keep them") == 1);
}

TEST_CASE("painting over leaves a channel alone that the source has not", "[flow]") {
  Scene scene("colour.exr");
  const std::vector<float> fresh = noise(3, 1), old = noise(4, 2);
  write_samples(scene.texture(), kFloatRgb, fresh);
  write_samples(scene.folder.file("old.exr"), kFloatData, old);
  scene.options.composite.onto = scene.folder.file("old.exr");
  CHECK(scene.run("out.exr").warnings.empty());
  const std::vector<float> out = floats(scene.result());
  CHECK(scene.result().info.names == Names{"R", "G", "B", "disp"});
  REQUIRE(out.size() == old.size());
  for (std::size_t i = 0; i < out.size(); ++i)
    if (out[i] != (i % 4 == 3 ? old[i] : fresh[i / 4 * 3 + i % 4])) FAIL("sample " << i);
}

TEST_CASE("images whose channels do not go together are said so", "[flow]") {
  std::string message;
  Scene scene("set.<UDIM>.exr");
  mesh::Mesh two = wavy_sheet();
  for (Vec2f& uv : two.uv_sets[0]) uv.x *= 2;
  write_glb(scene.folder.file("sheet.glb"), two);
  write_samples(scene.folder.file("set.1001.exr"), kFloatData, noise(4));
  write_samples(scene.folder.file("set.1002.exr"), kFloatRgba, noise(4));
  const Report report = scene.run("out.exr");
  CHECK(warnings(report, "does not fit into an image with alpha and is left out: disp") == 1);
  CHECK(scene.result().info.names == Names{"R", "G", "B", "A"});
  Scene absent("absent.exr");
  CHECK(error_of(absent, "out.exr", message) == ErrorKind::storage);
  CHECK_THAT(message, Catch::Contains("absent.exr: cannot open: No such file or directory"));
}

TEST_CASE("padding costs an image the rows that it looks ahead, once", "[flow]") {
  const Depth depth = GENERATE(Depth::u8, Depth::float32);
  const std::uint32_t padding = GENERATE(16U, 512U, 4096U);
  const shading::TexelFormat format{4, depth, true, false, true, false};
  planning::ImageOutput image;
  image.path = "o.exr";
  image.lattice = {65536, 65536, 0, {}};
  const auto padder = [&](std::uint32_t radius) {
    return shading::SeamPadder::memory_bytes(65536, radius,
                                             static_cast<std::uint32_t>(format.texel_bytes()), 64);
  };
  const std::uint64_t without = flow::image_least_bytes(image, format);
  image.padding = padding;
  CHECK(flow::image_least_bytes(image, format) - without == padder(padding) - padder(0));
}

}  // namespace pounce::test
