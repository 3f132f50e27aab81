// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <span>
#include <vector>

#include "io/files/asset_file.h"
#include "io/image/read.h"
#include "pounce/error.h"

namespace pounce::io {

Hash128 hash_image(const mesh::ImageRef& image) {
  ByteSource bytes(image);
  std::vector<std::byte> piece(std::min<std::uint64_t>(bytes.size_bytes(), 1 << 20));
  Hasher hasher;
  for (std::uint64_t at = 0; at < bytes.size_bytes();) {
    const std::size_t got = bytes.read_at(at, piece.data(), piece.size());
    bytes.check();
    if (got == 0) {
      throw Error(ErrorKind::input,
                  fmt::format("{}: reading stopped after {} of {} bytes: the file shrank",
                              bytes.label(), at, bytes.size_bytes()));
    }
    hasher.add(std::span<const std::byte>(piece.data(), got));
    at += got;
  }
  return hasher.digest();
}

}  // namespace pounce::io
