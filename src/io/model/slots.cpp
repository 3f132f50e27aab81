// SPDX-License-Identifier: Apache-2.0
//
// A texture that is replaced leaves a hole: its entry, its image, its bytes. Entries cannot be
// taken out of their arrays, since every index behind them would change, and an extension that
// nobody here knows may hold such an index. So a new texture takes the place of the one it
// replaces, if that one has no other user, and else goes to the end of the array; then the same for
// the image, and for the buffer view.
#include "io/model/slots.h"

#include <algorithm>
#include <map>
#include <set>
#include <string_view>

#include "io/gltf/validate.h"

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
const Json* at(const Json& from, std::initializer_list<const char*> keys) {
  const Json* value = &from;
  for (const char* key : keys) {
    if (!value->is_object()) return nullptr;
    const auto it = value->find(key);
    if (it == value->end()) return nullptr;
    value = &*it;
  }
  return value;
}

/// The textures that a material shows in a channel and that a new one stands for.
std::vector<std::size_t> replaced_textures(const Json& material, Channel channel) {
  constexpr const char* kGlossy = "KHR_materials_pbrSpecularGlossiness";
  const Json* infos[2] = {nullptr, nullptr};
  switch (channel) {
    case Channel::base_color:
      infos[0] = at(material, {"pbrMetallicRoughness", "baseColorTexture", "index"});
      infos[1] = at(material, {"extensions", kGlossy, "diffuseTexture", "index"});
      break;
    case Channel::metallic_roughness:
      infos[0] = at(material, {"pbrMetallicRoughness", "metallicRoughnessTexture", "index"});
      infos[1] = at(material, {"extensions", kGlossy, "specularGlossinessTexture", "index"});
      break;
    case Channel::occlusion:
      infos[0] = at(material, {"occlusionTexture", "index"});
      break;
    case Channel::emissive:
      infos[0] = at(material, {"emissiveTexture", "index"});
      break;
    case Channel::normal:
      infos[0] = at(material, {"normalTexture", "index"});
      break;
    case Channel::confidence:  // no material has these
    case Channel::distance:
    case Channel::height:
    case Channel::position:
    case Channel::vertex_color:
    case Channel::other:
      break;
  }
  std::vector<std::size_t> textures;
  for (const Json* info : infos) {
    if (info != nullptr && info->is_number_unsigned()) {
      textures.push_back(info->get<std::size_t>());
    }
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
    left_.count(document_, false);
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
  void assign_materials() {
    std::set<std::size_t> written;
    for (const ModelTexture& texture : request_.textures) written.insert(texture.material);
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
  ModelSlots::Texture take(const std::vector<std::size_t>& replaced) {
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

}  // namespace

ModelSlots find_slots(const nlohmann::json& document, const ModelRequest& request) {
  return SlotFinder(document, request).find();
}

}  // namespace pounce::io
