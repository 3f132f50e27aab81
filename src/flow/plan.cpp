// SPDX-License-Identifier: Apache-2.0
#include "flow/plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "core/box.h"
#include "flow/output_names.h"
#include "io/image_write.h"

namespace pounce::flow {
namespace {

constexpr std::uint32_t kLargestSide = 65536;
constexpr std::uint32_t kUntexturedSize = 1024;
constexpr std::uint32_t kPaddingShare = 128;

/// The file name without folder and ending.
std::string stem(const std::string& path) { return std::filesystem::path(path).stem().string(); }

bool is_exr(const std::string& path) {
  std::string ending = std::filesystem::path(path).extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(), [](char c) {
    return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  });
  return ending == ".exr";
}

bool is_colour(Channel channel) {
  return channel == Channel::base_color || channel == Channel::emissive;
}

/// Materials that triangles really use.
std::vector<bool> used_materials(const mesh::Mesh& mesh) {
  std::vector<bool> used(mesh.materials.size());
  for (const std::uint32_t m : mesh.triangle_material) used[m] = true;
  return used;
}

/// The texture of a material in a channel, with --source-texture applied.
class SourceTextures {
 public:
  SourceTextures(const TransferOptions& options, const mesh::Mesh& source)
      : mesh_(source), images_(source.images) {
    for (const SourceTexture& given : options.source_textures) {
      const auto c = static_cast<std::size_t>(given.channel);
      if (override_[c] >= 0) {
        throw Error(
            ErrorKind::usage,
            fmt::format("two source textures for {}: {} and {}", channel_name(given.channel),
                        images_[static_cast<std::size_t>(override_[c])].path, given.path));
      }
      mesh::ImageRef image;
      image.path = given.path;
      image.label = given.path;
      override_[c] = static_cast<int>(images_.size());
      images_.push_back(image);
    }
  }

  std::optional<mesh::TextureBinding> binding(std::size_t material, Channel channel) const {
    const auto c = static_cast<std::size_t>(channel);
    std::optional<mesh::TextureBinding> found = mesh_.materials[material].textures[c];
    if (override_[c] >= 0) {
      if (!found) found.emplace();
      found->image = static_cast<std::uint32_t>(override_[c]);
    }
    return found;
  }
  const mesh::ImageRef& image(std::uint32_t index) const { return images_[index]; }

 private:
  const mesh::Mesh& mesh_;
  std::vector<mesh::ImageRef> images_;
  std::array<int, kChannelCount> override_{-1, -1, -1, -1};
};

class Planner {
 public:
  Planner(const TransferOptions& options, const mesh::Mesh& source, const mesh::Mesh& target)
      : options_(options),
        source_(source),
        target_(target),
        textures_(options, source),
        used_(used_materials(source)) {}

  Plan make() {
    if (source_.triangles.empty())
      throw Error(ErrorKind::input, source_.path + ": has no triangles");
    const double diag = diagonal(target_);
    plan_.max_distance = static_cast<float>(options_.max_distance.is_percent
                                                ? options_.max_distance.value / 100 * diag
                                                : options_.max_distance.value);
    plan_.smallest_edge = static_cast<float>(std::max(diag * 1e-7, 1e-30));
    pages_ = target_pages(target_, has_token(options_.output, "MATERIAL"), plan_.warnings);
    for (const Channel channel : chosen_channels()) plan_.channels.push_back(plan_channel(channel));
    name_outputs();
    group_passes();
    return std::move(plan_);
  }

 private:
  bool source_has(Channel channel) const {
    for (std::size_t m = 0; m < used_.size(); ++m) {
      if (used_[m] && textures_.binding(m, channel)) return true;
    }
    return false;
  }

  std::vector<Channel> chosen_channels() {
    const bool all = options_.all_channels ||
                     (options_.channels.empty() && has_token(options_.output, "CHANNEL"));
    std::vector<Channel> chosen = options_.channels;
    if (!all && chosen.empty()) chosen = {Channel::base_color};
    if (all) {
      for (int c = 0; c < kChannelCount; ++c) {
        if (source_has(static_cast<Channel>(c))) chosen.push_back(static_cast<Channel>(c));
      }
    }
    std::vector<Channel> distinct;
    for (const Channel c : chosen) {
      if (std::find(distinct.begin(), distinct.end(), c) == distinct.end()) distinct.push_back(c);
    }
    for (const Channel c : distinct) {
      if (!source_has(c)) {
        throw Error(ErrorKind::input,
                    fmt::format("{}: no material has a {} texture; give one with --source-texture "
                                "{}=FILE",
                                source_.path, channel_name(c), channel_name(c)));
      }
    }
    if (distinct.empty()) {
      throw Error(
          ErrorKind::input,
          source_.path + ": has no textures; give one with --source-texture baseColor=FILE");
    }
    return distinct;
  }

  int column_for(const mesh::TextureBinding& binding) {
    const mesh::ImageRef& image = textures_.image(binding.image);
    for (std::size_t i = 0; i < plan_.columns.size(); ++i) {
      const ColumnPlan& c = plan_.columns[i];
      if (column_image_[i] == binding.image && c.wrap_u == binding.wrap_u &&
          c.wrap_v == binding.wrap_v) {
        return static_cast<int>(i);
      }
    }
    if (!image.problem.empty()) throw Error(ErrorKind::input, image.label + ": " + image.problem);
    plan_.columns.push_back({image, binding.wrap_u, binding.wrap_v, io::ImageReader(image).info()});
    column_image_.push_back(binding.image);
    return static_cast<int>(plan_.columns.size() - 1);
  }

  /// A primitive without this texture still hides what is behind it: its factor, as the image would
  /// hold it.
  texture::TexelValue constant(std::size_t material, Channel channel) const {
    const auto& f = source_.materials[material].factors[static_cast<std::size_t>(channel)];
    return {{f[0], f[1], f[2], f[3]}, 4, is_colour(channel)};
  }

  ChannelPlan plan_channel(Channel channel) {
    ChannelPlan plan;
    plan.channel = channel;
    bool gray_only = true, alpha = false, linear = false;
    Depth depth = Depth::u8;
    for (std::size_t m = 0; m < source_.materials.size(); ++m) {
      const auto binding = used_[m] ? textures_.binding(m, channel) : std::nullopt;
      plan.page_column.push_back(binding ? column_for(*binding) : -1);
      plan.page_constant.push_back(constant(m, channel));
      if (!binding) continue;
      const io::ImageInfo& info =
          plan_.columns[static_cast<std::size_t>(plan.page_column.back())].info;
      plan.size.width = std::max(plan.size.width, info.width);
      plan.size.height = std::max(plan.size.height, info.height);
      gray_only = gray_only && info.channels <= 2;
      alpha = alpha || info.has_alpha;
      linear = linear || info.linear;
      depth = std::max(depth, info.depth);
    }
    plan.page_column.resize(2 * source_.materials.size(), -1);
    for (std::size_t m = 0; m < source_.materials.size(); ++m) {
      plan.page_constant.push_back(plan.page_constant[m]);
    }
    if (options_.size) plan.size = *options_.size;
    if (plan.size.width == 0) plan.size = {kUntexturedSize, kUntexturedSize};
    if (plan.size.width > kLargestSide || plan.size.height > kLargestSide) {
      throw Error(ErrorKind::usage, fmt::format("--size {}x{}: at most {} texels a side",
                                                plan.size.width, plan.size.height, kLargestSide));
    }
    plan.format.channels = (gray_only ? 1U : 3U) + (alpha ? 1U : 0U);
    plan.format.has_alpha = alpha;
    plan.format.is_colour = is_colour(channel);
    const Depth wanted = options_.depth ? *options_.depth : depth;
    plan.format.depth = options_.depth ? wanted : io::writable_depth(options_.output, wanted);
    // EXR is linear; float TIFF keeps linear input linear; everything else is sRGB-coded.
    const bool float_out = plan.format.depth == Depth::half || plan.format.depth == Depth::float32;
    plan.format.linear = is_exr(options_.output) || (float_out && linear);
    const io::ImageWriteSpec spec{plan.size.width,   plan.size.height,   plan.format.channels,
                                  plan.format.depth, plan.format.linear, plan.format.has_alpha};
    if (const std::string why = io::why_not_writable(options_.output, spec); !why.empty()) {
      throw Error(ErrorKind::usage, options_.output + ": " + why);
    }
    return plan;
  }

  void name_outputs() {
    std::vector<std::string> paths;
    for (std::size_t c = 0; c < plan_.channels.size(); ++c) {
      ChannelPlan& channel = plan_.channels[c];
      for (std::size_t p = 0; p < pages_.names.size(); ++p) {
        const std::map<std::string, std::string> values{
            {"CHANNEL", channel_name(channel.channel)},
            {"MATERIAL", file_name_part(pages_.names[p])},
            {"TARGET", stem(options_.target)}};
        ImageOutput image;
        image.path = expand_pattern(options_.output, values);
        paths.push_back(image.path);
        // Without <CHANNEL> one mask stands for all channels: that of the first.
        if (!options_.coverage_output.empty() &&
            (c == 0 || has_token(options_.coverage_output, "CHANNEL"))) {
          image.coverage_path = expand_pattern(options_.coverage_output, values);
          const io::ImageWriteSpec mask{channel.size.width,
                                        channel.size.height,
                                        1,
                                        io::writable_depth(image.coverage_path, Depth::u8),
                                        false,
                                        false};
          if (const std::string why = io::why_not_writable(image.coverage_path, mask);
              !why.empty()) {
            throw Error(ErrorKind::usage, image.coverage_path + ": " + why);
          }
          paths.push_back(image.coverage_path);
        }
        image.lattice = {channel.size.width, channel.size.height, 0, {}};
        image.padding = options_.padding_px.value_or(
            std::max(channel.size.width, channel.size.height) / kPaddingShare);
        image.stripe_rows = options_.internal.stripe_rows;
        channel.images.push_back(image);
      }
    }
    check_outputs(paths);
    check_inputs_survive(paths);
    plan_.outputs = paths;
  }

  /// The source and what it is made of are never written over; the target's own textures may be.
  void check_inputs_survive(const std::vector<std::string>& outputs) const {
    std::vector<std::string> inputs{options_.source, options_.target};
    for (const ColumnPlan& column : plan_.columns) inputs.push_back(column.image.path);
    for (const std::string& output : outputs) {
      for (const std::string& input : inputs) {
        std::error_code ignored;
        if (!input.empty() && std::filesystem::equivalent(output, input, ignored)) {
          throw Error(ErrorKind::usage,
                      fmt::format("{}: is also an input; write to another file", output));
        }
      }
    }
  }

  /// How this channel sees the source: a lattice per material.
  GeometryRequest source_request(const ChannelPlan& channel) {
    GeometryRequest request;
    request.mesh = &source_;
    for (std::size_t m = 0; m < source_.materials.size(); ++m) {
      mesh::Lattice lattice;
      if (channel.page_column[m] >= 0) {
        const auto binding = *textures_.binding(m, channel.channel);
        const io::ImageInfo& info =
            plan_.columns[static_cast<std::size_t>(channel.page_column[m])].info;
        lattice = {info.width, info.height, binding.uv_set, binding.transform};
      }
      request.pages.push_back(lattice);
    }
    // What has the texture but not the UVs for it is constant, as if it had no texture.
    request.triangle_page = source_.triangle_material;
    set_apart_without_uvs(request, channel.channel);
    return request;
  }

  void set_apart_without_uvs(GeometryRequest& request, Channel channel) {
    std::size_t with = 0, without = 0;
    for (std::size_t t = 0; t < source_.triangles.size(); ++t) {
      std::uint32_t& page = request.triangle_page[t];
      const mesh::Lattice& lattice = request.pages[page];
      if (lattice.width == 0) continue;
      const auto& corners = source_.triangles[t];
      if (std::all_of(corners.begin(), corners.end(),
                      [&](std::uint32_t v) { return source_.has_uv(lattice.uv_set, v); })) {
        ++with;
        continue;
      }
      page += static_cast<std::uint32_t>(source_.materials.size());
      ++without;
    }
    if (with == 0) {
      throw Error(ErrorKind::input,
                  fmt::format("{}: has no UVs for its {} texture; unwrap the source first",
                              source_.path, channel_name(channel)));
    }
    if (without > 0) {
      request.pages.resize(2 * source_.materials.size());
      plan_.warnings.push_back(fmt::format(
          "{}: {} triangles have no UVs for their {} texture and count as one plain colour",
          source_.path, without, channel_name(channel)));
    }
  }

  void group_passes() {
    for (std::size_t c = 0; c < plan_.channels.size(); ++c) {
      GeometryRequest source = source_request(plan_.channels[c]);
      const ImageSize size = plan_.channels[c].size;
      const auto same =
          std::find_if(plan_.passes.begin(), plan_.passes.end(), [&](const PassPlan& pass) {
            return plan_.channels[pass.channels.front()].size == size &&
                   pass.source.pages == source.pages;
          });
      if (same != plan_.passes.end()) {
        same->channels.push_back(c);
        continue;
      }
      PassPlan pass;
      pass.source = std::move(source);
      pass.target.mesh = &target_;
      pass.target.is_target = true;
      pass.target.pages.assign(pages_.names.size(), mesh::Lattice{size.width, size.height, 0, {}});
      pass.target.triangle_page = pages_.triangle_page;
      pass.channels = {c};
      plan_.passes.push_back(std::move(pass));
    }
  }

  const TransferOptions& options_;
  const mesh::Mesh& source_;
  const mesh::Mesh& target_;
  SourceTextures textures_;
  std::vector<bool> used_;
  TargetPages pages_;
  std::vector<std::uint32_t> column_image_;
  Plan plan_;
};

}  // namespace

Plan make_plan(const TransferOptions& options, const mesh::Mesh& source, const mesh::Mesh& target) {
  return Planner(options, source, target).make();
}

double diagonal(const mesh::Mesh& mesh) {
  Box3f box;
  for (const auto& triangle : mesh.triangles) {
    for (const std::uint32_t v : triangle) box.extend(mesh.positions[v]);
  }
  return box.empty() ? 0 : length(Vec3d(box.hi) - Vec3d(box.lo));
}

TargetPages target_pages(const mesh::Mesh& target, bool by_material,
                         std::vector<std::string>& warnings) {
  TargetPages pages;
  if (target.triangles.empty()) throw Error(ErrorKind::input, target.path + ": has no triangles");
  if (!by_material) pages.names = {"default"};
  std::map<std::uint32_t, std::uint32_t> page_of;
  std::uint64_t without = 0, outside = 0;
  for (std::size_t t = 0; t < target.triangles.size(); ++t) {
    bool has_uv = true, leaves = false;
    for (const std::uint32_t v : target.triangles[t]) {
      has_uv = has_uv && target.has_uv(0, v);
      if (!has_uv) break;
      const Vec2f uv = target.uv_sets[0][v];
      leaves = leaves || !(uv.x >= 0 && uv.x <= 1 && uv.y >= 0 && uv.y <= 1);
    }
    outside += has_uv && leaves ? 1 : 0;
    without += has_uv ? 0 : 1;
    std::uint32_t page = has_uv ? 0 : mesh::kNoPage;
    if (has_uv && by_material) {
      const std::uint32_t material = target.triangle_material[t];
      const auto [at, fresh] =
          page_of.try_emplace(material, static_cast<std::uint32_t>(pages.names.size()));
      if (fresh) pages.names.push_back(target.materials[material].name);
      page = at->second;
    }
    pages.triangle_page.push_back(page);
  }
  if (without == target.triangles.size()) {
    throw Error(ErrorKind::input,
                target.path + ": has no UVs (no TEXCOORD_0 or vt); unwrap the target first");
  }
  if (without > 0) {
    warnings.push_back(fmt::format("{}: {} of {} triangles have no UVs and get no texels",
                                   target.path, without, target.triangles.size()));
  }
  if (outside > 0) {
    warnings.push_back(
        fmt::format("{}: the UVs of {} triangles leave the image and wrap around into it",
                    target.path, outside));
  }
  return pages;
}

LeastMemory least_memory(const Plan& plan, const mesh::Mesh& source, const mesh::Mesh& target,
                         unsigned threads, std::uint64_t tile_cap_bytes) {
  const std::uint64_t contexts = threads * tiles::Compressor::context_bytes();
  const std::uint64_t meshes = source.size_bytes() + target.size_bytes();
  LeastMemory least;
  const auto need = [&](std::uint64_t bytes, const std::string& why) {
    if (bytes > least.bytes) least = {bytes, why};
  };
  std::uint64_t colour_tile = 0;
  for (const ColumnPlan& column : plan.columns) {
    const std::uint64_t texel = column.info.channels * tiles::depth_bytes(column.info.depth);
    need(
        contexts + meshes + colour_least_bytes(column.info.width, texel, column.info.decoder_bytes),
        "reading " + column.image.label);
    colour_tile = std::max(colour_tile,
                           round_to_pages(tiles::kColourTileEdge * tiles::kColourTileEdge * texel));
  }
  for (const PassPlan& pass : plan.passes) {
    need(contexts + meshes + geometry_least_bytes(pass.source, tile_cap_bytes),
         "preconditioning " + source.path);
    need(contexts + meshes + geometry_least_bytes(pass.target, tile_cap_bytes),
         "vectorizing " + target.path);
    std::uint64_t result_texel = 0, indices = 0;
    for (const std::size_t c : pass.channels) result_texel += plan.channels[c].format.texel_bytes();
    for (const mesh::Lattice& page : pass.target.pages) {
      indices += (page.width / 64 + 1ULL) * (page.height / 64 + 1ULL) *
                 (sizeof(tiles::ChunkRef) + 24) * pass.channels.size();
    }
    const auto triangles = static_cast<std::uint32_t>(
        std::min<std::size_t>(source.triangles.size(), tiles::kMostTrianglesPerBlock));
    need(contexts + indices + (2ULL << 20) +
             project_least_bytes(triangles, triangles + 1024, triangles * 160 + (1 << 16),
                                 result_texel, colour_tile),
         "projecting one block of the target");
    for (const std::size_t c : pass.channels) {
      for (const ImageOutput& image : plan.channels[c].images) {
        need(contexts + indices + image_least_bytes(image, plan.channels[c].format),
             "writing " + image.path);
      }
    }
  }
  return least;
}

}  // namespace pounce::flow
