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

#include "io/image/read.h"
#include "io/image/write.h"
#include "mesh/lattice.h"
#include "mesh/mesh.h"
#include "mesh/uv_raster.h"
#include "planning/target_pages.h"
#include "pounce/options.h"
#include "shading/paint_over.h"
#include "shading/result_block.h"

namespace pounce::planning {

/// What one output image is painted onto.
struct OntoImage {
  std::string path;
  std::string mask_path;  ///< "" = all of it is painted
  shading::PaintAlpha alpha = shading::PaintAlpha::keep;
  bool keep_last = false;      ///< a fourth channel that is no alpha and that the source has not
  bool in_place = false;       ///< the output takes its place: painted once, it is another image
  bool premultiplied = false;  ///< EXR onto EXR: colours stay multiplied by alpha, bit for bit
  std::uint64_t decoder_bytes = 0;
  ImageTrust trust;
  /// What padding must not run into; null: there is no padding.
  std::shared_ptr<const mesh::UvOccupancy> occupied;
};

/// One output image: which results go into it and how it is finished.
struct ImageOutput {
  std::string path;           ///< "" = no colour image
  std::string coverage_path;  ///< "" = no coverage mask
  mesh::Lattice lattice;      ///< its size
  bool keep = false;          ///< this run does not make it: it is there already and stays as it is
  bool elsewhere = false;     ///< kept because another task makes it
  bool painted = false;       ///< the image alone stays: in place, by this very job
  ImageLayout layout, coverage_layout;
  /// --tile-size or --mipmap was given, and the layouts are the same without it.
  bool usual_tiles = false, usual_levels = false;
  std::string job;  ///< see JobHash; "" until it is known
  std::uint32_t padding = 0;
  /// A tangent-space normal map: texels that nothing covers or fills are flat (0, 0, 1), not black,
  /// which is no direction. Their alpha, if there is one, stays 0.
  bool is_normal_map = false;
  std::vector<std::string> channel_names;
  std::string hits_note;  ///< of a hit map: see io::ImageInfo
  std::optional<Chromaticities> chromaticities;
  bool tagged = true;             ///< see io::ImageWriteSpec
  std::optional<OntoImage> onto;  ///< --onto
  std::uint32_t stripe_rows = 0;  ///< rows handed to the padder at once; 0 = a row of blocks
};

/// Header of an image that --onto means for this channel: the first by name of those that the
/// pattern fits. All must be alike. Nothing without --onto. Throws Error(storage) if there is none.
std::optional<io::ImageInfo> onto_header(const TransferOptions& options,
                                         const std::string& channel);

/// What the source has in a channel: how many samples besides alpha, and whether it has alpha.
struct SourceSamples {
  std::uint32_t colours = 0;
  bool alpha = false;
};

/// The images for `output`, checked: there, and of its size. Throws Error(input) naming the file
/// and the cure, Error(storage) for what is not there or cannot be read.
OntoImage plan_onto(const TransferOptions& options, const std::string& output,
                    const std::map<std::string, std::string>& tokens, ImageSize size,
                    const shading::TexelFormat& format, const SourceSamples& source);

/// What one triangle takes below, on one image.
inline constexpr std::uint64_t kOccupiedBytes = 36;
/// By page: the UV triangles of the whole target, selected or not.
std::vector<std::shared_ptr<const mesh::UvOccupancy>> occupied_pages(
    const mesh::Mesh& target, const std::vector<TargetPage>& pages, bool by_tile,
    std::uint32_t uv_set);

// --- projection maps -----------------------------------------------------------------------------

/// A target's projection maps, by number.
inline constexpr std::array<const char*, 3> kMapNames{"position", "normal", "mask"};
inline constexpr int kMask = 2;

/// What a job of maps writes, and where. The options must outlive it.
class MapsOutput {
 public:
  /// Throws Error(usage) for patterns that cannot be.
  explicit MapsOutput(const MapsOptions& options);
  bool by_tile() const { return by_tile_; }
  std::string path(const TargetPage& page, int map) const;
  /// Throws Error(usage) for names that clash and formats that do not hold maps, Error(storage)
  /// where no file can be made.
  void plan(const std::vector<TargetPage>& pages);
  /// By map, once it is planned.
  const std::vector<io::ImageWriteSpec>& specs() const { return specs_; }

 private:
  const MapsOptions& options_;
  const bool by_tile_;
  std::vector<io::ImageWriteSpec> specs_;
};

}  // namespace pounce::planning
