// SPDX-License-Identifier: Apache-2.0
//
// What can be known of OpenImageIO's decoders from outside. None of them says how much memory it
// takes, so each cost here is an upper bound that was read from the libraries' sources and is held
// against resident memory by a test. And their errors come as texts of many libraries, in which a
// damaged file, a lack of memory and something that the library cannot do look alike.
#include "io/image/decoder.h"

#include <OpenImageIO/imageio.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <mutex>
#include <new>
#include <string_view>

#include "io/image/guard.h"
#include "io/image/header.h"
#include "pounce/error.h"

namespace pounce::io {

void set_up_oiio() {
  static std::once_flag once;
  std::call_once(once, [] {
    OIIO::attribute("exr_threads", -1);      // -1: none at all; it has no setting per file
    OIIO::attribute("tiff:multithread", 0);  // its readers ask no file either
    // What nobody asked for it would put on the standard error output, between lines of ours.
    OIIO::attribute("oiio:print_uncaught_errors", 0);
    OIIO::attribute("limits:imagesize_MB", 0);  // no limit: we never allocate by what a header says
  });
}

std::string one_line(std::string message) {
  while (!message.empty() &&
         (message.back() == '\n' || message.back() == '.' || message.back() == ' ')) {
    message.pop_back();
  }
  for (std::size_t at = 0; (at = message.find('\n', at)) != std::string::npos;)
    message.replace(at, 1, "; ");
  return message;
}

namespace {

/// Rows that an EXR file compresses together.
int exr_block_rows(const std::string& compression) {
  if (compression.starts_with("dwab")) return 256;
  if (compression == "piz" || compression.starts_with("dwaa") || compression.starts_with("b44"))
    return 32;
  if (compression == "zip" || compression == "pxr24") return 16;
  return 1;
}

constexpr std::uint64_t kBase = 1U << 20;

}  // namespace

std::uint64_t jpeg_row_cost(std::uint64_t width) { return (1U << 20) + width * 3 * 64; }

std::uint64_t whole_cost(std::uint64_t decoded_bytes, const ByteSource& bytes) {
  return kBase + decoded_bytes + bytes.size_bytes();
}

std::uint32_t block_rows(const OIIO::ImageSpec& spec, const std::string& format) {
  int rows = 1;
  if (spec.tile_width > 0) {
    rows = spec.tile_height;
  } else if (format == "openexr") {
    rows = exr_block_rows(spec.get_string_attribute("compression"));
  } else if (format == "tiff") {
    rows = spec.get_int_attribute("tiff:RowsPerStrip", spec.height);
  }
  return static_cast<std::uint32_t>(std::clamp(rows, 1, spec.height));
}

std::uint64_t decoder_cost(const OIIO::ImageSpec& spec, const std::string& format,
                           ByteSource& bytes) {
  const auto row = static_cast<std::uint64_t>(spec.scanline_bytes(true));
  const std::uint64_t whole = row * static_cast<std::uint64_t>(spec.height);
  const std::uint64_t block = row * block_rows(spec, format);
  if (spec.tile_width > 0) {  // whole tiles, which may be larger than the image
    const auto tile = static_cast<std::uint64_t>(spec.tile_bytes(true));
    const auto across = static_cast<std::uint64_t>((spec.width - 1) / spec.tile_width + 1);
    return kBase + 4 * std::max(block, tile * across);
  }
  if (format == "png") return kBase + (is_interlaced_png(bytes) ? whole : 4 * row);
  if (format == "jpeg") return jpeg_row_cost(static_cast<std::uint64_t>(spec.width));
  if (format == "openexr") return kBase + 6 * block;
  if (format == "hdr") return kBase + 4 * row;
  // libtiff holds a strip as it is in the file, however large.
  if (format == "tiff") {
    const std::uint64_t rows = std::min(block_rows(spec, format), kMostRowsAtOnce);
    return kBase + 4 * row * rows + std::min(block, bytes.size_bytes());
  }
  return whole_cost(whole, bytes);
}

namespace {

/// Does a decoder's message say that it got no memory? Decoders turn that into an error like any.
bool tells_of_memory(std::string message) {
  std::transform(message.begin(), message.end(), message.begin(),
                 [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c; });
  constexpr std::array<std::string_view, 4> kWords{"std::bad_alloc", "no space", "memory",
                                                   "allocat"};
  return std::any_of(kWords.begin(), kWords.end(), [&](std::string_view word) {
    return message.find(word) != std::string::npos;
  });
}

/// Could a decoder have got that much?
bool has_room(std::uint64_t size_bytes) {
  void* const room = ::operator new(static_cast<std::size_t>(size_bytes), std::nothrow);
  ::operator delete(room);
  return room != nullptr;
}

std::string in_brackets(const std::string& text) {
  return text.empty() ? "" : fmt::format(" ({})", text);
}

}  // namespace

OIIO::TypeDesc sample_type_of(const OIIO::ImageSpec& spec, const std::vector<int>& places) {
  OIIO::TypeDesc deepest = spec.channelformat(places.front());
  for (const int place : places) {
    const OIIO::TypeDesc type = spec.channelformat(place);
    if (type.basetype != OIIO::TypeDesc::HALF) deepest = type;
    if (type.basetype != OIIO::TypeDesc::HALF && type.basetype != OIIO::TypeDesc::FLOAT) break;
  }
  return deepest;
}

Depth depth_of(const std::string& label, OIIO::TypeDesc type) {
  switch (type.basetype) {
    case OIIO::TypeDesc::UINT8:
      return Depth::u8;
    case OIIO::TypeDesc::UINT16:
      return Depth::u16;
    case OIIO::TypeDesc::HALF:
      return Depth::half;
    case OIIO::TypeDesc::FLOAT:
      return Depth::float32;
    default:
      throw Error(
          ErrorKind::input,
          fmt::format("{}: samples of type {} are not supported; convert it to 8-bit or 16-bit "
                      "integers, half or float",
                      label, type.c_str()));
  }
}

void take_chromaticities(const OIIO::ImageSpec& spec, ColourTags& tags) {
  const OIIO::ParamValue* found = spec.find_attribute("chromaticities");
  if (found == nullptr || found->type().basetype != OIIO::TypeDesc::FLOAT ||
      found->type().basevalues() * static_cast<std::size_t>(found->nvalues()) != 8) {
    return;
  }
  Chromaticities said;
  std::memcpy(said.data(), found->data(), sizeof said);
  if (are_primaries(said)) {
    tags.primaries = said;
  } else {
    tags.problem = "its chromaticities are invalid: they enclose no colours";
  }
}

void refuse_damaged(const std::string& label, const std::string& what, const std::string& why) {
  throw Error(ErrorKind::input, fmt::format("{}: {}{}; the file is damaged or truncated", label,
                                            what, in_brackets(why)));
}

void decoder_failed(const std::string& label, const std::string& what, const std::string& why,
                    std::uint64_t needed_bytes) {
  if (tells_of_memory(why) || (why.empty() && !has_room(needed_bytes))) {
    throw Error(
        ErrorKind::budget,
        fmt::format(
            "{}: not enough memory to decode it{}; raise the limit of the process (ulimit -v, "
            "ulimit -d, a control group), or run it with a smaller --memory or fewer --threads",
            label, in_brackets(why)));
  }
  if (why.find("not supported") != std::string::npos) {
    throw Error(ErrorKind::input, fmt::format("{}: {}{}; convert it to a plain PNG or EXR", label,
                                              what, in_brackets(why)));
  }
  refuse_damaged(label, what, why);
}

std::vector<Part> parts_of(OIIO::ImageInput& input) {
  constexpr int kMostParts = 1024;
  std::vector<Part> parts{{"", input.spec().channelnames}};
  const int count = std::min(input.spec().get_int_attribute("oiio:subimages", 1), kMostParts);
  if (count < 2) return parts;
  parts.clear();
  for (int i = 0; i < count && input.seek_subimage(i, 0); ++i) {
    parts.push_back(
        {input.spec().get_string_attribute("oiio:subimagename"), input.spec().channelnames});
  }
  input.seek_subimage(0, 0);
  return parts;
}

std::uint32_t levels_of(OIIO::ImageInput& input, int part) {
  int levels = 1;
  while (input.seek_subimage(part, levels)) ++levels;
  input.seek_subimage(part, 0);
  return static_cast<std::uint32_t>(levels);
}

std::vector<std::string> names_of(std::span<const Part> parts) {
  std::vector<std::string> names;
  for (const Part& part : parts) {
    const std::vector<std::string> own = part.full_names();
    names.insert(names.end(), own.begin(), own.end());
  }
  return names;
}

ChosenPart wanted_part(const std::string& label, const std::vector<Part>& parts,
                       const std::string& wanted) {
  ChosenPart chosen = named_channels(parts, wanted);
  if (!chosen.channels.places.empty()) return chosen;
  throw Error(ErrorKind::input,
              fmt::format("{}: \"{}\" names neither a layer nor 1 to {} different channels of this "
                          "file; it has {}",
                          label, wanted, kMostChannels, joined(names_of(parts))));
}

}  // namespace pounce::io
