// SPDX-License-Identifier: Apache-2.0
//
// The images of a source mesh.
//
// A material names an image, an option may name another, and either may stand for a whole set of
// UDIM tiles: by a token in its name, or because exporters write one tile's name for all of them.
// Which tiles a set must have is read off the UVs, not off the folder. Images are opened for their
// headers alone, each once for all materials and channels that sample it alike.
#include "planning/source_images.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>

#include "io/files/asset_file.h"
#include "io/image/write.h"
#include "io/read_mesh.h"

namespace pounce::planning {
namespace {

/// Is the file there?
bool is_there(const std::string& path) {
  std::error_code ignored;
  return std::filesystem::status(path, ignored).type() != std::filesystem::file_type::not_found;
}

}  // namespace

std::array<Vec2d, 3> transformed_uvs(const mesh::Mesh& mesh, std::size_t triangle,
                                     std::uint32_t uv_set, const mesh::UvTransform& m) {
  std::array<Vec2d, 3> uvs;
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec2f uv = mesh.uv_sets[uv_set][mesh.triangles[triangle][k]];
    uvs[k] = {m.a * uv.x + m.b * uv.y + m.c, m.d * uv.x + m.e * uv.y + m.f};
  }
  return uvs;
}

SourceImages::SourceImages(const TransferOptions& options, const mesh::Mesh& source,
                           SourcePlan& plan)
    : options_(options),
      source_(source),
      plan_(plan),
      images_(source.images),
      uv_set_(options.source_use.uv_set) {
  // Images of options are numbered after those of the mesh, so that one number names either.
  // is_own() tells them apart, which matters for trust (folders) and for colour (glTF is sRGB).
  for (const SourceTexture& given : options.material.textures) {
    const auto [at, is_first] = override_.try_emplace(given.channel, images_.size());
    if (!is_first) {
      throw Error(
          ErrorKind::usage,
          fmt::format("two source textures for {}: {} and {}; specify one",
                      channel_name(options, given.channel), images_[at->second].label, given.path));
    }
    mesh::ImageRef image;
    const io::FileChannels named = io::split_channels(given.path);
    image.path = named.file;
    image.channels = named.channels;
    image.label = given.path;
    images_.push_back(image);
  }
}

std::optional<mesh::TextureBinding> SourceImages::binding(std::size_t material,
                                                          Channel channel) const {
  std::optional<mesh::TextureBinding> found;
  if (is_of_material(channel))
    found = source_.materials[material].textures[static_cast<std::size_t>(channel)];
  if (const auto given = override_.find(channel); given != override_.end()) {
    // The image changes, and the material's UV set, transform and wrap modes stay.
    if (!found) found.emplace();
    found->image = static_cast<std::uint32_t>(given->second);
  }
  if (found && uv_set_) found->uv_set = *uv_set_;
  return found;
}

/// Does --source-uv-set name the set through which the material's texture is seen anyway?
bool SourceImages::is_usual_uv_set(std::size_t material, Channel channel) const {
  if (!uv_set_ || !is_of_material(channel)) return uv_set_.value_or(0) == 0;
  const auto& own = source_.materials[material].textures[static_cast<std::size_t>(channel)];
  return *uv_set_ == (own ? own->uv_set : 0);
}

bool SourceImages::has_uvs(std::size_t triangle, std::uint32_t uv_set) const {
  const auto& corners = source_.triangles[triangle];
  return std::all_of(corners.begin(), corners.end(),
                     [&](std::uint32_t v) { return source_.has_uv(uv_set, v); });
}

int SourceImages::column_of(const mesh::TextureBinding& bound) {
  return column_for(images_[bound.image], bound.wrap_u, bound.wrap_v, heeds_tags(bound.image));
}

int SourceImages::tile_set_of(const mesh::TextureBinding& bound, Channel channel) {
  const auto meant = set_meant(bound.image, channel);
  return meant ? tile_set_for(*meant, bound.image, channel) : -1;
}

int SourceImages::column_for(const mesh::ImageRef& image, mesh::Wrap wrap_u, mesh::Wrap wrap_v,
                             bool heeds_tags) {
  // One column per image as it is sampled: an atlas of a hundred materials is opened, decoded and
  // stored once. Wrap modes are part of it, since a tile's apron depends on them.
  for (std::size_t i = 0; i < plan_.columns.size(); ++i) {
    const ColumnPlan& c = plan_.columns[i];
    if (c.image.label == image.label && c.image.path == image.path &&
        c.image.channels == image.channels && c.image.offset_bytes == image.offset_bytes &&
        c.image.bytes == image.bytes && c.wrap_u == wrap_u && c.wrap_v == wrap_v &&
        c.heeds_tags == heeds_tags) {
      return static_cast<int>(i);
    }
  }
  plan_.columns.push_back({image, wrap_u, wrap_v, io::ImageReader(image, options_.trust).info(),
                           heeds_tags, options_.trust});
  if (const io::ImageInfo& info = plan_.columns.back().info; !info.left_out.empty()) {
    plan_.warnings.push_back(fmt::format(
        "{}: of its {} channels {} are used, the others are left out: {}{}", image.label,
        info.names.size() + info.left_out.size(), io::joined(info.names), io::joined(info.left_out),
        info.format == "openexr"
            ? "; to use these, name them: --source-texture NAME=FILE.exr:" + info.left_out.front()
            : ""));
  }
  return static_cast<int>(plan_.columns.size() - 1);
}

/// By image that a channel samples: the tiles of UV space in which triangles' middles lie.
const std::map<std::uint32_t, std::set<mesh::UvTile>>& SourceImages::middles(Channel channel) {
  const auto [at, is_new] = middles_.try_emplace(channel);
  if (!is_new) return at->second;
  for (std::size_t t = 0; t < source_.triangles.size(); ++t) {
    const auto bound = binding(source_.triangle_material[t], channel);
    if (!bound || !has_uvs(t, bound->uv_set)) continue;
    Vec2d middle{0, 0};
    for (const Vec2d uv : transformed_uvs(source_, t, bound->uv_set, bound->transform)) {
      middle.x += uv.x / 3;
      middle.y += uv.y / 3;
    }
    // Stray coordinates would make tiles that no set has.
    constexpr double kFar = 1e6;
    if (!(std::abs(middle.x) < kFar && std::abs(middle.y) < kFar)) continue;
    at->second[bound->image].insert(
        mesh::tile_of_period(static_cast<std::int32_t>(std::floor(middle.x)),
                             static_cast<std::int32_t>(std::floor(middle.y))));
  }
  return at->second;
}

/// The set of UDIM tiles that is meant by an image; nothing where it is meant itself. Exporters
/// write the name of one tile's image for the whole set.
std::optional<mesh::ImageRef> SourceImages::set_meant(std::uint32_t index, Channel channel) {
  const mesh::ImageRef& image = images_[index];
  // A file that is called so in earnest is that file. The token means a set only where no such file
  // exists, or where the user wrote it.
  if (is_tile_pattern(image.path))
    return is_own(index) && !image.missing ? std::nullopt : std::optional(image);
  // A number in a name may be a year. A set is meant only if UVs say so as well, and if files of at
  // least two tiles exist.
  const bool is_file = image.size_bytes == 0 && image.bytes == nullptr && image.problem.empty();
  const auto named = is_file ? named_tile(image.path) : std::nullopt;
  if (!named) return std::nullopt;
  const auto found = middles(channel).find(index);
  if (found == middles(channel).end() || found->second.size() < 2) return std::nullopt;
  const std::set<mesh::UvTile>& tiles = found->second;
  const auto there = std::count_if(tiles.begin(), tiles.end(), [&](mesh::UvTile tile) {
    return mesh::udim_number(tile) && is_there(tile_path(named->pattern, tile));
  });
  if (there < 2) {
    if (tiles.contains(named->tile)) warn_of_one_tile(image, *named, tiles.size(), channel);
    return std::nullopt;
  }
  plan_.notes.push_back(
      fmt::format("{}: {} is read as one of the UDIM tiles {}, since the UVs enter {} tiles and {} "
                  "of them have an image",
                  name_of(channel), image.label, named->pattern, tiles.size(), there));
  mesh::ImageRef set = image;
  set.path = set.label = named->pattern;
  return set;
}

void SourceImages::warn_of_one_tile(const mesh::ImageRef& image, const NamedTile& named,
                                    std::size_t tiles, Channel channel) {
  plan_.warnings.push_back(fmt::format(
      "{}: its name is that of one UDIM tile, but it is used for all {} tiles that the UVs enter "
      "because the others have no images; add them, or name the set: --source-texture '{}={}'",
      image.label, tiles, name_of(channel), named.pattern));
}

/// glTF has the profiles of its images ignored: its colours are sRGB.
bool SourceImages::heeds_tags(std::uint32_t image) const {
  return !(is_own(image) && io::is_gltf(source_.path));
}

/// The UDIM tiles that the source's UVs enter where this channel samples a pattern, and the
/// images there are for them.
int SourceImages::tile_set_for(const mesh::ImageRef& wanted, std::uint32_t index, Channel channel) {
  // The names that a pattern expands to were in no list when the mesh was read, so their folder is
  // checked here. A pattern of the user's own may lead anywhere.
  const io::AssetFolder folder(source_.path, options_.allow_external || !is_own(index));
  const std::string& pattern = wanted.path;
  TileSetPlan set;
  std::vector<std::uint32_t> missing;
  std::string first_missing;
  for (const std::uint32_t udim : entered_udims(channel, index)) {
    const mesh::UvTile tile = mesh::udim_tile(udim);
    mesh::ImageRef image;
    image.path = image.label = tile_path(pattern, tile);
    image.channels = wanted.channels;
    if (!is_there(image.path)) {
      missing.push_back(udim);
      if (first_missing.empty()) first_missing = image.path;
      continue;
    }
    if (!folder.holds(image.path)) {
      throw Error(ErrorKind::input,
                  fmt::format("{}: the file {}", image.path, io::kOutsideProblem));
    }
    const int column = column_for(image, mesh::Wrap::clamp, mesh::Wrap::clamp, heeds_tags(index));
    const io::ImageInfo& info = plan_.columns[static_cast<std::size_t>(column)].info;
    set.columns[tile] = static_cast<std::size_t>(column);
    set.size.width = std::max(set.size.width, info.width);
    set.size.height = std::max(set.size.height, info.height);
  }
  if (set.columns.empty()) {
    throw Error(missing.empty() ? ErrorKind::input : ErrorKind::storage,
                missing.empty() ? fmt::format("{}: the source's UVs enter no UDIM tile", pattern)
                                : fmt::format("{}: no image exists for the UDIM tiles that the "
                                              "source's UVs enter ({}); the first would be {}",
                                              pattern, udim_list(missing), first_missing));
  }
  if (!missing.empty()) {
    plan_.warnings.push_back(fmt::format(
        "{}: no image for UDIM {}, which the source's UVs enter; texels that hit it stay empty",
        pattern, udim_list(missing)));
  }
  plan_.tile_sets.push_back(std::move(set));
  return static_cast<int>(plan_.tile_sets.size() - 1);
}

/// Those that UVs enter where an image is sampled.
std::vector<std::uint32_t> SourceImages::entered_udims(Channel channel, std::uint32_t image) {
  // By triangle, not by vertex: a triangle may cross a tile without a corner in it.
  std::set<std::uint32_t> entered;
  std::uint64_t beyond = 0;
  for (std::size_t t = 0; t < source_.triangles.size(); ++t) {
    const auto bound = binding(source_.triangle_material[t], channel);
    if (!bound || bound->image != image || !has_uvs(t, bound->uv_set)) continue;
    const auto uvs = transformed_uvs(source_, t, bound->uv_set, bound->transform);
    bool outside = false;
    const std::uint64_t count = mesh::visit_uv_tiles(uvs, [&](mesh::UvTile tile) {
      const auto udim = mesh::udim_number(tile);
      outside = outside || !udim;
      if (udim) entered.insert(*udim);
    });
    beyond += outside || count > 65536 ? 1 : 0;
  }
  if (beyond > 0) {
    plan_.warnings.push_back(
        fmt::format("{}: the UVs of {} triangles leave the UDIM tiles 1001 to 9999; texels that "
                    "hit them there stay empty",
                    source_.path, beyond));
  }
  return {entered.begin(), entered.end()};
}

}  // namespace pounce::planning
