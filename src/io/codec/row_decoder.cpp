// SPDX-License-Identifier: Apache-2.0
//
// Decoders' errors come as texts of many libraries, in which a damaged file, a lack of memory and
// something that the library cannot do look alike. Here they are told apart.
#include "io/codec/row_decoder.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <new>
#include <string_view>

#include "pounce/error.h"
#include "store/blocks/colour_store.h"

namespace pounce::io {
namespace {

/// Does a decoder's message say that it got no memory?
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

std::unique_ptr<RowDecoder> open_here(ByteSource& bytes, const WantedChannels& wanted,
                                      ImageInfo& info) {
  if (info.format == "png") return open_png(bytes, info);
  if (info.format == "jpeg") return open_jpeg(bytes, info);
  if (info.format == "tiff") return open_tiff(bytes, info);
  if (info.format == "openexr") return open_exr(bytes, wanted, info);
  if (info.format == "webp") return open_webp(bytes, info);
  if (info.format == "pnm") return open_pnm(bytes, info);
  return open_foreign(bytes, info);
}

void check_size(const std::string& label, std::int64_t width, std::int64_t height) {
  constexpr std::uint32_t kLargestSide = store::kLargestImageSide;
  if (width >= 1 && height >= 1 && width <= kLargestSide && height <= kLargestSide) return;
  throw Error(ErrorKind::input,
              fmt::format("{}: the image is {} x {} texels, but each side must be 1 to {}", label,
                          width, height, kLargestSide));
}

Error too_many_channels(const std::string& label, const std::vector<std::string>& names) {
  return {ErrorKind::input,
          fmt::format("{}: it has {} channels ({}), but no single set of R, G, B or Y; save up to "
                      "{} of them as a separate file, or name those of an EXR after its path, such "
                      "as FILE.exr:diffuse.R,G,B",
                      label, names.size(), joined(names), kMostChannels)};
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

void refuse_damaged(const std::string& label, const std::string& what, const std::string& why) {
  throw Error(ErrorKind::input, fmt::format("{}: {}{}; the file is damaged or truncated", label,
                                            what, in_brackets(why)));
}

void decoder_failed(const ByteSource& bytes, const std::string& what, const std::string& why,
                    std::uint64_t needed_bytes) {
  bytes.check();
  if (tells_of_memory(why) || (why.empty() && !has_room(needed_bytes))) {
    throw Error(
        ErrorKind::budget,
        fmt::format(
            "{}: not enough memory to decode it{}; raise the limit of the process (ulimit -v, "
            "ulimit -d, a control group), or run it with a smaller --memory or fewer --threads",
            bytes.label(), in_brackets(why)));
  }
  if (why.find("not supported") != std::string::npos) {
    throw Error(ErrorKind::input, fmt::format("{}: {}{}; convert it to a plain PNG or EXR",
                                              bytes.label(), what, in_brackets(why)));
  }
  refuse_damaged(bytes.label(), what, why);
}

}  // namespace pounce::io
