// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "flow/plan/target_pages.h"
#include "io/image/read.h"
#include "mesh/mesh.h"
#include "mesh/uv_occupancy.h"
#include "pounce/options.h"
#include "texture/paint_over.h"

namespace pounce::flow {

/// What one output image is painted onto.
struct OntoImage {
  std::string path;
  std::string mask_path;  ///< "" = all of it is painted
  texture::PaintAlpha alpha = texture::PaintAlpha::keep;
  bool keep_last = false;      ///< a fourth channel that is no alpha and that the source has not
  bool in_place = false;       ///< the output takes its place: painted once, it is another image
  bool premultiplied = false;  ///< EXR onto EXR: colours stay multiplied by alpha, bit for bit
  std::uint64_t decoder_bytes = 0;
  std::vector<ImageFormat> allowed_formats;
  /// What padding must not run into; null: there is no padding.
  std::shared_ptr<const mesh::UvOccupancy> occupied;
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
                    const texture::TexelFormat& format, const SourceSamples& source);

/// What one triangle takes below, on one image.
inline constexpr std::uint64_t kOccupiedBytes = 36;
/// By page: the UV triangles of the whole target, selected or not.
std::vector<std::shared_ptr<const mesh::UvOccupancy>> occupied_pages(
    const mesh::Mesh& target, const std::vector<TargetPage>& pages, bool by_tile,
    std::uint32_t uv_set);

/// Paints finished rows over an image that is read beside them, from top to bottom.
class OntoPainter {
 public:
  OntoPainter(const OntoImage& onto, const texture::TexelFormat& format, ImageSize size);
  /// `texels`: new samples of the next `rows` rows, turned into what is written; `kinds`: what the
  /// padder says they are.
  void paint(std::uint32_t rows, const std::uint8_t* kinds, std::byte* texels);
  std::uint64_t filled() const { return filled_; }  ///< padding that was painted
  /// Samples of the old image that stay and that the output's depth cannot hold.
  std::uint64_t clipped() const { return clipped_; }
  bool paints() const { return paints_; }  ///< is any texel so far painted?
  /// Its own, and what the padder says of a stripe of 64 rows.
  static std::uint64_t memory_bytes(const OntoImage& onto, std::uint32_t width);

 private:
  void convert_old(std::size_t count);
  void paint_rows(std::uint32_t rows, const std::uint8_t* kinds, std::byte* texels);

  const OntoImage& onto_;
  texture::TexelFormat format_, painted_format_, onto_format_, mask_format_;
  std::uint32_t width_;
  io::ImageReader image_;
  std::optional<io::ImageReader> mask_;
  std::optional<mesh::UvOccupancy::Rows> occupied_rows_;
  PageVector<std::byte> old_raw_, old_, mask_raw_;
  PageVector<float> weights_;
  PageVector<std::uint8_t> occupied_;
  std::uint64_t filled_ = 0, clipped_ = 0;
  bool paints_ = false;
};

}  // namespace pounce::flow
