// SPDX-License-Identifier: Apache-2.0
//
// Numbers of neighbouring texels hardly differ, so each is stored as what it differs by from what
// its neighbours let expect: on a plane that texels are spread over evenly, by nothing. Small
// differences of either sign become small numbers, whose upper bytes are zero; a plane of zeros
// costs zstd next to nothing to keep and to read.
//
//   . . . . . . .        expected of x:  left + above - above left, where all three are covered
//   . c b . . . .                        left, else above, where one of them is
//   . a x . . . .                        else the covered texel before it; 0 for the first
#include "store/blocks/texel_records.h"

#include <bit>
#include <cmath>
#include <cstring>
#include <type_traits>

#include "mesh/lattice.h"
#include "store/pack/codec.h"

namespace pounce::store {
namespace {

constexpr std::size_t kTexels = std::size_t{mesh::kBlockEdge} * mesh::kBlockEdge;

/// Which records say what to expect of one: first + second - third. Counted from 1; 0 has zeros.
struct Expected {
  std::uint16_t first = 0, second = 0, third = 0;
};

std::vector<Expected> expectations(const std::vector<std::uint16_t>& owner, std::size_t records) {
  std::vector<Expected> all;
  all.reserve(records);
  const auto slot = [&](std::size_t texel, bool there) {
    return static_cast<std::uint16_t>(there && owner[texel] != kNoTriangle ? owner[texel] + 1 : 0);
  };
  for (std::size_t t = 0; t < owner.size(); ++t) {
    if (owner[t] == kNoTriangle) continue;
    const bool inner = t % mesh::kBlockEdge != 0, below = t >= mesh::kBlockEdge;
    const std::uint16_t left = slot(t - 1, inner), above = slot(t - mesh::kBlockEdge, below);
    const std::uint16_t corner = slot(t - mesh::kBlockEdge - 1, inner && below);
    if (left != 0 && above != 0 && corner != 0)
      all.push_back({left, above, corner});
    else
      all.push_back({left != 0 ? left : above != 0 ? above : owner[t], 0, 0});
  }
  return all;
}

template <class T>
using Unsigned = std::make_unsigned_t<T>;

/// Small numbers for small differences of either sign: 0 -1 1 -2 2 become 0 1 2 3 4.
template <class U>
U folded(U difference) {
  constexpr int kSign = 8 * sizeof(U) - 1;
  const U sign = static_cast<U>(-static_cast<int>(difference >> kSign & 1U));
  return static_cast<U>(static_cast<U>(difference << 1U) ^ sign);
}
template <class U>
U unfolded(U number) {
  return static_cast<U>((number >> 1U) ^ static_cast<U>(-static_cast<int>(number & 1U)));
}

template <class Field>
void put_column(std::vector<std::byte>& raw, const std::vector<TexelRecord>& records,
                const std::vector<Expected>& expected, const Field& field) {
  using U = Unsigned<std::remove_cvref_t<decltype(field(records[0]))>>;
  std::vector<U> values(records.size() + 1), numbers(records.size());
  for (std::size_t i = 0; i < records.size(); ++i)
    values[i + 1] = static_cast<U>(field(records[i]));
  for (std::size_t i = 0; i < records.size(); ++i) {
    const Expected& e = expected[i];
    numbers[i] = folded(
        static_cast<U>(values[i + 1] - (values[e.first] + values[e.second] - values[e.third])));
  }
  const std::size_t at = raw.size();
  raw.resize(at + numbers.size() * sizeof(U));
  shuffle(std::as_bytes(std::span(numbers)), sizeof(U), std::span(raw).subspan(at));
}

template <class Field>
void get_column(ByteReader& in, std::vector<TexelRecord>& records,
                const std::vector<Expected>& expected, const Field& field) {
  using T = std::remove_cvref_t<decltype(field(records[0]))>;
  using U = Unsigned<T>;
  std::array<U, kTexels> numbers;
  std::array<U, kTexels + 1> values;
  const auto bytes = std::as_writable_bytes(std::span(numbers).first(records.size()));
  unshuffle(in.take(bytes.size()), sizeof(U), bytes);
  values[0] = 0;
  for (std::size_t i = 0; i < records.size(); ++i) {
    const Expected& e = expected[i];
    values[i + 1] =
        static_cast<U>(values[e.first] + values[e.second] - values[e.third] + unfolded(numbers[i]));
    field(records[i]) = static_cast<T>(values[i + 1]);
  }
}

/// Lengths of runs of texels that are not covered and covered, by turns. The first may be 0.
std::vector<std::uint16_t> coverage_runs(const std::vector<std::uint16_t>& owner) {
  std::vector<std::uint16_t> lengths{0};
  bool covered = false;
  for (const std::uint16_t o : owner) {
    if ((o != kNoTriangle) != covered) {
      covered = !covered;
      lengths.push_back(0);
    }
    ++lengths.back();
  }
  return lengths;
}

/// Returns how many texels are covered.
std::size_t get_coverage(ByteReader& in, std::vector<std::uint16_t>& owner) {
  const auto runs = in.get<std::uint32_t>();
  if (runs < 2 || runs > kTexels + 1) in.fail("has an impossible number of texel runs");
  std::vector<std::uint16_t> lengths(runs);
  unshuffle(in.take(runs * sizeof(std::uint16_t)), sizeof(std::uint16_t),
            std::as_writable_bytes(std::span(lengths)));
  owner.reserve(kTexels);
  std::uint16_t next = 0;
  for (std::size_t r = 0; r < runs; ++r) {
    if ((r != 0 && lengths[r] == 0) || owner.size() + lengths[r] > kTexels)
      in.fail("has texel runs beyond its window");
    for (std::size_t i = 0; i < lengths[r]; ++i) owner.push_back(r % 2 == 0 ? kNoTriangle : next++);
  }
  if (owner.size() != kTexels) in.fail("has texel runs that do not fill its window");
  return next;
}

bool is_step(float step) {
  int exponent = 0;
  return step >= kSmallestStep && step <= kLargestStep && std::frexp(step, &exponent) == 0.5F;
}

/// Calls visit(accessor) for each column in the order of the format, without the insets.
template <class Visit>
void for_each_column(const Visit& visit) {
  visit([](auto& r) -> auto& { return r.position[0]; });
  visit([](auto& r) -> auto& { return r.position[1]; });
  visit([](auto& r) -> auto& { return r.position[2]; });
  visit([](auto& r) -> auto& { return r.normal[0]; });
  visit([](auto& r) -> auto& { return r.normal[1]; });
  visit([](auto& r) -> auto& { return r.edge; });
}

}  // namespace

void put_records(std::vector<std::byte>& raw, float step, const std::vector<std::uint16_t>& owner,
                 const std::vector<TexelRecord>& records) {
  ByteWriter out(raw);
  out.put(step);
  const std::vector<std::uint16_t> lengths = coverage_runs(owner);
  out.put(static_cast<std::uint32_t>(lengths.size()));
  const std::size_t at = raw.size();
  raw.resize(at + lengths.size() * sizeof(lengths[0]));
  shuffle(std::as_bytes(std::span(lengths)), sizeof(lengths[0]), std::span(raw).subspan(at));
  const std::vector<Expected> expected = expectations(owner, records.size());
  for_each_column([&](const auto& field) { put_column(raw, records, expected, field); });
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (const TexelRecord& record : records) out.put(record.inset[axis]);
  }
}

void get_records(ByteReader& in, float& step, std::vector<std::uint16_t>& owner,
                 std::vector<TexelRecord>& records) {
  step = in.get<float>();
  if (!is_step(step)) in.fail("has a step that is no power of two");
  const std::size_t count = get_coverage(in, owner);
  if (in.left() != count * kRecordBytes) in.fail("has another size than its records");
  records.resize(count);
  const std::vector<Expected> expected = expectations(owner, count);
  for_each_column([&](const auto& field) { get_column(in, records, expected, field); });
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto bytes = in.take(count);
    for (std::size_t i = 0; i < count; ++i)
      records[i].inset[axis] = static_cast<std::int8_t>(bytes[i]);
  }
  constexpr std::uint16_t kInfinity = 0x7F80;
  for (const TexelRecord& record : records) {
    for (const std::int32_t p : record.position) {
      if (p < -kLargestPosition || p > kLargestPosition) in.fail("has a position out of range");
    }
    if (record.edge == 0 || record.edge >= kInfinity) in.fail("has an edge that is none");
  }
}

}  // namespace pounce::store
