// SPDX-License-Identifier: Apache-2.0
//
// Where everything of a model output will be: entries of arrays (find_slots()) and bytes of buffers
// (ModelBuffers). Both are decided before anything is written, from the document alone.
//
// A texture that is replaced leaves a hole: its entry, its image, its bytes. Entries cannot be
// taken out of their arrays, since every index behind them would change, and an extension that
// nobody here knows may hold such an index. So a new texture takes the place of the one it
// replaces, if that one has no other user, and else goes to the end of the array; then the same for
// the image, and for the buffer view. Who uses what is counted over the whole document; what is of
// unknown meaning counts as a reference to everything that its numbers could mean.
//
// Bytes can be taken out: those of a freed view that no other view reads, in steps of 16, so that
// what lies behind keeps its alignment. Buffers are lists of pieces of files until the very end, so
// a model of any size is copied in constant memory.
//
// To count a reference too many is safe: an entry stays that could have gone. One too few would
// pull bytes away from somebody. All guesses here are on that side.
//
// To append always would be simpler, and an avatar that is painted ten times would hold eleven
// textures. To close the holes in the arrays would be smaller, and would change what an index in an
// unknown extension means (docs/decisions/012).
#include "io/model/layout.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <set>
#include <string_view>

#include "io/gltf/validate.h"
#include "io/problems.h"

namespace pounce::io {
namespace {

using Json = nlohmann::json;

std::size_t size_of(const Json& document, const char* key) {
  const auto it = document.find(key);
  return it == document.end() ? 0 : it->size();
}

/// How often each entry is referred to.
struct References {
  std::map<std::size_t, std::size_t> textures, images, views;

  /// `anything`: of unknown meaning, every whole number may be a reference to anything.
  // As deep as the document nests, which was limited when the file was opened (gltf_file.cpp).
  void count(const Json& value, bool anything) {
    if (anything && value.is_number_unsigned()) {
      for (auto* kind : {&textures, &images, &views}) ++(*kind)[value.get<std::size_t>()];
    }
    if (value.is_array()) {
      for (const Json& item : value) count(item, anything);
    }
    if (!value.is_object()) return;
    for (const auto& item : value.items()) count_member(item.key(), item.value(), anything);
  }

 private:
  void count_member(const std::string& key, const Json& value, bool anything) {
    if (!anything && value.is_number_unsigned()) {
      const auto index = value.get<std::size_t>();
      if (key == "index") ++textures[index];
      if (key == "source") ++images[index];
      if (key == "bufferView") ++views[index];
    }
    if (!anything && key == "extensions" && value.is_object()) {
      for (const auto& item : value.items()) {
        // Khronos' own keep to the names above.
        count(item.value(), !item.key().starts_with("KHR_"));
      }
      return;
    }
    count(value, anything || key == "extras");
  }
};

/// The member at the end of a path of keys, or null.
const Json* at(const Json& from, const std::vector<const char*>& keys) {
  const Json* value = &from;
  for (const char* key : keys) {
    if (!value->is_object()) return nullptr;
    const auto it = value->find(key);
    if (it == value->end()) return nullptr;
    value = &*it;
  }
  return value;
}

/// Where a material names the texture of a channel, and what else a new one stands for.
struct TexturePlace {
  Channel channel;
  std::vector<const char*> keys;
};

std::vector<std::size_t> replaced_textures(const Json& material, Channel channel) {
  constexpr const char* kPbr = "pbrMetallicRoughness";
  constexpr const char* kGlossy = "KHR_materials_pbrSpecularGlossiness";
  static const std::vector<TexturePlace> places{
      {Channel::base_color, {kPbr, "baseColorTexture", "index"}},
      {Channel::base_color, {"extensions", kGlossy, "diffuseTexture", "index"}},
      {Channel::metallic_roughness, {kPbr, "metallicRoughnessTexture", "index"}},
      {Channel::metallic_roughness, {"extensions", kGlossy, "specularGlossinessTexture", "index"}},
      {Channel::occlusion, {"occlusionTexture", "index"}},
      {Channel::emissive, {"emissiveTexture", "index"}},
      {Channel::normal, {"normalTexture", "index"}}};
  std::vector<std::size_t> textures;
  for (const TexturePlace& place : places) {
    const Json* const index = place.channel == channel ? at(material, place.keys) : nullptr;
    if (index != nullptr && index->is_number_unsigned())
      textures.push_back(index->get<std::size_t>());
  }
  return textures;
}

class SlotFinder {
 public:
  SlotFinder(const Json& document, const ModelRequest& request)
      : document_(document),
        request_(request),
        material_count_(size_of(document, "materials")),
        texture_count_(size_of(document, "textures")),
        image_count_(size_of(document, "images")) {}

  ModelSlots find() {
    assign_materials();
    // The document as it is, then less what the new textures replace. What is left at 0 is free.
    left_.count(document_, false);
    // A copy shows the same textures, so it refers to them once more.
    for (const MaterialCopy& copy : slots_.copies) {
      left_.count(document_.at("materials").at(copy.material), false);
    }
    std::vector<std::vector<std::size_t>> replaced;
    for (const ModelTexture& texture : request_.textures) {
      replaced.emplace_back();
      if (texture.material >= size_of(document_, "materials")) continue;
      const Json& material = document_.at("materials").at(texture.material);
      replaced.back() = replaced_textures(material, texture.channel);
      for (const std::size_t index : replaced.back()) --left_.textures[index];
    }
    for (const auto& candidates : replaced) slots_.textures.push_back(take(candidates));
    std::sort(slots_.free_views.begin(), slots_.free_views.end());
    return std::move(slots_);
  }

 private:
  /// New materials: for primitives without one, and copies for primitives without the UVs.
  // A material is written for all primitives that show it. One that has no such UVs would show the
  // new texture by other coordinates, or none: it gets a copy of the old material.
  void assign_materials() {
    std::set<std::size_t> written;
    for (const ModelTexture& texture : request_.textures) written.insert(texture.material);
    // A texture whose material has the number behind the last is for triangles without a material.
    const std::size_t own = material_count_;
    if (written.contains(own)) ++material_count_;
    std::map<std::size_t, std::size_t> copies;
    const std::string uvs = "TEXCOORD_" + std::to_string(request_.uv_set);
    for (std::size_t m = 0; m < size_of(document_, "meshes"); ++m) {
      const Json& primitives = document_.at("meshes").at(m).at("primitives");
      for (std::size_t p = 0; p < primitives.size(); ++p) {
        const Json* named = at(primitives[p], {"material"});
        const std::size_t material = named == nullptr ? own : named->get<std::size_t>();
        if (!written.contains(material)) continue;
        const bool has_uvs = primitives[p].at("attributes").contains(uvs);
        if (material == own) {
          // Modes from 4 on are triangles; points and lines show no texture of this kind.
          const bool is_surface = primitives[p].value("mode", 4) >= 4;
          if (has_uvs && is_surface) slots_.primitives.push_back({m, p, own});
        } else if (!has_uvs) {
          const auto [copy, fresh] = copies.try_emplace(material, material_count_);
          if (fresh) slots_.copies.push_back({material, material_count_++});
          slots_.primitives.push_back({m, p, copy->second});
        }
      }
    }
  }

  /// A texture, an image and a buffer view for one new texture that stands for these.
  // Each level is free only if the one above was: an image that another texture shows keeps its
  // bytes. taken_: two channels may have shown one texture, and only one of them may have its
  // entry.
  ModelSlots::Texture take(const std::vector<std::size_t>& replaced) {
    // At the ends of the arrays, unless something below becomes free.
    ModelSlots::Texture slot{texture_count_, image_count_, std::nullopt};
    const std::size_t own = size_of(document_, "textures");
    const auto unused = std::find_if(replaced.begin(), replaced.end(), [&](std::size_t index) {
      return index < own && left_.textures[index] == 0 && taken_.insert(index).second;
    });
    std::optional<std::size_t> image;
    if (unused != replaced.end()) {
      slot.texture = *unused;
      image = release(document_.at("textures").at(*unused), &References::images);
    }
    std::optional<std::size_t> view;
    if (image) {
      slot.image = *image;
      view = release(document_.at("images").at(*image), &References::views);
    }
    if (view) {
      slots_.free_views.push_back(*view);
      slot.view = view;
    }
    texture_count_ += unused == replaced.end() ? 1 : 0;
    image_count_ += image ? 0 : 1;
    return slot;
  }

  /// Takes what `entry` refers to off the counts; the first thing that nobody refers to any more.
  std::optional<std::size_t> release(const Json& entry,
                                     std::map<std::size_t, std::size_t> References::*kind) {
    References gone;
    gone.count(entry, false);
    std::optional<std::size_t> unused;
    // Taken off all of them, also of those that are not reused: their entries stay, with nobody's
    // name.
    for (const auto& [index, count] : gone.*kind) {
      std::size_t& left = (left_.*kind)[index];
      left -= std::min(left, count);
      if (left == 0 && !unused && is_reference(entry, index)) unused = index;
    }
    return unused;
  }

  /// Is the number a reference of this entry, not just a number somewhere in its extras?
  static bool is_reference(const Json& entry, std::size_t index) {
    for (const char* key : {"source", "bufferView"}) {
      const Json* value = at(entry, {key});
      if (value != nullptr && *value == index) return true;
    }
    const Json* extensions = at(entry, {"extensions"});
    if (extensions == nullptr || !extensions->is_object()) return false;
    for (const auto& item : extensions->items()) {
      const Json* image = is_image_extension(item.key()) ? at(item.value(), {"source"}) : nullptr;
      if (image != nullptr && *image == index) return true;
    }
    return false;
  }

  const Json& document_;
  const ModelRequest& request_;
  References left_;
  std::set<std::size_t> taken_;
  /// How many entries there will be; what is beyond the document's own is new.
  std::size_t material_count_, texture_count_, image_count_;
  ModelSlots slots_;
};

// No component of an accessor is larger than 4 bytes; extensions may want more.
constexpr std::uint64_t kAlignment = 16;

/// The byte ranges of the views of one buffer, to ask whether one meets any.
class Ranges {
 public:
  void add(std::uint64_t begin, std::uint64_t size) {
    if (size > 0) ranges_.emplace_back(begin, begin + size);
  }
  void close() {
    std::sort(ranges_.begin(), ranges_.end());
    // The largest end so far, instead of each one's own: then one look at the range before answers
    // for all that begin earlier.
    std::uint64_t end = 0;
    for (auto& range : ranges_) range.second = end = std::max(end, range.second);
  }
  bool meets(std::uint64_t begin, std::uint64_t end) const {
    const auto after =
        std::lower_bound(ranges_.begin(), ranges_.end(), std::pair(end, std::uint64_t{0}));
    return after != ranges_.begin() && (after - 1)->second > begin;
  }

 private:
  std::vector<std::pair<std::uint64_t, std::uint64_t>> ranges_;
};

}  // namespace

ModelSlots find_slots(const nlohmann::json& document, const ModelRequest& request) {
  return SlotFinder(document, request).find();
}

void ModelBuffer::append(const ModelPiece& piece) {
  if (piece.size_bytes == 0) return;
  pieces.push_back(piece);
  size_bytes += piece.size_bytes;
}

void ModelBuffer::align(std::uint64_t alignment) {
  append({nullptr, nullptr, 0, (alignment - size_bytes % alignment) % alignment});
}

ModelBuffers::ModelBuffers(const GltfFile& target, const ModelSlots& slots,
                           const std::string& output)
    : target_(target), origins_(target.buffers().size()) {
  const bool is_glb = is_glb_path(output);
  const auto is_data_uri = [&](std::size_t b) { return target.buffers()[b].bytes != nullptr; };
  const auto has_data = [&](std::size_t b) {
    const GltfBuffer& buffer = target.buffers()[b];
    if (buffer.problem.empty()) return true;
    const nlohmann::json& entry = target.document().at("buffers").at(b);
    // A buffer that has no data anywhere, as some extensions have it, is kept as it is. One whose
    // data should be there and are not cannot be copied.
    if (!entry.contains("uri") && buffer.bytes == nullptr && buffer.file == nullptr) return false;
    refuse(target.path(),
           "buffer {} {}, so a copy would be incomplete; restore the missing data or export the "
           "model again",
           b, buffer.problem);
  };
  find_holes(slots);
  // The BIN chunk has to be buffer 0; it takes over the entry of the first buffer that has data.
  if (is_glb) buffers_.emplace_back().is_new = true;
  for (std::size_t b = 0; b < origins_.size(); ++b) {
    if (!has_data(b) || (!is_glb && is_data_uri(b))) {
      add_kept(b);
      continue;
    }
    if (!is_glb) {
      const std::filesystem::path stem = std::filesystem::path(output).replace_extension();
      buffers_.emplace_back().origin = b;
      buffers_.back().path = stem.string() + (b == 0 ? ".bin" : fmt::format(".{}.bin", b));
    } else if (buffers_.front().is_new) {
      buffers_.front().is_new = false;
      buffers_.front().origin = b;
    }
    add_pieces(b, is_glb ? buffers_.front() : buffers_.back());
  }
}

/// Which bytes of the freed views are nobody's.
void ModelBuffers::find_holes(const ModelSlots& slots) {
  const auto views = target_.document().find("bufferViews");
  if (views == target_.document().end()) return;
  std::vector<Ranges> live(origins_.size());
  for (std::size_t v = 0; v < views->size(); ++v) {
    const nlohmann::json& view = (*views)[v];
    if (view.contains("extensions")) return;  // who knows what else it reads
    if (std::binary_search(slots.free_views.begin(), slots.free_views.end(), v)) continue;
    live[view.at("buffer").get<std::size_t>()].add(view.value("byteOffset", std::uint64_t{0}),
                                                   view.at("byteLength").get<std::uint64_t>());
  }
  for (Ranges& ranges : live) ranges.close();
  for (const std::size_t v : slots.free_views) {
    const nlohmann::json& view = views->at(v);
    const auto buffer = view.at("buffer").get<std::size_t>();
    const std::uint64_t begin = view.value("byteOffset", std::uint64_t{0});
    const auto size = view.at("byteLength").get<std::uint64_t>();
    // Fewer than 16 bytes stay: they would move what is behind them out of its alignment. A view
    // that loses its bytes keeps its entry, with one byte at the beginning of the buffer.
    const std::uint64_t gone = size / kAlignment * kAlignment;
    if (gone == 0 || live[buffer].meets(begin, begin + size)) continue;
    emptied_[v] = true;
    origins_[buffer].holes.push_back({begin, gone});
  }
  for (Origin& origin : origins_) {
    auto& holes = origin.holes;
    std::sort(holes.begin(), holes.end(),
              [](const Hole& a, const Hole& b) { return a.begin < b.begin; });
    // Freed views may overlap: each leaves out what those before it have not.
    std::uint64_t end = 0;
    for (Hole& hole : holes) {
      const std::uint64_t skip = hole.begin < end ? end - hole.begin : 0;
      // In steps of 16 again, or what is behind would lose its alignment.
      const std::uint64_t stepped = (skip + kAlignment - 1) / kAlignment * kAlignment;
      const std::uint64_t used = std::min(stepped, hole.size);
      hole = {hole.begin + used, hole.size - used};
      end = std::max(end, hole.begin + hole.size);
    }
  }
}

void ModelBuffers::add_kept(std::size_t index) {
  origins_[index].holes.clear();
  origins_[index].buffer = buffers_.size();
  ModelBuffer& kept = buffers_.emplace_back();
  kept.origin = index;
  kept.is_kept = true;
  kept.size_bytes = target_.buffers()[index].size_bytes;
}

// The buffer without its holes. In a .glb it is put behind the others, aligned, and `base` says
// where it has gone; views find their place through moved().
void ModelBuffers::add_pieces(std::size_t index, ModelBuffer& to) {
  const GltfBuffer& from = target_.buffers()[index];
  Origin& origin = origins_[index];
  if (!from.path.empty()) inputs_.push_back(from.path);
  to.align(kAlignment);
  origin.buffer = static_cast<std::size_t>(&to - buffers_.data());
  origin.base = to.size_bytes;
  std::uint64_t copied = 0;
  const auto copy_to = [&](std::uint64_t end) {
    to.append({from.file, from.bytes, from.offset_bytes + copied, end - copied});
  };
  for (const Hole& hole : origin.holes) {
    copy_to(hole.begin);
    copied = hole.begin + hole.size;
  }
  copy_to(from.size_bytes);
  // A buffer of no bytes is not allowed.
  if (to.size_bytes == 0) to.append({nullptr, nullptr, 0, kAlignment});
}

ViewPlace ModelBuffers::moved(std::size_t buffer, std::uint64_t offset, std::uint64_t size) const {
  const Origin& origin = origins_.at(buffer);
  std::uint64_t gone = 0;
  for (const Hole& hole : origin.holes) {
    // An offset may lie inside a hole only for the view that was freed, which view() has answered
    // before.
    if (hole.begin >= offset) break;
    gone += std::min(hole.size, offset - hole.begin);
  }
  return {origin.buffer, origin.base + offset - gone, size};
}

ViewPlace ModelBuffers::view(std::size_t index) const {
  const nlohmann::json& view = target_.document().at("bufferViews").at(index);
  const auto buffer = view.at("buffer").get<std::size_t>();
  const std::uint64_t offset = view.value("byteOffset", std::uint64_t{0});
  const auto size = view.at("byteLength").get<std::uint64_t>();
  const bool kept = buffers_[origins_[buffer].buffer].is_kept;
  // A view that lost its bytes still has to be valid: one byte, at the beginning.
  if (!kept && emptied_.contains(index)) return {origins_[buffer].buffer, 0, 1};
  return moved(buffer, offset, size);
}

ViewPlace ModelBuffers::append(const ModelPiece& piece) {
  ModelBuffer& bin = buffers_.front();
  bin.align(4);
  const ViewPlace place{0, bin.size_bytes, piece.size_bytes};
  bin.append(piece);
  return place;
}

}  // namespace pounce::io
