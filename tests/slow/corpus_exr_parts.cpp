// SPDX-License-Identifier: Apache-2.0
//
// EXR files that hold more than one image, layers, or no plain one.
#include <Imath/half.h>
#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfDeepFrameBuffer.h>
#include <OpenEXR/ImfDeepScanLineOutputFile.h>
#include <OpenEXR/ImfDeepTiledOutputFile.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfMultiPartOutputFile.h>
#include <OpenEXR/ImfOutputPart.h>
#include <OpenEXR/ImfPartType.h>
#include <OpenEXR/ImfRgbaFile.h>
#include <OpenEXR/ImfTiledOutputPart.h>
#include <fmt/format.h>

#include <array>

#include "corpus_exr.h"
#include "io/codec/sample.h"

namespace pounce::test::corpus {
namespace {

/// An entry per set of channels that is wanted of one file; the first one writes it.
struct Wanted {
  const char* what;  ///< ImageRef::channels
  std::vector<std::string> names;
  bool has_alpha = false;
  int part = 0;
};

void write_parts(const std::vector<Exr>& parts, const std::vector<Planes>& planes,
                 const std::string& path) {
  std::vector<Imf::Header> headers;
  for (const Exr& part : parts) headers.push_back(header_of(part));
  Imf::MultiPartOutputFile file(path.c_str(), headers.data(), static_cast<int>(headers.size()));
  for (std::size_t i = 0; i < parts.size(); ++i) {
    Imf::FrameBuffer buffer;
    Planes copy = planes[i];
    for (const ExrChannel& channel : parts[i].channels) {
      const std::size_t size = channel.type == Imf::HALF ? 2 : 4;
      buffer.insert(channel.name,
                    Imf::Slice(channel.type, reinterpret_cast<char*>(copy[channel.name].data()),
                               size, size * parts[i].width));
    }
    const int number = static_cast<int>(i);
    if (parts[i].tile_width > 0) {
      Imf::TiledOutputPart part(file, number);
      part.setFrameBuffer(buffer);
      part.writeTiles(0, part.numXTiles() - 1, 0, part.numYTiles() - 1);
    } else {
      Imf::OutputPart part(file, number);
      part.setFrameBuffer(buffer);
      part.writePixels(static_cast<int>(parts[i].height));
    }
  }
}

/// Of one part: without a name it is a plain file.
void add_wanted(Entries& entries, const std::string& name, const std::vector<Exr>& parts,
                const std::vector<Wanted>& all) {
  const std::string file = "exr-" + name + ".exr";
  for (const Wanted& wanted : all) {
    // The same file each time: the maker's numbers come from the file's name.
    const Maker make = [parts, wanted](const std::string& path, Random& random) {
      std::vector<Planes> planes;
      for (const Exr& part : parts) planes.push_back(planes_of(part, random));
      if (parts.size() == 1 && parts[0].part.empty())
        write_file(parts[0], planes[0], path);
      else
        write_parts(parts, planes, path);
      const auto at = static_cast<std::size_t>(wanted.part);
      Exr exr = parts[at];
      exr.wanted = wanted.names;
      exr.has_alpha = wanted.has_alpha;
      exr.no_rule = wanted.names.empty();
      return expected(exr, planes[at]);
    };
    const std::string what = wanted.what;
    entries.push_back({what.empty() ? file : file + ":" + what, file, what, wanted.part, make});
  }
}

void add_layers(Entries& entries) {
  Exr exr;
  exr.channels = {{"diffuse.R"}, {"diffuse.G"}, {"diffuse.B"}, {"spec.R"},
                  {"spec.G"},    {"spec.B"},    {"spec.A"},    {"depth.Z", Imf::FLOAT}};
  add_wanted(entries, "layers", {exr},
             {{"", {}},
              {"diffuse", {"diffuse.R", "diffuse.G", "diffuse.B"}},
              {"spec", {"spec.R", "spec.G", "spec.B", "spec.A"}, true},
              {"spec.B,G,R", {"spec.B", "spec.G", "spec.R"}},
              {"spec.A", {"spec.A"}},
              {"depth.Z", {"depth.Z"}},
              {"depth.Z,diffuse.R", {"depth.Z", "diffuse.R"}},
              {"nothing", {}}});
  exr.channels.insert(exr.channels.begin(), {{"R"}, {"G"}, {"B"}, {"A"}});
  add_wanted(entries, "layers-and-main", {exr},
             {{"", {"R", "G", "B", "A"}, true}, {"R", {"R"}}, {"A,R", {"A", "R"}}});
  exr.channels = {{"left.R"}, {"left.G"}, {"left.B"}, {"right.R"}, {"right.G"}, {"right.B"}};
  add_wanted(entries, "views", {exr},
             {{"", {"left.R", "left.G", "left.B"}}, {"right", {"right.R", "right.G", "right.B"}}});
  exr.channels = {{"R"}, {"G"}, {"B"}, {"right.R"}, {"right.G"}, {"right.B"}};
  add_wanted(entries, "right-view", {exr}, {{"", {"R", "G", "B"}}});
}

void add_parts(Entries& entries) {
  Exr main = usual_exr(), other = usual_exr(), depth;
  main.part = "main";
  other.part = "glow";
  other.height = 20;
  other.display = Imath::Box2i({0, 0}, {36, 28});
  other.compression = Imf::PIZ_COMPRESSION;
  depth.part = "depth";
  depth.channels = {{"Z", Imf::FLOAT}};
  const std::vector<std::string> rgba{"R", "G", "B", "A"};
  add_wanted(entries, "parts", {main, depth},
             {{"", rgba, true}, {"depth", {"Z"}, false, 1}, {"Z", {"Z"}, false, 1}});
  add_wanted(entries, "parts-of-sizes", {main, other, depth},
             {{"", rgba, true}, {"glow", rgba, true, 1}, {"depth", {"Z"}, false, 2}});
  other.height = main.height;
  add_wanted(entries, "parts-alike", {main, other, depth},
             {{"", rgba, true}, {"glow", rgba, true, 1}, {"glow.R,G", {"R", "G"}, false, 1}});
  main.tile_width = main.tile_height = 16;
  add_wanted(entries, "parts-tiled", {main, depth},
             {{"", rgba, true}, {"depth.Z", {"Z"}, false, 1}});
  main.tile_width = main.tile_height = 0;
  main.view = "left";
  other = main;
  other.part = "second";
  other.view = "right";
  add_wanted(entries, "parts-views", {main, other}, {{"", rgba, true}});
}

/// As OpenEXR itself turns luminance and chroma into colours. Luminance alone stays one channel.
std::optional<Picture> read_rgba_file(const std::string& path, bool has_alpha) {
  Imf::RgbaInputFile file(path.c_str());
  const Imath::Box2i box = file.dataWindow();
  const int width = box.max.x + 1, height = box.max.y + 1;
  std::vector<Imf::Rgba> texels(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  file.setFrameBuffer(texels.data(), 1, static_cast<std::size_t>(width));
  file.readPixels(0, height - 1);
  const bool grey = (file.channels() & (Imf::WRITE_RGB | Imf::WRITE_C)) == 0;
  Picture out{static_cast<std::uint32_t>(width),
              static_cast<std::uint32_t>(height),
              (grey ? 1U : 3U) + (has_alpha ? 1U : 0U),
              Depth::half,
              has_alpha,
              {}};
  for (const Imf::Rgba& texel : texels) {
    append(out.samples, texel.r);
    if (!grey) append(out.samples, texel.g);
    if (!grey) append(out.samples, texel.b);
    if (has_alpha) append(out.samples, texel.a);
  }
  if (has_alpha) io::divide_by_alpha(out.depth, out.channels, texels.size(), out.samples.data());
  return out;
}

/// By OpenEXR's interface for colours: luminance and chroma, the latter coarser.
void add_rgba_files(Entries& entries) {
  struct Kind {
    const char* name;
    Imf::RgbaChannels channels;
  };
  for (const Kind& kind :
       {Kind{"yc", Imf::WRITE_YC}, Kind{"yca", Imf::WRITE_YCA}, Kind{"y", Imf::WRITE_Y},
        Kind{"ya", Imf::WRITE_YA}, Kind{"rgb", Imf::WRITE_RGB}, Kind{"rgba", Imf::WRITE_RGBA}}) {
    corpus::add(entries, fmt::format("exr-rgba-file-{}.exr", kind.name),
                [kind](const std::string& path, Random& random) {
                  constexpr int kWidth = 36, kHeight = 28;
                  std::vector<Imf::Rgba> texels(std::size_t{kWidth} * kHeight);
                  for (Imf::Rgba& texel : texels) {
                    texel = {half(random.between(0.0F, 2.0F)), half(random.between(0.0F, 2.0F)),
                             half(random.between(0.0F, 2.0F)), half(random.between(0.0F, 1.0F))};
                  }
                  {
                    Imf::RgbaOutputFile file(path.c_str(), kWidth, kHeight, kind.channels);
                    file.setFrameBuffer(texels.data(), 1, kWidth);
                    file.writePixels(kHeight);
                  }
                  return read_rgba_file(path, (kind.channels & Imf::WRITE_A) != 0);
                });
  }
}

struct Deep {
  std::vector<unsigned> counts;
  std::vector<std::vector<half>> samples;
  std::vector<half*> places;
};

Imf::DeepFrameBuffer deep_buffer(Deep& deep, std::size_t texels, std::size_t width,
                                 Random& random) {
  for (std::size_t i = 0; i < texels; ++i) {
    deep.counts.push_back(static_cast<unsigned>(random.below(4)));
    deep.samples.emplace_back(deep.counts.back(), half(0.5F));
  }
  for (std::vector<half>& some : deep.samples) deep.places.push_back(some.data());
  Imf::DeepFrameBuffer buffer;
  buffer.insertSampleCountSlice(Imf::Slice(Imf::UINT, reinterpret_cast<char*>(deep.counts.data()),
                                           sizeof(unsigned), sizeof(unsigned) * width));
  for (const char* name : {"A", "Z"}) {
    buffer.insert(name, Imf::DeepSlice(Imf::HALF, reinterpret_cast<char*>(deep.places.data()),
                                       sizeof(half*), sizeof(half*) * width, sizeof(half)));
  }
  return buffer;
}

void add_deep(Entries& entries) {
  for (const bool tiled : {false, true}) {
    corpus::add(entries, tiled ? "exr-deep-tiles.exr" : "exr-deep.exr",
                [tiled](const std::string& path, Random& random) {
                  constexpr int kSide = 20;
                  Imf::Header header(kSide, kSide);
                  header.channels().insert("A", Imf::Channel(Imf::HALF));
                  header.channels().insert("Z", Imf::Channel(Imf::HALF));
                  header.compression() = Imf::ZIPS_COMPRESSION;
                  header.setType(tiled ? Imf::DEEPTILE : Imf::DEEPSCANLINE);
                  if (tiled) header.setTileDescription({16, 16, Imf::ONE_LEVEL});
                  Deep deep;
                  const auto buffer = deep_buffer(deep, std::size_t{kSide} * kSide, kSide, random);
                  if (tiled) {
                    Imf::DeepTiledOutputFile file(path.c_str(), header);
                    file.setFrameBuffer(buffer);
                    file.writeTiles(0, file.numXTiles() - 1, 0, file.numYTiles() - 1);
                  } else {
                    Imf::DeepScanLineOutputFile file(path.c_str(), header);
                    file.setFrameBuffer(buffer);
                    file.writePixels(kSide);
                  }
                  return std::optional<Picture>();
                });
  }
}

}  // namespace

void add_exr_parts(Entries& entries) {
  add_layers(entries);
  add_parts(entries);
  add_rgba_files(entries);
  add_deep(entries);
}

}  // namespace pounce::test::corpus
