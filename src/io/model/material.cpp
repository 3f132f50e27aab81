// SPDX-License-Identifier: Apache-2.0
#include "io/model/material.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "io/json/edit.h"

namespace pounce::io {
namespace {

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
    switch (texture.channel) {
      case Channel::base_color:
        write_base_color(texture);
        break;
      case Channel::metallic_roughness:
        write_metallic_roughness(texture);
        break;
      case Channel::occlusion:
        write_occlusion(texture);
        break;
      case Channel::emissive:
        write_emissive(texture);
        break;
      case Channel::normal:
        write_normal(texture);
        break;
      case Channel::confidence:  // no material has these
      case Channel::distance:
      case Channel::height:
      case Channel::position:
      case Channel::vertex_color:
      case Channel::other:
        break;
    }
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

}  // namespace

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

}  // namespace pounce::io
