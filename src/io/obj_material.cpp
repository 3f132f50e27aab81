// SPDX-License-Identifier: Apache-2.0
#include "io/obj_material.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <initializer_list>
#include <sstream>
#include <utility>

#include "core/file.h"
#include "pounce/error.h"

namespace pounce::io {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kMaxMtlBytes = 64 << 20;

/// tinyobjloader invents a diffuse colour of 0.6 where a material has a map but no Kd, and black
/// where it has neither. One more line after each "newmtl" makes white the default.
std::string with_white_default(const std::string& text) {
  std::istringstream lines(text);
  std::string out, line;
  while (std::getline(lines, line)) {
    if (!line.empty() && line.back() == '\r') line.pop_back();
    out += line;
    out += '\n';
    const std::size_t start = line.find_first_not_of(" \t");
    if (start != std::string::npos && line.compare(start, 6, "newmtl") == 0) out += "Kd 1 1 1\n";
  }
  return out;
}

std::string read_all(const std::string& path) {
  const auto file = posix_file_system().open(path);
  if (file->size_bytes() > kMaxMtlBytes) {
    throw Error(ErrorKind::input, path + ": larger than 64 MiB, which no material file is");
  }
  std::string text(file->size_bytes(), '\0');
  file->read(0, std::as_writable_bytes(std::span(text)));
  return text;
}

std::string slashed(std::string name) {
  std::replace(name.begin(), name.end(), '\\', '/');
  return name;
}

bool is_file(const fs::path& path) {
  std::error_code error;
  return fs::is_regular_file(path, error);
}

}  // namespace

ObjMaterials::ObjMaterials(const std::string& obj_path, mesh::Mesh& mesh)
    : path_(obj_path), mesh_(mesh) {}

bool ObjMaterials::operator()(const std::string& name, std::vector<tinyobj::material_t>* materials,
                              std::map<std::string, int>* by_name, std::string* warning,
                              std::string* error) {
  const fs::path path = fs::path(path_).parent_path() / slashed(name);
  std::string text;
  try {
    if (!is_file(path)) throw Error(ErrorKind::storage, "no such file");
    text = read_all(path.string());
  } catch (const Error& e) {
    mesh_.warnings.push_back(
        fmt::format("{}: material file {} cannot be read ({})", path_, path.string(), e.what()));
    mesh_.missing_files.push_back(path.string());
    return false;
  }
  mesh_.files.push_back(path.string());
  std::istringstream stream(with_white_default(text));
  tinyobj::LoadMtl(by_name, materials, &stream, warning, error);
  for (std::size_t i = loaded_.size(); i < materials->size(); ++i) {
    loaded_.push_back({(*materials)[i], path.parent_path().string()});
  }
  return true;
}

void ObjMaterials::use(const std::string& name, int id) { in_use_ = {id, id >= 0 ? "" : name}; }

std::uint32_t ObjMaterials::current() {
  const auto found = made_.find(in_use_);
  return found != made_.end() ? found->second : made_[in_use_] = make();
}

std::uint32_t ObjMaterials::make() {
  mesh::Material out;
  const auto& [id, name] = in_use_;
  if (id >= 0 && static_cast<std::size_t>(id) < loaded_.size()) {
    const auto& [in, folder] = loaded_[static_cast<std::size_t>(id)];
    out.name = in.name;
    out.factors[static_cast<std::size_t>(Channel::base_color)] = {in.diffuse[0], in.diffuse[1],
                                                                  in.diffuse[2], in.dissolve};
    const bool dark = in.emission[0] == 0 && in.emission[1] == 0 && in.emission[2] == 0;
    auto& emissive = out.factors[static_cast<std::size_t>(Channel::emissive)];
    emissive = {in.emission[0], in.emission[1], in.emission[2], 1};
    if (dark && !in.emissive_texname.empty()) emissive = {1, 1, 1, 1};
    bind(out, Channel::base_color, in.diffuse_texname, in.diffuse_texopt, folder);
    bind(out, Channel::emissive, in.emissive_texname, in.emissive_texopt, folder);
    const std::initializer_list<std::pair<const char*, const std::string&>> others{
        {"map_Ka", in.ambient_texname},
        {"map_Ks", in.specular_texname},
        {"map_Ns", in.specular_highlight_texname},
        {"map_Bump", in.bump_texname},
        {"disp", in.displacement_texname},
        {"map_d", in.alpha_texname},
        {"refl", in.reflection_texname},
        {"map_Pr", in.roughness_texname},
        {"map_Pm", in.metallic_texname},
        {"map_Ps", in.sheen_texname},
        {"norm", in.normal_texname}};
    for (const auto& [slot, texture] : others) {
      if (!texture.empty()) out.other_textures.push_back({slot, image(texture, folder)});
    }
  } else if (!name.empty()) {
    out.name = name;
    mesh_.warnings.push_back(fmt::format(
        "{}: no material file has the material \"{}\"; it has no textures", path_, name));
  } else {
    out.name = "default";
  }
  mesh_.materials.push_back(std::move(out));
  return static_cast<std::uint32_t>(mesh_.materials.size() - 1);
}

void ObjMaterials::bind(mesh::Material& material, Channel channel, const std::string& texture,
                        const tinyobj::texture_option_t& options, const std::string& folder) {
  if (texture.empty()) return;
  mesh::TextureBinding binding;
  binding.image = image(texture, folder);
  binding.wrap_u = binding.wrap_v = options.clamp ? mesh::Wrap::clamp : mesh::Wrap::repeat;
  // "-s" and "-o" scale and move with v up: v_up' = s v_up + o, written for v down = 1 - v_up.
  const double su = options.scale[0], sv = options.scale[1];
  const double ou = options.origin_offset[0], ov = options.origin_offset[1];
  binding.transform = {su, 0, ou, 0, sv, 1 - sv - ov};
  material.textures[static_cast<std::size_t>(channel)] = binding;
}

std::uint32_t ObjMaterials::image(const std::string& name, const std::string& folder) {
  std::string clean = slashed(name);
  while (!clean.empty() && (clean.back() == ' ' || clean.back() == '\t')) clean.pop_back();
  fs::path path = fs::path(folder) / clean;
  // Paths of another machine ("C:/art/skin.png"): the file is often beside the MTL.
  if (const fs::path beside = fs::path(folder) / fs::path(clean).filename();
      !is_file(path) && is_file(beside)) {
    path = beside;
  }
  const auto [it, is_new] =
      images_.try_emplace(path.string(), static_cast<std::uint32_t>(mesh_.images.size()));
  if (is_new) {
    mesh::ImageRef& out = mesh_.images.emplace_back();
    out.path = out.label = path.string();
    std::error_code error;  // whatever else is wrong with it, reading says
    if (fs::status(path, error).type() == fs::file_type::not_found) {
      out.problem = fmt::format("the file is not there (named by a material of {})", path_);
      out.missing = true;
    }
  }
  return it->second;
}

}  // namespace pounce::io
