// SPDX-License-Identifier: Apache-2.0
//
// One channel of a source mesh: what its materials give to it, and what the output becomes.
//
// A material gives an image, a set of UDIM tiles or a constant, times its factor and the colours of
// vertices. The output must hold all of them at once: the most channels, the deepest samples, an
// alpha if any has one that means something, the colour space of the first. What cannot be held is
// thrown before any work; what is lost or converted on the way is told.
//
// The steps of make() follow from each other. First the pages, which add columns and tile sets to
// the plan. From these comes the look of the source: what all images together have. Factors, vertex
// colours and a configuration may raise it, grey to colour for instance. Then the output is chosen,
// and only then is it known how each page's samples get there.
//
// Pages come twice: once per material, and once more for its triangles without UVs, which get the
// constant (request_of_pages() in source.cpp).
#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>

#include "io/image/write.h"
#include "planning/mesh_planning.h"
#include "planning/name_patterns.h"
#include "planning/texture_meaning.h"

namespace pounce::planning {
namespace {

class ChannelPlanner {
 public:
  explicit ChannelPlanner(MeshPlanning& planning)
      : planning_(planning),
        options_(planning.options),
        source_(planning.source),
        plan_(planning.plan),
        spaces_(planning.spaces),
        images_(planning.images) {}

  ChannelPlan make(Channel channel) {
    ChannelPlan plan;
    plan.channel = channel;
    plan.baked = planning_.is_baked(channel);
    plan.name = planning_.name_of(channel);
    note_kind(channel);
    std::map<std::uint32_t, int> tile_sets;  // by image
    std::vector<PageTexture> without_uvs;
    // A factor that all materials of the source share goes into the model's materials. Then the
    // images must not show it, since renderers multiply the two.
    const auto common = common_factor(channel);
    if (common) plan.material_factor = *common;
    if (channel == Channel::emissive && planning_.is_told_apart(channel))
      plan.material_factor[3] = most_light();
    const bool applies_factors = options_.material.apply_factors && !common;
    for (std::size_t m = 0; m < source_.materials.size(); ++m) {
      plan.pages.push_back(page_texture(m, channel, applies_factors, tile_sets));
      without_uvs.emplace_back().constant = plan.pages[m].constant;
      without_uvs[m].tinted = planning_.is_tinted(channel);
    }
    plan.shows_alpha = channel == Channel::base_color && alpha_counts();
    if (planning_.for_model) note_factors(plan);
    const std::vector<const ColumnPlan*> images = images_of(plan_, plan);
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

 private:
  /// A primitive without this texture still hides what is behind it: its factor, as the image would
  /// hold it.
  shading::TexelValue constant(std::size_t material, Channel channel, bool applies_factors) const {
    // Flat: the surface's own normal.
    if (channel == Channel::normal) return {{0.5, 0.5, 1}, 3, false, false, false};
    if (is_shape(channel)) return {};
    if (!is_of_material(channel)) return {{0, 0, 0, 1}, 4, true, true, false};
    const mesh::Material& m = source_.materials[material];
    if (planning_.is_told_apart(channel)) {
      std::array<float, 4> own = merged_factor(m, channel);
      if (channel == Channel::emissive) {
        for (std::size_t c = 0; c < 3; ++c) own[c] *= own[3] / most_light();
        own[3] = 1;
      }
      return {{own[0], own[1], own[2], own[3]}, 4, is_colour(options_, channel), true, false};
    }
    const auto& f = m.factors[static_cast<std::size_t>(channel)];
    const float light = applies_factors && channel == Channel::emissive ? m.emissive_strength : 1;
    return {{f[0] * light, f[1] * light, f[2] * light, f[3]},
            4,
            is_colour(options_, channel),
            true,
            false};
  }

  /// The strength that materials which become one have, so that none of their light is clipped: 1
  /// where one has an image, which cannot be divided.
  float most_light() const {
    float most = 1;
    for (std::size_t m = 0; m < source_.materials.size(); ++m) {
      if (!planning_.used[m]) continue;
      if (images_.binding(m, Channel::emissive)) return 1;
      most = std::max(most, merged_factor(source_.materials[m], Channel::emissive)[3]);
    }
    return most;
  }

  /// Of a material whose own texture, or what stands for it, is sampled.
  std::optional<shading::Factor> factor(std::size_t material, Channel channel) const {
    const mesh::Material& m = source_.materials[material];
    if (!is_of_material(channel) || !m.textures[static_cast<std::size_t>(channel)])
      return std::nullopt;
    return texture_factor(m, channel);
  }

  /// What the material of a model may have instead of its images: what all that is seen has.
  std::optional<std::array<float, 4>> common_factor(Channel channel) const {
    if (!planning_.for_model || !is_of_material(channel) || channel == Channel::normal)
      return std::nullopt;
    std::optional<std::array<float, 4>> common;
    for (std::size_t m = 0; m < source_.materials.size(); ++m) {
      if (!planning_.used[m]) continue;
      if (!images_.binding(m, channel)) return std::nullopt;
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
    for (std::size_t m = 0; m < planning_.used.size(); ++m) {
      const auto binding = images_.binding(m, Channel::base_color);
      if (planning_.used[m] &&
          (!source_.materials[m].is_opaque || (binding && !images_.is_own(binding->image))))
        return true;
    }
    return false;
  }

  /// What a material gives to a channel.
  PageTexture page_texture(std::size_t material, Channel channel, bool applies_factors,
                           std::map<std::uint32_t, int>& tile_sets) {
    PageTexture page;
    page.constant = constant(material, channel, applies_factors);
    const auto binding =
        planning_.used[material] ? images_.binding(material, channel) : std::nullopt;
    // As factors are: what --source-texture gives to a material without texture is given as it is.
    page.tinted =
        planning_.is_tinted(channel) &&
        (!binding || source_.materials[material].textures[static_cast<std::size_t>(channel)]);
    if (!binding) return page;
    // By image: several materials may sample one set, which must be found, checked and warned of
    // once.
    const auto [set, is_new] = tile_sets.try_emplace(binding->image, -1);
    if (is_new) set->second = images_.tile_set_of(*binding, channel);
    page.tile_set = set->second;
    if (page.tile_set < 0) page.column = images_.column_of(*binding);
    if (channel == Channel::normal)
      page.normal_scale = source_.materials[material].factors[static_cast<std::size_t>(channel)][0];
    if (applies_factors) page.factor = factor(material, channel);
    return page;
  }

  /// A map whose name says neither colour nor data.
  void note_kind(Channel channel) {
    if (!is_other(channel)) return;
    const OtherMap& map = options_.channels.other_maps[other_index(channel)];
    if (map.is_colour || usually_colour(map.name)) return;
    plan_.notes.push_back(
        fmt::format("{}: treated as data (never converted); use --color {} if it is colour",
                    map.name, map.name));
  }

  void note_factors(const ChannelPlan& plan) {
    const auto has_factor = [](const PageTexture& page) { return page.factor.has_value(); };
    if (std::none_of(plan.pages.begin(), plan.pages.end(), has_factor)) return;
    plan_.notes.push_back(
        fmt::format("{}: its materials have different {} factors, but a model's material has only "
                    "one: they are multiplied into the images",
                    source_.path, plan.name));
  }

  /// What options say that holds without them.
  void note_said_anyway(const std::vector<const ColumnPlan*>& images, ChannelPlan& plan) const {
    const bool same_spaces = std::all_of(
        images.begin(), images.end(),
        [&](const ColumnPlan* image) { return spaces_.said_anyway(plan.channel, *image); });
    if (same_spaces) plan.said_anyway.emplace_back("source-colorspace");
    bool same_uvs = true;
    for (std::size_t m = 0; m < source_.materials.size(); ++m)
      same_uvs = same_uvs && (!planning_.used[m] || images_.is_usual_uv_set(m, plan.channel));
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
                  fmt::format("{}: has {} channel{}, but a normal map has three; convert a height "
                              "map to a normal map first",
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
                  fmt::format("{}{} has no texture that determines the image size; specify --size",
                              plan.baked ? "--bake: " : "", source_.path));
    }
    return largest;
  }

  /// What a page's samples mean, and its constant, which is a factor of the material: linear light
  /// of sRGB's primaries.
  void give_space(const ChannelPlan& plan, PageTexture& page) {
    if (const auto input = colour_input({kRec709, true}, true, plan)) {
      // A constant that vertices tint can be converted only when a vertex's colour is known.
      if (page.tinted) {
        page.input = *input;
      } else {
        shading::apply(*input, page.constant);
      }
    }
    if (page.column >= 0) page.input = input_of(plan, static_cast<std::size_t>(page.column));
    if (page.tile_set < 0) return;
    TileSetPlan& set = plan_.tile_sets[static_cast<std::size_t>(page.tile_set)];
    for (const auto& [tile, column] : set.columns) {
      if (const auto input = input_of(plan, column)) set.inputs[tile] = *input;
    }
  }

  std::optional<shading::ColourInput> input_of(const ChannelPlan& plan, std::size_t column) {
    const ColumnPlan& c = plan_.columns[column];
    // Nothing happens to the texels between reading and writing.
    const bool plain = !planning_.as_gaussians &&
                       std::none_of(plan.pages.begin(), plan.pages.end(),
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
    const bool has_constants = planning_.is_told_apart(plan.channel);
    for (std::size_t m = 0; has_constants && m < source_.materials.size(); ++m) {
      const PageTexture& page = plan.pages[m];
      if (!planning_.used[m] || page.column >= 0 || page.tile_set >= 0) continue;
      take_three(look);
      const bool fades = plan.shows_alpha && !source_.materials[m].is_opaque;
      has_opacity = has_opacity || (fades && page.constant.v[3] < 1);
    }
    if (has_opacity && !look.alpha) take_opacity("the materials' opacity", plan, look);
  }

  /// The same of the vertices' colours.
  void take_colours(const ChannelPlan& plan, SourceLook& look) {
    if (!plan.is_tinted() && plan.channel != Channel::vertex_color) return;
    take_three(look);
    const bool has_opacity = std::any_of(source_.colours.begin(), source_.colours.end(),
                                         [](const Vec4f& c) { return c.w != 1; });
    if (has_opacity && !look.alpha) take_opacity("the vertices' opacity", plan, look);
    if (!plan.is_tinted()) return;
    plan_.notes.push_back(fmt::format(
        "{}: its vertex colours are multiplied into {} (--factors {} disables this)", source_.path,
        plan.name, options_.material.apply_factors ? "factors" : "textures"));
  }

  void take_opacity(const char* what, const ChannelPlan& plan, SourceLook& look) {
    const std::string& output = output_of(options_, plan.channel);
    const Depth depth = io::writable_depth(output, look.depth);
    // An opacity is a wish of the material, not of the user: a JPEG is written without it, with a
    // warning.
    const std::string why = io::why_not_writable(output, {1, 1, 4, depth, look.linear, true});
    look.alpha = why.empty() && look.colours < 4;
    if (!look.alpha) {
      plan_.warnings.push_back(
          fmt::format("{}: {} is left out: {}", plan.name, what,
                      why.empty() ? "the source's images already have four channels" : why));
    }
  }

  SourceLook look_of(Channel channel, const std::vector<const ColumnPlan*>& images) {
    SourceLook look;
    look.colours = 1;
    // True until an image with alpha says otherwise: one straight image makes the whole channel
    // straight.
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
        plan_.warnings.push_back(
            fmt::format("{}: the channels of {} are {}, but those of {} are {}; the output has the "
                        "default names",
                        planning_.name_of(channel), first->image.label, io::joined(look.names),
                        image->image.label, io::joined(names)));
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
            fmt::format("{}: {}; its colours are read as {}; convert the image, or specify its "
                        "colour space with --source-colorspace",
                        image->image.label, problem, colour_space_name(space)));
      }
      const bool is_said = !same_primaries(space.primaries, kRec709) ||
                           (image->heeds_tags && image->info.colours.primaries);
      if (image == images.front() && is_said) look.chromaticities = space.primaries;
      if (same_primaries(space.primaries, look.chromaticities.value_or(kRec709))) continue;
      plan_.notes.push_back(fmt::format("{}: {} is converted from {} to the colour space of {}",
                                        planning_.name_of(channel), image->image.label,
                                        colour_space_name(space), images.front()->image.label));
    }
  }

  MeshPlanning& planning_;
  const TransferOptions& options_;
  const mesh::Mesh& source_;
  SourcePlan& plan_;
  ColourSpaces& spaces_;
  SourceImages& images_;
};

}  // namespace

ChannelPlan plan_channel(MeshPlanning& planning, Channel channel) {
  return ChannelPlanner(planning).make(channel);
}

std::vector<const ColumnPlan*> images_of(const SourcePlan& plan, const ChannelPlan& channel) {
  std::set<std::size_t> columns;
  for (const PageTexture& page : channel.pages) {
    if (page.column >= 0) columns.insert(static_cast<std::size_t>(page.column));
    if (page.tile_set < 0) continue;
    for (const auto& [tile, column] :
         plan.tile_sets[static_cast<std::size_t>(page.tile_set)].columns)
      columns.insert(column);
  }
  std::vector<const ColumnPlan*> images;
  for (const std::size_t column : columns) images.push_back(&plan.columns[column]);
  return images;
}

bool ChannelPlan::is_tinted() const {
  return std::any_of(pages.begin(), pages.end(),
                     [](const PageTexture& page) { return page.tinted; });
}

}  // namespace pounce::planning
