// SPDX-License-Identifier: Apache-2.0
#include "store/blocks/geometry_block.h"

#include <algorithm>
#include <bit>
#include <cmath>

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
    if (block.owner.size() + length > kTexelsPerBlock) in.fail("has texel runs beyond its window");
    if (values[i] != kNoTriangle && values[i] >= block.triangles.size())
      in.fail("names a triangle it lacks");
    block.owner.insert(block.owner.end(), length, values[i]);
  }
  if (block.owner.size() != kTexelsPerBlock) in.fail("has texel runs that do not fill its window");
}

std::int16_t to_snorm(float value) {
  return static_cast<std::int16_t>(std::lround(std::clamp(value, -1.0F, 1.0F) * 32767.0F));
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
  for (const auto& triangle : block.triangles) {
    for (const std::uint16_t v : triangle) {
      if (v >= vertices) in.fail("names a vertex it lacks");
    }
  }
  if ((flags & kHasShifts) != 0) get_filtered(in, block.shifts, triangles, 4, 2);
  if ((flags & kHasOwner) != 0) get_runs(in, block);
  if (in.left() != 0) in.fail("has bytes left over");
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
  const std::size_t vertices = 3 * std::min<std::size_t>(most_triangles, kMostTrianglesPerBlock);
  slots_.assign(std::bit_ceil(2 * vertices + 1), {kEmptySlot, 0});
}

std::uint16_t GeometryBlockBuilder::local_vertex(std::uint32_t vertex, std::uint32_t uv_set,
                                                 bool has_image) {
  const std::size_t mask = slots_.size() - 1;  // at most half full, so probing ends
  std::size_t slot = (vertex * 2654435761U) & mask;
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
