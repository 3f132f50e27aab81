// SPDX-License-Identifier: Apache-2.0
//
// KHR_draco_mesh_compression: primitives whose triangles and attributes are packed together. Their
// accessors say types and counts and have no bytes.
//
// How many points and faces a mesh has stands in a few bytes of its head, and the library makes
// memory for them before it decodes the first one; a row of equal values costs next to nothing, so
// the packed bytes do not limit it. The accessors do: what they claim was compared with the size of
// the file when the scene was planned (mesh_reader.cpp). So the head is read here first, and what
// claims more than the accessors is refused; then again, by the decoder itself, between triangles
// and attributes, when it knows how many of each there will be. A few more vertices are fine: the
// milk truck of Khronos' samples has 1,886 where its accessors say 1,856.
//
//   head          "DRACO", version 2.2, a mesh, how it is packed; maybe metadata, which are cut out
//   connectivity  varints: faces and points, or vertices, faces, kinds of seams, symbols
//   attributes    their types, then their values
//
// Metadata nest and repeat as they like and are of no use here: the library never sees them.
#include "io/gltf/draco.h"

#include <draco/compression/mesh/mesh_edgebreaker_decoder.h>
#include <draco/compression/mesh/mesh_sequential_decoder.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <new>
#include <stdexcept>
#include <string_view>
#include <utility>
#include <vector>

#include "io/problems.h"

namespace pounce::io {
namespace {

using Json = nlohmann::json;

/// Attributes beyond those that the primitive names: a few are harmless.
constexpr std::uint64_t kMoreAttributes = 4;
constexpr int kMostMetadataDepth = 16;

/// What a mesh may have, by its accessors.
struct Claims {
  std::uint64_t faces = 0, points = 0, attributes = 0;
};

const tinygltf::Value& extension_of(const tinygltf::Primitive& primitive) {
  return primitive.extensions.at(kDraco);
}

Claims claims_of(const tinygltf::Model& model, const tinygltf::Primitive& primitive) {
  const auto count = [&](int accessor) {
    return static_cast<std::uint64_t>(model.accessors.at(static_cast<std::size_t>(accessor)).count);
  };
  const auto position = primitive.attributes.find("POSITION");
  Claims out;
  out.faces = primitive.indices < 0 ? 0 : count(primitive.indices) / 3;
  out.points =
      position == primitive.attributes.end() ? 0 : most_draco_vertices(count(position->second));
  out.attributes = extension_of(primitive).Get("attributes").Size() + kMoreAttributes;
  return out;
}

/// Walks over the head of packed bytes. Throws std::invalid_argument where they end.
class HeadReader {
 public:
  explicit HeadReader(std::span<const std::byte> bytes) : bytes_(bytes) {}

  std::size_t at() const { return at_; }
  std::uint8_t byte() {
    skip(1);
    return static_cast<std::uint8_t>(bytes_[at_ - 1]);
  }
  void skip(std::uint64_t count) {
    if (count > bytes_.size() - at_) throw std::invalid_argument("are truncated");
    at_ += count;
  }
  /// Seven bits a byte, the lowest first.
  std::uint64_t varint() {
    std::uint64_t value = 0;
    for (int shift = 0; shift < 35; shift += 7) {
      const std::uint8_t bits = byte();
      value |= std::uint64_t{bits & 0x7FU} << shift;
      if ((bits & 0x80U) == 0) return value;
    }
    throw std::invalid_argument("have a number that is too long");
  }
  /// Entries of (name, bytes), then parts of (name, the same again).
  void skip_metadata(int depth = 0) {
    if (depth > kMostMetadataDepth) throw std::invalid_argument("have metadata nested too deep");
    for (std::uint64_t entries = varint(); entries > 0; --entries) {
      skip(byte());
      skip(varint());
    }
    for (std::uint64_t parts = varint(); parts > 0; --parts) {
      skip(byte());
      skip_metadata(depth + 1);
    }
  }

 private:
  std::span<const std::byte> bytes_;
  std::size_t at_ = 0;
};

void require_at_most(std::uint64_t found, std::uint64_t most, const char* what) {
  if (found <= most) return;
  throw std::invalid_argument(
      fmt::format("claim {} {}, but at most {} fit the accessors", found, what, most));
}

/// Cuts metadata out of `packed` and compares what the head claims. Is it packed as a walk over the
/// triangles ("edgebreaker"), and not one after the other?
bool check_head(std::vector<std::byte>& packed, const Claims& claims) {
  HeadReader head(packed);
  for (const char c : std::string_view("DRACO")) {
    if (head.byte() != static_cast<std::uint8_t>(c))
      throw std::invalid_argument("do not begin like Draco");
  }
  const int major = head.byte(), minor = head.byte();
  if (major != 2 || minor != 2) {
    throw std::invalid_argument(
        fmt::format("have the Draco version {}.{}; glTF has 2.2", major, minor));
  }
  if (head.byte() != draco::TRIANGULAR_MESH) throw std::invalid_argument("are no mesh");
  const int method = head.byte();
  if (method != draco::MESH_SEQUENTIAL_ENCODING && method != draco::MESH_EDGEBREAKER_ENCODING)
    throw std::invalid_argument(fmt::format("are packed by the unknown method {}", method));
  head.skip(1);
  const std::size_t flags_at = head.at();  // of the high byte; its highest bit stands for metadata
  if ((head.byte() & 0x80U) != 0) {
    const std::size_t begin = head.at();
    for (std::uint64_t attributes = head.varint(); attributes > 0; --attributes) {
      head.varint();
      head.skip_metadata();
    }
    head.skip_metadata();
    const auto first = packed.begin();
    packed.erase(first + static_cast<std::ptrdiff_t>(begin),
                 first + static_cast<std::ptrdiff_t>(head.at()));
    packed[flags_at] &= std::byte{0x7F};
    head = HeadReader(packed);
    head.skip(begin);
  }
  if (method == draco::MESH_SEQUENTIAL_ENCODING) {
    require_at_most(head.varint(), claims.faces, "triangles");
    require_at_most(head.varint(), claims.points, "vertices");
    return false;
  }
  head.skip(1);  // the kind of walk
  require_at_most(head.varint(), claims.points, "vertices");
  require_at_most(head.varint(), claims.faces, "triangles");
  require_at_most(head.byte(), claims.attributes, "kinds of seams");
  require_at_most(head.varint(), claims.faces, "symbols");
  require_at_most(head.varint(), claims.faces, "splits");
  return true;
}

/// A decoder that looks at what it has so far before it decodes attributes.
template <class Decoder>
class LimitedDecoder : public Decoder {
 public:
  explicit LimitedDecoder(const Claims& claims) : claims_(claims) {}

  /// Why it stopped, where that is known.
  const std::string& problem() const { return problem_; }

 protected:
  // Nothing is thrown through the library.
  bool DecodeAllAttributes() override {
    try {
      check();
    } catch (const std::invalid_argument& e) {
      problem_ = e.what();
      return false;
    }
    return Decoder::DecodeAllAttributes();
  }

 private:
  void check() {
    const draco::PointCloud& cloud = *this->point_cloud();
    require_at_most(this->mesh()->num_faces(), claims_.faces, "triangles");
    require_at_most(cloud.num_points(), claims_.points, "vertices");
    require_at_most(static_cast<std::uint64_t>(cloud.num_attributes()), claims_.attributes,
                    "attributes");
    for (int a = 0; a < cloud.num_attributes(); ++a) {
      const int components = cloud.attribute(a)->num_components();
      if (components < 1 || components > 4) {
        throw std::invalid_argument(
            fmt::format("have an attribute of {} numbers, which no accessor has", components));
      }
    }
  }

  Claims claims_;
  std::string problem_;
};

template <class Decoder>
void decode(const Claims& claims, draco::DecoderBuffer& buffer, draco::Mesh& mesh) {
  const draco::DecoderOptions options;
  LimitedDecoder<Decoder> decoder(claims);
  if (decoder.Decode(options, &buffer, &mesh).ok()) return;
  throw std::invalid_argument(decoder.problem().empty() ? "are damaged" : decoder.problem());
}

std::unique_ptr<draco::Mesh> unpack(std::vector<std::byte> packed, const Claims& claims) {
  const bool is_walk = check_head(packed, claims);
  auto mesh = std::make_unique<draco::Mesh>();
  draco::DecoderBuffer buffer;
  buffer.Init(reinterpret_cast<const char*>(packed.data()), packed.size());
  if (is_walk) {
    decode<draco::MeshEdgebreakerDecoder>(claims, buffer, *mesh);
  } else {
    decode<draco::MeshSequentialDecoder>(claims, buffer, *mesh);
  }
  return mesh;
}

/// The values of one point after the other, in the type of the accessor.
template <class Stored>
bool copy_values(const draco::PointAttribute& from, std::uint64_t first, std::uint64_t count,
                 std::span<std::byte> out) {
  std::array<Stored, 4> values{};
  const auto components = static_cast<std::size_t>(from.num_components());
  const std::size_t element = components * sizeof(Stored);
  for (std::uint64_t i = 0; i < count; ++i) {
    const draco::AttributeValueIndex value =
        from.mapped_index(draco::PointIndex(static_cast<std::uint32_t>(first + i)));
    if (value.value() >= from.size()) return false;
    if (!from.ConvertValue<Stored>(value, static_cast<std::int8_t>(components), values.data()))
      return false;
    std::memcpy(out.data() + i * element, values.data(), element);
  }
  return true;
}

bool copy_any(const draco::PointAttribute& from, int component_type, std::uint64_t first,
              std::uint64_t count, std::span<std::byte> out) {
  switch (component_type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
      return copy_values<std::int8_t>(from, first, count, out);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return copy_values<std::uint8_t>(from, first, count, out);
    case TINYGLTF_COMPONENT_TYPE_SHORT:
      return copy_values<std::int16_t>(from, first, count, out);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return copy_values<std::uint16_t>(from, first, count, out);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
      return copy_values<std::uint32_t>(from, first, count, out);
    default:
      return copy_values<float>(from, first, count, out);
  }
}

}  // namespace

void check_draco(const JsonCheck& check, const Json& primitive, const std::string& place) {
  const Json* extensions = check.object(primitive, "extensions", place);
  const std::string here = place + "." + kDraco;
  const Json* extension =
      extensions == nullptr ? nullptr : check.object(*extensions, kDraco, place);
  if (extension == nullptr) return;
  check.required_index(*extension, "bufferView", here, "bufferViews");
  const Json* attributes = check.object(*extension, "attributes", here);
  if (attributes == nullptr) check.fail(here + ".attributes", "is missing");
  constexpr std::uint64_t kMost = std::numeric_limits<std::int32_t>::max();
  for (const auto& item : attributes->items())
    check.required_whole(*attributes, item.key().c_str(), here + ".attributes", 0, kMost);
}

bool is_draco(const GltfFile& file, const tinygltf::Model& model,
              const tinygltf::Primitive& primitive) {
  if (!primitive.extensions.contains(kDraco)) return false;
  if (file.requires_extension(kDraco)) return true;
  const auto is_packed = [&](int accessor) {
    return accessor >= 0 && model.accessors.at(static_cast<std::size_t>(accessor)).bufferView < 0;
  };
  for (const std::string& name : extension_of(primitive).Get("attributes").Keys()) {
    const auto found = primitive.attributes.find(name);
    if (found != primitive.attributes.end() && is_packed(found->second)) return true;
  }
  return is_packed(primitive.indices);
}

std::uint64_t most_draco_vertices(std::uint64_t accessor_count) {
  return accessor_count + accessor_count / 2 + 256;
}

// Estimated from the library's tables, and wide; tests/unit/io/test_packed.cpp holds it against
// what is allocated for grids.
std::uint64_t draco_bytes(const GltfFile& file, const tinygltf::Model& model,
                          const tinygltf::Primitive& primitive) {
  constexpr std::uint64_t kPerFace = 160, kPerPoint = 64;
  constexpr std::uint64_t kPerFaceAndAttribute = 48, kPerPointAndAttribute = 96;
  constexpr std::uint64_t kMost = std::uint64_t{1} << 40;
  const Claims claims = claims_of(model, primitive);
  const auto view =
      static_cast<std::size_t>(extension_of(primitive).Get("bufferView").GetNumberAsInt());
  const std::uint64_t packed =
      std::min<std::uint64_t>(model.bufferViews.at(view).byteLength, file.total_buffer_bytes());
  const std::uint64_t attributes = std::min(claims.attributes, kMost >> 30);
  const std::uint64_t faces = std::min(claims.faces, kMost),
                      points = std::min(claims.points, kMost);
  return faces * (kPerFace + kPerFaceAndAttribute * attributes) +
         points * (kPerPoint + kPerPointAndAttribute * attributes) + 3 * packed;
}

void DracoPrimitive::fail(const std::string& what) const {
  refuse(file_.path(), "{}: its {} data {}; export the model again, or without compression", place_,
         kDraco, what);
}

DracoPrimitive::DracoPrimitive(const GltfFile& file, const tinygltf::Model& model,
                               const tinygltf::Primitive& primitive, const std::string& place)
    : file_(file), model_(model), place_(place), indices_(primitive.indices) {
  const tinygltf::Value& extension = extension_of(primitive);
  const tinygltf::Value& names = extension.Get("attributes");
  if (primitive.mode != TINYGLTF_MODE_TRIANGLES) fail("are no list of triangles");
  if (indices_ < 0) fail("belong to a primitive without indices");
  if (!names.Has("POSITION") || !primitive.attributes.contains("POSITION"))
    fail("have no positions");
  const Claims claims = claims_of(model, primitive);
  const auto view = static_cast<std::size_t>(extension.Get("bufferView").GetNumberAsInt());
  file.read_view(view, 0, {});  // a buffer without bytes says so here
  std::vector<std::byte> packed(model.bufferViews.at(view).byteLength);
  file.read_view(view, 0, packed);
  try {
    mesh_ = unpack(std::move(packed), claims);
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::invalid_argument& e) {
    fail(e.what());
  } catch (const std::exception&) {
    fail("are damaged");
  }
  for (const std::string& name : names.Keys())
    find_attribute(primitive, name, static_cast<std::uint32_t>(names.Get(name).GetNumberAsInt()));
  const auto position = static_cast<std::size_t>(primitive.attributes.at("POSITION"));
  require_all_packed(primitive, model.accessors.at(position).count);
}

DracoPrimitive::~DracoPrimitive() = default;

/// Draco orders vertices anew and may make more of them: what is not packed would not fit them.
void DracoPrimitive::require_all_packed(const tinygltf::Primitive& primitive,
                                        std::uint64_t vertices) const {
  if (this->vertices() == vertices) return;
  const bool is_packed = primitive.targets.empty() &&
                         std::all_of(primitive.attributes.begin(), primitive.attributes.end(),
                                     [&](const auto& attribute) { return has(attribute.second); });
  if (!is_packed) {
    fail(fmt::format("have {} vertices, but attributes that are not packed with them have {}",
                     this->vertices(), vertices));
  }
}

std::uint64_t DracoPrimitive::vertices() const { return mesh_->num_points(); }
std::uint64_t DracoPrimitive::triangles() const { return mesh_->num_faces(); }

void DracoPrimitive::find_attribute(const tinygltf::Primitive& primitive, const std::string& name,
                                    std::uint32_t id) {
  const auto named = primitive.attributes.find(name);
  if (named == primitive.attributes.end()) return;
  const int attribute = mesh_->GetAttributeIdByUniqueId(id);
  if (attribute < 0) fail(fmt::format("have no attribute {}, which should be {}", id, name));
  const tinygltf::Accessor& accessor = model_.accessors.at(static_cast<std::size_t>(named->second));
  const int components =
      tinygltf::GetNumComponentsInType(static_cast<std::uint32_t>(accessor.type));
  if (mesh_->attribute(attribute)->num_components() != components) {
    fail(fmt::format("have {} numbers for each {}, but its accessor has {}",
                     static_cast<int>(mesh_->attribute(attribute)->num_components()), name,
                     components));
  }
  const auto [at, is_new] = attributes_.try_emplace(named->second, attribute);
  if (!is_new && at->second != attribute) fail("have two attributes for one accessor");
}

void DracoPrimitive::read_indices(std::uint32_t* out) const {
  for (std::uint32_t f = 0; f < mesh_->num_faces(); ++f) {
    for (const draco::PointIndex& corner : mesh_->face(draco::FaceIndex(f)))
      *out++ = corner.value();
  }
}

void DracoPrimitive::read(int accessor, std::uint64_t first, std::uint64_t count,
                          std::span<std::byte> out) const {
  const int type = model_.accessors.at(static_cast<std::size_t>(accessor)).componentType;
  if (!copy_any(*mesh_->attribute(attributes_.at(accessor)), type, first, count, out))
    fail("have values that are not of the types of the accessors");
}

}  // namespace pounce::io
