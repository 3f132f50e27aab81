// SPDX-License-Identifier: Apache-2.0
#include "io/image/decoder_error.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <new>
#include <string_view>

#include "pounce/error.h"

namespace pounce::io {
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

void refuse_damaged(const std::string& label, const std::string& what, const std::string& why) {
  throw Error(ErrorKind::input, fmt::format("{}: {}{}; the file is damaged or cut off", label, what,
                                            in_brackets(why)));
}

void decoder_failed(const std::string& label, const std::string& what, const std::string& why,
                    std::uint64_t needed_bytes) {
  if (tells_of_memory(why) || (why.empty() && !has_room(needed_bytes))) {
    throw Error(ErrorKind::budget,
                fmt::format("{}: there is no memory to decode it{}; give the job more (ulimit "
                            "-v, ulimit -d, a control group), or run it with a smaller --memory "
                            "or fewer --threads",
                            label, in_brackets(why)));
  }
  if (why.find("not supported") != std::string::npos) {
    throw Error(ErrorKind::input, fmt::format("{}: {}{}; convert it to a plainer kind of image",
                                              label, what, in_brackets(why)));
  }
  refuse_damaged(label, what, why);
}

}  // namespace pounce::io
