// SPDX-License-Identifier: Apache-2.0
//
// A mesh, and the header of an image, described: first as JSON, which programs read, then as text
// made of it. Each image is opened once, for its header alone, and what is wrong with it becomes a
// member "problem": a model whose textures are elsewhere can be looked at like any other.
//
// What a transfer would refuse is not refused here. A mesh without UVs, or with an image that is
// missing, is what somebody inspects who wants to know why.
#include "commands/inspect_mesh.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <vector>

#include "core/bounds.h"
#include "mesh/uv_tiles.h"
#include "pounce/error.h"

namespace pounce::commands {
namespace {

using Json = nlohmann::ordered_json;

// Floats are written as the shortest decimal that names them: 0.1, not 0.10000000149011612.
Json vector_json(Vec3f v) { return {shortest(v.x), shortest(v.y), shortest(v.z)}; }

/// With the origin, as far as single precision knows where they are from there.
Json vector_json(Vec3f v, Vec3d origin) {
  if (origin == Vec3d{}) return vector_json(v);
  const auto rounded = [](double value) { return std::round(value * 1e6) / 1e6; };
  const Vec3d whole = Vec3d(v) + origin;
  return {rounded(whole.x), rounded(whole.y), rounded(whole.z)};
}

const char* wrap_name(mesh::Wrap wrap) {
  return wrap == mesh::Wrap::repeat ? "repeat" : wrap == mesh::Wrap::mirror ? "mirror" : "clamp";
}

/// The image's header, or why it cannot be read.
Json image_json(const mesh::ImageRef& image, const ImageTrust& trust) {
  Json json{{"image", image.label}};
  if (!image.path.empty()) json["path"] = image.path;
  json["embedded"] = image.size_bytes > 0 || image.bytes != nullptr;
  try {
    if (!image.problem.empty()) throw Error(ErrorKind::input, image.problem);
    json.update(describe(io::ImageReader(image, trust).info()));
  } catch (const Error& error) {
    json["problem"] = error.what();
  }
  return json;
}

/// Of this mesh, each opened once.
class Images {
 public:
  Images(const mesh::Mesh& mesh, const ImageTrust& trust) : mesh_(mesh), trust_(trust) {}
  const Json& operator[](std::uint32_t image) {
    // An atlas of many materials is opened once. Its problem, if it has one, is shown at each of
    // them.
    const auto found = known_.find(image);
    if (found != known_.end()) return found->second;
    return known_[image] = image_json(mesh_.images.at(image), trust_);
  }

 private:
  const mesh::Mesh& mesh_;
  const ImageTrust& trust_;
  std::map<std::uint32_t, Json> known_;
};

/// Numbers rather than colours.
bool is_data(Channel channel) {
  return channel != Channel::base_color && channel != Channel::emissive;
}

/// Those of the five channels, in their order.
Json textures_json(const mesh::Material& material, Images& images) {
  Json textures = Json::array();
  for (int i = 0; i < kChannelCount; ++i) {
    const auto& binding = material.textures[static_cast<std::size_t>(i)];
    if (!binding) continue;
    Json texture{{"channel", channel_name(static_cast<Channel>(i))}};
    texture.update(images[binding->image]);
    if (is_data(static_cast<Channel>(i))) {  // numbers have none, whatever their file says
      texture.erase("linear");
      texture.erase("colour_space");
    }
    texture["uv_set"] = binding->uv_set;
    texture["wrap_u"] = wrap_name(binding->wrap_u);
    texture["wrap_v"] = wrap_name(binding->wrap_v);
    // A transform that changes nothing is not worth a line.
    if (const mesh::UvTransform& t = binding->transform; t != mesh::UvTransform{}) {
      texture["uv_transform"] = {t.a, t.b, t.c, t.d, t.e, t.f};
    }
    textures.push_back(texture);
  }
  return textures;
}

/// Those that no channel takes: a user shall see what a transfer leaves out.
Json other_textures_json(const mesh::Material& material, Images& images) {
  Json textures = Json::array();
  for (const mesh::OtherTexture& other : material.other_textures) {
    Json texture{{"slot", other.slot}};
    texture.update(images[other.image]);
    textures.push_back(texture);
  }
  return textures;
}

Json numbers_json(const std::array<float, 4>& values, std::size_t count) {
  Json numbers = Json::array();
  for (std::size_t i = 0; i < count; ++i) numbers.push_back(shortest(values[i]));
  return numbers;
}

/// Under the names that glTF has for them.
Json factors_json(const mesh::Material& material) {
  const auto of = [&](Channel c) { return material.factors[static_cast<std::size_t>(c)]; };
  // Factors are in the places of the texture's channels: roughness in green, metallic in blue.
  const auto data = of(Channel::metallic_roughness);
  return {{"baseColor", numbers_json(of(Channel::base_color), 4)},
          {"roughness", shortest(data[1])},
          {"metallic", shortest(data[2])},
          {"normal_scale", shortest(of(Channel::normal)[0])},
          {"occlusion_strength", shortest(material.occlusion_strength)},
          {"emissive", numbers_json(of(Channel::emissive), 3)},
          {"emissive_strength", shortest(material.emissive_strength)}};
}

/// All of them, used by triangles or not.
Json materials_json(const mesh::Mesh& mesh, const ImageTrust& trust) {
  std::vector<std::uint64_t> triangles(mesh.materials.size());
  for (const std::uint32_t material : mesh.triangle_material) ++triangles.at(material);
  Images images(mesh, trust);
  Json materials = Json::array();
  for (std::size_t i = 0; i < mesh.materials.size(); ++i) {
    const mesh::Material& material = mesh.materials[i];
    materials.push_back({{"name", material.name},
                         {"triangles", triangles[i]},
                         {"double_sided", material.double_sided},
                         {"factors", factors_json(material)},
                         {"textures", textures_json(material, images)},
                         {"other_textures", other_textures_json(material, images)}});
  }
  return materials;
}

/// What can be selected by name, in the order of appearance.
Json parts_json(const mesh::Mesh& mesh) {
  std::vector<std::uint64_t> triangles(mesh.parts.part_names.size());
  const auto& runs = mesh.parts.runs;
  for (std::size_t r = 0; r < runs.size(); ++r) {
    const std::size_t end =
        r + 1 < runs.size() ? runs[r + 1].first_triangle : mesh.triangles.size();
    triangles.at(runs[r].part) += end - runs[r].first_triangle;
  }
  Json parts = Json::array();
  for (std::size_t p = 0; p < triangles.size(); ++p) {
    Json names = Json::array();
    for (const std::uint32_t name : mesh.parts.part_names[p])
      names.push_back(mesh.parts.names.at(name));
    if (!names.empty()) parts.push_back({{"names", names}, {"triangles", triangles[p]}});
  }
  return parts;
}

/// The one tile that UVs between these corners can lie in; nothing if there are several.
std::optional<mesh::UvTile> only_tile(const Box3f& uvs) {
  const float column = std::floor(uvs.lo.x), row = std::floor(uvs.lo.y);
  constexpr float kFar = 1e6F;
  if (uvs.hi.x > column + 1 || uvs.hi.y > row + 1 || std::abs(column) > kFar ||
      std::abs(row) > kFar)
    return std::nullopt;
  return mesh::tile_of_period(static_cast<std::int32_t>(column), static_cast<std::int32_t>(row));
}

/// The UDIM tiles that a UV set lies in. Triangles that spread over more than a few tiles wrap, and
/// are left out.
Json udims_json(const mesh::Mesh& mesh, std::size_t set) {
  constexpr float kMostSpread = 8;
  // Of triangles, not of vertices: a chart may lie in a tile without a corner in it.
  std::set<std::uint32_t> udims;
  for (const auto& triangle : mesh.triangles) {
    std::array<Vec2d, 3> uvs;
    Box3f box;  // z unused
    bool has_uvs = true;
    for (std::size_t k = 0; k < 3; ++k) {
      has_uvs = has_uvs && mesh.has_uv(set, triangle[k]);
      const Vec2f uv = mesh.uv_sets[set][triangle[k]];
      uvs[k] = {uv.x, uv.y};
      box.extend(Vec3f{uv.x, uv.y, 0});
    }
    if (!has_uvs || box.hi.x - box.lo.x > kMostSpread || box.hi.y - box.lo.y > kMostSpread)
      continue;
    // Most triangles lie in a tile that is known already.
    if (const auto tile = only_tile(box)) {
      const auto udim = mesh::udim_number(*tile);
      if (!udim || udims.contains(*udim)) continue;
    }
    mesh::visit_uv_tiles(uvs, [&](mesh::UvTile tile) {
      if (const auto udim = mesh::udim_number(tile)) udims.insert(*udim);
    });
  }
  return udims;
}

/// Ranges are of vertices that have the set; v counts from above, as everywhere inside.
Json uv_sets_json(const mesh::Mesh& mesh) {
  Json sets = Json::array();
  for (std::size_t set = 0; set < mesh.uv_sets.size(); ++set) {
    Box3f range;  // z unused
    std::uint64_t vertices = 0;
    for (std::uint32_t i = 0; i < mesh.uv_sets[set].size(); ++i) {
      if (!mesh.has_uv(set, i)) continue;
      const Vec2f uv = mesh.uv_sets[set][i];
      range.extend(Vec3f{uv.x, uv.y, 0});
      ++vertices;
    }
    Json json{{"vertices", vertices}};
    if (vertices > 0) {
      json["u"] = {shortest(range.lo.x), shortest(range.hi.x)};
      json["v"] = {shortest(range.lo.y), shortest(range.hi.y)};
    }
    json["udims"] = udims_json(mesh, set);
    sets.push_back(json);
  }
  return sets;
}

/// The shortest text of each, with blanks between.
std::string numbers_text(const Json& numbers) {
  return fmt::format("{}", fmt::join(numbers.get<std::vector<double>>(), " "));
}

constexpr int kTextureColumn = 23;

/// Two lines: what it is for and where it is, and what the image is.
std::string texture_lines(const std::string& use, const Json& texture) {
  return fmt::format("    {:<18} {}\n{:{}}{}\n", use + ":",
                     texture.contains("path") && texture["embedded"] == false
                         ? texture["path"].get<std::string>()
                         : texture["image"].get<std::string>(),
                     "", kTextureColumn,
                     texture.contains("problem")
                         ? "problem: " + texture["problem"].get<std::string>()
                         : image_text(texture));
}

/// Three lines or four: the two above, how UVs lead there, and a transform where there is one.
std::string texture_text(const Json& texture) {
  std::string text = texture_lines(texture["channel"].get<std::string>(), texture);
  const std::string indent(kTextureColumn, ' ');
  text += fmt::format("{}uv set {}, wrap {} x {}\n", indent, texture["uv_set"].get<unsigned>(),
                      texture["wrap_u"].get<std::string>(), texture["wrap_v"].get<std::string>());
  if (texture.contains("uv_transform")) {
    text += fmt::format("{}uv transform {}\n", indent, numbers_text(texture["uv_transform"]));
  }
  return text;
}

/// Those that are not what a material has by itself: "baseColor 0.5 1 1 1, roughness 0.4".
std::string factors_text(const Json& factors) {
  // Factors of a material that says nothing: what differs from them is worth a line.
  static const Json usual = factors_json({});
  std::string text;
  for (const auto& [name, value] : factors.items()) {
    if (value == usual[name]) continue;
    text += (text.empty() ? "" : ", ") + name + " " +
            numbers_text(value.is_array() ? value : Json::array({value}));
  }
  return text.empty() ? "" : fmt::format("    {:<18} {}\n", "factors:", text);
}

}  // namespace

Json describe(const mesh::Mesh& mesh, Vec3d origin, const ImageTrust& trust) {
  Box3f box;
  for (const Vec3f& position : mesh.positions) box.extend(position);
  // The order of members is that of the text, and part of what scripts see.
  Json json{{"triangles", mesh.triangles.size()}, {"vertices", mesh.positions.size()}};
  if (!box.empty())
    json["box"] = {{"lo", vector_json(box.lo, origin)}, {"hi", vector_json(box.hi, origin)}};
  json["parts"] = parts_json(mesh);
  json["vertex_colours"] = mesh.has_vertex_colours;
  json["uv_sets"] = uv_sets_json(mesh);
  json["materials"] = materials_json(mesh, trust);
  json["warnings"] = mesh.warnings;
  return json;
}

// In the order of the JSON, with names of ten columns in front: what people compare by eye, and
// scripts by grep.
std::string mesh_text(const Json& mesh) {
  std::string text =
      fmt::format("triangles  {}\nvertices   {}\n", mesh["triangles"].get<std::uint64_t>(),
                  mesh["vertices"].get<std::uint64_t>());
  if (mesh.contains("box")) {
    text += fmt::format("box        {}  to  {}\n", numbers_text(mesh["box"]["lo"]),
                        numbers_text(mesh["box"]["hi"]));
  }
  for (const Json& part : mesh["parts"]) {
    text += fmt::format("part       \"{}\", {} triangles\n",
                        fmt::join(part["names"].get<std::vector<std::string>>(), "\", \""),
                        part["triangles"].get<std::uint64_t>());
  }
  if (mesh["vertex_colours"].get<bool>()) text += "colours    per vertex\n";
  if (mesh["uv_sets"].empty()) text += "uv sets    none\n";
  for (std::size_t i = 0; i < mesh["uv_sets"].size(); ++i) {
    const Json& set = mesh["uv_sets"][i];
    text += fmt::format("uv set {}   {} vertices", i, set["vertices"].get<std::uint64_t>());
    if (set.contains("u")) {
      text += fmt::format(", u {}, v {} (v down)",
                          fmt::join(set["u"].get<std::vector<double>>(), " to "),
                          fmt::join(set["v"].get<std::vector<double>>(), " to "));
    }
    const auto udims = set["udims"].get<std::vector<std::uint32_t>>();
    if (!udims.empty()) text += ", UDIM " + mesh::udim_list(udims);
    text += "\n";
  }
  for (const Json& material : mesh["materials"]) {
    text += fmt::format("material   \"{}\", {} triangles{}\n", material["name"].get<std::string>(),
                        material["triangles"].get<std::uint64_t>(),
                        material["double_sided"].get<bool>() ? ", double sided" : "");
    text += factors_text(material["factors"]);
    for (const Json& texture : material["textures"]) text += texture_text(texture);
    for (const Json& texture : material["other_textures"])
      text += texture_lines(texture["slot"].get<std::string>() + " (not transferred)", texture);
  }
  for (const Json& warning : mesh["warnings"]) {
    text += fmt::format("warning    {}\n", warning.get<std::string>());
  }
  return text;
}

// What the header says, and what decoding would take: an image may need far more than its texels.
Json describe(const io::ImageInfo& info) {
  return {{"width", info.width},           {"height", info.height},
          {"channels", info.channels},     {"depth", depth_name(info.depth)},
          {"linear", info.space().linear}, {"colour_space", colour_space_name(info.space())},
          {"alpha", info.has_alpha},       {"format", info.format},
          {"tile_width", info.tile_width}, {"tile_height", info.tile_height},
          {"levels", info.levels},         {"decoder_bytes", info.decoder_bytes}};
}

// "0 channels" is what info_of() says of an EXR that has nothing but layers.
std::string image_text(const Json& image) {
  const auto tile_width = image["tile_width"].get<std::uint32_t>();
  const auto levels = image["levels"].get<std::uint32_t>();
  const std::string tiles =
      fmt::format(", tiles {} x {}", tile_width, image["tile_height"].get<std::uint32_t>());
  const auto count = image["channels"].get<std::uint32_t>();
  const std::string channels = count == 0
                                   ? "channels in layers, selected by name (FILE.exr:LAYER)"
                                   : fmt::format("{} channel{}{}", count, count == 1 ? "" : "s",
                                                 image["alpha"].get<bool>() ? " with alpha" : "");
  const std::string space = image.contains("colour_space")
                                ? image["colour_space"].get<std::string>() + ", "
                                : "";  // of data
  return fmt::format("{} x {}, {}, {}, {}{}{}{}", image["width"].get<std::uint32_t>(),
                     image["height"].get<std::uint32_t>(), channels,
                     image["depth"].get<std::string>(), space, image["format"].get<std::string>(),
                     tile_width > 0 ? tiles : "",
                     levels > 1 ? fmt::format(", {} levels", levels) : "");
}

}  // namespace pounce::commands
