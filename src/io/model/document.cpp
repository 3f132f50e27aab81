// SPDX-License-Identifier: Apache-2.0
#include "io/model/document.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <set>

#include "io/files/job_mark.h"
#include "io/gltf/validate.h"
#include "io/json/edit.h"
#include "io/model/material.h"

namespace pounce::io {
namespace {

using Json = nlohmann::json;

// For primitives without a material. Without one they are metal, by glTF's defaults; what is
// painted on them shall be seen.
constexpr std::string_view kNewMaterial =
    "{\"name\":\"default\",\"pbrMetallicRoughness\":{\"metallicFactor\":0}}";

/// An array of the document that gets new entries: elements beyond its end are appended.
struct ArrayEdit {
  std::map<std::size_t, std::string> entries;

  std::string apply(std::string_view array) {
    if (array.empty()) array = "[]";
    const std::size_t own = json_elements(array).size();
    std::map<std::size_t, std::string> changed;
    std::vector<std::string> appended;
    for (auto& [index, text] : entries) {
      if (index < own) {
        changed.emplace(index, std::move(text));
      } else {
        appended.push_back(std::move(text));  // in order, without gaps
      }
    }
    return edit_json_array(array, changed, appended);
  }
};

class DocumentEditor {
 public:
  DocumentEditor(std::string_view text, const Json& document, const DocumentParts& parts)
      : text_(text),
        document_(document),
        parts_(parts),
        is_glb_(is_glb_path(parts.request.output)) {
    for (const JsonMember& member : json_members(text)) arrays_[member.key] = member.value;
  }

  std::string edit() {
    edit_views();  // images of a .glb need to know where theirs are
    edit_images();
    edit_materials();
    edit_meshes();
    edit_buffers();
    edit_extensions();
    edit_asset();
    return edit_json_object(text_, changes_);
  }

 private:
  std::string_view array(const char* key) const {
    const auto it = arrays_.find(key);
    return it == arrays_.end() ? std::string_view() : it->second;
  }
  void apply(const char* key, ArrayEdit& edit) {
    if (!edit.entries.empty()) changes_[key] = edit.apply(array(key));
  }

  static std::string view_text(std::string_view old, const ViewPlace& place) {
    return edit_json_object(old, {{"buffer", fmt::to_string(place.buffer)},
                                  {"byteOffset", fmt::to_string(place.offset_bytes)},
                                  {"byteLength", fmt::to_string(place.size_bytes)}});
  }

  void edit_views() {
    ArrayEdit edit;
    const auto old = json_elements(array("bufferViews").empty() ? "[]" : array("bufferViews"));
    for (std::size_t v = 0; v < old.size(); ++v) {
      const Json& view = document_.at("bufferViews").at(v);
      const ViewPlace place = parts_.buffers.view(v);
      const bool same = place.buffer == view.at("buffer").get<std::size_t>() &&
                        place.offset_bytes == view.value("byteOffset", std::uint64_t{0}) &&
                        place.size_bytes == view.at("byteLength").get<std::uint64_t>();
      std::string text = same ? std::string() : view_text(old[v], place);
      move_extensions(view, text.empty() ? old[v] : std::string_view(text), text);
      if (!text.empty()) edit.entries[v] = std::move(text);
    }
    std::size_t next = old.size();
    for (std::size_t k = 0; k < parts_.image_places.size(); ++k) {
      const auto reused = parts_.slots.textures[k].view;
      image_views_.push_back(reused ? *reused : next++);
      edit.entries[image_views_.back()] = view_text("{}", parts_.image_places[k]);
    }
    if (is_glb_) {
      for (const auto& [image, moved] : parts_.moved_images) {
        edit.entries[next] = view_text("{}", moved.place);
        moved_views_[image] = next++;
      }
    }
    apply("bufferViews", edit);
  }

  /// Extensions of a view that name a buffer (compressed geometry beside the plain one).
  void move_extensions(const Json& view, std::string_view now, std::string& text) const {
    const auto extensions = view.find("extensions");
    if (extensions == view.end() || !extensions->is_object()) return;
    JsonChanges changes;
    const std::string_view old = json_member(now, "extensions");
    for (const auto& item : extensions->items()) {
      if (!item.value().is_object() || !item.value().contains("buffer")) continue;
      const Json& buffer = item.value().at("buffer");
      if (!buffer.is_number_unsigned() ||
          buffer.get<std::size_t>() >= document_.at("buffers").size())
        continue;
      const Json offset = item.value().value("byteOffset", Json(0U));
      if (!offset.is_number_unsigned()) continue;
      const ViewPlace place =
          parts_.buffers.moved(buffer.get<std::size_t>(), offset.get<std::uint64_t>(), 0);
      changes[item.key()] = edit_json_object(json_member(old, item.key()),
                                             {{"buffer", fmt::to_string(place.buffer)},
                                              {"byteOffset", fmt::to_string(place.offset_bytes)}});
    }
    if (!changes.empty()) {
      text = edit_json_object(now, {{"extensions", edit_json_object(old, changes)}});
    }
  }

  void edit_images() {
    ArrayEdit images, textures;
    for (std::size_t k = 0; k < parts_.request.textures.size(); ++k) {
      const ModelSlots::Texture& slot = parts_.slots.textures[k];
      const ModelTexture& texture = parts_.request.textures[k];
      JsonChanges image{{"name", json_quoted(material_name(texture.material) + "." +
                                             channel_name(texture.channel))},
                        {"mimeType", "\"image/png\""}};
      if (is_glb_) {
        image["bufferView"] = fmt::to_string(image_views_[k]);
      } else {
        image["uri"] = json_quoted(parts_.image_uris[k]);
      }
      images.entries[slot.image] = edit_json_object("{}", image);
      // Without a sampler it repeats, which is how UVs outside of it were drawn.
      textures.entries[slot.texture] = fmt::format("{{\"source\":{}}}", slot.image);
    }
    const auto old = json_elements(array("images").empty() ? "[]" : array("images"));
    for (const auto& [index, moved] : parts_.moved_images) {
      JsonChanges changes{{"uri", json_quoted(moved.uri)}};
      if (is_glb_) {
        changes = {{"uri", std::nullopt},
                   {"mimeType", json_quoted(moved.mime_type)},
                   {"bufferView", fmt::to_string(moved_views_.at(index))}};
      }
      images.entries[index] = edit_json_object(old.at(index), changes);
    }
    apply("images", images);
    apply("textures", textures);
  }

  std::string material_name(std::size_t index) const {
    const auto materials = document_.find("materials");
    if (materials == document_.end() || index >= materials->size()) return "default";
    const std::string name = (*materials)[index].value("name", std::string());
    return name.empty() ? fmt::format("material {}", index) : name;
  }

  void edit_materials() {
    std::map<std::size_t, std::vector<MaterialTexture>> by_material;
    for (std::size_t k = 0; k < parts_.request.textures.size(); ++k) {
      const ModelTexture& texture = parts_.request.textures[k];
      by_material[texture.material].push_back(
          {texture.channel, parts_.slots.textures[k].texture, texture.factor, texture.alpha});
    }
    const auto old = json_elements(array("materials").empty() ? "[]" : array("materials"));
    ArrayEdit edit;
    for (const MaterialCopy& copy : parts_.slots.copies) {
      edit.entries[copy.index] = std::string(old.at(copy.material));
    }
    for (const auto& [index, textures] : by_material) {
      const std::string_view before = index < old.size() ? old[index] : kNewMaterial;
      edit.entries[index] = with_textures(before, textures, parts_.request.uv_set);
    }
    apply("materials", edit);
  }

  void edit_meshes() {
    std::map<std::size_t, std::map<std::size_t, std::size_t>> by_mesh;
    for (const PrimitiveMaterial& p : parts_.slots.primitives) {
      by_mesh[p.mesh][p.primitive] = p.material;
    }
    if (by_mesh.empty()) return;
    const auto meshes = json_elements(array("meshes"));
    ArrayEdit edit;
    for (const auto& [mesh, primitives] : by_mesh) {
      const std::string_view list = json_member(meshes.at(mesh), "primitives");
      const auto old = json_elements(list);
      std::map<std::size_t, std::string> changed;
      for (const auto& [primitive, material] : primitives) {
        changed[primitive] =
            edit_json_object(old.at(primitive), {{"material", fmt::to_string(material)}});
      }
      edit.entries[mesh] =
          edit_json_object(meshes[mesh], {{"primitives", edit_json_array(list, changed, {})}});
    }
    apply("meshes", edit);
  }

  void edit_buffers() {
    const auto old = json_elements(array("buffers").empty() ? "[]" : array("buffers"));
    const std::vector<ModelBuffer>& buffers = parts_.buffers.buffers();
    std::string list;
    bool same = buffers.size() == old.size();
    for (std::size_t b = 0; b < buffers.size(); ++b) {
      const ModelBuffer& buffer = buffers[b];
      std::string text(buffer.is_new ? "{}" : old.at(buffer.origin));
      if (!buffer.is_kept) {
        const std::string& uri = parts_.buffer_uris[b];
        text = edit_json_object(
            text, {{"uri", uri.empty() ? std::nullopt : std::optional(json_quoted(uri))},
                   {"byteLength", fmt::to_string(buffer.size_bytes)}});
      }
      same = same && buffer.is_kept;
      list += (b == 0 ? "" : ",") + text;
    }
    if (!same) changes_["buffers"] = "[" + list + "]";
  }

  /// Extras that are no object stay as they are, and the model without its job.
  void edit_asset() {
    const std::string_view asset = array("asset");
    std::string_view extras = json_member(asset, "extras");
    if (extras.empty()) extras = "{}";
    if (parts_.request.job.empty() || !extras.starts_with('{')) return;
    const std::string with_job =
        edit_json_object(extras, {{"pounce", job_extras(parts_.request.job)}});
    changes_["asset"] = edit_json_object(asset, {{"extras", with_job}});
  }

  /// Names of extensions that the entries of an array have, as they are now.
  std::set<std::string> extensions_of(const char* key) const {
    const auto changed = changes_.find(key);
    const std::string_view list = changed == changes_.end() ? array(key) : *changed->second;
    std::set<std::string> names;
    for (const std::string_view entry : json_elements(list.empty() ? "[]" : list)) {
      const std::string_view extensions = json_member(entry, "extensions");
      if (!extensions.starts_with('{')) continue;
      for (const JsonMember& member : json_members(extensions)) names.insert(member.key);
    }
    return names;
  }

  std::vector<std::string> names_in(const char* key) const {
    const auto list = document_.find(key);
    return list == document_.end() ? std::vector<std::string>()
                                   : list->get<std::vector<std::string>>();
  }

  /// Names of extensions that came or went with the materials and textures.
  void edit_extensions() {
    if (!changes_.contains("materials")) return;
    constexpr const char* kGlossy = "KHR_materials_pbrSpecularGlossiness";
    constexpr const char* kStrength = "KHR_materials_emissive_strength";
    const std::set<std::string> of_materials = extensions_of("materials");
    const std::set<std::string> of_textures = extensions_of("textures");
    const std::vector<std::string> required = names_in("extensionsRequired");
    const auto is_gone = [&](const std::string& name) {
      if (name == kGlossy || name == kStrength) return !of_materials.contains(name);
      // Required means that it stood for a plain image: without a texture none of its is left.
      return is_image_extension(name) && !of_textures.contains(name) &&
             std::find(required.begin(), required.end(), name) != required.end();
    };
    for (const char* key : {"extensionsUsed", "extensionsRequired"}) {
      const std::vector<std::string> before = names_in(key);
      std::vector<std::string> kept;
      for (const std::string& name : before) {
        if (!is_gone(name)) kept.push_back(json_quoted(name));
      }
      const bool missing = std::find(before.begin(), before.end(), kStrength) == before.end();
      if (std::string_view(key) == "extensionsUsed" && missing &&
          of_materials.contains(kStrength)) {
        kept.push_back(json_quoted(kStrength));
      }
      if (kept.size() == before.size()) continue;
      changes_[key] =
          kept.empty() ? std::nullopt : std::optional(fmt::format("[{}]", fmt::join(kept, ",")));
    }
  }

  std::string_view text_;
  const Json& document_;
  const DocumentParts& parts_;
  bool is_glb_;
  std::map<std::string, std::string_view> arrays_;
  std::vector<std::size_t> image_views_;            ///< by ModelRequest::textures
  std::map<std::size_t, std::size_t> moved_views_;  ///< by image
  JsonChanges changes_;
};

}  // namespace

std::string edit_model_json(std::string_view text, const nlohmann::json& document,
                            const DocumentParts& parts) {
  return DocumentEditor(text, document, parts).edit();
}

}  // namespace pounce::io
