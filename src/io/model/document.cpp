// SPDX-License-Identifier: Apache-2.0
//
// The JSON of a model with new textures, edited as text: only the values that change are touched,
// so all that nobody here knows, and every number as it is spelled, stays (io/json/untrusted.h).
//
// A material takes a new texture in five places, each with a factor beside it and maybe an
// extension that overrides it: MaterialEditor. Around materials DocumentEditor keeps the rest
// consistent: views and buffers at their new places, images and textures in the slots that layout.h
// chose, copies of materials for primitives that cannot show the new ones, and the two lists of
// extensions.
//
// Later steps ask for what earlier ones changed (changes_), so their order is fixed in edit().
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <optional>
#include <set>

#include "io/files/finished_output.h"
#include "io/gltf/validate.h"
#include "io/json/untrusted.h"
#include "io/model/layout.h"

namespace pounce::io {
namespace {

/// What a material shows in one channel from now on.
struct MaterialTexture {
  Channel channel = Channel::base_color;
  std::size_t texture = 0;                  ///< index into "textures"
  std::array<float, 4> factor{1, 1, 1, 1};  ///< as ModelTexture::factor
  ModelAlpha alpha = ModelAlpha::as_it_is;
};

constexpr const char* kGlossy = "KHR_materials_pbrSpecularGlossiness";
constexpr const char* kStrength = "KHR_materials_emissive_strength";
constexpr const char* kTransform = "KHR_texture_transform";

/// A member that is an object; an empty one where it is missing.
std::string_view object_in(std::string_view parent, const char* key) {
  const std::string_view found = json_member(parent, key);
  return found.starts_with('{') ? found : std::string_view("{}");
}

/// A value that is left out where it is the default.
std::optional<std::string> unless(bool is_default, const std::string& text) {
  return is_default ? std::nullopt : std::optional(text);
}

/// `object` with one of its extensions set (nothing = removed), and without the list when it is
/// empty.
// An empty list of extensions is valid, but the file had none before the first texture was written:
// what is removed leaves no trace.
std::string with_extension(std::string_view object, const char* name,
                           const std::optional<std::string>& value) {
  const std::string extensions = edit_json_object(object_in(object, "extensions"), {{name, value}});
  const bool empty = json_members(extensions).empty();
  return edit_json_object(object, {{"extensions", unless(empty, extensions)}});
}

/// A textureInfo for the new texture; what else it says (extras) stays.
std::string texture_info(std::string_view old, std::size_t texture, std::uint32_t uv_set) {
  const std::string info =
      edit_json_object(old, {{"index", fmt::to_string(texture)},
                             {"texCoord", unless(uv_set == 0, fmt::to_string(uv_set))}});
  return with_extension(info, kTransform, std::nullopt);
}

std::string number_array(const std::array<float, 4>& values, std::size_t count) {
  return fmt::format("[{}]", fmt::join(values.begin(), values.begin() + count, ","));
}

bool all_are(const std::array<float, 4>& values, std::size_t count, float wanted) {
  return std::all_of(values.begin(), values.begin() + count,
                     [&](float value) { return value == wanted; });
}

class MaterialEditor {
 public:
  MaterialEditor(std::string_view material, std::uint32_t uv_set)
      : text_(material), uv_set_(uv_set) {}

  void write(const MaterialTexture& texture) {
    const Channel channel = texture.channel;  // no other has a place in a material
    if (channel == Channel::base_color) write_base_color(texture);
    if (channel == Channel::metallic_roughness) write_metallic_roughness(texture);
    if (channel == Channel::occlusion) write_occlusion(texture);
    if (channel == Channel::emissive) write_emissive(texture);
    if (channel == Channel::normal) write_normal(texture);
  }
  std::string text() { return std::move(text_); }

 private:
  void set(const JsonChanges& changes) { text_ = edit_json_object(text_, changes); }
  void set_pbr(const JsonChanges& changes) {
    set({{"pbrMetallicRoughness",
          edit_json_object(object_in(text_, "pbrMetallicRoughness"), changes)}});
  }
  bool has_extension(const char* name) const {
    return !json_member(object_in(text_, "extensions"), name).empty();
  }

  void write_base_color(const MaterialTexture& texture) {
    const std::string_view pbr = object_in(text_, "pbrMetallicRoughness");
    const auto factor = unless(all_are(texture.factor, 4, 1), number_array(texture.factor, 4));
    set_pbr({{"baseColorTexture",
              texture_info(object_in(pbr, "baseColorTexture"), texture.texture, uv_set_)},
             {"baseColorFactor", factor}});
    show_alpha(texture.alpha);
    if (!has_extension(kGlossy)) return;
    const std::string_view glossy = object_in(object_in(text_, "extensions"), kGlossy);
    const std::string diffuse =
        texture_info(object_in(glossy, "diffuseTexture"), texture.texture, uv_set_);
    text_ = with_extension(
        text_, kGlossy,
        edit_json_object(glossy, {{"diffuseTexture", diffuse}, {"diffuseFactor", factor}}));
  }

  /// The default cutoff of a mask is a half.
  // OPAQUE means that viewers ignore the alpha that was just painted. Only that mode is changed:
  // what a material says itself about its transparency is left alone.
  void show_alpha(ModelAlpha alpha) {
    const std::string_view mode = json_member(text_, "alphaMode");
    if (alpha == ModelAlpha::as_it_is || (!mode.empty() && mode != R"("OPAQUE")")) return;
    set({{"alphaMode", alpha == ModelAlpha::mask ? R"("MASK")" : R"("BLEND")"}});
  }

  void write_metallic_roughness(const MaterialTexture& texture) {
    const std::string_view pbr = object_in(text_, "pbrMetallicRoughness");
    const float roughness = texture.factor[1], metallic = texture.factor[2];
    set_pbr({{"metallicRoughnessTexture",
              texture_info(object_in(pbr, "metallicRoughnessTexture"), texture.texture, uv_set_)},
             {"roughnessFactor", unless(roughness == 1, fmt::to_string(roughness))},
             {"metallicFactor", unless(metallic == 1, fmt::to_string(metallic))}});
    if (!has_extension(kGlossy)) return;
    const std::string_view glossy = object_in(object_in(text_, "extensions"), kGlossy);
    const std::string_view now = object_in(text_, "pbrMetallicRoughness");
    // Without the extension viewers show the plain values: what it said of the diffuse colour must
    // not be lost with it.
    if (json_member(now, "baseColorTexture").empty() &&
        json_member(now, "baseColorFactor").empty()) {
      const auto moved = [&](const char* key) -> std::optional<std::string> {
        const std::string_view value = json_member(glossy, key);
        return unless(value.empty(), std::string(value));
      };
      const auto diffuse = moved("diffuseTexture"), factor = moved("diffuseFactor");
      set_pbr({{"baseColorTexture", diffuse}, {"baseColorFactor", factor}});
    }
    text_ = with_extension(text_, kGlossy, std::nullopt);
  }

  void write_occlusion(const MaterialTexture& texture) {
    const std::string info =
        texture_info(object_in(text_, "occlusionTexture"), texture.texture, uv_set_);
    const float strength = texture.factor[0];
    set({{"occlusionTexture",
          edit_json_object(info,
                           {{"strength", unless(strength == 1, fmt::to_string(strength))}})}});
  }

  /// What the new texture holds are the vectors themselves: no scale is left.
  void write_normal(const MaterialTexture& texture) {
    const std::string info =
        texture_info(object_in(text_, "normalTexture"), texture.texture, uv_set_);
    set({{"normalTexture", edit_json_object(info, {{"scale", std::nullopt}})}});
  }

  void write_emissive(const MaterialTexture& texture) {
    set({{"emissiveTexture",
          texture_info(object_in(text_, "emissiveTexture"), texture.texture, uv_set_)},
         {"emissiveFactor", number_array(texture.factor, 3)}});
    const float strength = texture.factor[3];
    const std::string extension = fmt::format("{{\"emissiveStrength\":{}}}", strength);
    text_ = with_extension(text_, kStrength, unless(strength == 1, extension));
  }

  std::string text_;
  std::uint32_t uv_set_;
};

/// The JSON of a glTF material with these textures, on this UV set without a texture transform; the
/// rest of it as it was.
///
/// KHR_materials_pbrSpecularGlossiness stands above the metallic-roughness values in viewers that
/// know it. With a new baseColor its diffuse texture becomes the same one, so that every viewer
/// shows it. With a new metallicRoughness, for which it has no place, it is removed; the diffuse
/// texture and factor become those of baseColor where that is not written and there was none.
std::string with_textures(std::string_view material, const std::vector<MaterialTexture>& textures,
                          std::uint32_t uv_set) {
  MaterialEditor editor(material, uv_set);
  // baseColor first: a new metallicRoughness asks whether there is one.
  for (int channel = 0; channel < kChannelCount; ++channel) {
    for (const MaterialTexture& texture : textures) {
      if (texture.channel == static_cast<Channel>(channel)) editor.write(texture);
    }
  }
  return editor.text();
}

using Json = nlohmann::json;

// For primitives without a material. Without one they are metal, by glTF's defaults; what is
// painted on them shall be seen.
constexpr std::string_view kNewMaterial =
    "{\"name\":\"default\",\"pbrMetallicRoughness\":{\"metallicFactor\":0}}";

/// An array of the document that gets new entries: elements beyond its end are appended.
struct ArrayEdit {
  std::map<std::size_t, std::string> entries;

  std::string apply(std::string_view array) {
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
  /// A member of the root; an empty array where it is missing.
  std::string_view array(const char* key) const {
    const auto it = arrays_.find(key);
    return it == arrays_.end() ? std::string_view("[]") : it->second;
  }
  void apply(const char* key, ArrayEdit& edit) {
    if (!edit.entries.empty()) changes_[key] = edit.apply(array(key));
  }

  static std::string view_text(std::string_view old, const ViewPlace& place) {
    return edit_json_object(old, {{"buffer", fmt::to_string(place.buffer)},
                                  {"byteOffset", fmt::to_string(place.offset_bytes)},
                                  {"byteLength", fmt::to_string(place.size_bytes)}});
  }

  // Those that are freed get new places (an image that took the slot, or one byte), the others what
  // ModelBuffers says; whichever comes out the same keeps its text. New ones are appended.
  void edit_views() {
    ArrayEdit edit;
    const auto old = json_elements(array("bufferViews"));
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
    const auto old = json_elements(array("images"));
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
    const auto old = json_elements(array("materials"));
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

  // Primitives that get another material: see assign_materials() in layout.cpp.
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

  // By the order in which they will be written. In a .glb all buffers are one now, so their entries
  // behind the first go; views were moved before.
  void edit_buffers() {
    const auto old = json_elements(array("buffers"));
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
    for (const std::string_view entry : json_elements(list)) {
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
