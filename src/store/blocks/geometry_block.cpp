// SPDX-License-Identifier: Apache-2.0
//
// A block as bytes. zstd finds repetitions of bytes, not of numbers, so numbers are made to repeat
// first: each becomes its difference from the one before it, and then all first bytes are stored
// together, all second ones, and so on. Vertices of a block are neighbours, so upper bytes become
// runs of zeros.
//
// What is not stored is what follows from the rest: texels' positions, normals and frames from
// their triangle and the page's lattice, which triangle owns a texel as runs of equal owners. A
// source's blocks have no owners at all: texels of another mesh look for their triangles anew.
//
// Records of a dense target go further. Numbers of neighbouring texels hardly differ, so each is
// stored as what it differs by from what its neighbours let expect: on a plane that texels are
// spread over evenly, by nothing. Small differences of either sign become small numbers, whose
// upper bytes are zero; a plane of zeros costs zstd next to nothing to keep and to read.
//
//   . . . . . . .        expected of x:  left + above - above left, where all three are covered
//   . c b . . . .                        left, else above, where one of them is
//   . a x . . . .                        else the covered texel before it; 0 for the first
//
// Filters see integers, floats included: a difference of bit patterns is exact and comes back to
// the bit, while a difference of floats would round.
#include "store/blocks/geometry_block.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <type_traits>

#include "core/bytes.h"
#include "store/pack/codec.h"

namespace pounce::store {
namespace {

constexpr std::uint32_t kEmptySlot = 0xFFFFFFFF;
constexpr std::uint32_t kHasOwner = 1;
constexpr std::uint32_t kHasShifts = 2;
constexpr std::uint32_t kHasRecords = 4;
constexpr std::uint32_t kHasColours = 8;

/// Appends elements as differences to their predecessors, split into byte planes.
template <class T>
void put_filtered(std::vector<std::byte>& raw, std::span<const T> values, std::size_t element_bytes,
                  std::size_t stride) {
  std::vector<std::byte> bytes(values.size_bytes());
  if (!bytes.empty()) std::memcpy(bytes.data(), values.data(), bytes.size());
  delta(bytes, element_bytes, stride);
  const std::size_t at = raw.size();
  raw.resize(at + bytes.size());
  shuffle(bytes, element_bytes, std::span(raw).subspan(at));
}

template <class T>
void get_filtered(ByteReader& in, std::vector<T>& values, std::size_t count,
                  std::size_t element_bytes, std::size_t stride) {
  const auto planes = in.take(count * sizeof(T));  // before the allocation: the size is real
  values.resize(count);
  const auto bytes = std::as_writable_bytes(std::span(values));
  unshuffle(planes, element_bytes, bytes);
  undelta(bytes, element_bytes, stride);
}

/// A chart's rows are runs, and its triangles neighbours in the block: both compress to little.
/// Runs of equal owners: first all lengths (1..4096 less one), then all values.
void put_runs(std::vector<std::byte>& raw, const std::vector<std::uint16_t>& owner) {
  std::vector<std::uint16_t> lengths, values;
  for (std::size_t i = 0; i < owner.size();) {
    std::size_t end = i + 1;
    while (end < owner.size() && owner[end] == owner[i]) ++end;
    lengths.push_back(static_cast<std::uint16_t>(end - i - 1));
    values.push_back(owner[i]);
    i = end;
  }
  ByteWriter(raw).put(static_cast<std::uint32_t>(lengths.size()));
  put_filtered<std::uint16_t>(raw, lengths, 2,
                              lengths.size());  // lengths are not alike: planes only
  put_filtered<std::uint16_t>(raw, values, 2, 1);
}

void get_runs(ByteReader& in, GeometryBlock& block) {
  const auto count = in.get<std::uint32_t>();
  if (count == 0 || count > kTexelsPerBlock) in.fail("has an impossible number of texel runs");
  std::vector<std::uint16_t> lengths, values;
  get_filtered(in, lengths, count, 2, count);
  get_filtered(in, values, count, 2, 1);
  block.owner.reserve(kTexelsPerBlock);
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t length = std::size_t{lengths[i]} + 1;
    if (block.owner.size() + length > kTexelsPerBlock)
      in.fail("has texel runs outside of its window");
    if (values[i] != kNoTriangle && values[i] >= block.triangles.size())
      in.fail("refers to a missing triangle");
    block.owner.insert(block.owner.end(), length, values[i]);
  }
  if (block.owner.size() != kTexelsPerBlock) in.fail("has texel runs that do not fill its window");
}

/// 32767 steps: 1 and -1 are exact, which a tangent's handedness needs.
std::int16_t to_snorm(float value) {
  return static_cast<std::int16_t>(std::lround(std::clamp(value, -1.0F, 1.0F) * 32767.0F));
}

/// Which records say what to expect of one: first + second - third. Counted from 1; 0 has zeros.
struct Expected {
  std::uint16_t first = 0, second = 0, third = 0;
};

std::vector<Expected> expectations(const std::vector<std::uint16_t>& owner, std::size_t records) {
  std::vector<Expected> all;
  all.reserve(records);
  // `there` is asked before the texel is looked at: at the border its index means nothing.
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
  // On the stack: this runs for every dense block that is read, and 32 KiB need no allocation.
  std::array<U, kTexelsPerBlock> numbers;
  std::array<U, kTexelsPerBlock + 1> values;
  const auto bytes = std::as_writable_bytes(std::span(numbers).first(records.size()));
  unshuffle(in.take(bytes.size()), sizeof(U), bytes);
  values[0] = 0;
  for (std::size_t i = 0; i < records.size(); ++i) {
    const Expected& e = expected[i];
    // Unsigned, so that what a damaged file holds overflows in a defined way. The result is checked
    // in get_records().
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
  if (runs < 2 || runs > kTexelsPerBlock + 1) in.fail("has an impossible number of texel runs");
  std::vector<std::uint16_t> lengths(runs);
  unshuffle(in.take(runs * sizeof(std::uint16_t)), sizeof(std::uint16_t),
            std::as_writable_bytes(std::span(lengths)));
  // Records are in raster order, so a covered texel's record is the number of those before it.
  owner.reserve(kTexelsPerBlock);
  std::uint16_t next = 0;
  for (std::size_t r = 0; r < runs; ++r) {
    if ((r != 0 && lengths[r] == 0) || owner.size() + lengths[r] > kTexelsPerBlock)
      in.fail("has texel runs outside of its window");
    for (std::size_t i = 0; i < lengths[r]; ++i) owner.push_back(r % 2 == 0 ? kNoTriangle : next++);
  }
  if (owner.size() != kTexelsPerBlock) in.fail("has texel runs that do not fill its window");
  return next;
}

/// A power of two: times it a position is exact, whatever machine multiplies.
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

/// Appends step, coverage and records. `owner` has the record of each texel of the block, in raster
/// order, kNoTriangle where no texel is covered.
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

/// The inverse. Fails if the bytes are not what put_records() makes.
void get_records(ByteReader& in, float& step, std::vector<std::uint16_t>& owner,
                 std::vector<TexelRecord>& records) {
  step = in.get<float>();
  if (!is_step(step)) in.fail("has a step that is not a power of two");
  const std::size_t count = get_coverage(in, owner);
  if (in.left() != count * kRecordBytes) in.fail("has a different size than its records");
  records.resize(count);
  const std::vector<Expected> expected = expectations(owner, count);
  for_each_column([&](const auto& field) { get_column(in, records, expected, field); });
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto bytes = in.take(count);
    for (std::size_t i = 0; i < count; ++i)
      records[i].inset[axis] = static_cast<std::int8_t>(bytes[i]);
  }
  // What became of the differences is only known now; octahedral normals are all legal.
  constexpr std::uint16_t kInfinity = 0x7F80;
  for (const TexelRecord& record : records) {
    for (const std::int32_t p : record.position) {
      if (p < -kLargestPosition || p > kLargestPosition) in.fail("has a position out of range");
    }
    if (record.edge == 0 || record.edge >= kInfinity) in.fail("has an invalid edge");
  }
}

}  // namespace

std::array<Vec2d, 3> GeometryBlock::texel_corners(const mesh::Lattice& lattice,
                                                  std::size_t triangle) const {
  std::array<Vec2d, 3> corners;
  for (std::size_t k = 0; k < 3; ++k) {
    corners[k] = mesh::to_texel(lattice, uvs[triangles[triangle][k]]);
    if (!shifts.empty()) {
      corners[k].x -= static_cast<double>(shifts[triangle][0]) * lattice.width;
      corners[k].y -= static_cast<double>(shifts[triangle][1]) * lattice.height;
    }
  }
  return corners;
}

void encode(const GeometryBlock& block, std::vector<std::byte>& raw) {
  raw.clear();
  ByteWriter out(raw);
  // Most meshes stay inside one period: then they take no bytes.
  const bool has_shifts = std::any_of(block.shifts.begin(), block.shifts.end(),
                                      [](const auto& s) { return s[0] != 0 || s[1] != 0; });
  out.put(block.page);
  out.put(block.x);
  out.put(block.y);
  const bool has_owner = block.records.empty() && !block.owner.empty();
  out.put((has_owner ? kHasOwner : 0U) | (has_shifts ? kHasShifts : 0U) |
          (block.records.empty() ? 0U : kHasRecords) | (block.colours.empty() ? 0U : kHasColours));
  out.put(static_cast<std::uint32_t>(block.positions.size()));
  out.put(static_cast<std::uint32_t>(block.triangles.size()));
  if (!block.records.empty()) {
    put_records(raw, block.step, block.owner, block.records);
    return;
  }
  put_filtered<Vec3f>(raw, block.positions, 4, 3);
  put_filtered<Vec3f>(raw, block.normals, 4, 3);
  put_filtered<Vec2f>(raw, block.uvs, 4, 2);
  put_filtered<std::array<std::int16_t, 4>>(raw, block.tangents, 2, 4);
  put_filtered<Vec4f>(raw, block.colours, 4, 4);
  put_filtered<std::array<std::uint16_t, 3>>(raw, block.triangles, 2, 3);
  put_filtered<std::uint32_t>(raw, block.ids, 4, 1);
  if (has_shifts) put_filtered<std::array<std::int32_t, 2>>(raw, block.shifts, 4, 2);
  if (has_owner) put_runs(raw, block.owner);
}

GeometryBlock decode_geometry(std::span<const std::byte> raw, const std::string& name) {
  ByteReader in(raw, name);
  GeometryBlock block;
  block.page = in.get<std::uint32_t>();
  block.x = in.get<std::int32_t>();
  block.y = in.get<std::int32_t>();
  const auto flags = in.get<std::uint32_t>();
  const auto vertices = in.get<std::uint32_t>();
  const auto triangles = in.get<std::uint32_t>();
  const bool has_records = flags == kHasRecords && vertices == 0 && triangles == 0;
  if ((!has_records && (flags & ~(kHasOwner | kHasShifts | kHasColours)) != 0) ||
      triangles > kMostTrianglesPerBlock || vertices > 3 * triangles) {
    in.fail("has an impossible block header");
  }
  // Instead of triangles, not beside them: either is what the block's texels are made from.
  if (has_records) {
    get_records(in, block.step, block.owner, block.records);
    return block;
  }
  get_filtered(in, block.positions, vertices, 4, 3);
  get_filtered(in, block.normals, vertices, 4, 3);
  get_filtered(in, block.uvs, vertices, 4, 2);
  get_filtered(in, block.tangents, vertices, 2, 4);
  if ((flags & kHasColours) != 0) get_filtered(in, block.colours, vertices, 4, 4);
  get_filtered(in, block.triangles, triangles, 2, 3);
  get_filtered(in, block.ids, triangles, 4, 1);
  // From here on an index needs no check.
  for (const auto& triangle : block.triangles) {
    for (const std::uint16_t v : triangle) {
      if (v >= vertices) in.fail("refers to a missing vertex");
    }
  }
  if ((flags & kHasShifts) != 0) get_filtered(in, block.shifts, triangles, 4, 2);
  if ((flags & kHasOwner) != 0) get_runs(in, block);
  if (in.left() != 0) in.fail("has trailing bytes");
  return block;
}

GeometryBlockBuilder::GeometryBlockBuilder(const mesh::Mesh& mesh, bool with_colours)
    : mesh_(mesh), with_colours_(with_colours) {}

void GeometryBlockBuilder::start(std::uint32_t page, std::int32_t x, std::int32_t y,
                                 std::size_t most_triangles) {
  block_ = GeometryBlock{};
  block_.page = page;
  block_.x = x;
  block_.y = y;
  // A table per block instead of one of the whole mesh: blocks are built in parallel, and most
  // have few triangles.
  const std::size_t vertices = 3 * std::min<std::size_t>(most_triangles, kMostTrianglesPerBlock);
  slots_.assign(std::bit_ceil(2 * vertices + 1), {kEmptySlot, 0});
}

std::uint16_t GeometryBlockBuilder::local_vertex(std::uint32_t vertex, std::uint32_t uv_set,
                                                 bool has_image) {
  const std::size_t mask = slots_.size() - 1;        // at most half full, so probing ends
  std::size_t slot = (vertex * 2654435761U) & mask;  // Knuth's multiplier: 2^32 / golden ratio
  while (slots_[slot].first != kEmptySlot) {
    if (slots_[slot].first == vertex) return slots_[slot].second;
    slot = (slot + 1) & mask;
  }
  const std::uint16_t local = add_point(mesh_.positions[vertex], mesh_.normals[vertex],
                                        has_image ? mesh_.uv_sets[uv_set][vertex] : Vec2f{},
                                        mesh_.tangents.empty() ? Vec4f{} : mesh_.tangents[vertex]);
  if (with_colours_) block_.colours.push_back(mesh_.colours[vertex]);
  slots_[slot] = {vertex, local};
  return local;
}

std::uint16_t GeometryBlockBuilder::add_point(Vec3f position, Vec3f normal, Vec2f uv,
                                              Vec4f tangent) {
  const auto local = static_cast<std::uint16_t>(block_.positions.size());
  block_.positions.push_back(position);
  block_.normals.push_back(normal);
  block_.uvs.push_back(uv);
  block_.tangents.push_back(
      {to_snorm(tangent.x), to_snorm(tangent.y), to_snorm(tangent.z), to_snorm(tangent.w)});
  return local;
}

std::uint16_t GeometryBlockBuilder::add(const mesh::TriangleInstance& instance,
                                        std::uint32_t uv_set, bool has_image) {
  std::array<std::uint16_t, 3> local;
  for (std::size_t k = 0; k < 3; ++k) {
    local[k] = local_vertex(mesh_.triangles[instance.triangle][k], uv_set, has_image);
  }
  block_.triangles.push_back(local);
  block_.ids.push_back(instance.triangle);
  block_.shifts.push_back({instance.shift_x, instance.shift_y});
  return static_cast<std::uint16_t>(block_.triangles.size() - 1);
}

std::uint16_t GeometryBlockBuilder::add(const std::array<std::uint16_t, 3>& points,
                                        std::uint32_t id) {
  block_.triangles.push_back(points);
  block_.ids.push_back(id);
  block_.shifts.push_back({0, 0});
  return static_cast<std::uint16_t>(block_.triangles.size() - 1);
}

}  // namespace pounce::store
