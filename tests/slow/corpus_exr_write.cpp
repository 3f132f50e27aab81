// SPDX-License-Identifier: Apache-2.0
#include <Imath/half.h>
#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfInputFile.h>
#include <OpenEXR/ImfOutputFile.h>
#include <OpenEXR/ImfPartType.h>
#include <OpenEXR/ImfStandardAttributes.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <OpenEXR/ImfTileDescription.h>
#include <OpenEXR/ImfTiledOutputFile.h>

#include <cmath>
#include <limits>

#include "corpus_exr.h"
#include "io/codec/sample.h"

namespace pounce::test::corpus {
namespace {

std::size_t bytes_of(Imf::PixelType type) { return type == Imf::HALF ? 2 : 4; }

float number(const Exr& exr, const ExrChannel& channel, std::size_t i, Random& random) {
  const bool alpha = channel.name == "A" || channel.name.ends_with(".A");
  if (alpha) return random.one_in(5) ? 0 : random.one_in(3) ? 1 : random.between(0.0F, 1.0F);
  if (exr.odd_values && random.one_in(4)) {
    const std::array<float, 6> odd{std::numeric_limits<float>::infinity(),
                                   -std::numeric_limits<float>::infinity(),
                                   std::numeric_limits<float>::quiet_NaN(),
                                   -0.0F,
                                   6e-8F,
                                   65504};
    return odd[random.below(odd.size())];
  }
  const float slope = static_cast<float>(i % 397) / 397;
  return random.one_in(6) ? random.between(-2.0F, 40.0F) : slope + random.between(0.0F, 0.05F);
}

Imf::FrameBuffer buffer_of(const Exr& exr, Planes& planes, std::uint32_t width) {
  Imf::FrameBuffer buffer;
  for (const ExrChannel& channel : exr.channels) {
    const std::size_t size = bytes_of(channel.type);
    const auto step = static_cast<std::size_t>(channel.sampling);
    const std::size_t row = size * (width / step);
    char* const data = reinterpret_cast<char*>(planes[channel.name].data());
    buffer.insert(
        channel.name,
        Imf::Slice(channel.type,
                   data - exr.left / channel.sampling * static_cast<std::ptrdiff_t>(size) -
                       exr.top / channel.sampling * static_cast<std::ptrdiff_t>(row),
                   size, row, channel.sampling, channel.sampling));
  }
  return buffer;
}

bool loses(const Exr& exr) {
  return exr.compression == Imf::PXR24_COMPRESSION || exr.compression == Imf::B44_COMPRESSION ||
         exr.compression == Imf::B44A_COMPRESSION || exr.compression == Imf::DWAA_COMPRESSION ||
         exr.compression == Imf::DWAB_COMPRESSION;
}

/// What OpenEXR makes of what it was given.
Planes decoded(const Exr& exr, Planes planes, const std::string& path) {
  Imf::InputFile file(path.c_str());
  file.setFrameBuffer(buffer_of(exr, planes, exr.width));
  file.readPixels(exr.top, exr.top + static_cast<int>(exr.height) - 1);
  return planes;
}

void write_tiles(const Exr& exr, const Planes& planes, const std::string& path) {
  Imf::TiledOutputFile file(path.c_str(), header_of(exr));
  Planes level = planes;
  for (int y = 0; y < file.numYLevels(); ++y) {
    for (int x = 0; x < file.numXLevels(); ++x) {
      if (!file.isValidLevel(x, y)) continue;
      const auto width = static_cast<std::uint32_t>(file.levelWidth(x));
      // The smaller ones hold whatever is at the beginning of the large one.
      file.setFrameBuffer(buffer_of(exr, level, width));
      file.writeTiles(0, file.numXTiles(x) - 1, 0, file.numYTiles(y) - 1, x, y);
    }
  }
}

void append_sample(std::vector<std::byte>& out, Depth depth, const ExrChannel& channel,
                   const std::vector<std::byte>& plane, std::size_t i) {
  const std::size_t size = bytes_of(channel.type);
  const std::byte* const sample = plane.data() + i * size;
  if (depth == Depth::float32 && channel.type == Imf::HALF) {
    half narrow;
    std::memcpy(&narrow, sample, 2);
    return append(out, static_cast<float>(narrow));
  }
  out.insert(out.end(), sample, sample + size);
}

}  // namespace

Exr usual_exr() {
  Exr exr;
  for (const char* name : {"R", "G", "B", "A"}) exr.channels.push_back({name});
  exr.wanted = {"R", "G", "B", "A"};
  exr.has_alpha = true;
  return exr;
}

Imf::Header header_of(const Exr& exr) {
  const Imath::Box2i data({exr.left, exr.top}, {exr.left + static_cast<int>(exr.width) - 1,
                                                exr.top + static_cast<int>(exr.height) - 1});
  Imf::Header header(exr.display.value_or(data), data);
  header.compression() = exr.compression;
  header.lineOrder() = exr.order;
  for (const ExrChannel& channel : exr.channels) {
    header.channels().insert(channel.name,
                             Imf::Channel(channel.type, channel.sampling, channel.sampling));
  }
  if (exr.tile_width > 0)
    header.setTileDescription({exr.tile_width, exr.tile_height, exr.levels, exr.rounding});
  if (!exr.part.empty()) {
    header.setName(exr.part);
    header.setType(exr.tile_width > 0 ? Imf::TILEDIMAGE : Imf::SCANLINEIMAGE);
  }
  if (!exr.view.empty()) header.setView(exr.view);
  if (exr.attributes) {
    Imf::addChromaticities(
        header, {{0.713F, 0.293F}, {0.165F, 0.83F}, {0.128F, 0.044F}, {0.32168F, 0.33767F}});
    Imf::addOwner(header, "somebody");
    Imf::addComments(header, std::string(500, 'x'));
    Imf::addWhiteLuminance(header, 80);
    header.insert("something", Imf::StringAttribute("else"));
  }
  return header;
}

Planes planes_of(const Exr& exr, Random& random) {
  Planes planes;
  for (const ExrChannel& channel : exr.channels) {
    std::vector<std::byte>& plane = planes[channel.name];
    const auto step = static_cast<std::size_t>(channel.sampling);
    for (std::size_t i = 0; i < (exr.width / step) * (exr.height / step); ++i) {
      if (channel.type == Imf::UINT) {
        append(plane, static_cast<std::uint32_t>(random.bits()));
        continue;
      }
      const float value = number(exr, channel, i, random);
      if (channel.type == Imf::FLOAT)
        append(plane, value);
      else
        append(plane, half(value));
    }
  }
  return planes;
}

void write_file(const Exr& exr, const Planes& planes, const std::string& path) {
  if (exr.tile_width > 0) return write_tiles(exr, planes, path);
  Planes copy = planes;
  Imf::OutputFile file(path.c_str(), header_of(exr));
  file.setFrameBuffer(buffer_of(exr, copy, exr.width));
  file.writePixels(static_cast<int>(exr.height));
}

namespace {

/// The display window of data that begins at `origin`: what is missing is 0.
Picture within(const Imath::Box2i& display, Imath::V2i origin, const Picture& data) {
  Picture out = data;
  out.width = static_cast<std::uint32_t>(display.max.x - display.min.x + 1);
  out.height = static_cast<std::uint32_t>(display.max.y - display.min.y + 1);
  const std::size_t texel = data.samples.size() / (std::size_t{data.width} * data.height);
  out.samples.assign(std::size_t{out.width} * out.height * texel, std::byte{});
  for (int y = 0; y < static_cast<int>(data.height); ++y) {
    for (int x = 0; x < static_cast<int>(data.width); ++x) {
      const int to_x = origin.x + x - display.min.x, to_y = origin.y + y - display.min.y;
      if (to_x < 0 || to_y < 0 || to_x >= static_cast<int>(out.width) ||
          to_y >= static_cast<int>(out.height))
        continue;
      const auto from = (static_cast<std::size_t>(y) * data.width + static_cast<std::size_t>(x));
      const auto to = static_cast<std::size_t>(to_y) * out.width + static_cast<std::size_t>(to_x);
      std::memcpy(out.samples.data() + to * texel, data.samples.data() + from * texel, texel);
    }
  }
  return out;
}

}  // namespace

std::optional<Picture> expected(const Exr& exr, const Planes& planes) {
  if (exr.no_rule) return std::nullopt;
  Picture out{exr.width,   exr.height,    static_cast<std::uint32_t>(exr.wanted.size()),
              Depth::half, exr.has_alpha, {}};
  std::vector<const ExrChannel*> channels;
  for (const std::string& name : exr.wanted) {
    for (const ExrChannel& channel : exr.channels) {
      if (channel.name != name) continue;
      channels.push_back(&channel);
      if (channel.type == Imf::FLOAT) out.depth = Depth::float32;
    }
  }
  const std::size_t texels = std::size_t{exr.width} * exr.height;
  for (std::size_t i = 0; i < texels; ++i) {
    for (const ExrChannel* channel : channels)
      append_sample(out.samples, out.depth, *channel, planes.at(channel->name), i);
  }
  if (exr.has_alpha) io::divide_by_alpha(out.depth, out.channels, texels, out.samples.data());
  return exr.display ? within(*exr.display, {exr.left, exr.top}, out) : out;
}

void add(Entries& entries, const std::string& name, const Exr& exr) {
  corpus::add(entries, "exr-" + name + ".exr", [exr](const std::string& path, Random& random) {
    const Planes planes = planes_of(exr, random);
    write_file(exr, planes, path);
    const bool lossy = loses(exr) && !exr.no_rule;
    return expected(exr, lossy ? decoded(exr, planes, path) : planes);
  });
}

}  // namespace pounce::test::corpus
