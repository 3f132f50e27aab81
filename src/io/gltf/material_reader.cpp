// SPDX-License-Identifier: Apache-2.0
//
// Materials of a glTF: factors and textures of the five channels that have a place in the
// metallic-roughness model, and where the images are. No image is opened.
//
// A texture leads to its image by way of a sampler and maybe an extension (WebP, KTX2, ...). What
// cannot be read is no reason to refuse a model: its shape and its other textures are good. So an
// image that is missing, on the web or in a format that is not read becomes an ImageRef with a
// `problem`, and whoever needs it in the end says so by name. Textures of extensions for which
// there is no channel are listed, so that a user hears of what is not transferred.
//
// Indices are trusted here: check_gltf() has seen every one of them, those in extensions that are
// followed included.
//
// Colours of factors are linear in glTF, textures coded: they are kept apart here, and meet when a
// texel is stored (shading/texel_input.cpp).
#include "io/gltf/material_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string_view>

#include "io/read_mesh.h"

namespace pounce::io {
namespace {

using mesh::ImageRef;
using mesh::TextureBinding;

/// WebP is read like any other image, the others are not.
constexpr std::string_view kWebp = "EXT_texture_webp";
constexpr std::string_view kKtx2 = "KHR_texture_basisu";
const char* const kOtherSources[] = {kWebp.data(),        kKtx2.data(),
                                     "EXT_texture_avif",  "MSFT_texture_dds",
                                     "EXT_texture_video", "GOOGLE_texture_basis"};

/// "head.glb image 3 "skin"": what messages call an image that has no file of its own.
std::string image_label(const GltfFile& file, std::size_t index, const nlohmann::json& image) {
  const std::string name = image.value("name", std::string());
  return fmt::format("{} image {}{}", std::filesystem::path(file.path()).filename().string(), index,
                     name.empty() ? "" : " \"" + name + "\"");
}

/// Only a reference: image bytes stay where they are until a decoder asks for them, and data URIs
/// are shared by all images in the same buffer.
void refer_to_view(const GltfFile& file, std::size_t view_index, ImageRef& out) {
  const nlohmann::json& view = file.document().at("bufferViews").at(view_index);
  const GltfBuffer& buffer = file.buffers().at(view.at("buffer").get<std::size_t>());
  const std::uint64_t offset = view.value("byteOffset", std::uint64_t{0});
  const auto size = view.at("byteLength").get<std::uint64_t>();
  // A problem is kept and not thrown: perhaps no channel of the job needs this image.
  if (!buffer.problem.empty()) {
    out.problem = fmt::format("its buffer {}", buffer.problem);
  } else if (size == 0) {
    out.problem = "its buffer view is empty";
  } else if (buffer.bytes != nullptr) {
    out.bytes = buffer.bytes;  // shared: any number of images may lie in the same bytes
    out.offset_bytes = offset;
    out.size_bytes = size;
  } else {
    out.path = buffer.path;
    out.offset_bytes = buffer.offset_bytes + offset;
    out.size_bytes = size;
  }
}

ImageRef read_image_ref(const GltfFile& file, std::size_t index, const nlohmann::json& image) {
  ImageRef out;
  out.label = image_label(file, index, image);
  out.mime_type = image.value("mimeType", std::string());
  if (const auto view = image.find("bufferView"); view != image.end()) {
    refer_to_view(file, view->get<std::size_t>(), out);
    return out;
  }
  const auto uri_it = image.find("uri");
  if (uri_it == image.end()) {
    out.problem = "has neither a uri nor a buffer view";
    return out;
  }
  const auto& uri = uri_it->get_ref<const std::string&>();
  if (GltfFile::is_data_uri(uri)) {
    try {
      DataUri decoded = decode_data_uri(uri);
      if (out.mime_type.empty()) out.mime_type = decoded.mime_type;
      out.bytes = std::make_shared<const std::vector<std::byte>>(std::move(decoded.bytes));
    } catch (const std::invalid_argument& e) {
      out.problem = fmt::format("has {}", e.what());
    }
    return out;
  }
  out.path = file.resolve(uri);
  if (out.path.empty()) {
    out.problem = fmt::format("its uri \"{}\" is not a file name", uri.substr(0, 200));
  } else {
    out.label = out.path;
    std::error_code error;
    // Whatever else is wrong with it, reading says.
    if (std::filesystem::status(out.path, error).type() == std::filesystem::file_type::not_found) {
      out.problem = fmt::format("the file is missing (referenced by {})", file.path());
      out.missing = true;
    } else if (!file.may_read(out.path)) {
      out.problem = fmt::format("the file {} (referenced by {})", kOutsideProblem, file.path());
    }
  }
  return out;
}

/// Of OpenGL's numbers; a sampler that says nothing repeats.
mesh::Wrap wrap_mode(int value) {
  if (value == TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE) return mesh::Wrap::clamp;
  if (value == TINYGLTF_TEXTURE_WRAP_MIRRORED_REPEAT) return mesh::Wrap::mirror;
  return mesh::Wrap::repeat;
}

const tinygltf::Value* find(const tinygltf::ExtensionMap& extensions, const char* name) {
  const auto it = extensions.find(name);
  return it == extensions.end() || !it->second.IsObject() ? nullptr : &it->second;
}

/// A number of an extension, or element `element` of an array in it; negative = no array. tinygltf
/// keeps extensions as trees of its own kind, and check_gltf() has seen those that are asked for.
double number(const tinygltf::Value& object, const char* key, int element, double fallback) {
  if (!object.Has(key)) return fallback;
  const tinygltf::Value& value = object.Get(key);
  return element < 0 ? value.GetNumberAsDouble() : value.Get(element).GetNumberAsDouble();
}

class MaterialReader {
 public:
  MaterialReader(const tinygltf::Model& model, mesh::Mesh& mesh, MeshWarnings& warnings)
      : model_(model), mesh_(mesh), warnings_(warnings) {}

  mesh::Material read(const tinygltf::Material& in);

 private:
  template <class Info>
  void bind(mesh::Material& material, Channel channel, const Info& info);
  void note_others(mesh::Material& material, const tinygltf::Material& in);
  void note_other(mesh::Material& material, const std::string& slot, int texture);
  std::optional<std::uint32_t> image_of(const tinygltf::Texture& texture);

  const tinygltf::Model& model_;
  mesh::Mesh& mesh_;
  MeshWarnings& warnings_;
};

/// The image a texture shows: its plain source if it has one, else a WebP, else a stand-in whose
/// problem names the extension that holds it.
std::optional<std::uint32_t> MaterialReader::image_of(const tinygltf::Texture& texture) {
  // A plain source is there for readers without the extension; glTF allows PNG and JPEG for it.
  if (texture.source >= 0) return static_cast<std::uint32_t>(texture.source);
  for (const char* name : kOtherSources) {
    const tinygltf::Value* extension = find(texture.extensions, name);
    if (extension == nullptr || !extension->Has("source")) continue;
    const int source = extension->Get("source").GetNumberAsInt();
    // Of several, the first in our list: they are different forms of one image.
    ImageRef& image = mesh_.images.at(static_cast<std::size_t>(source));
    if (name == kWebp) return static_cast<std::uint32_t>(source);
    image.problem = fmt::format(
        "uses the extension {}, which pounce does not support; convert it to PNG{}", name,
        name == kKtx2 ? " (docs/limits.md shows how, under \"KTX2 textures\")" : "");
    return static_cast<std::uint32_t>(source);
  }
  return std::nullopt;
}

template <class Info>
void MaterialReader::bind(mesh::Material& material, Channel channel, const Info& info) {
  if (info.index < 0) return;
  const tinygltf::Texture& texture = model_.textures.at(static_cast<std::size_t>(info.index));
  const std::optional<std::uint32_t> image = image_of(texture);
  if (!image) {
    warnings_.add("material \"{}\": texture {} of {} has no image", material.name, info.index,
                  channel_name(channel));
    return;
  }
  TextureBinding binding;
  binding.image = *image;
  binding.uv_set = static_cast<std::uint32_t>(info.texCoord);
  if (const auto* t = find(info.extensions, "KHR_texture_transform"); t != nullptr) {
    // What is left out has the value that does nothing, as the extension says.
    binding.transform = gltf_uv_transform(number(*t, "offset", 0, 0), number(*t, "offset", 1, 0),
                                          number(*t, "rotation", -1, 0), number(*t, "scale", 0, 1),
                                          number(*t, "scale", 1, 1));
    if (t->Has("texCoord")) {
      binding.uv_set = static_cast<std::uint32_t>(t->Get("texCoord").GetNumberAsInt());
    }
  }
  // Filters are not read: a transfer has its own (--filter).
  if (texture.sampler >= 0) {
    const auto& sampler = model_.samplers.at(static_cast<std::size_t>(texture.sampler));
    binding.wrap_u = wrap_mode(sampler.wrapS);
    binding.wrap_v = wrap_mode(sampler.wrapT);
  }
  material.textures[static_cast<std::size_t>(channel)] = binding;
}

/// Textures that no channel takes: those of extensions.
void MaterialReader::note_others(mesh::Material& material, const tinygltf::Material& in) {
  for (const auto& [extension, value] : in.extensions) {
    if (!value.IsObject()) continue;
    for (const std::string& key : value.Keys()) {
      const tinygltf::Value& info = value.Get(key);
      if (info.IsObject() && info.Has("index") && info.Get("index").IsInt())
        note_other(material, extension + "." + key, info.Get("index").GetNumberAsInt());
    }
  }
}

void MaterialReader::note_other(mesh::Material& material, const std::string& slot, int texture) {
  // Extensions that nobody here knows were not checked, so their numbers may be anything.
  if (texture < 0 || static_cast<std::size_t>(texture) >= model_.textures.size()) return;
  const auto image = image_of(model_.textures[static_cast<std::size_t>(texture)]);
  if (image) material.other_textures.push_back({slot, *image});
}

mesh::Material MaterialReader::read(const tinygltf::Material& in) {
  mesh::Material out;
  out.name = in.name;
  out.double_sided = in.doubleSided;
  out.is_opaque = in.alphaMode != "MASK" && in.alphaMode != "BLEND";
  // A file may say any number; above 1 it hides all, however much.
  if (in.alphaMode == "MASK")
    out.alpha_cutoff = std::clamp(static_cast<float>(in.alphaCutoff), 0.0F, 2.0F);
  out.is_pbr = true;
  // What a file leaves out, tinygltf leaves empty: the default of glTF counts.
  const auto factor = [](const std::vector<double>& from, std::size_t i, float fallback) {
    return i < from.size() ? static_cast<float>(from[i]) : fallback;
  };
  const auto& pbr = in.pbrMetallicRoughness;
  auto& base = out.factors[static_cast<std::size_t>(Channel::base_color)];
  for (std::size_t i = 0; i < 4; ++i) base[i] = factor(pbr.baseColorFactor, i, 1);
  // In the order of the texture's channels: roughness is green, metallic blue.
  out.factors[static_cast<std::size_t>(Channel::metallic_roughness)] = {
      0, static_cast<float>(pbr.roughnessFactor), static_cast<float>(pbr.metallicFactor), 1};
  auto& emissive = out.factors[static_cast<std::size_t>(Channel::emissive)];
  for (std::size_t i = 0; i < 3; ++i) emissive[i] = factor(in.emissiveFactor, i, 0);
  out.occlusion_strength = static_cast<float>(in.occlusionTexture.strength);
  if (const auto* strength = find(in.extensions, "KHR_materials_emissive_strength")) {
    // The only factor of an extension: check_gltf() knows nothing of it.
    const double value = number(*strength, "emissiveStrength", -1, 1);
    if (std::isfinite(value) && value >= 0) out.emissive_strength = static_cast<float>(value);
  }

  bind(out, Channel::base_color, pbr.baseColorTexture);
  bind(out, Channel::metallic_roughness, pbr.metallicRoughnessTexture);
  bind(out, Channel::occlusion, in.occlusionTexture);
  bind(out, Channel::emissive, in.emissiveTexture);
  bind(out, Channel::normal, in.normalTexture);
  const auto scale = static_cast<float>(in.normalTexture.scale);
  out.factors[static_cast<std::size_t>(Channel::normal)] = {scale, scale, 1, 1};
  note_others(out, in);
  if (in.extensions.contains("KHR_materials_pbrSpecularGlossiness") &&
      pbr.baseColorTexture.index < 0) {
    warnings_.add(
        "material \"{}\" stores its colour in KHR_materials_pbrSpecularGlossiness, which pounce "
        "does not support; it has no baseColor or metallicRoughness texture",
        out.name);
  }
  return out;
}

}  // namespace

mesh::UvTransform gltf_uv_transform(double offset_u, double offset_v, double rotation,
                                    double scale_u, double scale_v) {
  // T * R * S with R = [cos sin; -sin cos], counter-clockwise seen with v down. The extension's
  // text has an example that settles the sign: offset (0, 1), 90 degrees, scale 0.5 shows the lower
  // left quarter. Rounded to 2^-40, since the last bit of libm's results differs between
  // processors.
  constexpr double kSteps = 1099511627776.0;
  const double c = std::nearbyint(std::cos(rotation) * kSteps) / kSteps;
  const double s = std::nearbyint(std::sin(rotation) * kSteps) / kSteps;
  return {c * scale_u, s * scale_v, offset_u, -s * scale_u, c * scale_v, offset_v};
}

// Names are made unique here, for all that follows: outputs are named after materials, and two
// files of one name would be one.
void read_gltf_materials(const GltfFile& file, const tinygltf::Model& model, mesh::Mesh& mesh,
                         MeshWarnings& warnings) {
  if (const auto it = file.document().find("images"); it != file.document().end()) {
    mesh.images.reserve(it->size());
    for (std::size_t i = 0; i < it->size(); ++i) {
      mesh.images.push_back(read_image_ref(file, i, (*it)[i]));
    }
  }
  std::vector<std::string> names;
  for (const auto& material : model.materials) names.push_back(material.name);
  names = unique_material_names(std::move(names));
  MaterialReader reader(model, mesh, warnings);
  for (std::size_t i = 0; i < model.materials.size(); ++i) {
    tinygltf::Material material = model.materials[i];
    material.name = names[i];
    mesh.materials.push_back(reader.read(material));
  }
}

}  // namespace pounce::io
