// SPDX-License-Identifier: Apache-2.0
//
// The note is JSON. Whoever sends a map may have written it, so every member is checked; what is
// too much for the program that wrote it (a million materials) is refused.
#include "planning/known_map.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>

#include "io/files/asset_file.h"
#include "io/image/read.h"
#include "io/json/untrusted.h"
#include "mesh/uv_tiles.h"
#include "planning/name_patterns.h"
#include "pounce/error.h"
#include "projection/hit_block.h"

namespace pounce::planning {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kNoteVersion = 1;
constexpr std::size_t kMostMaterials = 65536;
constexpr std::uint64_t kLargestSide = 65536;
constexpr std::size_t kMostNoteBytes = 6 << 20;  // a header is read up to 8 MiB (exr_guard.cpp)
constexpr double kFarthest = std::numeric_limits<float>::max();
constexpr std::array<const char*, 3> kWraps{"repeat", "mirror", "clamp"};  // by mesh::Wrap

// --- writing -------------------------------------------------------------------------------------

Json json_of(const mesh::UvTransform& t) { return Json::array({t.a, t.b, t.c, t.d, t.e, t.f}); }

Json json_of(const mesh::TextureBinding& binding) {
  return {{"uvSet", binding.uv_set},
          {"transform", json_of(binding.transform)},
          {"wrap",
           {kWraps[static_cast<std::size_t>(binding.wrap_u)],
            kWraps[static_cast<std::size_t>(binding.wrap_v)]}}};
}

Json json_of(const mesh::Lattice& lattice) {
  return {{"width", lattice.width},
          {"height", lattice.height},
          {"uvSet", lattice.uv_set},
          {"transform", json_of(lattice.transform)}};
}

/// The tiles that the triangles of a page enter, of those that have numbers.
std::set<std::uint32_t> entered_udims(const mesh::Mesh& mesh, const mesh::Lattice& lattice,
                                      std::span<const std::uint32_t> triangles) {
  std::set<std::uint32_t> udims;
  for (const std::uint32_t t : triangles) {
    const auto uvs = transformed_uvs(mesh, t, lattice.uv_set, lattice.transform);
    mesh::visit_uv_tiles(uvs, [&](mesh::UvTile tile) {
      if (const auto udim = mesh::udim_number(tile)) udims.insert(*udim);
    });
  }
  return udims;
}

Json json_of_material(const MeshPlanning& planning, const PassPlan& pass, std::size_t m) {
  const mesh::Material& material = planning.source.materials[m];
  const mesh::Lattice& lattice = pass.source.pages[m];
  Json out{{"name", material.name}, {"used", bool{planning.used[m]}}};
  if (!planning.used[m]) return out;
  out["opaque"] = material.is_opaque;
  out["occlusionStrength"] = material.occlusion_strength;
  out["emissiveStrength"] = material.emissive_strength;
  out["lattice"] = json_of(lattice);
  if (lattice.width > 0)
    out["udims"] = entered_udims(planning.source, lattice, pass.source.triangles->of(m));
  for (int c = 0; c < kChannelCount; ++c) {
    const auto channel = static_cast<std::size_t>(c);
    Json& entry = out["channels"][channel_name(static_cast<Channel>(c))];
    entry["factor"] = material.factors[channel];
    if (const auto& texture = material.textures[channel]) entry["texture"] = json_of(*texture);
  }
  return out;
}

// --- reading -------------------------------------------------------------------------------------

/// Members of a note, each of which must be there and of its kind.
class NoteReader {
 public:
  NoteReader(const std::string& text, const std::string& label) : label_(label) {
    root_ = Json::parse(text, nullptr, false);
    if (!root_.is_object()) refuse("it is not JSON");
  }

  MapNote read() {
    if (whole(root_, "version", 1, 1u << 16) != kNoteVersion)
      refuse("another version of pounce wrote it");
    MapNote note;
    note.size = {whole(root_, "width", 1, kLargestSide), whole(root_, "height", 1, kLargestSide)};
    note.pages = whole(root_, "pages", 1, 2 * kMostMaterials);
    note.has_colours = flag(root_, "vertexColors");
    note.max_distance = number(root_, "maxDistance");
    if (!(note.max_distance > 0 && note.max_distance <= kFarthest)) refuse("\"maxDistance\"");
    if (root_.contains("uvSet")) note.uv_set = whole(root_, "uvSet", 0, 255);
    const Json& materials = member(root_, "materials");
    if (!materials.is_array() || materials.empty() || materials.size() > kMostMaterials)
      refuse("\"materials\"");
    for (const Json& material : materials) note.materials.push_back(read_material(material));
    if (note.pages != note.materials.size() && note.pages != 2 * note.materials.size())
      refuse("\"pages\"");
    return note;
  }

 private:
  [[noreturn]] void refuse(const std::string& what) const {
    throw Error(ErrorKind::input,
                fmt::format("{}: its note on the source ({}) cannot be read: {}; write the map "
                            "again with pounce transfer --map",
                            label_, io::kHitsAttribute, what));
  }

  const Json& member(const Json& parent, const char* name) const {
    if (!parent.is_object() || !parent.contains(name)) refuse(fmt::format("\"{}\"", name));
    return parent[name];
  }
  std::uint32_t whole(const Json& parent, const char* name, std::uint64_t lo,
                      std::uint64_t hi) const {
    const Json& value = member(parent, name);
    if (!value.is_number_unsigned() || value < lo || value > hi)
      refuse(fmt::format("\"{}\"", name));
    return value.get<std::uint32_t>();
  }
  double number(const Json& parent, const char* name) const {
    const Json& value = member(parent, name);
    if (!value.is_number()) refuse(fmt::format("\"{}\"", name));
    return value.get<double>();
  }
  bool flag(const Json& parent, const char* name) const {
    const Json& value = member(parent, name);
    if (!value.is_boolean()) refuse(fmt::format("\"{}\"", name));
    return value.get<bool>();
  }
  template <std::size_t N>
  std::array<double, N> numbers(const Json& parent, const char* name) const {
    const Json& value = member(parent, name);
    const bool are_numbers =
        value.is_array() && value.size() == N &&
        std::all_of(value.begin(), value.end(), [](const Json& one) { return one.is_number(); });
    if (!are_numbers) refuse(fmt::format("\"{}\"", name));
    return value.get<std::array<double, N>>();
  }
  mesh::UvTransform transform(const Json& parent) const {
    const auto t = numbers<6>(parent, "transform");
    return {t[0], t[1], t[2], t[3], t[4], t[5]};
  }
  mesh::Wrap wrap(const Json& value) const {
    const auto at = std::find(kWraps.begin(), kWraps.end(), value);
    if (at == kWraps.end()) refuse("\"wrap\"");
    return static_cast<mesh::Wrap>(at - kWraps.begin());
  }

  mesh::TextureBinding read_texture(const Json& json) const {
    mesh::TextureBinding texture;
    texture.uv_set = whole(json, "uvSet", 0, 255);
    texture.transform = transform(json);
    const Json& wraps = member(json, "wrap");
    if (!wraps.is_array() || wraps.size() != 2) refuse("\"wrap\"");
    texture.wrap_u = wrap(wraps[0]);
    texture.wrap_v = wrap(wraps[1]);
    return texture;
  }

  mesh::Lattice read_lattice(const Json& json) const {
    const std::uint32_t width = whole(json, "width", 0, kLargestSide);
    const std::uint32_t height = whole(json, "height", 0, kLargestSide);
    if ((width == 0) != (height == 0)) refuse("\"lattice\"");
    return {width, height, whole(json, "uvSet", 0, 255), transform(json)};
  }

  MapNote::Material read_material(const Json& json) const {
    MapNote::Material out;
    const Json& name = member(json, "name");
    if (!name.is_string()) refuse("\"name\"");
    out.material.name = name.get<std::string>();
    out.is_used = flag(json, "used");
    if (!out.is_used) return out;
    out.material.is_opaque = flag(json, "opaque");
    out.material.occlusion_strength = static_cast<float>(number(json, "occlusionStrength"));
    out.material.emissive_strength = static_cast<float>(number(json, "emissiveStrength"));
    out.lattice = read_lattice(member(json, "lattice"));
    if (out.lattice.width > 0) {
      const Json& udims = member(json, "udims");
      if (!udims.is_array()) refuse("\"udims\"");
      for (const Json& udim : udims) {
        if (!udim.is_number_unsigned() || udim < mesh::kFirstUdim || udim > mesh::kLastUdim)
          refuse("\"udims\"");
        out.udims.push_back(udim.get<std::uint32_t>());
      }
    }
    const Json& channels = member(json, "channels");
    for (int c = 0; c < kChannelCount; ++c) {
      const auto channel = static_cast<std::size_t>(c);
      const Json& entry = member(channels, channel_name(static_cast<Channel>(c)));
      const auto factor = numbers<4>(entry, "factor");
      std::transform(factor.begin(), factor.end(), out.material.factors[channel].begin(),
                     [](double v) { return static_cast<float>(v); });
      if (entry.contains("texture"))
        out.material.textures[channel] = read_texture(entry["texture"]);
    }
    return out;
  }

  const std::string label_;
  Json root_;
};

/// Files of a pattern, or the one of that name.
std::vector<KnownMap::Page> pages_of(const std::string& pattern) {
  if (!is_tile_pattern(pattern)) return {{mesh::kFirstUdim, pattern}};
  std::vector<KnownMap::Page> pages;
  for (std::uint32_t udim = mesh::kFirstUdim; udim <= mesh::kLastUdim; ++udim) {
    const std::string path = tile_path(pattern, mesh::udim_tile(udim));
    std::error_code gone;
    if (std::filesystem::exists(path, gone)) pages.push_back({udim, path});
  }
  if (!pages.empty()) return pages;
  throw Error(ErrorKind::storage,
              fmt::format("{}: no file exists for any UDIM tile; the first would be {}", pattern,
                          tile_path(pattern, {0, 0})));
}

[[noreturn]] void refuse_as_no_map(const std::string& path) {
  throw Error(ErrorKind::input, path + ": is not a hit map; write one with pounce transfer --map");
}

/// The header of one image of a map.
io::ImageInfo header_of(const std::string& path, const ImageTrust& trust) {
  const std::vector<std::string> names = io::ImageReader::exr_channels(path, trust);
  if (std::find(names.begin(), names.end(), "hit.page") == names.end()) refuse_as_no_map(path);
  io::ImageInfo info =
      io::ImageReader(path, {projection::kHitMapNames.begin(), projection::kHitMapNames.end()},
                      trust)
          .info();
  if (info.hits_note.empty()) refuse_as_no_map(path);
  return info;
}

/// The texture that a job sees in a material, as SourceImages::binding() does.
mesh::TextureBinding binding_of(const MapNote& note, const MapNote::Material& material,
                                Channel channel) {
  mesh::TextureBinding binding;
  if (is_of_material(channel)) {
    if (const auto& own = material.material.textures[static_cast<std::size_t>(channel)])
      binding = *own;
  }
  binding.uv_set = note.uv_set.value_or(binding.uv_set);
  return binding;
}

/// A channel is looked up where the map's hits are, or not at all.
void check_channel(const KnownMap& map, const TransferOptions& options, Channel channel) {
  const std::string name = channel_name(options, channel);
  for (const MapNote::Material& material : map.note.materials) {
    if (!material.is_used) continue;
    const auto refuse = [&](const std::string& what) {
      throw Error(ErrorKind::input,
                  fmt::format("{}: {} of material \"{}\" {}; write a map of that with pounce "
                              "transfer --map and this --source-texture",
                              map.pattern, name, material.material.name, what));
    };
    const mesh::Lattice& lattice = material.lattice;
    const mesh::TextureBinding binding = binding_of(map.note, material, channel);
    if (lattice.width == 0) refuse("has no place in the map: it had no texture");
    if (binding.uv_set != lattice.uv_set || !(binding.transform == lattice.transform))
      refuse("lies elsewhere than the map's texels: in another UV set or texture transform");
    const bool is_own = is_of_material(channel) &&
                        material.material.textures[static_cast<std::size_t>(channel)].has_value();
    if (channel == Channel::base_color && is_own && map.note.has_colours &&
        options.material.apply_vertex_colours) {
      throw Error(ErrorKind::usage,
                  fmt::format("{}: the source's vertex colours multiply {}, and a map does not "
                              "hold them; leave them out with --factors factors, or use pounce "
                              "transfer",
                              map.pattern, name));
    }
  }
}

/// Adds a triangle over some of a unit square of UV space, beside the ones before it.
void add_triangle(mesh::UvTile tile, std::uint32_t material, mesh::Mesh& mesh) {
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  const auto at = static_cast<float>(mesh.triangles.size());
  const auto u = static_cast<float>(tile.column), v = static_cast<float>(mesh::period_y(tile));
  for (const Vec2f corner : {Vec2f{0.25F, 0.25F}, Vec2f{0.75F, 0.25F}, Vec2f{0.25F, 0.75F}}) {
    mesh.positions.push_back({at + corner.x, corner.y, 0});
    mesh.normals.push_back({0, 0, 1});
    mesh.uv_sets[0].push_back({u + corner.x, v + corner.y});
  }
  mesh.triangles.push_back({first, first + 1, first + 2});
  mesh.triangle_material.push_back(material);
}

}  // namespace

std::string map_note(const MeshPlanning& planning, const PassPlan& pass) {
  Json note{{"version", kNoteVersion},
            {"width", pass.size.width},
            {"height", pass.size.height},
            {"pages", pass.source.pages.size()},
            {"vertexColors", !planning.source.colours.empty()}};
  if (const auto uv_set = planning.options.source_use.uv_set) note["uvSet"] = *uv_set;
  for (std::size_t m = 0; m < planning.source.materials.size(); ++m)
    note["materials"].push_back(json_of_material(planning, pass, m));
  std::string text = note.dump(-1, ' ', true, Json::error_handler_t::replace);
  if (text.size() <= kMostNoteBytes) return text;
  throw Error(ErrorKind::input,
              fmt::format("--map {}: what a map must say of the {} materials of {} takes {} bytes, "
                          "but an EXR's header holds {}; select some with --source-material",
                          planning.options.image.map_output, planning.source.materials.size(),
                          planning.source.path, text.size(), kMostNoteBytes));
}

std::string with_distance(const std::string& note, double max_distance) {
  return io::edit_json_object(note, {{"maxDistance", Json(max_distance).dump()}});
}

bool is_hit_map(const std::string& path) { return io::lower_ending(path) == ".exr"; }

KnownMap read_known_map(const std::string& pattern, const ImageTrust& trust) {
  KnownMap map;
  map.pattern = pattern;
  map.pages = pages_of(pattern);
  std::string first;  // note
  for (const KnownMap::Page& page : map.pages) {
    const io::ImageInfo info = header_of(page.path, trust);
    map.decoder_bytes = std::max(map.decoder_bytes, info.decoder_bytes);
    if (first.empty()) {
      first = info.hits_note;
      map.size = {info.width, info.height};
      continue;
    }
    if (info.hits_note == first && map.size == ImageSize{info.width, info.height}) continue;
    throw Error(ErrorKind::input,
                fmt::format("{}: is of another job than {}; write all images of a map in one job",
                            page.path, map.pages.front().path));
  }
  map.note = NoteReader(first, map.pages.front().path).read();
  if (map.size == map.note.size) return map;
  throw Error(ErrorKind::input,
              fmt::format("{}: is {} x {} texels, but was written as {} x {}; hits cannot be "
                          "resized, write a map of this size",
                          map.pages.front().path, map.size.width, map.size.height,
                          map.note.size.width, map.note.size.height));
}

mesh::Mesh map_source(const KnownMap& map, const TransferOptions& options) {
  std::set<Channel> given;
  for (const SourceTexture& texture : options.material.textures) given.insert(texture.channel);
  mesh::Mesh mesh;
  mesh.path = map.pattern;
  mesh.uv_sets.resize(1);
  mesh.uv_present.resize(1);
  for (const MapNote::Material& noted : map.note.materials) {
    const auto m = static_cast<std::uint32_t>(mesh.materials.size());
    mesh::Material& material = mesh.materials.emplace_back(noted.material);
    // Of the textures, those that are painted; where they lie is in the triangles' UVs.
    for (std::size_t c = 0; c < material.textures.size(); ++c) {
      auto& texture = material.textures[c];
      if (!given.contains(static_cast<Channel>(c))) texture.reset();
      if (texture) texture = mesh::TextureBinding{0, 0, {}, texture->wrap_u, texture->wrap_v};
    }
    if (!noted.is_used) continue;
    for (const std::uint32_t udim : noted.udims) add_triangle(mesh::udim_tile(udim), m, mesh);
    if (noted.udims.empty()) add_triangle({0, 0}, m, mesh);
  }
  return mesh;
}

void check_map_channels(const KnownMap& map, const TransferOptions& options,
                        const SourcePlan& plan) {
  for (const ChannelPlan& channel : plan.channels) check_channel(map, options, channel.channel);
}

mesh::Mesh map_target(const KnownMap& map) {
  mesh::Mesh mesh;
  mesh.path = map.pattern;
  mesh.materials.emplace_back().name = "default";
  mesh.uv_sets.resize(1);
  mesh.uv_present.resize(1);
  for (const KnownMap::Page& page : map.pages) {
    // Whole numbers: exact, and a square that only touches its neighbours' tiles is in none.
    const mesh::UvTile tile = mesh::udim_tile(page.udim);
    const auto u = static_cast<float>(tile.column), v = static_cast<float>(mesh::period_y(tile));
    const auto first = static_cast<std::uint32_t>(mesh.positions.size());
    for (const Vec2f corner : {Vec2f{0, 0}, Vec2f{1, 0}, Vec2f{1, 1}, Vec2f{0, 1}}) {
      mesh.positions.push_back({u + corner.x, -(v + corner.y), 0});
      mesh.normals.push_back({0, 0, 1});
      mesh.uv_sets[0].push_back({u + corner.x, v + corner.y});
    }
    mesh.triangles.push_back({first, first + 2, first + 1});
    mesh.triangles.push_back({first, first + 3, first + 2});
  }
  mesh.triangle_material.assign(mesh.triangles.size(), 0);
  return mesh;
}

TransferOptions apply_options(const KnownMap& map, TransferOptions options) {
  options.targets = {map.pattern};
  options.image.size = map.size;
  options.search.max_distance = Length{map.note.max_distance, false};
  // Padding must not run into other charts of what is painted over, which a map does not know.
  if (!options.composite.onto.empty()) options.image.padding_px = 0;
  // Whoever names one texture wants to see that one.
  const bool names_none = !options.channels.all && options.channels.transferred.empty();
  if (names_none && options.material.textures.size() == 1 && !has_token(options.output, "CHANNEL"))
    options.channels.transferred = {options.material.textures.front().channel};
  return options;
}

}  // namespace pounce::planning
