// SPDX-License-Identifier: Apache-2.0
//
// Tiled images with levels, as renderers read them: through OpenImageIO's ImageCache, and beside
// what maketx makes.
#include <OpenImageIO/imagecache.h>
#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <cstring>

#include "core/portable_math.h"
#include "flow/write/image_file.h"
#include "job/run_job.h"
#include "support/model_files.h"
#include "support/test_data.h"

namespace pounce::test {
namespace {

struct Level {
  int width = 0, height = 0;
  std::vector<float> samples;
};

/// All levels as a renderer's cache hands them out, colours times alpha.
std::vector<Level> cached_levels(const std::string& path) {
  OIIO::ImageCache* const cache = OIIO::ImageCache::create(false);
  const OIIO::ustring name(path);
  int count = 0;
  REQUIRE(cache->get_image_info(name, 0, 0, OIIO::ustring("miplevels"), OIIO::TypeInt, &count));
  std::vector<Level> levels;
  for (int level = 0; level < count; ++level) {
    OIIO::ImageSpec spec;
    REQUIRE(cache->get_imagespec(name, spec, 0, level));
    CHECK(spec.tile_width > 0);
    Level& out = levels.emplace_back(Level{spec.width, spec.height, {}});
    out.samples.resize(std::size_t(spec.width) * std::size_t(spec.height) *
                       std::size_t(spec.nchannels));
    REQUIRE(cache->get_pixels(name, 0, level, 0, spec.width, 0, spec.height, 0, 1, OIIO::TypeFloat,
                              out.samples.data()));
  }
  CHECK(cache->geterror().empty());
  OIIO::ImageCache::destroy(cache);
  return levels;
}

/// The mean colour that a renderer is told.
std::vector<float> average_colour(const std::string& path, std::uint32_t channels) {
  OIIO::ImageCache* const cache = OIIO::ImageCache::create(false);
  std::vector<float> colour(channels);
  const OIIO::TypeDesc type(OIIO::TypeDesc::FLOAT, channels > 1 ? static_cast<int>(channels) : 0);
  CHECK(cache->get_image_info(OIIO::ustring(path), 0, 0, OIIO::ustring("averagecolor"), type,
                              colour.data()));
  OIIO::ImageCache::destroy(cache);
  return colour;
}

float worst(const std::vector<Level>& a, const std::vector<Level>& b) {
  REQUIRE(a.size() == b.size());
  float most = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    CAPTURE(i);
    REQUIRE(a[i].width == b[i].width);
    REQUIRE(a[i].height == b[i].height);
    REQUIRE(a[i].samples.size() == b[i].samples.size());
    for (std::size_t k = 0; k < a[i].samples.size(); ++k)
      most = std::max(most, std::abs(a[i].samples[k] - b[i].samples[k]));
  }
  return most;
}

/// Smooth, with an edge, alpha from 0 to 1.
std::vector<std::byte> picture(const io::ImageWriteSpec& spec) {
  std::vector<std::byte> bytes;
  for (std::uint32_t y = 0; y < spec.height; ++y) {
    for (std::uint32_t x = 0; x < spec.width; ++x) {
      for (std::uint32_t c = 0; c < spec.channels; ++c) {
        const bool alpha = spec.has_alpha && c + 1 == spec.channels;
        const double wave = 0.5 + 0.5 * std::sin(0.21 * x + 0.13 * y + c) * std::cos(0.05 * x * c);
        const double v = alpha ? double(x) / spec.width : x > y ? wave : 1 - wave / 3;
        std::byte sample[4] = {};
        const auto u8 = static_cast<std::uint8_t>(v * 255);
        const auto u16 = static_cast<std::uint16_t>(v * 65535);
        const auto f = static_cast<float>(alpha ? v : 3 * v);
        const std::uint16_t h = float_to_half(f);
        std::size_t size = 4;
        if (spec.depth == Depth::u8) std::memcpy(sample, &u8, size = 1);
        if (spec.depth == Depth::u16) std::memcpy(sample, &u16, size = 2);
        if (spec.depth == Depth::half) std::memcpy(sample, &h, size = 2);
        if (spec.depth == Depth::float32) std::memcpy(sample, &f, size = 4);
        bytes.insert(bytes.end(), sample, sample + size);
      }
    }
  }
  return bytes;
}

void write(const std::string& path, const io::ImageWriteSpec& spec, std::uint32_t together) {
  job::JobRun run(nullptr);
  Resources resources;
  resources.use_cache = false;
  const auto job = job::open_job(resources, path, nullptr, false, false, run);
  const std::vector<std::byte> samples = picture(spec);
  const std::size_t row = samples.size() / spec.height;
  flow::ImageFile file(*job, path, spec, nullptr);
  for (std::uint32_t y = 0; y < spec.height; y += together)
    file.write_rows(std::min(together, spec.height - y), samples.data() + y * row);
  file.finish()->commit();
  CHECK(job->scratch_account->peak_bytes() == flow::ImageFile::scratch_bytes(spec));
}

io::ImageWriteSpec levels_spec(std::uint32_t width, std::uint32_t height, std::uint32_t channels,
                               Depth depth) {
  io::ImageWriteSpec spec{width, height, channels, depth, depth >= Depth::half, channels == 4};
  spec.layout = {"", 64, true};
  return spec;
}

}  // namespace

TEST_CASE("levels are those of maketx, and a renderer's cache reads them all", "[flow][mip]") {
  const auto [ending, depth] = GENERATE(table<std::string, Depth>({{".tx", Depth::u8},
                                                                   {".tx", Depth::u16},
                                                                   {".tx", Depth::half},
                                                                   {".tx", Depth::float32},
                                                                   {".tif", Depth::u8},
                                                                   {".exr", Depth::half},
                                                                   {".exr", Depth::float32}}));
  const auto [width, height, channels] =
      GENERATE(table<std::uint32_t, std::uint32_t, std::uint32_t>(
          {{256, 128, 4}, {203, 97, 3}, {97, 203, 4}, {1, 77, 1}, {65, 1, 4}}));
  CAPTURE(ending, depth_name(depth), width, height, channels);
  const TempFolder folder;
  const io::ImageWriteSpec spec = levels_spec(width, height, channels, depth);
  const std::string made = folder.file("made" + ending);
  write(made, spec, 17);
  const std::vector<Level> levels = cached_levels(made);
  CHECK(levels.size() == shading::level_count({width, height}));
  CHECK(levels.back().samples.size() == channels);
  const std::vector<float> average = average_colour(made, channels);
  CHECK(average == levels.back().samples);
  const bool is_even = width == 256;  // a linear filter of odd sides is no plain mean
  for (std::uint32_t c = 0; is_even && c < channels; ++c) {
    double sum = 0;
    for (std::size_t i = c; i < levels.front().samples.size(); i += channels)
      sum += levels.front().samples[i];
    CHECK(average[c] == Approx(sum / (width * height)).margin(0.51 / 255));
  }

  const bool is_exr = io::is_exr(made, depth);
  CHECK(is_exr == (ending == ".exr" || depth == Depth::half));
  const auto input = OIIO::ImageInput::open(made);
  REQUIRE(input);
  CHECK(std::string(input->format_name()) == (is_exr ? "openexr" : "tiff"));
  CHECK(input->spec().get_string_attribute("textureformat") == "Plain Texture");
  CHECK(input->spec().get_string_attribute("wrapmodes") == "black,black");
  CHECK(input->spec().get_float_attribute("fovcot") == Approx(1.0 * width / height));

  if (std::system("maketx --version >/dev/null 2>&1") != 0) {
    WARN("SKIPPED: needs maketx");
    return;
  }
  io::ImageWriteSpec plain = spec;
  plain.layout = {};
  const std::string rows = folder.file(is_exr ? "rows.exr" : "rows.tif");
  write(rows, plain, 17);
  const std::string theirs = folder.file("theirs" + (ending == ".exr" ? ending : ".tx"));
  const std::string format = is_exr ? "maketx --format openexr '" : "maketx '";
  REQUIRE(std::system((format + rows + "' -o '" + theirs + "' >/dev/null").c_str()) == 0);
  // Half keeps eleven bits, and our alpha is multiplied in before, theirs after rounding to
  // integers.
  CHECK(worst(levels, cached_levels(theirs)) <= 1.0F / 255);
}

TEST_CASE("a file with levels has the same bytes however its rows come", "[flow][mip]") {
  const std::string ending = GENERATE(".tx", ".exr");
  const TempFolder folder;
  const auto bytes = [&](std::uint32_t together) {
    const std::string path = folder.file(std::to_string(together) + ending);
    write(path, levels_spec(203, 97, 4, ending == ".tx" ? Depth::u8 : Depth::half), together);
    return file_bytes(path);
  };
  const std::string first = bytes(1);
  CHECK(first == bytes(64));
  CHECK(first == bytes(97));
}

}  // namespace pounce::test
