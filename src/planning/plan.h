// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/job_space.h"
#include "gaussian/splat_keep.h"
#include "gaussian/splat_statistics.h"
#include "io/image/read.h"
#include "mesh/mesh.h"
#include "mesh/uv_tiles.h"
#include "planning/image_output.h"
#include "planning/target_pages.h"
#include "pounce/options.h"
#include "shading/texel_input.h"
#include "surface/geometry_request.h"

namespace pounce::planning {

/// A splat scene as a source.
struct SplatRequest {
  std::string path;
  Axes axes;  ///< applied to everything that is read
  /// What a texel will want of the harmonics decides how many of them are kept.
  SphericalHarmonics harmonics = SphericalHarmonics::mean;
  bool from_around = false;  ///< its views may be drawn: they show all harmonics
  gaussian::SplatKeep keep = {};
  /// keep.near counts whatever it saves; else only where little of the scene is near.
  bool near_is_asked = false;
  /// For tests: most Gaussians of a run and most runs merged at once; 0 = what the budget holds.
  /// The store does not depend on them.
  std::uint64_t run_splats = 0;
  std::size_t fan_in = 0;
  gaussian::FadeIsolated fades = gaussian::FadeIsolated::of_all_scenes;
};

/// What is known of a scene from its headers.
struct SceneFacts {
  std::uint64_t splats = 0;                     ///< in the file
  std::uint32_t lobes = 0;                      ///< of its harmonics that are kept
  bool is_linear = false;                       ///< colours are linear light, not sRGB-coded
  std::vector<std::string> files, assumptions;  ///< as in io::SplatSceneInfo
  /// The least that splat_store() may need at once; the same for a file of any length.
  std::uint64_t least_bytes = 0;
  std::uint64_t unpacked_bytes = 0;  ///< as io::SplatScene::unpacked_bytes()
  Vec3d origin = {};                 ///< as in io::SplatSceneInfo
};

class ColourSpaces;

/// How far texels look where nobody says: of the target's diagonal.
inline constexpr double kReachPercent = 5;

/// What one source page gives to a channel: an image, a set of UDIM tiles, or else a constant.
struct PageTexture {
  int column = -1;    ///< index into SourcePlan::columns
  int tile_set = -1;  ///< index into SourcePlan::tile_sets
  shading::TexelValue constant;
  std::optional<shading::ColourInput> input;  ///< for the texels of the column
  float normal_scale = 1;                     ///< of a normal map's x and y
  std::optional<shading::Factor> factor;      ///< of the material, for the texture's texels
  bool tinted =
      false;  ///< by the colours of the source's vertices; a constant's `input` is for that
};

/// One channel of the job: its images on the source side, its format on the output side.
struct ChannelPlan {
  Channel channel = Channel::base_color;
  std::string name;  ///< of the channel, in images and reports
  ImageSize size;    ///< of each output image
  shading::TexelFormat format;
  bool source_alpha = false;           ///< has some image of the source alpha here?
  std::uint32_t source_colours = 3;    ///< the most channels besides alpha that an image here has
  std::vector<std::string> names;      ///< of the output's channels, where its format has names
  Chromaticities primaries = kRec709;  ///< of the output's colours
  std::optional<Chromaticities> chromaticities;  ///< the same, where its file is to say it
  std::string colour_space;  ///< its name in --ocio's configuration, if it is of there
  /// Options that were given and say of this channel what holds without them: to JobHash they were
  /// not given.
  std::vector<std::string> said_anyway;
  /// What a model's material has beside the texture (io::ModelTexture::factor): what all of the
  /// source's that are used have beside theirs, which the images then do not show.
  std::array<float, 4> material_factor{1, 1, 1, 1};
  /// Of base colour: its alpha means something, as the source says; a model's material shows it.
  bool shows_alpha = false;
  /// By source page: the materials, then the same again for triangles without UVs.
  std::vector<PageTexture> pages;
  bool baked = false;     ///< ChannelOptions::baked
  std::string hits_note;  ///< of a hit map: map_note()
  /// Is it of the surface itself: a normal map, or baked?
  bool has_shape() const { return channel == Channel::normal || baked; }
  bool is_tinted() const;  ///< on some page
};

/// An image that some channel needs, with the wrap modes it is sampled with.
struct ColumnPlan {
  mesh::ImageRef image;
  mesh::Wrap wrap_u = mesh::Wrap::repeat, wrap_v = mesh::Wrap::repeat;
  io::ImageInfo info;
  bool heeds_tags = true;  ///< what the file says of its colours counts; glTF's textures are sRGB
  ImageTrust trust;
};

/// A source texture of many UDIM tiles, which may differ in size.
struct TileSetPlan {
  ImageSize size;                                       ///< of the largest
  std::map<mesh::UvTile, std::size_t> columns;          ///< index into SourcePlan::columns
  std::map<mesh::UvTile, shading::ColourInput> inputs;  ///< of the tiles that need one
};

/// The UVs, by material, along which a mesh's tangents run, and whose own tangents are along those.
struct TangentPlan {
  std::vector<std::uint32_t> uv_sets;
  std::vector<bool> keeps_own;
};

/// Channels whose outputs have one size and whose textures lie on the source in the same way: one
/// search serves them all, on the lattice of the largest image of each source page.
struct PassPlan {
  surface::GeometryRequest source;
  ImageSize size;                     ///< of the outputs
  std::vector<std::size_t> channels;  ///< into SourcePlan::channels
  bool has_shape = false;             ///< is one of them of the surface itself, or tinted?
  bool has_map = false;               ///< is one of them a map of the hits?
  bool keeps_hits = false;            ///< what its texels hit may stay in the cache
  bool keeps_results = false;         ///< what they become may
};

/// The source's side of a job: the same for all its targets, and for all kinds of sources.
struct SourcePlan {
  Vec3d origin;  ///< is subtracted from all positions that are read, on both sides
  double reach_percent = kReachPercent;  ///< of a target's diagonal, without --max-distance
  std::vector<ChannelPlan> channels;
  std::vector<ColumnPlan> columns;
  std::vector<TileSetPlan> tile_sets;
  std::vector<PassPlan> passes;
  std::optional<TangentPlan> tangents;  ///< of the source: where it has normal maps
  std::uint32_t views = 0;  ///< a scene may be drawn from so many sides, for each target
  /// Of --ocio's configuration: what formats and inputs point to.
  std::vector<std::shared_ptr<const ColourTransform>> transforms;
  /// Of its tables: what loading them takes in memory, and what stays as long as the job.
  std::uint64_t table_loading_bytes = 0, table_bytes = 0;
  std::vector<std::string> warnings, notes;

  bool makes_normals() const;  ///< is there a normal map among the outputs?
};

/// Of what a page's channel is sampled: an image's size, or that of a set's largest tile. 0 x 0 for
/// a constant.
ImageSize sampled_size(const SourcePlan& plan, const PageTexture& page);

/// Who makes a page of a pass, where several tasks share a job.
struct StepShare {
  /// By part: its task, from 1. A part is a run of the page's blocks in their order; one part is
  /// all of it.
  std::vector<std::uint32_t> tasks;
  bool in_parts = false;  ///< tasks leave parts, which are assembled later
  bool has(std::uint32_t task) const;
};

/// One target's side.
struct TargetPlan {
  std::string path;
  float max_distance = 0;  ///< in the target's units
  /// --max-distance was given and is what it is without.
  bool usual_distance = false;
  double diagonal = 0;  ///< of the target's bounding box
  float fit_reach = 0;  ///< splats: how far is looked to say whether the scene lies here at all
  float usual_fit_reach = 0;  ///< the same without --near-target
  float smallest_edge = 0;    ///< see TargetBlock
  std::vector<TargetPage> pages;
  bool by_tile = false;   ///< each tile of UV space has images of its own
  bool all_tiles = true;  ///< of these, none was left out by --tiles
  std::uint32_t uv_set = 0;
  Axes axes;                  ///< --target-axes
  bool in_part = false;       ///< only some of the mesh or of its materials takes part
  bool painted_over = false;  ///< --onto
  std::vector<std::vector<surface::GeometryRequest>> requests;  ///< [pass][page]
  std::vector<std::vector<ImageOutput>> images;                 ///< [channel][page]
  /// [pass][page]; empty: one run makes all.
  std::vector<std::vector<StepShare>> shares;
  std::vector<std::string> warnings;
  /// Every file that may be written: a tile that turns out to have no covered texel centre is not.
  std::vector<std::string> outputs;
  std::vector<std::string> kept;          ///< --skip-existing: there already, and not written
  std::vector<std::string> kept_by_time;  ///< of these, those that do not say which job made them
  std::vector<std::string> inputs;  ///< files besides the meshes that must not be written over
};

/// What a job does about outputs, whatever is in them.
struct OutputPolicy {
  bool skips_existing = false;      ///< those that are there and up to date stay as they are
  bool waits = true;                ///< for others that are making the same ones
  double min_coverage_percent = 0;  ///< below that a target has not found enough
  TaskRole role = TaskRole::whole;
  std::uint32_t task = 1;
};

/// What a mesh's texels are for a job: texels of images that its surface shows, or Gaussians.
enum class TexelsAs : std::uint8_t { surface, gaussians };
/// Decides what a transfer reads of a source mesh, from it and the headers of its images: channels,
/// sizes, passes. Throws what a user must hear before any work is done: missing UVs or textures,
/// formats that cannot hold the result. `for_model`: the images, which `options` name, go into a
/// model, of whose material the factors may be. `merges`: all of the source's materials become one,
/// so that an image holds what they differ by, be it a constant.
SourcePlan plan_mesh(const TransferOptions& options, const mesh::Mesh& source, TexelsAs as,
                     bool for_model, bool merges = false);

/// The same for a splat scene, from its headers. Throws Error(input) for channels that a scene does
/// not have.
SourcePlan plan_scene(const TransferOptions& options, const SceneFacts& scene, bool for_model);
/// Writing a source's Gaussians as a transfer without a target: what the two have in common is
/// checked, planned and named alike.
TransferOptions as_transfer(const GaussiansOptions& options);
/// The same of making a proxy.
TransferOptions as_transfer(const ProxyOptions& options);

/// Throws Error(usage) for options that only make sense for a mesh.
void refuse_mesh_options(const TransferOptions& options);
/// Throws Error(usage) for options that only make sense for a splat scene.
void refuse_splat_options(const TransferOptions& options);
/// The scene that is a job's source, and what its user wants of it.
SplatRequest splat_request(const TransferOptions& options);
/// What the request says of places is counted from there, as the scene's are.
void move_to_origin(Vec3d origin, SplatRequest& splats);
/// Leaves out of a scene what is far from this target too, as the options say. To be called for
/// every target.
void keep_near(const TransferOptions& options, const TargetPlan& target, const mesh::Mesh& mesh,
               SplatRequest& splats);
/// Is this source to be read as a splat scene? Throws Error(input) for scenes in formats that are
/// not read, naming the cure.
bool is_splat_scene(const std::string& path);

/// What a channel's output is, given what its source has: for plan_mesh() and plan_scene().
/// Throws Error(usage) where the output's format cannot hold it.
struct SourceLook {
  ImageSize size;             ///< of the largest image; 0 x 0: none
  std::uint32_t colours = 3;  ///< the most channels besides alpha
  bool alpha = false, linear = false;
  bool premultiplied = false;  ///< every image that has alpha holds its colours so
  Depth depth = Depth::u8;
  std::vector<std::string> names;  ///< of the image's channels with the most colours; empty: usual
  std::optional<Chromaticities> chromaticities;  ///< where some image is of such or says so
  bool of_scene = false;                         ///< colours of Gaussians: no image, but a space
};
/// What is lost on the way is told in `warnings`, what is converted in `notes`.
void choose_output(const TransferOptions& options, const SourceLook& look, ColourSpaces& spaces,
                   ChannelPlan& plan, std::vector<std::string>& warnings,
                   std::vector<std::string>& notes);

/// Decides what happens to one target: pages, output names. Throws what a user must hear at once:
/// missing UVs or folders, names that clash. The requests refer to `target`.
TargetPlan plan_target(const TransferOptions& options, const SourcePlan& plan,
                       const std::string& path, const mesh::Mesh& target);

/// How a target's normal map sees its tangents.
TangentPlan target_tangents(const TransferOptions& options, const mesh::Mesh& target);

/// Throws Error(usage) where numbers, such as lengths, do not fit what they are to be written as:
/// so many samples of a float format. `option` is the one that asks for them.
void check_numbers(const TransferOptions& options, const ChannelPlan& plan,
                   const std::string& option);

/// Throws Error(usage) for a channel with an output of its own that this job does not write: an
/// output is no wish for a channel, as it may be meant for another job.
void check_channel_outputs(const TransferOptions& options, const SourcePlan& plan);
/// What a user should know of a model whose vertices have colours, which it keeps; else empty.
std::string own_colours_note(const SourcePlan& plan, const mesh::Mesh& target);

/// Throws Error(usage) if two images of these plans have one name, or one of them is an input:
/// these, the meshes or the source's images.
void check_all_outputs(const TransferOptions& options, const SourcePlan& plan,
                       const std::vector<std::string>& outputs,
                       const std::vector<std::string>& inputs);

/// Length of the diagonal of the mesh's bounding box.
double diagonal(const mesh::Mesh& mesh);

/// Throws Error(usage) for what no transfer can do, whatever its files hold.
void check_options(const TransferOptions& options);

}  // namespace pounce::planning
