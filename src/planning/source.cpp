// SPDX-License-Identifier: Apache-2.0
//
// The source's side of a plan where the source is a mesh: which channels there are, and which of
// them are searched together.
//
// Channels are planned one by one (mesh_channel.cpp). What an option names must be there; of what
// is only meant by "all", whatever is missing or damaged is left out with a warning.
//
// Channels whose outputs have one size, and whose textures lie on the source in the same way (UV
// sets and transforms), share one pass: one search finds where each texel's ray meets the surface,
// and every image is looked up there. Their images may differ in size. A pass then sees the source
// on the lattice of the largest; in smaller images the same place is found in proportion.
//
// A pass costs a search per texel, a channel in it a lookup. A geometry store belongs to a pass as
// well, so passes that are joined also save a store. What does not matter for joining: constants,
// which have no place on the surface, and the sizes of source images.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "io/files/asset_file.h"
#include "planning/known_map.h"
#include "planning/mesh_planning.h"
#include "planning/name_patterns.h"
#include "planning/texture_meaning.h"
#include "projection/hit_block.h"

namespace pounce::planning {
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

class SourcePlanner {
 public:
  SourcePlanner(const TransferOptions& options, const mesh::Mesh& source, TexelsAs as,
                bool for_model, bool merges)
      : planning_(options, source, as, for_model, merges),
        options_(options),
        source_(source),
        plan_(planning_.plan) {}

  SourcePlan make() {
    if (source_.triangles.empty())
      throw Error(ErrorKind::input, source_.path + ": has no triangles");
    if (!has_surface(source_)) {
      throw Error(
          ErrorKind::input,
          fmt::format(
              "{}: all of its {} triangles are degenerate (no area); export the model again",
              source_.path, source_.triangles.size()));
    }
    // A channel that was asked for must succeed. One that is only part of "all" may fail alone.
    const std::vector<Channel> chosen = chosen_channels();
    for (const Channel channel : chosen) {
      if (is_asked_for(channel)) {
        add_channel(channel);
      } else {
        try_channel(channel);
      }
    }
    if (!options_.image.map_output.empty()) add_map();
    for (PassPlan& pass : plan_.passes) {
      // Each texel is a Gaussian; or the shape is what is transferred.
      pass.source.exact = planning_.as_gaussians || pass.has_shape;
      pass.keeps_hits = !pass.source.exact;
      pass.keeps_results = planning_.as_gaussians;
      pass.source.colours = needs_colours(pass);
    }
    plan_tangents();
    warn_of_directions();
    planning_.spaces.finish(plan_);
    return std::move(plan_);
  }

 private:
  /// Those of the source's vertices, if it has any.
  bool needs_colours(const PassPlan& pass) const {
    return !source_.colours.empty() &&
           std::any_of(pass.channels.begin(), pass.channels.end(), [&](std::size_t c) {
             const ChannelPlan& channel = plan_.channels[c];
             return channel.is_tinted() || channel.channel == Channel::vertex_color;
           });
  }

  /// Tangents matter where a material's normal map is read.
  void plan_tangents() {
    // Tangents split vertices (docs/decisions/031-normals.md), which would change the keys of
    // stores. So only a job that reads a normal map has them.
    for (const ChannelPlan& channel : plan_.channels) {
      if (channel.channel != Channel::normal || images_of(plan_, channel).empty()) continue;
      TangentPlan& tangents = plan_.tangents.emplace();
      for (std::size_t m = 0; m < source_.materials.size(); ++m) {
        const auto binding = planning_.images.binding(m, Channel::normal);
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
    plan_.warnings.push_back(fmt::format("{}: no normal map is written; remove this option",
                                         source ? "--normal-y" : "--output-normal-y"));
  }

  bool source_has(Channel channel) const {
    if (planning_.is_tinted(channel) || planning_.is_told_apart(channel)) return true;
    for (std::size_t m = 0; m < planning_.used.size(); ++m) {
      if (planning_.used[m] && planning_.images.binding(m, channel)) return true;
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
    return !takes_all() || channel == Channel::base_color || planning_.is_baked(channel) ||
           std::any_of(given.begin(), given.end(),
                       [&](const SourceTexture& texture) { return texture.channel == channel; });
  }

  /// Of all that the source has, what is missing, damaged or of no use is left out. A file that is
  /// there and that the system does not let us read ends the job: the next run would give more.
  void try_channel(Channel channel) {
    // The plan must then be as if the channel had never been tried.
    const std::size_t columns = plan_.columns.size(), tile_sets = plan_.tile_sets.size(),
                      warnings = plan_.warnings.size(), notes = plan_.notes.size();
    try {
      add_channel(channel);
    } catch (const Error& error) {
      const bool is_last = channel == last_channel_ && plan_.channels.empty();
      const bool is_missing = dynamic_cast<const io::MissingFile*>(&error) != nullptr;
      if (is_last || (error.kind() != ErrorKind::input && !is_missing)) throw;
      plan_.columns.erase(plan_.columns.begin() + static_cast<std::ptrdiff_t>(columns),
                          plan_.columns.end());
      plan_.tile_sets.erase(plan_.tile_sets.begin() + static_cast<std::ptrdiff_t>(tile_sets),
                            plan_.tile_sets.end());
      plan_.warnings.resize(warnings);
      plan_.notes.resize(notes);
      plan_.warnings.push_back(
          fmt::format("{}: {} is left out: {}; with --channels {} this is an error", source_.path,
                      planning_.name_of(channel), error.what(), planning_.name_of(channel)));
    }
  }

  void add_channel(Channel channel) {
    ChannelPlan plan = plan_channel(planning_, channel);
    surface::GeometryRequest source = source_request(plan);
    const std::size_t c = plan_.channels.size();
    const bool needs_surface = plan.has_shape() || (plan.is_tinted() && !planning_.as_gaussians);
    // The first pass that fits. With the finer lattice of both it still fits all its channels.
    const auto same =
        std::find_if(plan_.passes.begin(), plan_.passes.end(), [&](const PassPlan& pass) {
          return pass.size == plan.size && lie_alike(pass.source.pages, source.pages);
        });
    if (same != plan_.passes.end()) {
      same->channels.push_back(c);
      same->has_shape = same->has_shape || needs_surface;
      same->source = united(same->source, source);
    } else {
      plan_.passes.push_back({std::move(source), plan.size, {c}, needs_surface});
    }
    plan_.channels.push_back(std::move(plan));
  }

  /// Where the texels of all channels hit the source: of the one search that finds it.
  void add_map() {
    if (plan_.passes.size() > 1) {
      throw Error(ErrorKind::usage,
                  fmt::format("--map {}: these channels need {} searches, because their images "
                              "differ in size or in UV sets, and a map shows one; give --size, or "
                              "fewer --channels",
                              options_.image.map_output, plan_.passes.size()));
    }
    // No image is sampled, so every page is a constant. The names are those of the EXR's channels.
    PassPlan& pass = plan_.passes.front();
    ChannelPlan map;
    map.channel = Channel::hits;
    map.name = channel_name(Channel::hits);
    map.size = pass.size;
    map.format = {static_cast<std::uint32_t>(projection::kHitMapNames.size()), Depth::float32, true,
                  false};
    for (const char* name : projection::kHitMapNames) map.names.emplace_back(name);
    map.pages.resize(2 * source_.materials.size());
    map.hits_note = map_note(planning_, pass);
    pass.channels.push_back(plan_.channels.size());
    pass.has_map = true;
    plan_.channels.push_back(std::move(map));
  }

  /// Where every channel is meant, but not by name.
  void warn_of_one_channel() {
    std::string others;
    for (int c = 1; c < kChannelCount; ++c) {
      const auto channel = static_cast<Channel>(c);
      if (source_has(channel)) others += fmt::format(", {}", planning_.name_of(channel));
    }
    if (others.empty()) return;
    plan_.warnings.push_back(
        fmt::format("{}: --method gaussian transfers only baseColor; left out: {}", source_.path,
                    others.substr(2)));
  }

  /// Why there may be no textures: " (its material file ... is not there)".
  std::string missing_files() const {
    if (source_.unread_files.empty()) return "";
    const mesh::UnreadFile& file = source_.unread_files.front();
    return fmt::format(" (its material file {} {})", file.path, file.cure);
  }

  std::vector<Channel> chosen_channels() {
    const bool all = takes_all() && !planning_.as_gaussians;
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
    // Each once, in the order in which they were requested; channels are planned in that order.
    std::vector<Channel> distinct;
    for (const Channel c : chosen) {
      if (std::find(distinct.begin(), distinct.end(), c) == distinct.end()) distinct.push_back(c);
    }
    for (const Channel c : distinct) {
      if (!source_has(c) && !planning_.is_baked(c)) {
        throw Error(
            ErrorKind::input,
            fmt::format(
                "{}: no material has {} {} texture{}; specify one with --source-texture {}=FILE{}",
                source_.path, article(c), planning_.name_of(c), missing_files(),
                planning_.name_of(c),
                c == Channel::normal ? ", or create it from the geometry with --bake normal" : ""));
      }
    }
    if (planning_.is_baked(Channel::vertex_color) && source_.colours.empty()) {
      throw Error(ErrorKind::input,
                  fmt::format("{}: --bake vertexColor: its vertices {}", source_.path,
                              source_.has_vertex_colours ? "are all white, or all black"
                                                         : "have no colours"));
    }
    for (const Channel c : options_.channels.baked) {  // last: images of others may give their size
      if (std::find(distinct.begin(), distinct.end(), c) == distinct.end()) distinct.push_back(c);
    }
    if (distinct.empty()) {
      throw Error(
          ErrorKind::input,
          fmt::format("{}: has no textures{}; specify one with --source-texture baseColor=FILE",
                      source_.path, missing_files()));
    }
    last_channel_ = distinct.back();
    return distinct;
  }

  /// May one search serve two channels that see the source through these lattices? Wherever both
  /// have images, these must lie on the surface in the same way.
  bool lie_alike(const std::vector<mesh::Lattice>& a, const std::vector<mesh::Lattice>& b) const {
    for (std::size_t m = 0; m < source_.materials.size(); ++m) {
      // Without an image there is nothing to lie differently.
      if (a[m].width == 0 || b[m].width == 0) continue;
      if (a[m].uv_set != b[m].uv_set || !(a[m].transform == b[m].transform)) return false;
    }
    return true;
  }

  /// The source as both channels see it, on the finer lattice of the two for each material.
  surface::GeometryRequest united(const surface::GeometryRequest& a,
                                  const surface::GeometryRequest& b) const {
    std::vector<mesh::Lattice> pages(
        a.pages.begin(), a.pages.begin() + static_cast<std::ptrdiff_t>(source_.materials.size()));
    for (std::size_t m = 0; m < pages.size(); ++m) {
      const mesh::Lattice& other = b.pages[m];
      if (pages[m].width == 0) {
        pages[m] = other;
      } else {
        pages[m].width = std::max(pages[m].width, other.width);
        pages[m].height = std::max(pages[m].height, other.height);
      }
    }
    const bool is_same = std::equal(pages.begin(), pages.end(), a.pages.begin());
    return is_same ? a : request_of_pages(std::move(pages));
  }

  /// How this channel sees the source: a lattice per material.
  surface::GeometryRequest source_request(const ChannelPlan& channel) {
    std::vector<mesh::Lattice> pages;
    for (std::size_t m = 0; m < source_.materials.size(); ++m) {
      mesh::Lattice lattice;
      const PageTexture& page = channel.pages[m];
      if (page.column >= 0 || page.tile_set >= 0) {
        const auto binding = *planning_.images.binding(m, channel.channel);
        const ImageSize size = sampled_size(plan_, page);
        lattice = {size.width, size.height, binding.uv_set, binding.transform};
      }
      pages.push_back(lattice);
    }
    check_uvs(pages, channel.channel);
    return request_of_pages(std::move(pages));
  }

  /// The source's triangles by material. What has a texture there but not the UVs for it is set
  /// apart, in as many pages again: it is constant, as if it had no texture.
  surface::GeometryRequest request_of_pages(std::vector<mesh::Lattice> pages) const {
    // Such triangles still occlude, so they cannot be left out of the store. On a page without a
    // lattice they have no texel coordinates, and whatever hits them gets the constant.
    std::vector<std::uint32_t> triangle_page = source_.triangle_material;
    bool any_apart = false;
    for (std::size_t t = 0; t < triangle_page.size(); ++t) {
      if (!lacks_uvs(t, pages)) continue;
      triangle_page[t] += static_cast<std::uint32_t>(source_.materials.size());
      any_apart = true;
    }
    if (any_apart) pages.resize(2 * source_.materials.size());
    surface::GeometryRequest request;
    request.mesh = &source_;
    request.hashes = hashes_;
    request.triangles =
        std::make_shared<const mesh::PageTriangles>(std::span(triangle_page), pages.size());
    request.pages = std::move(pages);
    return request;
  }

  bool lacks_uvs(std::size_t triangle, const std::vector<mesh::Lattice>& pages) const {
    const mesh::Lattice& lattice = pages[source_.triangle_material[triangle]];
    return lattice.width != 0 && !planning_.images.has_uvs(triangle, lattice.uv_set);
  }

  void check_uvs(const std::vector<mesh::Lattice>& pages, Channel channel) {
    std::size_t with = 0, without = 0;
    for (std::size_t t = 0; t < source_.triangles.size(); ++t) {
      if (pages[source_.triangle_material[t]].width == 0) continue;
      ++(lacks_uvs(t, pages) ? without : with);
    }
    const bool needs_uvs = std::any_of(pages.begin(), pages.end(),
                                       [](const mesh::Lattice& page) { return page.width != 0; });
    if (with == 0 && needs_uvs) {
      throw Error(ErrorKind::input,
                  fmt::format("{}: has no UVs for its {} texture; unwrap the source first",
                              source_.path, planning_.name_of(channel)));
    }
    if (without > 0) {
      plan_.warnings.push_back(
          fmt::format("{}: {} triangles have no UVs for their {} texture and get one plain colour",
                      source_.path, without, planning_.name_of(channel)));
    }
  }

  MeshPlanning planning_;
  const TransferOptions& options_;
  const mesh::Mesh& source_;
  SourcePlan& plan_;
  const std::shared_ptr<surface::MeshHashes> hashes_ =
      std::make_shared<surface::MeshHashes>(source_);
  Channel last_channel_ = Channel::base_color;  ///< of those that are chosen
};

}  // namespace

MeshPlanning::MeshPlanning(const TransferOptions& of_options, const mesh::Mesh& of_source,
                           TexelsAs as, bool into_model, bool merges_materials)
    : options(of_options),
      source(of_source),
      as_gaussians(as == TexelsAs::gaussians),
      for_model(into_model),
      merges(merges_materials),
      spaces(of_options, into_model),
      images(of_options, of_source, plan),
      used(used_materials(of_source)) {}

bool MeshPlanning::is_told_apart(Channel channel) const {
  if (!merges || !options.material.apply_factors) return false;
  // Of the others an image says more than a constant could.
  if (channel != Channel::base_color && channel != Channel::metallic_roughness &&
      channel != Channel::emissive)
    return false;
  std::optional<std::array<float, 4>> first;
  for (std::size_t m = 0; m < used.size(); ++m) {
    if (!used[m]) continue;
    const std::array<float, 4> own = merged_factor(source.materials[m], channel);
    if (first && *first != own) return true;
    first = own;
  }
  return false;
}

bool MeshPlanning::is_baked(Channel channel) const {
  const std::vector<Channel>& baked = options.channels.baked;
  return std::find(baked.begin(), baked.end(), channel) != baked.end();
}

bool MeshPlanning::is_tinted(Channel channel) const {
  return channel == Channel::base_color && options.material.apply_vertex_colours &&
         !source.colours.empty();
}

bool SourcePlan::makes_normals() const {
  return std::any_of(channels.begin(), channels.end(),
                     [](const ChannelPlan& channel) { return channel.channel == Channel::normal; });
}

ImageSize sampled_size(const SourcePlan& plan, const PageTexture& page) {
  if (page.tile_set >= 0) return plan.tile_sets[static_cast<std::size_t>(page.tile_set)].size;
  if (page.column < 0) return {};
  const io::ImageInfo& info = plan.columns[static_cast<std::size_t>(page.column)].info;
  return {info.width, info.height};
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
                     bool for_model, bool merges) {
  return SourcePlanner(options, source, as, for_model, merges).make();
}

}  // namespace pounce::planning
