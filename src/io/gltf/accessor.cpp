// SPDX-License-Identifier: Apache-2.0
//
// Accessors: how numbers lie in a buffer, and which numbers an attribute may be of.
//
// An accessor names a type, a stride and a place in a buffer view; check_gltf() has made sure that
// all of it lies within the view. Reading goes through pieces of 1 MiB and converts to what the
// mesh keeps, so that no copy of the file's form is ever whole in memory; a sparse part is laid
// over what was read before.
//
// An accessor without a buffer view stands for zeros: ten bytes of JSON that may claim any number
// of elements. Wherever nothing else limits that number, check_unbacked() has to be asked first.
//
// check_primitive() judges a primitive by its accessors alone: what types glTF (with
// KHR_mesh_quantization) allows, that all attributes are as long as POSITION, and how much mesh
// will come of it. Values are looked at when they are read.
//
// Attributes are read one after the other in full, not vertex by vertex: a file may store them
// interleaved or apart, and a pass over each keeps one conversion in the inner loop.
//
// Nothing is cached between calls: a mesh that many nodes show is read once for each of them. To
// keep it would need its memory a second time, and what is read is bounded in proportion to the
// file (mesh_reader.cpp).
#include "io/gltf/accessor.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <optional>
#include <type_traits>

#include "io/problems.h"

namespace pounce::io {
namespace {

// Large enough that reading is not about calls, small enough beside any mesh to need no lease of
// its own (it is part of mesh_cost()).
constexpr std::uint64_t kPieceBytes = 1 << 20;

std::uint64_t component_count(int type) {
  return static_cast<std::uint64_t>(
      tinygltf::GetNumComponentsInType(static_cast<std::uint32_t>(type)));
}

std::uint64_t component_bytes(int component_type) {
  return static_cast<std::uint64_t>(
      tinygltf::GetComponentSizeInBytes(static_cast<std::uint32_t>(component_type)));
}

/// One stored component as a number. Integers become real by glTF's rule: c / max, and never below
/// -1.
template <class Stored, class Out>
Out convert(const std::byte* from, [[maybe_unused]] bool normalized) {
  Stored value;
  std::memcpy(&value, from, sizeof(Stored));
  if constexpr (std::is_floating_point_v<Out> && std::is_integral_v<Stored>) {
    if (normalized) {
      const double real =
          static_cast<double>(value) / static_cast<double>(std::numeric_limits<Stored>::max());
      return static_cast<Out>(std::max(real, -1.0));
    }
  }
  return static_cast<Out>(value);
}

template <class Stored, class Out>
void convert_elements(const std::byte* from, std::uint64_t stride, std::uint64_t count,
                      std::uint64_t components, bool normalized, Out* out) {
  for (std::uint64_t i = 0; i < count; ++i) {
    for (std::uint64_t c = 0; c < components; ++c) {
      *out++ = convert<Stored, Out>(from + i * stride + c * sizeof(Stored), normalized);
    }
  }
}

/// The component type is looked at once for each piece, not for each number.
template <class Out>
void convert_any(int component_type, const std::byte* from, std::uint64_t stride,
                 std::uint64_t count, std::uint64_t components, bool normalized, Out* out) {
  const auto run = [&](auto stored) {
    convert_elements<decltype(stored)>(from, stride, count, components, normalized, out);
  };
  switch (component_type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
      return run(std::int8_t{});
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return run(std::uint8_t{});
    case TINYGLTF_COMPONENT_TYPE_SHORT:
      return run(std::int16_t{});
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return run(std::uint16_t{});
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
      return run(std::uint32_t{});
    default:
      return run(float{});
  }
}

constexpr int kByte = TINYGLTF_COMPONENT_TYPE_BYTE, kUByte = TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE,
              kShort = TINYGLTF_COMPONENT_TYPE_SHORT,
              kUShort = TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT,
              kUInt = TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT, kFloat = TINYGLTF_COMPONENT_TYPE_FLOAT;

// Attributes of other names (COLOR_1, _CUSTOM) are not read; of them only what tinygltf and the
// arithmetic of sizes rely on is asked.
/// What glTF and KHR_mesh_quantization together allow for an attribute.
struct AttributeRule {
  int type;
  std::vector<int> components;  ///< besides float
  bool integers_normalized_only = false;
  bool allows_float = true;
};

AttributeRule rule_of(const std::string& name) {
  if (name == "POSITION") return {TINYGLTF_TYPE_VEC3, {kByte, kUByte, kShort, kUShort}, false};
  if (name == "NORMAL") return {TINYGLTF_TYPE_VEC3, {kByte, kShort}, true};
  if (name == "TANGENT") return {TINYGLTF_TYPE_VEC4, {kByte, kShort}, true};
  if (name.starts_with("TEXCOORD_")) {
    return {TINYGLTF_TYPE_VEC2, {kByte, kUByte, kShort, kUShort}, false};
  }
  if (name.starts_with("JOINTS_")) return {TINYGLTF_TYPE_VEC4, {kUByte, kUShort}, false, false};
  if (name.starts_with("WEIGHTS_")) return {TINYGLTF_TYPE_VEC4, {kUByte, kUShort}, true};
  return {0, {}, false};
}

/// glTF's colours: RGB or RGBA, of floats or of normalised integers without sign.
bool holds_colours(const tinygltf::Accessor& a) {
  const bool is_wide = a.type == TINYGLTF_TYPE_VEC3 || a.type == TINYGLTF_TYPE_VEC4;
  const bool is_whole = a.componentType == kUByte || a.componentType == kUShort;
  return is_wide && (a.componentType == kFloat || (is_whole && a.normalized));
}

const char* type_name(int type) {
  return type == TINYGLTF_TYPE_SCALAR ? "SCALAR"
         : type == TINYGLTF_TYPE_VEC2 ? "VEC2"
         : type == TINYGLTF_TYPE_VEC3 ? "VEC3"
         : type == TINYGLTF_TYPE_VEC4 ? "VEC4"
                                      : "a matrix type";
}

void check_type(const AccessorReader& accessors, int index, const std::string& name,
                const std::string& place) {
  const tinygltf::Accessor& a = accessors.accessor(index);
  const AttributeRule rule = rule_of(name);
  if (rule.type == 0) {
    if (a.componentType == kUInt) {
      accessors.fail(index, place, "has 32-bit integers, which no attribute allows");
    }
    return;
  }
  const bool is_float = a.componentType == kFloat;
  const bool allowed = is_float ? rule.allows_float
                                : std::find(rule.components.begin(), rule.components.end(),
                                            a.componentType) != rule.components.end() &&
                                      (a.normalized || !rule.integers_normalized_only);
  if (a.type != rule.type || !allowed) {
    accessors.fail(
        index, place,
        fmt::format("has type {} with component type {}{}, which this attribute does not allow",
                    type_name(a.type), a.componentType, a.normalized ? " (normalized)" : ""));
  }
}

/// TEXCOORD_2 -> 2; nothing for other names and for sets beyond kMaxUvSets.
std::optional<std::size_t> set_index(const std::string& name, const char* prefix) {
  const std::string_view head(prefix);
  if (!name.starts_with(head) || name.size() != head.size() + 1) return std::nullopt;
  const char digit = name.back();
  if (digit < '0' || digit > '9') return std::nullopt;
  const auto index = static_cast<std::size_t>(digit - '0');
  return index < kMaxUvSets ? std::optional(index) : std::nullopt;
}

int attribute(const std::map<std::string, int>& attributes, const std::string& name) {
  const auto it = attributes.find(name);
  return it == attributes.end() ? -1 : it->second;
}

void check_attribute_set(const AccessorReader& accessors,
                         const std::map<std::string, int>& attributes, std::uint64_t vertices,
                         const std::string& place) {
  for (const auto& [name, index] : attributes) {
    const std::string where = place + " " + name;
    check_type(accessors, index, name, where);
    if (accessors.count(index) != vertices) {
      accessors.fail(
          index, where,
          fmt::format("has {} elements, but POSITION has {}", accessors.count(index), vertices));
    }
  }
}

/// JOINTS_n and WEIGHTS_n come in pairs, numbered from 0 without a gap. Returns how many.
std::size_t check_joint_sets(const AccessorReader& accessors,
                             const std::map<std::string, int>& attributes,
                             const std::string& place) {
  std::size_t sets = 0;
  for (const auto& [name, index] : attributes) {
    const bool joints = name.starts_with("JOINTS_");
    if (!joints && !name.starts_with("WEIGHTS_")) continue;
    const std::string number = name.substr(joints ? 7 : 8);
    if (!attributes.contains((joints ? "WEIGHTS_" : "JOINTS_") + number)) {
      accessors.fail(index, place + " " + name, "has no matching joints or weights");
    }
    if (joints) ++sets;
  }
  // As many sets as there are, so a gap among the numbers leaves one of these missing.
  for (std::size_t set = 0; set < sets; ++set) {
    if (!attributes.contains("JOINTS_" + std::to_string(set))) {
      const auto first = attributes.lower_bound("JOINTS_");
      accessors.fail(first->second, place + " " + first->first, "is not numbered from 0");
    }
  }
  return sets;
}

/// Corners too many for whole triangles are left out, with a warning when they are read.
std::uint64_t triangle_count(int mode, std::uint64_t corners) {
  if (mode == TINYGLTF_MODE_TRIANGLES) return corners / 3;
  return corners < 3 ? 0 : corners - 2;
}

}  // namespace

void AccessorReader::fail(int index, const std::string& place, const std::string& what) const {
  refuse(file_.path(), "{} (accessor {}) {}; export the model again", place, index, what);
}

std::uint64_t AccessorReader::count(int index) const {
  if (unpacked_ != nullptr && unpacked_->has(index)) return unpacked_->vertices();
  if (unpacked_ != nullptr && unpacked_->is_indices(index)) return 3 * unpacked_->triangles();
  return accessor(index).count;
}

void AccessorReader::check_unbacked(int index, std::uint64_t most, const std::string& place) const {
  const tinygltf::Accessor& a = accessor(index);
  if (a.bufferView < 0 && a.count > most) {
    fail(index, place, fmt::format("claims {} elements but has no bytes", a.count));
  }
}

template <class Out>
void AccessorReader::read(int index, Out* out, const std::string& place) const {
  const tinygltf::Accessor& a = accessor(index);
  if (unpacked_ != nullptr && (unpacked_->has(index) || unpacked_->is_indices(index)))
    return read_unpacked(index, out);
  if (a.bufferView < 0) {
    std::fill_n(out, a.count * component_count(a.type), Out{});
  } else {
    read_elements(a, 0, a.count, out);
  }
  // On top of zeros or of what the view holds.
  if (a.sparse.isSparse) read_sparse(a, index, out, place);
}

template <class Out>
void AccessorReader::read_elements(const tinygltf::Accessor& a, std::uint64_t first,
                                   std::uint64_t count, Out* out) const {
  const std::uint64_t components = component_count(a.type);
  const std::uint64_t element = components * component_bytes(a.componentType);
  const std::uint64_t view_stride = model_.bufferViews.at(idx(a.bufferView)).byteStride;
  // A stride of 0 means that elements follow each other without a gap.
  const std::uint64_t stride = view_stride == 0 ? element : view_stride;
  const std::uint64_t most = std::max<std::uint64_t>(1, kPieceBytes / stride);
  std::vector<std::byte> raw;
  for (std::uint64_t done = 0; done < count;) {
    const std::uint64_t piece = std::min(most, count - done);
    // Not piece * stride: the view may end with the last element.
    raw.resize((piece - 1) * stride + element);
    file_.read_view(idx(a.bufferView), a.byteOffset + (first + done) * stride, raw);
    convert_any(a.componentType, raw.data(), stride, piece, components, a.normalized,
                out + done * components);
    done += piece;
  }
}

/// What Draco held, by the same conversions as what lies in a buffer.
template <class Out>
void AccessorReader::read_unpacked(int index, Out* out) const {
  if constexpr (std::is_same_v<Out, std::uint32_t>) {
    if (unpacked_->is_indices(index)) return unpacked_->read_indices(out);
  }
  const tinygltf::Accessor& a = accessor(index);
  const std::uint64_t components = component_count(a.type);
  const std::uint64_t element = components * component_bytes(a.componentType);
  const std::uint64_t total = count(index);
  const std::uint64_t most = std::max<std::uint64_t>(1, kPieceBytes / element);
  std::vector<std::byte> raw;
  for (std::uint64_t done = 0; done < total;) {
    const std::uint64_t piece = std::min<std::uint64_t>(most, total - done);
    raw.resize(piece * element);
    unpacked_->read(index, done, piece, raw);
    convert_any(a.componentType, raw.data(), element, piece, components, a.normalized,
                out + done * components);
    done += piece;
  }
}

void AccessorReader::read_range(int index, std::uint64_t first, std::uint64_t count,
                                float* out) const {
  read_elements(accessor(index), first, count, out);
}

template <class Out>
void AccessorReader::read_sparse(const tinygltf::Accessor& a, int index, Out* out,
                                 const std::string& place) const {
  const std::uint64_t components = component_count(a.type);
  const std::uint64_t element = components * component_bytes(a.componentType);
  const std::uint64_t index_bytes = component_bytes(a.sparse.indices.componentType);
  const auto total = static_cast<std::uint64_t>(a.sparse.count);
  const std::uint64_t piece = kPieceBytes / element;
  std::vector<std::byte> raw;
  std::vector<std::uint32_t> where;
  for (std::uint64_t first = 0; first < total; first += piece) {
    const std::uint64_t count = std::min(piece, total - first);
    // Indices and values lie in two views: a piece of each at a time, into the same buffer.
    raw.resize(count * index_bytes);
    where.resize(count);
    file_.read_view(idx(a.sparse.indices.bufferView),
                    static_cast<std::uint64_t>(a.sparse.indices.byteOffset) + first * index_bytes,
                    raw);
    convert_any(a.sparse.indices.componentType, raw.data(), index_bytes, count, 1, false,
                where.data());
    // The same buffer again: the indices are numbers in `where` by now.
    raw.resize(count * element);
    file_.read_view(idx(a.sparse.values.bufferView),
                    static_cast<std::uint64_t>(a.sparse.values.byteOffset) + first * element, raw);
    for (std::uint64_t i = 0; i < count; ++i) {
      // Looked at here and not in check_gltf(), which sees no bytes of buffers.
      if (where[i] >= a.count) {
        fail(index, place,
             fmt::format("has the sparse index {}, but only {} elements", where[i], a.count));
      }
      convert_any(a.componentType, raw.data() + i * element, element, 1, components, a.normalized,
                  out + where[i] * components);
    }
  }
}

// NaN and infinity are refused where a number ends in geometry: one of them spreads over every box
// and bin it is put into. Normals, tangents and colours are looked at by the caller instead.
void AccessorReader::read_floats(int index, float* out, const std::string& place,
                                 bool any_value) const {
  read(index, out, place);
  if (any_value) return;
  const std::uint64_t components = component_count(accessor(index).type);
  const std::uint64_t total = count(index) * components;
  for (std::uint64_t i = 0; i < total; ++i) {
    if (!std::isfinite(out[i])) {
      fail(index, place, fmt::format("element {} is not a finite number", i / components));
    }
  }
}

void AccessorReader::read_whole(int index, std::uint32_t* out, const std::string& place) const {
  read(index, out, place);
}

// Throws for what makes no sense in any renderer (another number of elements, a type that no
// attribute may have); what pounce merely does not use is left out without a word.
PrimitiveShape check_primitive(const AccessorReader& accessors,
                               const tinygltf::Primitive& primitive, const std::string& place,
                               std::size_t skin_joints) {
  PrimitiveShape shape;
  const int position = attribute(primitive.attributes, "POSITION");
  if (position < 0) return shape;
  shape.vertices = accessors.count(position);
  check_attribute_set(accessors, primitive.attributes, shape.vertices, place);
  for (std::size_t t = 0; t < primitive.targets.size(); ++t) {
    for (const auto& [name, index] : primitive.targets[t]) {
      const std::string where = fmt::format("{} target {} {}", place, t, name);
      // A target moves attributes of the primitive: as many of them, of three numbers each.
      // The displacement of a tangent has no handedness.
      if (rule_of(name).type != 0 && name != "TEXCOORD_0" &&
          accessors.accessor(index).type != TINYGLTF_TYPE_VEC3 && !name.starts_with("TEXCOORD_")) {
        accessors.fail(index, where, "is not an accessor of VEC3");
      }
      if (accessors.count(index) != shape.vertices) {
        accessors.fail(index, where,
                       fmt::format("has {} elements, but POSITION has {}", accessors.count(index),
                                   shape.vertices));
      }
    }
  }
  const std::size_t joint_sets = check_joint_sets(accessors, primitive.attributes, place);
  if (skin_joints > 0) shape.joint_sets = joint_sets;
  // Without indices the vertices are the corners, in their order.
  std::uint64_t corners = shape.vertices;
  if (primitive.indices >= 0) {
    const tinygltf::Accessor& indices = accessors.accessor(primitive.indices);
    const std::string where = place + " indices";
    if (indices.type != TINYGLTF_TYPE_SCALAR || indices.normalized ||
        (indices.componentType != kUByte && indices.componentType != kUShort &&
         indices.componentType != kUInt)) {
      accessors.fail(primitive.indices, where, "is not an accessor of unsigned integers");
    }
    corners = indices.count;
  }
  shape.is_surface = primitive.mode >= TINYGLTF_MODE_TRIANGLES;
  // Points and lines are counted and left out, so what follows is not asked of them.
  if (!shape.is_surface) return shape;
  shape.triangles = triangle_count(primitive.mode, corners);
  shape.has_normals = primitive.attributes.contains("NORMAL");
  const int colours = attribute(primitive.attributes, "COLOR_0");
  shape.has_colours = colours >= 0 && holds_colours(accessors.accessor(colours));
  // Without normals each triangle gets corners of its own (placed_primitive.cpp).
  shape.flattened = shape.has_normals ? shape.vertices : 3 * shape.triangles;
  for (const auto& item : primitive.attributes) {
    const auto set = set_index(item.first, "TEXCOORD_");
    if (set) shape.uv_sets = std::max(shape.uv_sets, *set + 1);
  }
  return shape;
}

}  // namespace pounce::io
