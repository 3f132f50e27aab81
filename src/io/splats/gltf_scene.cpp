// SPDX-License-Identifier: Apache-2.0
//
// KHR_gaussian_splatting: a primitive of points whose attributes are those of Gaussians, an
// accessor for each, or an SPZ in a buffer view in their place (a compression extension within the
// first).
//
// One file may have many such primitives, shown by many nodes. They become one scene: parts that
// follow each other, each with the placement of its node. A part is decoded where it lies in the
// file (accessors), or from the scratch file that its SPZ was unpacked to; then the batch is
// placed. An SPZ that several nodes show is unpacked once.
//
// Memory: the JSON is kept as long as the scene, as a tree and as tinygltf's model of it, and this
// is the only part that grows with the file. So it is measured before it is parsed and refused
// where no scene would need as much; what it takes is part of decode_bytes(), and leased by who
// reads.
//
// The document was checked by check_gltf() before anything here looks at it, but for
// is_splat_gltf(), which is asked of any file and trusts nothing.
#include <fmt/format.h>
#include <tiny_gltf.h>

#include <algorithm>
#include <array>
#include <map>
#include <memory>
#include <optional>
#include <string_view>
#include <vector>

#include "core/input_file.h"
#include "io/files/asset_file.h"
#include "io/gltf/accessor.h"
#include "io/gltf/gltf_file.h"
#include "io/gltf/placed_primitive.h"
#include "io/gltf/validate.h"
#include "io/json/untrusted.h"
#include "io/problems.h"
#include "io/splats/batch.h"
#include "io/splats/spz_scene.h"

namespace pounce::io {
namespace {

using Json = nlohmann::json;

constexpr const char* kExtension = "KHR_gaussian_splatting";
constexpr const char* kSpz = "KHR_gaussian_splatting_compression_spz_2";
// A primitive has twenty accessors, and scenes in pieces have hundreds of primitives.
constexpr std::uint64_t kMostJsonBytes = 1 << 20, kMostInlineBytes = 8 << 20;
constexpr std::uint64_t kMostEntries = 1 << 14;
constexpr std::size_t kMostParts = 4096;

/// A buffer view as a file, so that the SPZ reader needs no second way in: its offsets count from
/// the view's first byte, and reads beyond the view's end fail as those beyond a file's do.
class ViewFile : public ReadFile {
 public:
  ViewFile(const GltfFile& file, std::size_t view, std::uint64_t size)
      : file_(file), view_(view), size_(size) {}
  std::uint64_t size_bytes() const override { return size_; }
  void read(std::uint64_t offset, std::span<std::byte> out) const override {
    file_.read_view(view_, offset, out);
  }

 private:
  const GltfFile& file_;
  std::size_t view_;
  std::uint64_t size_;
};

/// Where the JSON of a glTF is; nothing where the file is none. A .glb has its JSON first, behind a
/// header of 12 bytes and the chunk's own 8; its length is the file's word and may exceed the file.
std::optional<std::pair<std::uint64_t, std::uint64_t>> json_range(const ReadFile& file,
                                                                  const std::string& path) {
  const std::uint64_t size = file.size_bytes();
  if (size < 4) return std::nullopt;
  if (read_value<std::uint32_t>(file, 0) == 0x46546C67) {  // "glTF"
    if (size < 20) return std::nullopt;
    return std::pair{std::uint64_t{20},
                     std::min<std::uint64_t>(read_value<std::uint32_t>(file, 12), size - 20)};
  }
  const std::string ending = lower_ending(path);
  if (ending != ".gltf" && ending != ".json" && ending != ".glb") return std::nullopt;
  return std::pair{std::uint64_t{0}, size};
}

/// Searches text without loading it: most files asked about are meshes with large JSON, and only
/// those that name the extension at all are worth parsing.
bool contains(const ReadFile& file, std::uint64_t offset, std::uint64_t size,
              std::string_view word) {
  constexpr std::uint64_t kPiece = 64 << 10;
  std::string text;
  for (std::uint64_t at = 0; at < size;) {
    // The word may lie across two pieces.
    const std::size_t kept = std::min(text.size(), word.size() - 1);
    text.erase(0, text.size() - kept);
    const std::uint64_t next = std::min(kPiece, size - at);
    text.resize(kept + next);
    file.read(offset + at, std::as_writable_bytes(std::span(text)).subspan(kept));
    if (text.find(word) != std::string::npos) return true;
    at += next;
  }
  return false;
}

/// Null where there is no such member, and where there is no object to have it.
const Json* member(const Json* object, const char* key) {
  if (object == nullptr || !object->is_object()) return nullptr;
  const auto found = object->find(key);
  return found == object->end() ? nullptr : &*found;
}

const Json* splat_extension(const Json& primitive) {
  return member(member(&primitive, "extensions"), kExtension);
}

/// For a document that nobody has checked yet. member() accepts any value and finds nothing in one
/// that is no object, so every step down is safe; arrays are the only thing left to test.
bool has_splat_primitive(const Json& document) {
  const Json* const meshes = member(&document, "meshes");
  if (meshes == nullptr || !meshes->is_array()) return false;
  for (const Json& mesh : *meshes) {
    const Json* const primitives = member(&mesh, "primitives");
    if (primitives == nullptr || !primitives->is_array()) continue;
    if (std::any_of(primitives->begin(), primitives->end(),
                    [](const Json& p) { return splat_extension(p) != nullptr; }))
      return true;
  }
  return false;
}

bool is_small(const JsonSize& size) {
  return size.text_bytes <= kMostJsonBytes && size.data_bytes <= 2 * kMostInlineBytes;
}

/// The path, once its JSON is known to be no larger than a scene's.
const std::string& checked(const std::string& path) {
  if (is_small(gltf_json_size(path))) return path;
  refuse(path,
         "its JSON is too large for a scene of Gaussians ({} MiB, and {} MiB of data within it); "
         "write it as .glb, without anything else",
         kMostJsonBytes >> 20, kMostInlineBytes >> 20);
}

/// Entries are limited as text is: an accessor of 30 bytes costs over a kilobyte of model.
tinygltf::Model load_scene(const GltfFile& file) {
  if (gltf_entry_count(file.document()) > kMostEntries) {
    refuse(file.path(),
           "more than {} nodes, accessors and other elements, which is too many for a scene of "
           "Gaussians; export it alone",
           kMostEntries);
  }
  return load_model(file);
}

class GltfSplats : public BatchScene {
 public:
  GltfSplats(const std::string& path, const Axes& axes, const std::function<void()>& poll);

  void prepare(const ScratchFolder& folder, const std::function<void()>& poll) override;
  std::uint64_t prepare_bytes() const override;
  std::uint64_t unpacked_bytes() const override;
  void decode(std::uint64_t first, std::uint64_t count, std::uint32_t lobes, SplatBatch& batch,
              const Take& take) const override;
  std::uint64_t decode_bytes() const override;

 private:
  /// A primitive as a node shows it.
  struct Part {
    explicit Part(const SplatPlacement& where) : placement(where) { harmonics.fill(-1); }
    std::uint64_t first = 0, count = 0;
    SplatPlacement placement;
    int position = -1, rotation = -1, scale = -1, opacity = -1;  ///< accessors
    std::array<int, 1 + store::kMostLobes> harmonics;            ///< -1 beyond the degree
    const SpzScene* spz = nullptr;                               ///< in place of accessors
  };

  [[noreturn]] void fail(const std::string& what) const;
  void add(int mesh, std::size_t primitive, const SplatPlacement& placement,
           const std::function<void()>& poll);
  void check_kind(const nlohmann::json& extension, const std::string& place);
  const SpzScene& open_spz(const nlohmann::json& extension, const std::string& place,
                           const std::function<void()>& poll);
  int accessor(const tinygltf::Primitive& primitive, const std::string& name, int type,
               std::uint64_t count, const std::string& place) const;
  void find_accessors(const tinygltf::Primitive& primitive, const std::string& place, Part& part);
  void decode_accessors(const Part& part, std::uint64_t first, std::size_t rows,
                        std::uint32_t lobes, SplatBatch& batch) const;

  GltfFile file_;
  tinygltf::Model model_;
  AccessorReader accessors_;
  std::uint64_t held_bytes_ = 0;
  std::string colour_space_;
  bool names_no_kernel_ = false;                          ///< some primitive
  std::map<std::size_t, std::unique_ptr<SpzScene>> spz_;  ///< by buffer view
  std::vector<Part> parts_;
};

void GltfSplats::fail(const std::string& what) const { refuse(file_.path(), "{}", what); }

GltfSplats::GltfSplats(const std::string& path, const Axes& axes, const std::function<void()>& poll)
    : BatchScene(axes),
      file_(checked(path), false),
      model_(load_scene(file_)),
      accessors_(file_, model_) {
  // As mesh_cost() has it: measured for trees and models of accessors and nodes. Packed views stay
  // unpacked once they were read.
  held_bytes_ = kTypedBytesPerJsonByte * file_.json_bytes() +
                kBytesPerEntry * gltf_entry_count(file_.document()) + 3 * file_.inline_bytes() +
                file_.unpacking_bytes();
  info_.files = {path};
  for (const GltfBuffer& buffer : file_.buffers()) {
    if (!buffer.path.empty() && buffer.path != path) info_.files.push_back(buffer.path);
  }
  // Parts stand in the order in which the scene shows them: the file alone says which Gaussian has
  // which number.
  std::uint64_t others = 0;
  for (const MeshInstance& instance : mesh_instances(model_, world_transforms(model_))) {
    const SplatPlacement placement(instance.to_world.columns, instance.to_world.offset);
    const auto mesh = static_cast<std::size_t>(instance.mesh);
    const Json& primitives = file_.document().at("meshes").at(mesh).at("primitives");
    for (std::size_t p = 0; p < primitives.size(); ++p) {
      if (splat_extension(primitives[p]) == nullptr) {
        ++others;
      } else {
        add(instance.mesh, p, placement, poll);
      }
    }
  }
  if (parts_.empty()) {
    fail("its default scene has no primitive of Gaussians; add their node to it");
  }
  info_.format = fmt::format("glTF ({})", spz_.empty() ? kExtension : kSpz);
  info_.is_linear = colour_space_ == "lin_rec709_display";
  if (axes == Axes{}) {  // else the user says it
    info_.assumptions.emplace_back(
        "its axes are assumed to be glTF's (left, up, forward); --source-axes=-x,-y,z rotates it "
        "to the axes of trained scenes in other formats (right, down, forward)");
  }
  if (names_no_kernel_) {
    info_.assumptions.push_back(fmt::format(
        "its kernel is missing, which {} requires; \"ellipse\" is assumed", kExtension));
  }
  if (others > 0) {
    info_.assumptions.push_back(fmt::format(
        "{} primitives without {} ignored: if a file has Gaussians, these are the source", others,
        kExtension));
  }
}

// One colour space for the whole scene: Gaussians are blended with each other, so they cannot be
// converted one by one afterwards.
void GltfSplats::check_kind(const Json& extension, const std::string& place) {
  const JsonCheck check(file_.path(), file_.document());
  // The extension wants a kernel to be named, but files of public tools and tests name none, and
  // the ellipse is the only one there is: what is read without it is what was meant.
  const std::string* const kernel = check.string(extension, "kernel", place);
  if (kernel == nullptr) {
    names_no_kernel_ = true;
  } else if (*kernel != "ellipse") {
    fail(fmt::format(
        "{} has the kernel \"{}\", but only \"ellipse\" is supported; export it with that", place,
        kernel->substr(0, 60)));
  }
  const std::string* const space = check.string(extension, "colorSpace", place);
  if (space == nullptr || (*space != "srgb_rec709_display" && *space != "lin_rec709_display")) {
    fail(
        fmt::format("{} has the colour space \"{}\", but only srgb_rec709_display and "
                    "lin_rec709_display are supported; export it in one of these",
                    place, space == nullptr ? "" : space->substr(0, 60)));
  }
  if (!colour_space_.empty() && colour_space_ != *space) {
    fail(fmt::format("{} is in {}, another primitive in {}; export each as its own scene", place,
                     *space, colour_space_));
  }
  colour_space_ = *space;
}

// An SPZ is opened in its buffer view as in a file of its own, and once however often it is shown.
// Its own word about axes does not count here: glTF fixes them.
const SpzScene& GltfSplats::open_spz(const Json& extension, const std::string& place,
                                     const std::function<void()>& poll) {
  const JsonCheck check(file_.path(), file_.document());
  check.required_index(extension, "bufferView", place, "bufferViews");
  const auto view = extension.at("bufferView").get<std::size_t>();
  auto& scene = spz_[view];
  if (scene == nullptr) {
    const Json& json = file_.document().at("bufferViews").at(view);
    file_.read_view(view, 0, {});  // a buffer that cannot be read says so here
    scene = std::make_unique<SpzScene>(
        std::make_unique<ViewFile>(file_, view, json.at("byteLength").get<std::uint64_t>()),
        fmt::format("{}: {}", file_.path(), place), Axes{}, poll);
    if (!scene->own_axes().empty()) {
      info_.assumptions.push_back(fmt::format(
          "its SPZ states the axes {}; ignored, because glTF defines the axes", scene->own_axes()));
    }
  }
  return *scene;
}

// Adds one use of a primitive by a node: its number of Gaussians and where their values are. An SPZ
// says its number itself, accessors by POSITION; all others must have as many.
void GltfSplats::add(int mesh, std::size_t primitive, const SplatPlacement& placement,
                     const std::function<void()>& poll) {
  if (parts_.size() == kMostParts) {
    fail(fmt::format("its nodes have more than {} primitives of Gaussians; join them", kMostParts));
  }
  const std::string place = primitive_place(model_, mesh, primitive);
  const auto& meshes = file_.document().at("meshes");
  const Json& extension =
      *splat_extension(meshes.at(static_cast<std::size_t>(mesh)).at("primitives").at(primitive));
  check_kind(extension, place);
  Part part(placement);
  part.first = info_.splats;
  std::uint32_t degree = 0;
  if (const Json* inner = member(&extension, "extensions"); inner != nullptr) {
    for (const auto& [name, value] : inner->items()) {
      if (name != kSpz) {
        fail(
            fmt::format("{} is compressed or extended with {}, which is not supported; the only "
                        "supported compression is {}: export it without",
                        place, name.substr(0, 80), kSpz));
      }
      part.spz = &open_spz(value, place + " " + kSpz, poll);
    }
  }
  const auto& source = model_.meshes[static_cast<std::size_t>(mesh)].primitives[primitive];
  if (part.spz != nullptr) {
    part.count = part.spz->info().splats;
    degree = part.spz->info().sh_degree;
    if (part.spz->info().model != store::SplatModel::standard) info_.model = part.spz->info().model;
  } else {
    find_accessors(source, place, part);
    while (degree < 3 && part.harmonics[(degree + 1) * (degree + 1)] >= 0) ++degree;
  }
  info_.splats += part.count;
  info_.sh_degree = std::max(info_.sh_degree, degree);
  if (part.count > 0) parts_.push_back(std::move(part));
}

// -1 where the primitive has no such attribute. Sparse accessors and those of zeros are refused: no
// program writes Gaussians so, and a range of them could not be read.
int GltfSplats::accessor(const tinygltf::Primitive& primitive, const std::string& name, int type,
                         std::uint64_t count, const std::string& place) const {
  const auto found = primitive.attributes.find(name);
  if (found == primitive.attributes.end()) return -1;
  const int index = found->second;
  const tinygltf::Accessor& a = accessors_.accessor(index);
  const std::string where = place + " " + name;
  if (a.type != type) accessors_.fail(index, where, "has the wrong type for Gaussians");
  if (a.bufferView < 0 || a.sparse.isSparse)
    accessors_.fail(index, where, "has no buffer view or is sparse");
  if (a.count != count)
    accessors_.fail(index, where, fmt::format("has {} elements for {} Gaussians", a.count, count));
  file_.read_view(static_cast<std::size_t>(a.bufferView), 0, {});
  return index;
}

void GltfSplats::find_accessors(const tinygltf::Primitive& primitive, const std::string& place,
                                Part& part) {
  const auto position = primitive.attributes.find("POSITION");
  if (position == primitive.attributes.end())
    fail(place + " has no POSITION for its Gaussians; export the scene again");
  part.count = accessors_.count(position->second);
  const auto required = [&](const std::string& name, int type) {
    const int index = accessor(primitive, name, type, part.count, place);
    if (index < 0) fail(fmt::format("{} has no {}; export the scene again", place, name));
    return index;
  };
  const std::string prefix = std::string(kExtension) + ":";
  part.position = required("POSITION", TINYGLTF_TYPE_VEC3);
  part.rotation = required(prefix + "ROTATION", TINYGLTF_TYPE_VEC4);
  part.scale = required(prefix + "SCALE", TINYGLTF_TYPE_VEC3);
  part.opacity = required(prefix + "OPACITY", TINYGLTF_TYPE_SCALAR);
  const tinygltf::Accessor& opacity = accessors_.accessor(part.opacity);
  if (opacity.componentType != TINYGLTF_COMPONENT_TYPE_FLOAT && !opacity.normalized) {
    accessors_.fail(part.opacity, place + " OPACITY", "has integers that are not normalized");
  }
  std::size_t k = 0;
  for (int degree = 0; degree <= 3; ++degree) {
    for (int n = 0; n <= 2 * degree; ++n, ++k) {
      const std::string name = fmt::format("{}SH_DEGREE_{}_COEF_{}", prefix, degree, n);
      part.harmonics[k] = accessor(primitive, name, TINYGLTF_TYPE_VEC3, part.count, place);
      // Whole degrees only: all of a degree or none of it, and none above one that is missing.
      const bool begun = n > 0 && part.harmonics[k - 1] >= 0;
      const bool missed = k > 0 && part.harmonics[k - 1] < 0;
      if (k == 0 ? part.harmonics[k] < 0 : part.harmonics[k] < 0 ? begun : missed) {
        fail(
            fmt::format("{} has an incomplete set of spherical harmonics ({} is the first that is "
                        "missing); export the scene again",
                        place, missed ? fmt::format("one before {}", name) : name));
      }
    }
  }
}

std::uint64_t GltfSplats::prepare_bytes() const {
  std::uint64_t most = 0;
  for (const auto& [view, scene] : spz_) most = std::max(most, scene->prepare_bytes());
  return most;
}

std::uint64_t GltfSplats::unpacked_bytes() const {
  std::uint64_t all = 0;
  for (const auto& [view, scene] : spz_) all += scene->unpacked_bytes();
  return all;
}

// Those that are stored in accessors need none.
void GltfSplats::prepare(const ScratchFolder& folder, const std::function<void()>& poll) {
  for (const auto& [view, scene] : spz_) scene->prepare(folder, poll);
}

// Parts are decoded one after the other: the largest need of any of them.
std::uint64_t GltfSplats::decode_bytes() const {
  std::uint64_t most = 1 << 20;  // a piece of an accessor
  for (const auto& [view, scene] : spz_) most = std::max(most, scene->decode_bytes());
  return most + held_bytes_;
}

void GltfSplats::decode(std::uint64_t first, std::uint64_t count, std::uint32_t lobes,
                        SplatBatch& batch, const Take& take) const {
  for (const Part& part : parts_) {
    const std::uint64_t from = std::max(first, part.first);
    const std::uint64_t end = std::min(first + count, part.first + part.count);
    if (from >= end) continue;
    for (auto& column : batch.sh) column.fill(0);  // parts differ in their degrees
    // Placed after decoding and before it is taken: what leaves here is in the scene's own space.
    const auto place = [&](std::size_t rows) {
      part.placement.apply(batch, rows, lobes);
      take(rows);
    };
    if (part.spz != nullptr) {
      part.spz->decode(from - part.first, end - from, lobes, batch, place);
      continue;
    }
    for_batches(end - from, [&](std::uint64_t begin, std::size_t rows) {
      decode_accessors(part, from - part.first + begin, rows, lobes, batch);
      place(rows);
    });
  }
}

// Attributes are read one after the other into a row-wise buffer of 256 rows, then split into
// columns. Rotations change from x y z w to w x y z; scales and opacities are linear in glTF.
void GltfSplats::decode_accessors(const Part& part, std::uint64_t first, std::size_t rows,
                                  std::uint32_t lobes, SplatBatch& batch) const {
  std::array<float, 4 * SplatBatch::kRows> values;
  const auto load = [&](int index, std::size_t components, auto column) {
    accessors_.read_range(index, first, rows, values.data());
    for (std::size_t i = 0; i < rows; ++i) {
      for (std::size_t k = 0; k < components; ++k) column(k)[i] = values[i * components + k];
    }
  };
  const auto of = [](auto& columns, std::size_t at) {
    return [&columns, at](std::size_t k) -> SplatBatch::Column& { return columns[at + k]; };
  };
  load(part.position, 3, of(batch.mean, 0));
  load(part.scale, 3, of(batch.sigma, 0));
  load(part.opacity, 1, [&](std::size_t) -> SplatBatch::Column& { return batch.alpha; });
  load(part.rotation, 4, [&](std::size_t k) -> SplatBatch::Column& {
    return batch.rotation[(k + 1) % 4];  // x, y, z, w
  });
  load(part.harmonics[0], 3, of(batch.colour, 0));
  for (auto& column : batch.colour) colour_of_dc(column, rows);
  for (std::size_t k = 0; k < lobes && part.harmonics[k + 1] >= 0; ++k)
    load(part.harmonics[k + 1], 3, of(batch.sh, 3 * k));
}

}  // namespace

bool is_splat_gltf(const std::string& path) {
  const auto file = open_input(path);
  const auto range = json_range(*file, path);
  if (!range || !contains(*file, range->first, range->second, kExtension)) return false;
  const JsonSize size = gltf_json_size(path);
  if (!is_small(size)) return false;
  // No more than 1 MiB by now: is_small().
  std::string text(range->second, '\0');
  file->read(range->first, std::as_writable_bytes(std::span(text)));
  return has_splat_primitive(Json::parse(text, nullptr, false));
}

std::unique_ptr<SplatScene> open_splat_gltf(const std::string& path, const Axes& axes,
                                            const std::function<void()>& poll) {
  return std::make_unique<GltfSplats>(path, axes, poll);
}

}  // namespace pounce::io
