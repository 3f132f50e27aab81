// SPDX-License-Identifier: Apache-2.0
//
// OpenEXR makes room for what headers claim, and OpenEXR 3.1 copies whole blocks out of its buffers
// whatever a block of the file held: of one that is too short the rest is what was there before.
// A block decodes into the buffer of the block before, so it is enough that the first one, which is
// the largest, fills it: then no picture holds memory that nobody wrote.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <map>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "io/codec/exr_block.h"
#include "io/codec/guard.h"

namespace pounce::io {
namespace {

/// The largest header of an EXR, preview and manifests included. OpenEXR keeps it whole, twice.
constexpr std::uint64_t kMostHeaderBytes = 8 << 20;
constexpr std::uint64_t kLargestSide = 65536;
/// 65536 x 256 texels of four floats. OpenEXR makes room for such a block of every part when a file
/// is opened, before anybody knows its size.
constexpr std::uint64_t kMostBlockBytes = 256 << 20, kMostBlockBytesOfAll = 1 << 30;

enum Coding : std::uint8_t { kNone = 0, kRuns = 1, kZipRow = 2, kZip = 3, kDwaa = 8, kDwab = 9 };

/// What the header says of one of an EXR's parts.
struct HeaderPart {
  std::uint64_t end = 0;  ///< behind the header
  std::int64_t width = 0, height = 0;
  std::uint64_t texel_bytes = 0;
  std::vector<ExrChannel> channels;
  std::uint32_t tile_width = 0, tile_height = 0;  ///< 0: rows
  std::uint8_t levels = 0;  ///< of tiles: the file's byte of mode and rounding
  std::uint8_t coding = kNone;
  bool deep = false;

  std::uint64_t block_rows() const {
    constexpr std::array<std::uint16_t, 10> kRows{1, 1, 1, 16, 32, 16, 32, 32, 32, 256};
    return coding < kRows.size() ? kRows[coding] : 1;
  }
  std::uint64_t wide() const {
    return static_cast<std::uint64_t>(std::max<std::int64_t>(width, 1));
  }
  std::uint64_t high() const {
    return static_cast<std::uint64_t>(std::max<std::int64_t>(height, 1));
  }
  /// Of pixels, at least.
  std::uint64_t chunks() const {
    const auto parts = [](std::uint64_t side, std::uint64_t part) { return (side - 1) / part + 1; };
    return tile_width > 0 ? parts(wide(), tile_width) * parts(high(), std::max(tile_height, 1U))
                          : parts(high(), block_rows());
  }
  /// Places that the file lists, those of levels with them. OpenEXR believes no chunkCount either.
  std::uint64_t places() const {
    const unsigned mode = levels & 15U;
    if (tile_width == 0 || tile_height == 0 || mode == 0) return chunks();
    const std::vector<std::uint64_t> across = tiles_of_levels(wide(), tile_width),
                                     down = tiles_of_levels(high(), tile_height);
    std::uint64_t count = 0;
    for (std::size_t y = 0; y < down.size(); ++y) {
      for (std::size_t x = 0; x < across.size(); ++x)
        count += mode == 2 || x == y ? across[x] * down[y] : 0;
    }
    // Of a mipmap the shorter side has one tile where only the longer one goes on.
    for (std::size_t i = std::min(across.size(), down.size());
         mode == 1 && i < std::max(across.size(), down.size()); ++i)
      count += i < across.size() ? across[i] : down[i];
    return count;
  }
  /// Of each level of a side: halves, rounded as the file says.
  std::vector<std::uint64_t> tiles_of_levels(std::uint64_t side, std::uint64_t tile) const {
    const std::uint64_t up = levels >> 4;
    std::vector<std::uint64_t> tiles;
    for (;; side = (side + (up != 0 ? 1 : 0)) / 2) {
      tiles.push_back((side - 1) / tile + 1);
      if (side <= 1) return tiles;
    }
  }
  /// What a decoder makes room for.
  std::uint64_t block_bytes() const {
    return tile_width > 0 ? std::uint64_t{tile_width} * tile_height * texel_bytes
                          : wide() * block_rows() * texel_bytes;
  }
  /// Of the first chunk.
  std::uint64_t first_width() const {
    return tile_width > 0 ? std::min<std::uint64_t>(tile_width, wide()) : wide();
  }
  std::uint64_t first_rows() const {
    return std::min<std::uint64_t>(tile_width > 0 ? tile_height : block_rows(), high());
  }
  /// What it decodes to.
  std::uint64_t first_bytes() const { return first_width() * first_rows() * texel_bytes; }
};

class Guard {
 public:
  explicit Guard(ByteSource& bytes) : at_(bytes, "EXR", false) {}

  std::uint64_t check() {
    constexpr std::uint32_t kSeveral = 0x1000, kDeep = 0x800;
    const bool several = several_ = (at_.u32(4) & kSeveral) != 0;
    may_be_deep_ = (at_.u32(4) & (kSeveral | kDeep)) != 0;
    std::vector<HeaderPart> parts;
    std::uint64_t position = 8, chunks = 0, room = 0;
    do {
      parts.push_back(header(position, kMostHeaderBytes));
      position = parts.back().end;
      chunks += parts.back().chunks();
      room += parts.back().block_bytes();
    } while (several && at_.u8(position) != 0);
    if (chunks > at_.size() / 8) {
      at_.refuse(
          fmt::format("the EXR needs {} chunks, more than a file of {} bytes can list; the file is "
                      "damaged or truncated",
                      chunks, at_.size()));
    }
    if (room > kMostBlockBytesOfAll) {
      at_.refuse(
          fmt::format("one chunk of each part of the EXR takes {} MiB in total, but at most {} MiB "
                      "are supported; save the parts as separate files",
                      room >> 20, kMostBlockBytesOfAll >> 20));
    }
    position += several ? 1 : 0;
    for (const HeaderPart& part : parts) {
      // A damaged one goes to the decoder, which says so.
      if (part.width > 0 && part.height > 0 && !part.deep) {
        check_places(part, position);
        check_first_chunk(part, position, several);
      }
      position += 8 * part.places();
    }
    return several ? room : 0;
  }

 private:
  std::string text(std::uint64_t& position) {
    constexpr std::size_t kLongest = 255;
    std::string text;
    while (const std::uint8_t c = at_.u8(position++)) {
      text += static_cast<char>(c);
      if (text.size() > kLongest)
        at_.refuse(fmt::format(
            "a name in the EXR header has more than {} bytes; the file is damaged", kLongest));
    }
    return text;
  }

  HeaderPart header(std::uint64_t position, std::uint64_t most_end) {
    HeaderPart part;
    std::set<std::string> missing{"compression", "dataWindow", "displayWindow"};
    for (;;) {
      const std::string name = text(position);
      if (name.empty()) break;
      missing.erase(name);
      const std::string type = text(position);
      const bool is_list = name == "channels";
      const std::uint32_t size = at_.u32(position);
      position += 4;
      if (size > most_end || position + size > most_end || position + size > at_.size()) {
        at_.refuse(
            fmt::format("the attribute \"{}\" of the EXR header claims {} bytes, more than the "
                        "file has or than "
                        "the limit of {} MiB for headers; remove large metadata, or save it again "
                        "if it is damaged",
                        name, size, kMostHeaderBytes >> 20));
      }
      check_value(name, type, position, size);
      take(name, position, size, part);
      if (type == "stringvector") check_strings(position, position + size);
      // Whatever its name: OpenEXR reads it to the end that it says itself, and goes on behind.
      HeaderPart other;
      if (type == "chlist") take_channels(position, position + size, is_list ? part : other);
      if (is_list && type != "chlist")
        at_.refuse(
            "the attribute \"channels\" of the EXR header is not a channel list; the file is "
            "damaged");
      position += size;
    }
    part.end = position;
    if (part.texel_bytes == 0) at_.refuse("a part of the EXR has no channels; the file is damaged");
    // OpenEXR takes what it has in mind itself: 64 x 64 texels, packed by zip.
    if (!missing.empty()) {
      at_.refuse(fmt::format("a part of the EXR has no attribute \"{}\"; the file is damaged",
                             *missing.begin()));
    }
    check_sizes(part);
    return part;
  }

  /// OpenEXR reads values of these types by their own lengths, and goes on behind them.
  void check_value(const std::string& name, const std::string& type, std::uint64_t position,
                   std::uint32_t size) {
    static const std::map<std::string, std::uint64_t> kBytes{
        {"box2f", 16},      {"box2i", 16},   {"chromaticities", 32},
        {"compression", 1}, {"double", 8},   {"envmap", 1},
        {"float", 4},       {"int", 4},      {"keycode", 28},
        {"lineOrder", 1},   {"m33d", 72},    {"m33f", 36},
        {"m44d", 128},      {"m44f", 64},    {"rational", 8},
        {"tiledesc", 9},    {"timecode", 8}, {"v2d", 16},
        {"v2f", 8},         {"v2i", 8},      {"v3d", 24},
        {"v3f", 12},        {"v3i", 12},     {"deepImageState", 1}};
    const auto fixed = kBytes.find(type);
    std::uint64_t needed = fixed == kBytes.end() ? size : fixed->second;
    if (type == "preview")
      needed = 8 + std::uint64_t{4} * at_.u32(position) * at_.u32(position + 4);
    if (needed == size) return;
    at_.refuse(
        fmt::format("the attribute \"{}\" of the EXR header has {} bytes, but its type {} needs "
                    "{}; the file is "
                    "damaged",
                    name, size, type, needed));
  }

  void take(const std::string& name, std::uint64_t position, std::uint32_t size, HeaderPart& part) {
    const auto side = [&](std::uint64_t low, std::uint64_t high) {
      return std::int64_t{static_cast<std::int32_t>(at_.u32(position + high))} -
             static_cast<std::int32_t>(at_.u32(position + low)) + 1;
    };
    if (name == "dataWindow" && size == 16) {
      part.width = side(0, 8);
      part.height = side(4, 12);
    } else if (name == "tiles" && size >= 8) {
      part.tile_width = at_.u32(position);
      part.tile_height = at_.u32(position + 4);
      part.levels = size > 8 ? at_.u8(position + 8) : 0;
    } else if (name == "compression" && size == 1) {
      part.coding = at_.u8(position);
    } else if (name == "type") {
      take_type(position, size, part);
    }
  }

  /// A length before each: OpenEXR makes room for as much as it says.
  void check_strings(std::uint64_t position, std::uint64_t end) {
    while (position < end) {
      const std::uint64_t length = end - position < 4 ? end : at_.u32(position);
      position += 4 + length;
      if (position > end)
        at_.refuse(
            "a string in the EXR header extends past the end of its list; the file is damaged");
    }
  }

  /// Of a file in parts. A type that no part has would stand in the decoder's message, whatever it
  /// says.
  void take_type(std::uint64_t position, std::uint32_t size, HeaderPart& part) {
    constexpr std::array<std::string_view, 4> kTypes{"scanlineimage", "tiledimage", "deepscanline",
                                                     "deeptile"};
    std::string type;
    for (std::uint32_t i = 0; i < std::min(size, 64U); ++i)
      type += static_cast<char>(at_.u8(position + i));
    if (several_ && std::find(kTypes.begin(), kTypes.end(), type) == kTypes.end())
      at_.refuse("a part of the EXR has an unknown type; the file is damaged");
    // Without these flags OpenEXR decodes a plain image, whatever its type says.
    part.deep = may_be_deep_ && type.starts_with("deep");
  }

  /// Name, type, four bytes, sampling across and down.
  void take_channels(std::uint64_t position, std::uint64_t end, HeaderPart& part) {
    constexpr std::uint32_t kFloat = 2;
    constexpr std::uint64_t kSampling = 8, kChannelBytes = 16;
    part.texel_bytes = 0;
    part.channels.clear();
    while (position < end && at_.u8(position) != 0) {
      const std::string name = text(position);
      const std::uint32_t type = at_.u32(position);
      if (type > kFloat) {  // of which OpenImageIO 2.4 would end the process
        at_.refuse(fmt::format(
            "a channel of the EXR has the unknown sample type {}; the file is damaged", type));
      }
      part.channels.push_back({name, type});
      part.texel_bytes += part.channels.back().bytes();
      if (at_.u32(position + kSampling) != 1 || at_.u32(position + kSampling + 4) != 1)
        at_.refuse("subsampled channels (luminance/chroma) are not supported; convert it to RGB");
      position += kChannelBytes;
    }
    if (part.texel_bytes == 0 || position + 1 != end)
      at_.refuse("the EXR's channel list is empty or not terminated; the file is damaged");
  }

  void check_sizes(const HeaderPart& part) {
    if (part.width > static_cast<std::int64_t>(kLargestSide) ||
        part.height > static_cast<std::int64_t>(kLargestSide)) {
      at_.refuse(fmt::format("the image is {} x {} texels, but each side must be 1 to {}",
                             part.width, part.height, kLargestSide));
    }
    const bool tiles_fit = part.tile_width <= kLargestSide && part.tile_height <= kLargestSide;
    if (!tiles_fit || part.block_bytes() > kMostBlockBytes) {
      at_.refuse(fmt::format(
          "the EXR has {0} of {1} x {2} texels with {3} bytes per texel, but at most {4} MiB each "
          "are supported; save it with smaller {0}",
          part.tile_width > 0 ? "tiles" : "blocks",
          part.tile_width > 0 ? part.tile_width : part.wide(),
          part.tile_width > 0 ? part.tile_height : part.block_rows(), part.texel_bytes,
          kMostBlockBytes >> 20));
    }
  }

  /// Where a place is missing OpenEXR takes none of them: it takes chunks as they follow in the
  /// file.
  void check_places(const HeaderPart& part, std::uint64_t list) {
    const std::uint64_t count = part.places();
    for (std::uint64_t i = 1; i < count; ++i) {  // the first is looked at more closely
      if (at_.number(list + 8 * i, 8) - 1 >= INT64_MAX) {
        at_.refuse(fmt::format(
            "the EXR has no place for chunk {} of {}: it was not written to its end, or is damaged",
            i + 1, count));
      }
    }
  }

  /// The chunk whose place stands at `list`: the number of its part where there are several, where
  /// it belongs, its size, its data.
  void check_first_chunk(const HeaderPart& part, std::uint64_t list, bool several) {
    const std::uint64_t chunk = at_.number(list, 8);
    const std::uint64_t head = (several ? 4 : 0) + (part.tile_width > 0 ? 16 : 4);
    const bool inside = chunk >= list && chunk < at_.size() && at_.size() - chunk > head + 4;
    const std::uint64_t size = inside ? at_.u32(chunk + head) : 0;
    const std::uint64_t data = chunk + head + 4;
    if (!inside || size == 0 || size > at_.size() - data) {
      at_.refuse(
          fmt::format("the first chunk of the EXR has {} bytes at offset {}, in a file of {} "
                      "bytes; the file is "
                      "damaged or truncated",
                      size, chunk, at_.size()));
    }
    const std::uint64_t wanted = part.first_bytes();
    if (size > wanted) {  // what would be larger packed is stored as it is
      at_.refuse(
          fmt::format("the first chunk of the EXR has {} bytes, more than the {} that it can hold; "
                      "the file is damaged",
                      size, wanted));
    }
    std::uint64_t decoded = wanted;  // equal: as it is. Other codings check themselves.
    if (size < wanted && part.coding == kNone) decoded = size;
    if (size < wanted && part.coding == kRuns) decoded = bytes_of_runs(data, size);
    if (size < wanted && (part.coding == kZip || part.coding == kZipRow))
      decoded = inflated_bytes(at_, data, size, wanted);
    if (size < wanted && (part.coding == kDwaa || part.coding == kDwab)) {
      const std::string why =
          why_dwa_is_short(at_, data, size, part.channels, part.first_width(), part.first_rows());
      if (!why.empty())
        at_.refuse(fmt::format("the first chunk of the EXR {}; the file is damaged", why));
    }
    if (decoded != wanted) {
      at_.refuse(
          fmt::format("the first chunk of the EXR decodes to {} bytes instead of {}; the file is "
                      "damaged",
                      decoded, wanted));
    }
  }

  /// A count below zero has as many bytes behind it, any other one that is repeated.
  std::uint64_t bytes_of_runs(std::uint64_t begin, std::uint64_t size) {
    std::uint64_t decoded = 0;
    for (std::uint64_t at = begin; at < begin + size;) {
      const auto count = static_cast<std::int8_t>(at_.u8(at));
      decoded += static_cast<std::uint64_t>(count < 0 ? -count : count + 1);
      at += count < 0 ? 1 + static_cast<std::uint64_t>(-count) : 2;
    }
    return decoded;
  }

  Cursor at_;
  bool several_ = false;  ///< parts
  bool may_be_deep_ = false;
};

}  // namespace

std::uint64_t guard_exr(ByteSource& bytes) { return Guard(bytes).check(); }

}  // namespace pounce::io
