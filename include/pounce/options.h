// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "pounce/export.h"

namespace pounce {

/// The texture channels of a glTF metallic-roughness material, of which baseColor carries the
/// material's alpha as its fourth component; after them what a splat scene says of each texel, and
/// what the shape of a mesh does.
enum class Channel : std::uint8_t {
  base_color,          ///< "baseColor": colour, sRGB-coded unless the file is linear (EXR)
  metallic_roughness,  ///< "metallicRoughness": data
  occlusion,           ///< "occlusion": data
  emissive,            ///< "emissive": colour
  normal,              ///< "normal": data, a tangent-space normal map
  confidence,          ///< "confidence": data, 0..1: how sure a texel's colour is
  /// "distance": data, one float: how far along the texel's normal the surface was found, in the
  /// target's units, positive outside.
  distance,
  height,        ///< "height": the same of a mesh, by ChannelOptions::baked
  position,      ///< "position": data: where the surface was found, in the job's axes; by `baked`
  vertex_color,  ///< "vertexColor": colour: that of the mesh's vertices; by `baked`
  hits,          ///< "hits": data: where on a mesh each texel's ray ended; by `map_output` alone
  /// The first of the maps of the user's own; see other_channel(). No material has these.
  other,
};
inline constexpr int kChannelCount = 5;   ///< of a material
inline constexpr int kEvidenceCount = 2;  ///< of a splat scene, after those
inline constexpr int kShapeCount = 3;     ///< of a mesh's triangles, after those

/// Is it evidence (confidence, distance), which splat scenes alone have?
constexpr bool is_evidence(Channel channel) noexcept {
  return channel == Channel::confidence || channel == Channel::distance;
}

/// Is it of a mesh's triangles (height, position, vertex_color), whatever its materials are?
constexpr bool is_shape(Channel channel) noexcept {
  return channel == Channel::height || channel == Channel::position ||
         channel == Channel::vertex_color;
}

inline constexpr std::size_t kMostOtherMaps = 64;

/// The map ChannelOptions::other_maps[index], index < kMostOtherMaps.
constexpr Channel other_channel(std::size_t index) noexcept {
  return static_cast<Channel>(static_cast<std::size_t>(Channel::other) + index);
}
constexpr bool is_other(Channel channel) noexcept { return channel >= Channel::other; }
/// Which one it is; of an other channel alone.
constexpr std::size_t other_index(Channel channel) noexcept {
  return static_cast<std::size_t>(channel) - static_cast<std::size_t>(Channel::other);
}
/// Is it one that a material may have a texture and a factor for?
constexpr bool is_of_material(Channel channel) noexcept {
  return static_cast<int>(channel) < kChannelCount;
}

/// "baseColor", "metallicRoughness", "occlusion", "emissive", "normal", "confidence", "distance",
/// "height", "position", "vertexColor"; "other" for maps of the user's own, whose names the options
/// have.
POUNCE_API const char* channel_name(Channel channel) noexcept;
/// The channel with that name (exactly as above), or nothing.
POUNCE_API std::optional<Channel> channel_from_name(const std::string& name) noexcept;

/// Which way a normal map's green channel rises.
enum class NormalY : std::uint8_t {
  up,    ///< "up": towards smaller v, up in the image: glTF, OpenGL, Blender
  down,  ///< "down": towards larger v: DirectX, Unreal
};
/// "up", "down".
POUNCE_API const char* normal_y_name(NormalY direction) noexcept;
POUNCE_API std::optional<NormalY> normal_y_from_name(const std::string& name) noexcept;

/// How one sample of an image is stored.
enum class Depth : std::uint8_t { u8, u16, half, float32 };
/// "u8", "u16", "half", "float".
POUNCE_API const char* depth_name(Depth depth) noexcept;
POUNCE_API std::optional<Depth> depth_from_name(const std::string& name) noexcept;

/// Formats of images that are read only where they are allowed by name: their decoders are held to
/// less than those of PNG, JPEG, TIFF, EXR, WebP and Radiance HDR.
enum class ImageFormat : std::uint8_t { bmp, tga };
/// "bmp", "tga".
POUNCE_API const char* image_format_name(ImageFormat format) noexcept;
POUNCE_API std::optional<ImageFormat> image_format_from_name(const std::string& name) noexcept;

/// Are images decoded in a process of their own, which can do nothing else? A file that is made to
/// do harm then harms that process alone. automatic: formats whose libraries have had such faults
/// (EXR, TIFF, HDR, BMP, Targa), where there is the program pounce-decoder and the kernel can
/// confine it; on: all formats, or none; off: all are decoded here. The samples are the same.
enum class Sandbox : std::uint8_t { automatic, on, off };
/// "auto", "on", "off".
POUNCE_API const char* sandbox_name(Sandbox sandbox) noexcept;
POUNCE_API std::optional<Sandbox> sandbox_from_name(const std::string& name) noexcept;

/// How far image files are trusted.
struct ImageTrust {
  std::vector<ImageFormat> formats = {};  ///< are read, too
  Sandbox sandbox = Sandbox::automatic;
};

/// Width and height of an image in texels, each 1..65536.
struct ImageSize {
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  bool operator==(const ImageSize&) const = default;
};

/// A length in the target's units, or a share of the diagonal of the target's bounding box.
struct Length {
  double value = 0;
  bool is_percent = false;  ///< value is a percentage of the diagonal
};

/// An image file that overrides or adds one channel of the source. With <UDIM> or <UVTILE> in it,
/// `path` names a set of images, one per tile of UV space; they may differ in size.
struct SourceTexture {
  Channel channel = Channel::base_color;
  std::string path;
};

/// The images of one channel, in a file of their own format or name.
struct ChannelOutput {
  Channel channel = Channel::base_color;
  std::string path;  ///< an image pattern with the tokens of TransferOptions::output
};

/// What the images of the source's colours hold, whatever their files say: "srgb", "lin_rec709",
/// "acescg", "aces2065-1", "display-p3", or a space of ColourOptions::config.
struct SourceColourSpace {
  std::optional<Channel> channel;  ///< nothing: every one of colours that is not named itself
  std::string space;
};
/// A map of the user's own, such as a displacement. Its image is a SourceTexture.
struct OtherMap {
  std::string name;  ///< is_map_name()
  /// Colour is converted between sRGB coding and linear light where formats ask for it, data never
  /// is. Nothing: by the name, see docs/maps.md.
  std::optional<bool> is_colour;
};
/// 1 to 64 letters, digits, - and _, and neither "all" nor a channel's name in other case.
POUNCE_API bool is_map_name(const std::string& name) noexcept;

/// What machine resources a job may use.
struct Resources {
  /// Everything big the job holds in memory, in bytes: blocks in flight, grids, result blocks,
  /// image stripes, triangle tables, caches. 0 = half of what the process may use (cgroup
  /// included).
  std::uint64_t memory_bytes = 0;
  /// Worker threads, the calling one included; 0 = all cores. No more than the process lets oneTBB
  /// have: its cores, or its tbb::global_control. The result does not depend on it.
  unsigned threads = 0;
  /// Folder of the tile cache; empty = $XDG_CACHE_HOME/pounce, else ~/.cache/pounce.
  std::string cache_dir;
  /// Another cache, which is read where the first has nothing, and never written: of a farm, or on
  /// a disk that many share. Empty: none.
  std::string cache_readonly_dir;
  /// false: build the tile stores in `temp_dir` and remove them at the end.
  bool use_cache = true;
  /// Room on disk that the cache may take, in bytes; what was used longest ago makes room before
  /// anything is written, what does not fit is not kept. 0 = no limit. Default: a tenth of the file
  /// system. Smaller costs making things again.
  std::optional<std::uint64_t> cache_limit_bytes;
  /// What another process is just making for the cache: true = wait for it, false = end with
  /// Error(ErrorKind::busy).
  bool wait_for_cache = true;
  /// Folder for scratch files; empty = the output's folder.
  std::string temp_dir;
  /// Room on disk that scratch files may take at one moment, in bytes; a job that comes to need
  /// more ends with Error(ErrorKind::storage). 0 = no limit. Default: a tenth of what is free in
  /// their folder, but 1 GiB at least.
  std::optional<std::uint64_t> max_temp_bytes;
};

/// Which part of a mesh takes part in a job, and how it is seen.
struct MeshUse {
  /// Patterns as in a shell (* ? [a-c]) for the names that triangles have: node or mesh of glTF,
  /// object or group of OBJ. Any of them; empty = all. Nothing matches: Error(input).
  std::vector<std::string> meshes;
  std::vector<std::string> materials;   ///< the same for the names of materials
  std::optional<std::uint32_t> uv_set;  ///< target: default 0; source: what its materials say
  /// Turns the mesh: the job's x, y and z as the file's, such as "x,-y,-z"; empty = as stored.
  std::string axes;
};

/// How a texel finds its colour on a mesh. A splat scene is always blended as what it is.
enum class Method : std::uint8_t {
  surface,   ///< "surface": what the ray hits, blended with its neighbours in the source's image
  gaussian,  ///< "gaussian": all of the source's texels that the ray meets, as Gaussians
};
/// "surface", "gaussian".
POUNCE_API const char* method_name(Method method) noexcept;
POUNCE_API std::optional<Method> method_from_name(const std::string& name) noexcept;

/// How Method::surface blends the texels around a hit: to what is between the four nearest ones, on
/// a texel's middle to that texel; of the cubics where the target is finer, to a little beyond.
enum class Filter : std::uint8_t {
  tent,   ///< "tent": bilinear, as a renderer looks textures up; softens a little
  cubic,  ///< "cubic": Catmull-Rom, over 4x4 texels; even gradients stay even
  sharp,  ///< "sharp": a steeper cubic, for drawings and hard edges; gradients ripple a little
};
/// "tent", "cubic", "sharp".
POUNCE_API const char* filter_name(Filter filter) noexcept;
POUNCE_API std::optional<Filter> filter_from_name(const std::string& name) noexcept;
/// Where nothing else is asked for.
inline constexpr Filter kDefaultFilter = Filter::cubic;

/// Which colour a Gaussian of a splat scene shows to a texel. Scenes whose files have no harmonics
/// look the same with all three.
enum class SphericalHarmonics : std::uint8_t {
  dc,      ///< "dc": its base colour, which is the mean over all directions
  normal,  ///< "normal": what it shows along the texel's normal: highlights as seen from there
  mean,    ///< "mean": the mean over the directions that look at the texel, by their cosine
};
/// "dc", "normal", "mean".
POUNCE_API const char* harmonics_name(SphericalHarmonics harmonics) noexcept;
POUNCE_API std::optional<SphericalHarmonics> harmonics_from_name(const std::string& name) noexcept;

/// From where a texel looks at a splat scene.
enum class Look : std::uint8_t {
  automatic,  ///< "auto": `around` for captures, `normal` for scenes made of a surface's discs
  /// "around": the mean of what the scene shows from directions all around, as far as the texel is
  /// seen from there; along its normal where no view sees it.
  around,
  normal,  ///< "normal": what lies on the line along the texel's normal
};
/// "auto", "around", "normal".
POUNCE_API const char* look_name(Look look) noexcept;
POUNCE_API std::optional<Look> look_from_name(const std::string& name) noexcept;
inline constexpr std::uint32_t kLeastViews = 6, kMostViews = 96, kDefaultViews = 36;

/// A box with its sides along the axes, in the job's axes and units.
struct AxisBox {
  std::array<double, 3> lowest{}, highest{};  ///< x, y, z
};

/// A point in the air of a room, in the job's axes and units.
struct AirPoint {
  std::optional<std::array<double, 3>> at = {};  ///< nothing: the middle of the scene
};

/// Standard deviation of a texel's Gaussian in texels where nothing else is asked for.
inline constexpr double kDefaultSigma = 0.5;
/// Gaussians that are less opaque are left out where nothing else is asked for: nobody sees them.
inline constexpr double kDefaultMinOpacity = 1.0 / 255;
/// Texels that are less sure stay empty where nothing else is asked for.
inline constexpr double kDefaultMinConfidence = 0.01;

/// The most rays that a texel has beside its normal.
inline constexpr std::uint32_t kMostRays = 16;

/// How image files hold their samples; no texel depends on it.
struct ImageLayout {
  /// Lossless compression of EXR: "none", "rle", "zips", "zip", "piz"; empty: "zip".
  std::string exr_compression = {};
  /// EXR and TIFF in tiles of this many texels each way instead of rows: a multiple of 16,
  /// 16..1024; 0: rows, and 64 with mipmaps.
  std::uint32_t tile_size = 0;
  /// EXR and TIFF with all mipmap levels; those called .tx always have them. Adds a third to the
  /// file's size, and as much scratch space.
  bool mipmap = false;
  std::uint32_t png_compression = 2;  ///< zlib level of PNG, 0..9: higher is smaller and slower
  std::uint32_t jpeg_quality = 95;    ///< of JPEG, 1..100: lower is smaller and loses more
  bool operator==(const ImageLayout&) const = default;
};

/// What the images that are written look like. Of a model's textures, too, where it says so.
struct ImageOptions {
  std::optional<ImageSize> size = {};  ///< default: per channel that of the largest source image
  std::optional<Depth> depth = {};     ///< default: the source image's
  std::optional<std::uint32_t> padding_px = {};  ///< default: larger side of the image / 128
  bool drop_alpha = false;                       ///< outputs have no alpha, whatever the source has
  NormalY normal_y = NormalY::up;                ///< green channel of the normal map written
  /// Colour space of colour channels, a name as in SourceColourSpace. Default: the source's, but
  /// sRGB for integer formats if the source is linear, and in models.
  std::string colour_space = {};
  std::vector<std::uint32_t> tiles = {};  ///< only these UDIMs, sorted; empty = all
  /// Channels that do not go to `TransferOptions::output` but here, such as height to "height.exr"
  /// where the others are PNG. Each channel at most once; <MATERIAL>, <TARGET>, <UDIM> or <UVTILE>
  /// must be in these patterns as they are in `output`. Not for models.
  std::vector<ChannelOutput> channel_outputs = {};
  /// Also write an 8-bit mask (255 = covered) here; same tokens as `output`; empty = no.
  std::string coverage_output = {};
  /// Also write where each texel hit the source, as an EXR of floats (docs/hit-map.md): u, v and
  /// UDIM tile on the source, signed distance, angle, and what painting through it takes; same
  /// tokens as `output`, without <CHANNEL>; empty = no. Surface transfers of meshes to images,
  /// whose channels share one search.
  std::string map_output = {};
  ImageLayout layout = {};
};

/// Which channels are written.
struct ChannelOptions {
  /// Empty: baseColor if `TransferOptions::output` is an image without <CHANNEL>, else every
  /// channel the source has, except those (baseColor apart) whose images cannot be read, which is a
  /// warning.
  std::vector<Channel> transferred = {};
  bool all = false;  ///< every channel the source has, except evidence; `transferred` is empty
  /// Generated from the source's geometry, in the same passes: normal (its smooth normals combined
  /// with its normal map, in the target's tangent space; replaces the transferred one), height,
  /// position, vertex_color. Without other channels these are the only outputs, unless
  /// `TransferOptions::output` is a model or holds <CHANNEL>. Height and position need a float
  /// format.
  std::vector<Channel> baked = {};
  /// Names of other_channel(0), other_channel(1), ..., which `transferred` and
  /// MaterialOptions::textures may then hold; each needs a source texture. Not for models.
  std::vector<OtherMap> other_maps = {};
};

/// How the source's materials are read. Not for splat scenes.
struct MaterialOptions {
  std::vector<SourceTexture> textures = {};  ///< instead of or beside those of the materials
  /// Images: multiply the materials' factors (baseColorFactor, Kd, ...) into their textures. A
  /// model has them in its materials: false is refused.
  bool apply_factors = true;
  /// Multiply vertex colours into the base colour, of models, too. Vertex colours that are black
  /// everywhere are ignored.
  bool apply_vertex_colours = true;
  NormalY normal_y = NormalY::up;  ///< green channel of the source's normal maps
};

/// What the source's colours are. Not for splat scenes.
struct ColourOptions {
  /// Default: what the image files state (known ICC profiles, PNG chunks, EXR chromaticities; not
  /// in glTF, whose textures are sRGB), else sRGB for integers and linear Rec. 709 for floats.
  std::vector<SourceColourSpace> source_spaces = {};
  /// An OpenColorIO configuration whose spaces may be named, too; empty: none. Its tables (LUTs)
  /// must be in its folder, unless `allow_external`, and count as memory. Its results may differ in
  /// the last bits between kinds of processors.
  std::string config = {};
};

/// Where a texel searches for the source.
struct SearchOptions {
  /// How far along the texel's normal, both ways. A larger distance costs time: much where nothing
  /// is near, else little. Default: 5 % of the target's diagonal, 3 % for splat scenes.
  std::optional<Length> max_distance = {};
  /// Source surface that faces away from the texel's normal by more than this is ignored; 0..89.9.
  double max_angle_deg = 80;
};

/// How a textured mesh is sampled. Not for splat scenes.
struct MeshOptions {
  Method method = Method::surface;    ///< `gaussian` transfers baseColor alone; see docs/paper.md
  std::optional<Filter> filter = {};  ///< Method::surface only; default kDefaultFilter
  /// Standard deviation of a texel's Gaussian in texels, 0.1..4; Method::gaussian only; default
  /// kDefaultSigma. Wider blurs more and costs time with its square.
  std::optional<double> sigma_texels = {};
  /// Split texels that are large on the surface, so that Gaussians are about uniformly dense;
  /// Method::gaussian only. At most three times as many Gaussians.
  bool densify = false;
};

/// Which Gaussians of a splat scene are used.
struct SplatFilter {
  /// Skip Gaussians less opaque than this, 1/255..1. Below 1/255, the default, they are invisible.
  std::optional<double> min_opacity = {};
  /// Skip Gaussians with a larger standard deviation; above 0, in the scene's units.
  std::optional<double> max_scale = {};
  std::optional<AxisBox> box = {};  ///< skip Gaussians whose centre is outside
};

/// How a splat scene is blended. Not for meshes.
struct SplatOptions {
  Look look = Look::automatic;
  /// How many directions `around` looks from, kLeastViews..kMostViews: more are smoother, see more
  /// texels, and take time in proportion.
  std::uint32_t views = kDefaultViews;
  /// View dependence along normals. A view shows the harmonics of its own direction, unless `dc`.
  SphericalHarmonics harmonics = SphericalHarmonics::mean;
  SplatFilter filter = {};
  /// Extra rays per texel, 0..kMostRays, in a cone of 35 degrees around its normal, whose colours
  /// are averaged with the normal's. Closer to the multi-view appearance, but softer; time and
  /// memory of projection scale with their number.
  std::uint32_t rays = 0;
  /// The output's alpha is the opacity along the texel's normal, 0.1..1 where it is covered.
  /// Formats without alpha are refused.
  bool alpha = false;
  /// Skip Gaussians whose 3-sigma extent stays farther than this from every target. Default: 2.2
  /// times max_distance, at least 6.6 %, and only if a sample shows that three quarters are farther
  /// away: such a store serves these targets alone.
  std::optional<Length> near_target = {};
  bool everywhere = false;  ///< disables `near_target`: the whole scene is sorted
  /// Leave texels below this confidence empty; 0..1. 0 covers every texel with a surface in reach,
  /// even that of another object.
  double min_confidence = kDefaultMinConfidence;
};

/// Painting over existing images.
struct CompositeOptions {
  /// Covered texels are written over these images (same tokens as `TransferOptions::output`), which
  /// give size, depth and channels unless set. May be the output itself. Empty: none.
  std::string onto = {};
  /// Blend by this image: white paints, black keeps; same tokens; needs `onto`.
  std::string mask = {};
};

/// What a run does of a job.
enum class TaskRole : std::uint8_t {
  whole,     ///< all of it
  prepare,   ///< the stores that the other runs read; needs a cache
  share,     ///< its share of the images, and of those that are too much for one run a part
  assemble,  ///< makes images of these parts
};

/// What a run does of a job that several share, on one machine or on many (docs/farm.md). What they
/// make together is what one run makes, byte for byte; two that make the same do no harm.
struct TaskShare {
  TaskRole role = TaskRole::whole;
  std::uint32_t task = 1;   ///< of TaskRole::share: which one, 1..tasks
  std::uint32_t tasks = 1;  ///< how many there are, 1..kMostTasks
  /// A folder that all of them see, where parts of images wait. Empty: no image is cut, and a model
  /// cannot be shared.
  std::string folder = {};
};
inline constexpr std::uint32_t kMostTasks = 100'000;

/// One transfer of appearance from a textured mesh or a splat scene onto the UV textures of meshes.
struct TransferOptions {
  /// .glb, .gltf, .obj, .ply or .stl with textures; a splat scene in any format; or a hit map that
  /// ImageOptions::map_output named (.exr), through which MaterialOptions::textures are painted.
  std::string source = {};
  MeshUse source_use = {};
  /// .glb, .gltf, .obj or .ply with UVs; at least one, but none for a hit map, which has its target
  /// in it.
  std::vector<std::string> targets = {};
  MeshUse target_use = {};  ///< for every target
  /// Image path; may hold <CHANNEL>, <MATERIAL>, <TARGET> (needed for several), <UDIM> and
  /// <UVTILE>. With one of the last two, UVs outside [0,1) are UDIM tiles with an image each;
  /// without, they wrap. The ending picks the format. Missing folders are created.
  /// Or a model, .glb or .gltf: the target, which must be one of these too, with a new texture per
  /// material and channel and everything else unchanged; may hold <TARGET>.
  std::string output = {};
  ImageOptions image = {};
  ChannelOptions channels = {};
  MaterialOptions material = {};
  ColourOptions colour = {};
  SearchOptions search = {};
  MeshOptions mesh = {};
  SplatOptions splats = {};
  CompositeOptions composite = {};
  /// 0..100: for how many of its texels a target must find the source. A target below this is
  /// written like any other; TargetReport::enough says which are.
  double min_coverage_percent = 0;
  /// Outputs already produced by the same inputs and options stay as they are; so do those without
  /// a recorded job that are newer than every input (docs/outputs.md).
  bool skip_existing = false;
  /// Outputs that record this very job stay as they are, whatever their times; nothing else is
  /// skipped. The command line sets it unless --redo is given. Nothing is skipped with
  /// min_coverage_percent: what was counted when they were made is not known; but what this job has
  /// painted over in place is not painted again.
  bool keep_made = false;
  /// Files that a mesh file (buffers, images, materials) or a colour configuration (tables) names
  /// may be outside of its folder (an absolute path, "..", a link); false: they are refused, since
  /// a model from elsewhere could copy any file of this machine into the output.
  bool allow_external = false;
  ImageTrust trust = {};  ///< of the images of the source, `onto` and `mask`
  TaskShare share = {};
  Resources resources = {};
};

/// The channel's name in this job, maps of the user's own included.
POUNCE_API std::string channel_name(const TransferOptions& options, Channel channel);

/// Target vectorization alone: position, normal and mask images.
struct MapsOptions {
  std::string target = {};
  MeshUse target_use = {};
  /// Must hold <CHANNEL>: "position", "normal", "mask"; .exr for the first two. With <UDIM> or
  /// <UVTILE> one image per tile of UV space.
  std::string output = {};
  ImageSize size{1024, 1024};
  bool keep_made = false;       ///< as in TransferOptions
  bool allow_external = false;  ///< the same
  Resources resources = {};
};

/// Source preconditioning alone: a textured mesh or a splat scene as a file of Gaussians.
struct GaussiansOptions {
  std::string source =
      {};  ///< .glb, .gltf, .obj or .ply with a baseColor texture, or a splat scene
  /// .ply (3DGS), .spz (version 2) or .glb (KHR_gaussian_splatting, colours sRGB-coded or, where
  /// the source's are, linear).
  std::string output = {};
  /// Turns the source: the output's x, y and z as the file's, such as "x,-y,-z". Empty: a mesh as
  /// it is stored; a scene as it is, but turned by 180 degrees about z from or to glTF, where y is
  /// up.
  std::string axes = {};
  std::vector<SourceTexture> source_textures = {};  ///< instead of the mesh's own; baseColor only
  ColourOptions colour = {};                        ///< for meshes
  /// For meshes: standard deviation of a texel's Gaussian in texels: 0.1..4; default kDefaultSigma.
  /// Narrower ones blend sharper and, below 0.4, leave gaps in viewers.
  std::optional<double> sigma_texels = {};
  /// For meshes: 0..4. Sharpens colours by this share of what a transfer of these Gaussians onto
  /// texels of the same size takes away from them, from texels of the same chart. Costs 25 lookups
  /// per texel.
  double sharpen = 0;
  SplatFilter filter = {};  ///< for splat scenes
  /// For splat scenes: write at most this many, at least 1: the most important ones, by opacity
  /// times the product of their two larger standard deviations; of equals the first. Reads the
  /// source twice.
  std::optional<std::uint64_t> count = {};
  bool allow_external = false;  ///< as in TransferOptions
  ImageTrust trust = {};        ///< the same
  Resources resources = {};
};

/// How fine a mesh is that is made of a source, and how its UVs lie.
struct MeshShape {
  std::uint32_t triangles = 20000;  ///< at most so many, as far as the shape allows: 100..5000000
  /// Instead of a number: as few as keep the surface within about this of what it was, before it is
  /// simplified. In the source's units, or of the diagonal of its surface.
  std::optional<Length> detail = {};
  std::uint32_t cells = 256;  ///< of scenes, along their longest side: 16..512
  /// Of scenes: what no view sees counts as inside, so that nothing stays open there.
  bool close = false;
  /// Of scenes that are rooms: what is seen from within, as far as the air around this reaches.
  std::optional<AirPoint> inside = {};
  /// Of models: the light one has the UVs and materials of the heavy one, which a texture of that
  /// still fits. `gutter` means nothing then.
  bool keep_uvs = false;
  std::uint32_t size = 2048;  ///< texels along the image that charts are packed for
  std::uint32_t gutter = 4;   ///< texels between charts: 0..64
  /// Charts go into so many UDIM tiles of that size, each a material that is called by its number:
  /// 1..100.
  std::uint32_t udims = 1;
};

/// A mesh with UVs of a scene's surface; of a model a lighter one with its textures.
struct ProxyOptions {
  std::string source = {};  ///< a splat scene, a point cloud or a mesh
  std::string output = {};  ///< .glb
  /// Turns the source: the output's x, y and z as the file's, such as "x,-y,-z". Empty: as stored.
  std::string axes = {};
  MeshShape shape = {};
  SplatFilter filter = {};
  Resources resources = {};
};

/// The same, and what the source looks like in its textures.
struct TexturedMeshOptions {
  /// Without targets, and with a model (.glb, .gltf) as output; `shape` has the size of its images.
  TransferOptions transfer = {};
  MeshShape shape = {};
};

}  // namespace pounce
