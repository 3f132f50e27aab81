// SPDX-License-Identifier: Apache-2.0
#include "mutants.h"

#include <algorithm>
#include <array>

#include "fuzz/image_pieces.h"

namespace pounce::test {
namespace {

void flip_bits(std::string& bytes, Random& random) {
  for (std::uint64_t left = 1 + random.below(8); left > 0; --left) {
    char& byte = bytes[random.below(bytes.size())];
    byte = static_cast<char>(byte ^ (1 << random.below(8)));
  }
}

void cut_off(std::string& bytes, Random& random) { bytes.resize(1 + random.below(bytes.size())); }

void insert(std::string& bytes, Random& random) {
  std::string block(1 + random.below(64), static_cast<char>(random.bits()));
  for (char& byte : block) {
    if (random.one_in(2)) byte = static_cast<char>(random.bits());
  }
  bytes.insert(random.below(bytes.size() + 1), block);
}

void swap_blocks(std::string& bytes, Random& random) {
  const std::uint64_t size = 1 + random.below(std::min<std::size_t>(256, bytes.size()));
  const std::uint64_t first = random.below(bytes.size() - size + 1);
  const std::uint64_t second = random.below(bytes.size() - size + 1);
  for (std::uint64_t i = 0; i < size; ++i) std::swap(bytes[first + i], bytes[second + i]);
}

/// Somewhere in a window of one of the file's pieces, near its begin more often than not.
void write_number(std::string& bytes, Random& random) {
  constexpr std::array<std::uint64_t, 10> kNumbers{
      0, 1, 2, 0x7F, 0x80, 0xFF, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF};
  const auto pieces =
      fuzz::pieces_of(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size());
  fuzz::Range piece{0, bytes.size()};
  if (!pieces.empty()) piece = pieces[random.below(pieces.size())];
  const std::uint64_t window =
      random.one_in(3) ? piece.size : std::min<std::size_t>(piece.size, 24);
  const std::uint64_t at = piece.begin + random.below(window);
  const std::uint64_t number =
      random.one_in(2) ? random.bits() : kNumbers[random.below(kNumbers.size())];
  const std::uint64_t size = std::uint64_t{1} << random.below(3);
  const bool big_endian = random.one_in(2);
  for (std::uint64_t i = 0; i < size && at + i < bytes.size(); ++i)
    bytes[at + i] = static_cast<char>(number >> 8 * (big_endian ? size - 1 - i : i));
}

}  // namespace

void mutate(std::string& bytes, Random& random) {
  constexpr std::array kChanges{flip_bits,    cut_off,      insert,      swap_blocks,
                                write_number, write_number, write_number};
  for (std::uint64_t left = 1 + random.below(3); left > 0 && !bytes.empty(); --left)
    kChanges[random.below(kChanges.size())](bytes, random);
  if (!random.one_in(8))
    fuzz::mend_checksums(reinterpret_cast<std::uint8_t*>(bytes.data()), bytes.size());
}

}  // namespace pounce::test
