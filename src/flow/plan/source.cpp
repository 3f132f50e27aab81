// SPDX-License-Identifier: Apache-2.0
//
// The source's side of a plan: channels, images, sampling groups.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <set>

#include "flow/plan/colour_spaces.h"
#include "flow/plan/map_kind.h"
#include "flow/plan/output_names.h"
#include "flow/plan/plan.h"
#include "flow/plan/texture_factor.h"
#include "flow/plan/tile_pattern.h"
#include "io/files/asset_file.h"
#include "io/image/write.h"
#include "io/read_mesh.h"

namespace pounce::flow {
namespace {

/// Of the channel's name in a sentence.
const char* article(Channel channel) {
  return channel == Channel::occlusion || channel == Channel::emissive ? "an" : "a";
}

/// Materials that triangles really use.
std::vector<bool> used_materials(const mesh::Mesh& mesh) {
  std::vector<bool> used(mesh.materials.size());
  for (const std::uint32_t m : mesh.triangle_material) used[m] = true;
  return used;
}

/// Has any triangle an area?
bool has_surface(const mesh::Mesh& mesh) {
  return std::any_of(mesh.triangles.begin(), mesh.triangles.end(), [&](const auto& triangle) {
    const Vec3d a(mesh.positions[triangle[0]]), b(mesh.positions[triangle[1]]),
        c(mesh.positions[triangle[2]]);
    const double doubled_area = length(cross(b - a, c - a));
    return doubled_area > 0 && std::isfinite(1 / doubled_area);
  });
}

Vec2d transformed(const mesh::UvTransform& m, Vec2f uv) {
  return {m.a * uv.x + m.b * uv.y + m.c, m.d * uv.x + m.e * uv.y + m.f};
}

/// The texture of a material in a channel, with --source-texture applied.
class SourceTextures {
 public:
  SourceTextures(const TransferOptions& options, const mesh::Mesh& source)
      : mesh_(source), images_(source.images), uv_set_(options.source_use.uv_set) {
    for (const SourceTexture& given : options.material.textures) {
      const auto [at, is_first] = override_.try_emplace(given.channel, images_.size());
      if (!is_first) {
        throw Error(ErrorKind::usage, fmt::format("two source textures for {}: {} and {}",
                                                  channel_name(options, given.channel),
                                                  images_[at->second].label, given.path));
      }
      mesh::ImageRef image;
      const io::FileChannels named = io::split_channels(given.path);
      image.path = named.file;
      image.channels = named.channels;
      image.label = given.path;
      images_.push_back(image);
    }
  }

  std::optional<mesh::TextureBinding> binding(std::size_t material, Channel channel) const {
    std::optional<mesh::TextureBinding> found;
    if (is_of_material(channel))
      found = mesh_.materials[material].textures[static_cast<std::size_t>(channel)];
    if (const auto given = override_.find(channel); given != override_.end()) {
      if (!found) found.emplace();
      found->image = static_cast<std::uint32_t>(given->second);
    }
    if (found && uv_set_) found->uv_set = *uv_set_;
    return found;
  }
  const mesh::ImageRef& image(std::uint32_t index) const { return images_[index]; }
  /// Does --source-uv-set name the set through which the material's texture is seen anyway?
  bool is_usual_uv_set(std::size_t material, Channel channel) const {
    if (!uv_set_ || !is_of_material(channel)) return uv_set_.value_or(0) == 0;
    const auto& own = mesh_.materials[material].textures[static_cast<std::size_t>(channel)];
    return *uv_set_ == (own ? own->uv_set : 0);
  }

 private:
  const mesh::Mesh& mesh_;
  std::vector<mesh::ImageRef> images_;
  std::optional<std::uint32_t> uv_set_;      ///< instead of what the materials say
  std::map<Channel, std::size_t> override_;  ///< by --source-texture: into images_
};

class SourcePlanner {
 public:
  SourcePlanner(const TransferOptions& options, const mesh::Mesh& source, TexelsAs as,
                bool for_model)
      : options_(options),
        source_(source),
        as_gaussians_(as == TexelsAs::gaussians),
        spaces_(options, for_model),
        textures_(options, source),
        used_(used_materials(source)),
        for_model_(for_model) {
    for (const Channel channel : options.channels.baked)
      is_baked_[static_cast<std::size_t>(channel)] = true;
  }

  SourcePlan make() {
    if (source_.triangles.empty())
      throw Error(ErrorKind::input, source_.path + ": has no triangles");
    if (!has_surface(source_)) {
      throw Error(
          ErrorKind::input,
          fmt::format("{}: all of its {} triangles are degenerate, none has an area; export "
                      "the model again",
                      source_.path, source_.triangles.size()));
    }
    const std::vector<Channel> chosen = chosen_channels();
    for (const Channel channel : chosen) {
      if (is_asked_for(channel)) {
        add_channel(channel);
      } else {
        try_channel(channel);
      }
    }
    for (PassPlan& pass : plan_.passes) {
      // Each texel is a Gaussian; or the shape is what is transferred.
      pass.source.exact = as_gaussians_ || pass.has_shape;
      pass.source.colours = needs_colours(pass);
      pass.shape = source_shape(pass.source);
    }
    plan_tangents();
    warn_of_directions();
    spaces_.finish(plan_);
    return std::move(plan_);
  }

 private:
  bool is_baked(Channel channel) const {
    return !is_other(channel) && is_baked_[static_cast<std::size_t>(channel)];
  }

  /// Those of the source's vertices, if it has any.
  bool needs_colours(const PassPlan& pass) const {
    return !source_.colours.empty() &&
           std::any_of(pass.channels.begin(), pass.channels.end(), [&](std::size_t c) {
             const ChannelPlan& channel = plan_.channels[c];
             return channel.is_tinted() || channel.channel == Channel::vertex_color;
           });
  }

  /// Do the colours of the source's vertices multiply a channel? No output but these images can
  /// show them: a model has the vertices of the target.
  bool is_tinted(Channel channel) const {
    return channel == Channel::base_color && options_.material.apply_vertex_colours &&
           !source_.colours.empty();
  }

  /// Tangents matter where a material's normal map is read.
  void plan_tangents() {
    for (const ChannelPlan& channel : plan_.channels) {
      if (channel.channel != Channel::normal || images_of(channel).empty()) continue;
      TangentPlan& tangents = plan_.tangents.emplace();
      for (std::size_t m = 0; m < source_.materials.size(); ++m) {
        const auto binding = textures_.binding(m, Channel::normal);
        tangents.uv_sets.push_back(binding ? binding->uv_set : 0);
        // What the file's tangents follow is the set that its normal map says.
        const bool own = options_.source_use.uv_set.value_or(0) == 0;
        tangents.keeps_own.push_back(own);
      }
    }
  }

  void warn_of_directions() {
    if (plan_.makes_normals()) return;
    const bool source = options_.material.normal_y != NormalY::up;
    if (!source && options_.image.normal_y == NormalY::up) return;
    plan_.warnings.push_back(
        fmt::format("{}: no normal map is made", source ? "--normal-y" : "--output-normal-y"));
  }

  std::string name_of(Channel channel) const { return channel_name(options_, channel); }

  bool source_has(Channel channel) const {
    if (is_tinted(channel)) return true;
    for (std::size_t m = 0; m < used_.size(); ++m) {
      if (used_[m] && textures_.binding(m, channel)) return true;
    }
    return false;
  }

  /// All channels are chosen, not some by name.
  bool takes_all() const {
    return options_.channels.all ||
           (options_.channels.transferred.empty() && has_token(options_.output, "CHANNEL"));
  }

  /// By name, or by an image of its own. Nobody leaves out the colour without saying so.
  bool is_asked_for(Channel channel) const {
    const auto& given = options_.material.textures;
    return !takes_all() || channel == Channel::base_color || is_baked(channel) ||
           std::any_of(given.begin(), given.end(),
                       [&](const SourceTexture& texture) { return texture.channel == channel; });
  }

  /// Of all that the source has, what is missing, damaged or of no use is left out. A file that is
  /// there and that the system does not let us read ends the job: the next run would give more.
  void try_channel(Channel channel) {
    const std::size_t columns = plan_.columns.size(), warnings = plan_.warnings.size(),
                      notes = plan_.notes.size();
    try {
      add_channel(channel);
    } catch (const Error& error) {
      const bool is_last = channel == last_channel_ && plan_.channels.empty();
      const bool is_missing = dynamic_cast<const io::MissingFile*>(&error) != nullptr;
      if (is_last || (error.kind() != ErrorKind::input && !is_missing)) throw;
      plan_.columns.erase(plan_.columns.begin() + static_cast<std::ptrdiff_t>(columns),
                          plan_.columns.end());
      plan_.warnings.resize(warnings);
      plan_.notes.resize(notes);
      plan_.warnings.push_back(fmt::format("{}: {} is left out: {}; --channels {} insists on it",
                                           source_.path, name_of(channel), error.what(),
                                           name_of(channel)));
    }
  }

  void add_channel(Channel channel) {
    ChannelPlan plan = plan_channel(channel);
    GeometryRequest source = source_request(plan);
    const std::size_t c = plan_.channels.size();
    const bool needs_surface = plan.has_shape() || (plan.is_tinted() && !as_gaussians_);
    const auto same =
        std::find_if(plan_.passes.begin(), plan_.passes.end(), [&](const PassPlan& pass) {
          return pass.size == plan.size &&
                 (images_of(plan).empty() || pass.source.pages == source.pages);
        });
    if (same != plan_.passes.end()) {
      same->channels.push_back(c);
      same->has_shape = same->has_shape || needs_surface;
    } else {
      plan_.passes.push_back({std::move(source), {}, plan.size, {c}, needs_surface});
    }
    plan_.channels.push_back(std::move(plan));
  }

  /// Where every channel is meant, but not by name.
  void warn_of_one_channel() {
    std::string others;
    for (int c = 1; c < kChannelCount; ++c) {
      const auto channel = static_cast<Channel>(c);
      if (source_has(channel)) others += fmt::format(", {}", name_of(channel));
    }
    if (others.empty()) return;
    plan_.warnings.push_back(
        fmt::format("{}: --method gaussian transfers baseColor alone; left out: {}", source_.path,
                    others.substr(2)));
  }

  /// Why there may be no textures: " (its material file ... is not there)".
  std::string missing_files() const {
    if (source_.unread_files.empty()) return "";
    const mesh::UnreadFile& file = source_.unread_files.front();
    return fmt::format(" (its material file {} {})", file.path, file.cure);
  }

  std::vector<Channel> chosen_channels() {
    const bool all = takes_all() && !as_gaussians_;
    if (takes_all() && !all) warn_of_one_channel();
    std::vector<Channel> chosen = options_.channels.transferred;
    if (!all && chosen.empty() && options_.channels.baked.empty()) chosen = {Channel::base_color};
    if (all) {
      for (int c = 0; c < kChannelCount; ++c) {
        if (source_has(static_cast<Channel>(c))) chosen.push_back(static_cast<Channel>(c));
      }
      for (std::size_t k = 0; k < options_.channels.other_maps.size(); ++k)
        chosen.push_back(other_channel(k));
    }
    std::vector<Channel> distinct;
    for (const Channel c : chosen) {
      if (std::find(distinct.begin(), distinct.end(), c) == distinct.end()) distinct.push_back(c);
    }
    for (const Channel c : distinct) {
      if (!source_has(c) && !is_baked(c)) {
        throw Error(
            ErrorKind::input,
            fmt::format(
                "{}: no material has {} {} texture{}; give one with --source-texture "
                "{}=FILE{}",
                source_.path, article(c), name_of(c), missing_files(), name_of(c),
                c == Channel::normal ? ", or make it of the shape with --bake normal" : ""));
      }
    }
    if (is_baked(Channel::vertex_color) && source_.colours.empty()) {
      throw Error(ErrorKind::input,
                  fmt::format("{}: --bake vertexColor: its vertices {}", source_.path,
                              source_.has_vertex_colours ? "are all white, or all black"
                                                         : "have no colours"));
    }
    for (const Channel c : options_.channels.baked) {  // last: images of others may give their size
      if (std::find(distinct.begin(), distinct.end(), c) == distinct.end()) distinct.push_back(c);
    }
    if (distinct.empty()) {
      throw Error(ErrorKind::input,
                  fmt::format("{}: has no textures{}; give one with --source-texture "
                              "baseColor=FILE",
                              source_.path, missing_files()));
    }
    last_channel_ = distinct.back();
    return distinct;
  }

  int column_for(const mesh::ImageRef& image, mesh::Wrap wrap_u, mesh::Wrap wrap_v,
                 bool heeds_tags) {
    for (std::size_t i = 0; i < plan_.columns.size(); ++i) {
      const ColumnPlan& c = plan_.columns[i];
      if (c.image.label == image.label && c.image.path == image.path &&
          c.image.channels == image.channels && c.image.offset_bytes == image.offset_bytes &&
          c.image.bytes == image.bytes && c.wrap_u == wrap_u && c.wrap_v == wrap_v &&
          c.heeds_tags == heeds_tags) {
        return static_cast<int>(i);
      }
    }
    plan_.columns.push_back({image, wrap_u, wrap_v,
                             io::ImageReader(image, options_.allowed_formats).info(), heeds_tags,
                             options_.allowed_formats});
    if (const io::ImageInfo& info = plan_.columns.back().info; !info.left_out.empty()) {
      plan_.warnings.push_back(fmt::format(
          "{}: of its {} channels {} are taken, the others are left out: {}{}", image.label,
          info.names.size() + info.left_out.size(), io::joined(info.names),
          io::joined(info.left_out),
          info.format == "openexr" ? "; to take these, name them: --source-texture NAME=FILE.exr:" +
                                         info.left_out.front()
                                   : ""));
    }
    return static_cast<int>(plan_.columns.size() - 1);
  }

  /// Is the file there?
  static bool is_there(const std::string& path) {
    std::error_code ignored;
    return std::filesystem::status(path, ignored).type() != std::filesystem::file_type::not_found;
  }

  /// Is it an image that the mesh file names itself?
  bool is_own(std::uint32_t image) const { return image < source_.images.size(); }

  /// By image that a channel samples: the tiles of UV space in which triangles' middles lie.
  const std::map<std::uint32_t, std::set<mesh::UvTile>>& middles(Channel channel) {
    const auto [at, is_new] = middles_.try_emplace(channel);
    if (!is_new) return at->second;
    for (std::size_t t = 0; t < source_.triangles.size(); ++t) {
      const auto binding = textures_.binding(source_.triangle_material[t], channel);
      if (!binding || !has_uvs(t, binding->uv_set)) continue;
      Vec2d middle{0, 0};
      for (const std::uint32_t corner : source_.triangles[t]) {
        const Vec2d uv = transformed(binding->transform, source_.uv_sets[binding->uv_set][corner]);
        middle.x += uv.x / 3;
        middle.y += uv.y / 3;
      }
      constexpr double kFar = 1e6;
      if (!(std::abs(middle.x) < kFar && std::abs(middle.y) < kFar)) continue;
      at->second[binding->image].insert(
          mesh::tile_of_period(static_cast<std::int32_t>(std::floor(middle.x)),
                               static_cast<std::int32_t>(std::floor(middle.y))));
    }
    return at->second;
  }

  /// The set of UDIM tiles that is meant by an image; nothing where it is meant itself. Exporters
  /// write the name of one tile's image for the whole set.
  std::optional<mesh::ImageRef> set_meant(std::uint32_t index, Channel channel) {
    const mesh::ImageRef& image = textures_.image(index);
    if (is_tile_pattern(image.path))
      return is_own(index) && !image.missing ? std::nullopt : std::optional(image);
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
    plan_.notes.push_back(fmt::format(
        "{}: {} is taken for one of the UDIM tiles {}, since UVs enter {} tiles and {} of them "
        "have an image there",
        name_of(channel), image.label, named->pattern, tiles.size(), there));
    mesh::ImageRef set = image;
    set.path = set.label = named->pattern;
    return set;
  }

  void warn_of_one_tile(const mesh::ImageRef& image, const NamedTile& named, std::size_t tiles,
                        Channel channel) {
    plan_.warnings.push_back(fmt::format(
        "{}: it is called like one UDIM tile, but shown on all {} tiles that the UVs enter, as "
        "there are no images of the others; put them there, or name the set: --source-texture "
        "'{}={}'",
        image.label, tiles, name_of(channel), named.pattern));
  }

  /// glTF has the profiles of its images ignored: its colours are sRGB.
  bool heeds_tags(std::uint32_t image) const {
    return !(is_own(image) && io::is_gltf(source_.path));
  }

  /// The UDIM tiles that the source's UVs enter where this channel samples a pattern, and the
  /// images there are for them.
  int tile_set_for(const mesh::ImageRef& wanted, std::uint32_t index, Channel channel) {
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
                  missing.empty()
                      ? fmt::format("{}: the source's UVs lie in no UDIM tile", pattern)
                      : fmt::format("{}: no image of this set is there for the tiles that the "
                                    "source's UVs enter ({}); the first would be {}",
                                    pattern, udim_list(missing), first_missing));
    }
    if (!missing.empty()) {
      plan_.warnings.push_back(
          fmt::format("{}: no image for UDIM {}, which the source's UVs enter; texels that meet it "
                      "stay empty",
                      pattern, udim_list(missing)));
    }
    plan_.tile_sets.push_back(std::move(set));
    return static_cast<int>(plan_.tile_sets.size() - 1);
  }

  /// Those that UVs enter where an image is sampled.
  std::vector<std::uint32_t> entered_udims(Channel channel, std::uint32_t image) {
    std::set<std::uint32_t> entered;
    std::uint64_t beyond = 0;
    for (std::size_t t = 0; t < source_.triangles.size(); ++t) {
      const auto binding = textures_.binding(source_.triangle_material[t], channel);
      if (!binding || binding->image != image || !has_uvs(t, binding->uv_set)) continue;
      std::array<Vec2d, 3> uvs;
      for (std::size_t k = 0; k < 3; ++k) {
        uvs[k] = transformed(binding->transform,
                             source_.uv_sets[binding->uv_set][source_.triangles[t][k]]);
      }
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
                      "meet them there stay empty",
                      source_.path, beyond));
    }
    return {entered.begin(), entered.end()};
  }

  bool has_uvs(std::size_t triangle, std::uint32_t uv_set) const {
    const auto& corners = source_.triangles[triangle];
    return std::all_of(corners.begin(), corners.end(),
                       [&](std::uint32_t v) { return source_.has_uv(uv_set, v); });
  }

  /// A primitive without this texture still hides what is behind it: its factor, as the image would
  /// hold it.
  texture::TexelValue constant(std::size_t material, Channel channel, bool applies_factors) const {
    if (channel == Channel::normal) return {{0.5, 0.5, 1}, 3, false, false, false};
    if (is_shape(channel)) return {};
    if (!is_of_material(channel)) return {{0, 0, 0, 1}, 4, true, true, false};
    const mesh::Material& m = source_.materials[material];
    const auto& f = m.factors[static_cast<std::size_t>(channel)];
    const float light = applies_factors && channel == Channel::emissive ? m.emissive_strength : 1;
    return {{f[0] * light, f[1] * light, f[2] * light, f[3]},
            4,
            is_colour(options_, channel),
            true,
            false};
  }

  /// Of a material whose own texture, or what stands for it, is sampled.
  std::optional<texture::Factor> factor(std::size_t material, Channel channel) const {
    const mesh::Material& m = source_.materials[material];
    if (!is_of_material(channel) || !m.textures[static_cast<std::size_t>(channel)])
      return std::nullopt;
    return texture_factor(m, channel);
  }

  /// What the material of a model may have instead of its images: what all that is seen has.
  std::optional<std::array<float, 4>> common_factor(Channel channel) const {
    if (!for_model_ || !is_of_material(channel) || channel == Channel::normal) return std::nullopt;
    std::optional<std::array<float, 4>> common;
    for (std::size_t m = 0; m < source_.materials.size(); ++m) {
      if (!used_[m]) continue;
      if (!textures_.binding(m, channel)) return std::nullopt;
      const mesh::Material& material = source_.materials[m];
      const bool own = material.textures[static_cast<std::size_t>(channel)].has_value();
      const auto factor =
          own ? material_factor(material, channel) : std::array<float, 4>{1, 1, 1, 1};
      if (common && *common != factor) return std::nullopt;
      common = factor;
    }
    return common;
  }

  /// Does the alpha of the base colour mean anything? Not where every material that is used is
  /// opaque by the file, and its image is its own.
  bool alpha_counts() const {
    for (std::size_t m = 0; m < used_.size(); ++m) {
      const auto binding = textures_.binding(m, Channel::base_color);
      if (used_[m] && (!source_.materials[m].is_opaque || (binding && !is_own(binding->image))))
        return true;
    }
    return false;
  }

  /// What a material gives to a channel.
  PageTexture page_texture(std::size_t material, Channel channel, bool applies_factors,
                           std::map<std::uint32_t, int>& tile_sets) {
    PageTexture page;
    page.constant = constant(material, channel, applies_factors);
    const auto binding = used_[material] ? textures_.binding(material, channel) : std::nullopt;
    // As factors are: what --source-texture gives to a material without texture is given as it is.
    page.tinted =
        is_tinted(channel) &&
        (!binding || source_.materials[material].textures[static_cast<std::size_t>(channel)]);
    if (!binding) return page;
    const auto [set, is_new] = tile_sets.try_emplace(binding->image, -1);
    if (is_new) {
      if (const auto meant = set_meant(binding->image, channel))
        set->second = tile_set_for(*meant, binding->image, channel);
    }
    page.tile_set = set->second;
    if (page.tile_set < 0) {
      page.column = column_for(textures_.image(binding->image), binding->wrap_u, binding->wrap_v,
                               heeds_tags(binding->image));
    }
    if (channel == Channel::normal)
      page.normal_scale = source_.materials[material].factors[static_cast<std::size_t>(channel)][0];
    if (applies_factors) page.factor = factor(material, channel);
    return page;
  }

  /// The images that a channel samples.
  std::vector<const ColumnPlan*> images_of(const ChannelPlan& plan) const {
    std::set<std::size_t> columns;
    for (const PageTexture& page : plan.pages) {
      if (page.column >= 0) columns.insert(static_cast<std::size_t>(page.column));
      if (page.tile_set < 0) continue;
      for (const auto& [tile, column] :
           plan_.tile_sets[static_cast<std::size_t>(page.tile_set)].columns)
        columns.insert(column);
    }
    std::vector<const ColumnPlan*> images;
    for (const std::size_t column : columns) images.push_back(&plan_.columns[column]);
    return images;
  }

  /// A map whose name says neither colour nor data.
  void note_kind(Channel channel) {
    if (!is_other(channel)) return;
    const OtherMap& map = options_.channels.other_maps[other_index(channel)];
    if (map.is_colour || usually_colour(map.name)) return;
    plan_.notes.push_back(fmt::format(
        "{}: taken as data, never converted; --color {} where it is colour", map.name, map.name));
  }

  void note_factors(const ChannelPlan& plan) {
    const auto has_factor = [](const PageTexture& page) { return page.factor.has_value(); };
    if (std::none_of(plan.pages.begin(), plan.pages.end(), has_factor)) return;
    plan_.notes.push_back(
        fmt::format("{}: its materials have different {} factors, a model's material has one: "
                    "they are multiplied into the images",
                    source_.path, plan.name));
  }

  ChannelPlan plan_channel(Channel channel) {
    ChannelPlan plan;
    plan.channel = channel;
    plan.baked = is_baked(channel);
    plan.name = name_of(channel);
    note_kind(channel);
    std::map<std::uint32_t, int> tile_sets;  // by image
    std::vector<PageTexture> without_uvs;
    const auto common = common_factor(channel);
    if (common) plan.material_factor = *common;
    const bool applies_factors = options_.material.apply_factors && !common;
    for (std::size_t m = 0; m < source_.materials.size(); ++m) {
      plan.pages.push_back(page_texture(m, channel, applies_factors, tile_sets));
      without_uvs.emplace_back().constant = plan.pages[m].constant;
      without_uvs[m].tinted = is_tinted(channel);
    }
    plan.shows_alpha = channel == Channel::base_color && alpha_counts();
    if (for_model_) note_factors(plan);
    const std::vector<const ColumnPlan*> images = images_of(plan);
    SourceLook look = look_of(channel, images);
    if (channel == Channel::normal) take_vectors(images, look);
    if (is_shape(channel)) take_shape(channel, look);
    if (images.empty()) look.size = size_without_images(plan);
    take_factors(plan, look);
    take_colours(plan, look);
    if (spaces_.is_by_config(channel)) take_three(look);
    choose_output(options_, look, spaces_, plan, plan_.warnings, plan_.notes);
    if (channel == Channel::height || channel == Channel::position)
      check_numbers(options_, plan, "--bake");
    note_said_anyway(images, plan);
    plan.pages.insert(plan.pages.end(), without_uvs.begin(), without_uvs.end());
    for (PageTexture& page : plan.pages) give_space(plan, page);
    return plan;
  }

  /// What options say that holds without them.
  void note_said_anyway(const std::vector<const ColumnPlan*>& images, ChannelPlan& plan) const {
    const bool same_spaces = std::all_of(
        images.begin(), images.end(),
        [&](const ColumnPlan* image) { return spaces_.said_anyway(plan.channel, *image); });
    if (same_spaces) plan.said_anyway.emplace_back("source-colorspace");
    bool same_uvs = true;
    for (std::size_t m = 0; m < source_.materials.size(); ++m)
      same_uvs = same_uvs && (!used_[m] || textures_.is_usual_uv_set(m, plan.channel));
    // Tangents follow the first set, whatever set the normal map says.
    const bool by_first = options_.source_use.uv_set.value_or(0) == 0;
    if (same_uvs && (by_first || !plan.has_shape())) plan.said_anyway.emplace_back("source-uv-set");
  }

  static void take_shape(Channel channel, SourceLook& look) {
    look.colours = channel == Channel::height ? 1 : 3;
    if (channel == Channel::vertex_color) {
      look.linear = true;
    } else {
      look.depth = Depth::float32;
    }
  }

  /// A normal map has three numbers, whatever its image has besides.
  static void take_vectors(const std::vector<const ColumnPlan*>& images, SourceLook& look) {
    look.colours = 3;
    look.names.resize(std::min<std::size_t>(look.names.size(), 3));
    for (const ColumnPlan* image : images) {
      const std::uint32_t samples = image->info.channels - (image->info.has_alpha ? 1U : 0U);
      if (samples >= 3) continue;
      throw Error(ErrorKind::input,
                  fmt::format("{}: has {} channel{}, a normal map has three; heights are none: "
                              "bake them into one",
                              image->image.label, samples, samples == 1 ? "" : "s"));
    }
  }

  /// Of what is baked of the shape alone: as large as the largest of the others.
  ImageSize size_without_images(const ChannelPlan& plan) const {
    ImageSize largest;
    for (const ChannelPlan& channel : plan_.channels) {
      if (std::uint64_t{channel.size.width} * channel.size.height >
          std::uint64_t{largest.width} * largest.height)
        largest = channel.size;
    }
    if (largest.width == 0 && !options_.image.size && options_.composite.onto.empty()) {
      throw Error(ErrorKind::usage,
                  fmt::format("{}{} has no texture whose size the images could take; give --size",
                              plan.baked ? "--bake: " : "", source_.path));
    }
    return largest;
  }

  /// What a page's samples mean, and its constant, which is a factor of the material: linear light
  /// of sRGB's primaries.
  void give_space(const ChannelPlan& plan, PageTexture& page) {
    if (const auto input = colour_input({kRec709, true}, true, plan)) {
      if (page.tinted) {
        page.input = *input;
      } else {
        texture::apply(*input, page.constant);
      }
    }
    if (page.column >= 0) page.input = input_of(plan, static_cast<std::size_t>(page.column));
    if (page.tile_set < 0) return;
    TileSetPlan& set = plan_.tile_sets[static_cast<std::size_t>(page.tile_set)];
    for (const auto& [tile, column] : set.columns) {
      if (const auto input = input_of(plan, column)) set.inputs[tile] = *input;
    }
  }

  std::optional<texture::ColourInput> input_of(const ChannelPlan& plan, std::size_t column) {
    const ColumnPlan& c = plan_.columns[column];
    const bool plain =
        !as_gaussians_ && std::none_of(plan.pages.begin(), plan.pages.end(),
                                       [](const PageTexture& p) { return p.factor || p.tinted; });
    return spaces_.input(spaces_.of(plan.channel, c), c.info.linear, plain, plan);
  }

  /// Grey becomes red, green and blue.
  static void take_three(SourceLook& look) {
    if (look.colours != 1) return;
    look.colours = 3;
    look.names.clear();
  }

  /// What images have once the materials' factors were applied. Neither a format without alpha nor
  /// four colours are given up for an opacity, which is said.
  void take_factors(const ChannelPlan& plan, SourceLook& look) {
    bool has_opacity = false;
    for (const PageTexture& page : plan.pages) {
      if (!page.factor) continue;
      has_opacity = has_opacity || page.factor->scale[3] != 1;
      if (page.factor->spreads) take_three(look);
    }
    if (has_opacity && !look.alpha) take_opacity("the materials' opacity", plan, look);
  }

  /// The same of the vertices' colours.
  void take_colours(const ChannelPlan& plan, SourceLook& look) {
    if (!plan.is_tinted() && plan.channel != Channel::vertex_color) return;
    take_three(look);
    const bool has_opacity = std::any_of(source_.colours.begin(), source_.colours.end(),
                                         [](const Vec4f& c) { return c.w != 1; });
    if (has_opacity && !look.alpha) take_opacity("the opacity of its vertices", plan, look);
    if (!plan.is_tinted()) return;
    plan_.notes.push_back(fmt::format(
        "{}: the colours of its vertices are multiplied into {} "
        "(--factors {}: not)",
        source_.path, plan.name, options_.material.apply_factors ? "factors" : "textures"));
  }

  void take_opacity(const char* what, const ChannelPlan& plan, SourceLook& look) {
    const std::string& output = output_of(options_, plan.channel);
    const Depth depth = io::writable_depth(output, look.depth);
    const std::string why = io::why_not_writable(output, {1, 1, 4, depth, look.linear, true});
    look.alpha = why.empty() && look.colours < 4;
    if (!look.alpha) {
      plan_.warnings.push_back(
          fmt::format("{}: {} is left out: {}", plan.name, what,
                      why.empty() ? "the source's images have four channels of their own" : why));
    }
  }

  SourceLook look_of(Channel channel, const std::vector<const ColumnPlan*>& images) {
    SourceLook look;
    look.colours = 1;
    look.premultiplied = true;
    for (const ColumnPlan* image : images) {
      const io::ImageInfo& info = image->info;
      look.size.width = std::max(look.size.width, info.width);
      look.size.height = std::max(look.size.height, info.height);
      look.colours = std::max(look.colours, info.channels - (info.has_alpha ? 1U : 0U));
      look.alpha = look.alpha || info.has_alpha;
      look.linear = look.linear || spaces_.of(channel, *image).linear;
      look.premultiplied =
          look.premultiplied && (!info.has_alpha || (info.premultiplied && info.linear));
      look.depth = std::max(look.depth, info.depth);
    }
    take_names(channel, images, look);
    take_primaries(channel, images, look);
    return look;
  }

  /// The names of the channels, if all images that have them agree.
  void take_names(Channel channel, const std::vector<const ColumnPlan*>& images, SourceLook& look) {
    const ColumnPlan* first = nullptr;
    for (const ColumnPlan* image : images) {
      std::vector<std::string> names = image->info.names;
      if (image->info.has_alpha) names.pop_back();
      if (names.size() < look.colours) continue;
      if (first == nullptr) {
        first = image;
        look.names = names;
      } else if (names != look.names) {
        plan_.warnings.push_back(fmt::format(
            "{}: the channels of {} are {}, those of {} {}; the output has the usual names",
            name_of(channel), first->image.label, io::joined(look.names), image->image.label,
            io::joined(names)));
        look.names.clear();
        return;
      }
    }
  }

  /// The primaries of the images: of the first, to which the others are converted.
  void take_primaries(Channel channel, const std::vector<const ColumnPlan*>& images,
                      SourceLook& look) {
    if (!is_colour(options_, channel)) return;
    for (const ColumnPlan* image : images) {
      const std::string& problem = image->info.colours.problem;
      const ColourSpace space = spaces_.of(channel, *image);
      if (!problem.empty() && image->heeds_tags && !spaces_.given(channel)) {
        plan_.warnings.push_back(
            fmt::format("{}: {}; its colours are taken as {}; convert the image, or say what they "
                        "are with --source-colorspace",
                        image->image.label, problem, colour_space_name(space)));
      }
      const bool is_said = !same_primaries(space.primaries, kRec709) ||
                           (image->heeds_tags && image->info.colours.primaries);
      if (image == images.front() && is_said) look.chromaticities = space.primaries;
      if (same_primaries(space.primaries, look.chromaticities.value_or(kRec709))) continue;
      plan_.notes.push_back(fmt::format("{}: {} is converted from {} to the colour space of {}",
                                        name_of(channel), image->image.label,
                                        colour_space_name(space), images.front()->image.label));
    }
  }

  /// How this channel sees the source: a lattice per material.
  GeometryRequest source_request(const ChannelPlan& channel) {
    GeometryRequest request;
    request.mesh = &source_;
    for (std::size_t m = 0; m < source_.materials.size(); ++m) {
      mesh::Lattice lattice;
      const PageTexture& page = channel.pages[m];
      if (page.column >= 0 || page.tile_set >= 0) {
        const auto binding = *textures_.binding(m, channel.channel);
        const ImageSize size = sampled_size(page);
        lattice = {size.width, size.height, binding.uv_set, binding.transform};
      }
      request.pages.push_back(lattice);
    }
    // What has the texture but not the UVs for it is constant, as if it had no texture.
    std::vector<std::uint32_t> triangle_page = source_.triangle_material;
    set_apart_without_uvs(request, channel.channel, triangle_page);
    request.hashes = hashes_;
    request.triangles =
        std::make_shared<const mesh::PageTriangles>(std::span(triangle_page), request.pages.size());
    return request;
  }

  ImageSize sampled_size(const PageTexture& page) const {
    if (page.tile_set >= 0) return plan_.tile_sets[static_cast<std::size_t>(page.tile_set)].size;
    const io::ImageInfo& info = plan_.columns[static_cast<std::size_t>(page.column)].info;
    return {info.width, info.height};
  }

  void set_apart_without_uvs(GeometryRequest& request, Channel channel,
                             std::vector<std::uint32_t>& triangle_page) {
    std::size_t with = 0, without = 0;
    for (std::size_t t = 0; t < source_.triangles.size(); ++t) {
      std::uint32_t& page = triangle_page[t];
      const mesh::Lattice& lattice = request.pages[page];
      if (lattice.width == 0) continue;
      if (has_uvs(t, lattice.uv_set)) {
        ++with;
        continue;
      }
      page += static_cast<std::uint32_t>(source_.materials.size());
      ++without;
    }
    const bool needs_uvs = std::any_of(request.pages.begin(), request.pages.end(),
                                       [](const mesh::Lattice& page) { return page.width != 0; });
    if (with == 0 && needs_uvs) {
      throw Error(ErrorKind::input,
                  fmt::format("{}: has no UVs for its {} texture; unwrap the source first",
                              source_.path, name_of(channel)));
    }
    if (without > 0) {
      request.pages.resize(2 * source_.materials.size());
      plan_.warnings.push_back(fmt::format(
          "{}: {} triangles have no UVs for their {} texture and count as one plain colour",
          source_.path, without, name_of(channel)));
    }
  }

  const TransferOptions& options_;
  const mesh::Mesh& source_;
  const bool as_gaussians_;
  const std::shared_ptr<MeshHashes> hashes_ = std::make_shared<MeshHashes>(source_);
  ColourSpaces spaces_;
  SourceTextures textures_;
  std::vector<bool> used_;
  std::array<bool, kChannelCount + kEvidenceCount + kShapeCount> is_baked_{};
  const bool for_model_;
  Channel last_channel_ = Channel::base_color;  ///< of those that are chosen
  std::map<Channel, std::map<std::uint32_t, std::set<mesh::UvTile>>> middles_;
  SourcePlan plan_;
};

}  // namespace

bool ChannelPlan::is_tinted() const {
  return std::any_of(pages.begin(), pages.end(),
                     [](const PageTexture& page) { return page.tinted; });
}

bool SourcePlan::makes_normals() const {
  return std::any_of(channels.begin(), channels.end(),
                     [](const ChannelPlan& channel) { return channel.channel == Channel::normal; });
}

TangentPlan target_tangents(const TransferOptions& options, const mesh::Mesh& target) {
  const std::uint32_t uv_set = options.target_use.uv_set.value_or(0);
  TangentPlan plan;
  for (const mesh::Material& material : target.materials) {
    const auto& own = material.textures[static_cast<std::size_t>(Channel::normal)];
    plan.uv_sets.push_back(uv_set);
    plan.keeps_own.push_back((own ? own->uv_set : 0) == uv_set);
  }
  return plan;
}

SourcePlan plan_mesh(const TransferOptions& options, const mesh::Mesh& source, TexelsAs as,
                     bool for_model) {
  return SourcePlanner(options, source, as, for_model).make();
}

}  // namespace pounce::flow
