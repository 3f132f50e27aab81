// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "flow/project/page_colour.h"
#include "flow/stores/build_stores.h"
#include "gaussian/gaussian_source.h"
#include "gaussian/texel_gaussians.h"
#include "job/job_context.h"
#include "store/blocks/geometry_store.h"

namespace pounce::flow {

/// A mesh's texel as a Gaussian, as exact as it is made.
struct TexelGaussian {
  const gaussian::MeshGaussian& place;
  const gaussian::Footprint& shape;
  std::array<float, 4> rgba;  ///< alpha is 1 where the image has none
};

/// The texels of a textured mesh as Gaussians: by page, then from top to bottom and left to right
/// of the page in blocks of 64x64 texels, then by triangle in file order. No tile cut, thread or
/// budget knows of that order. Nothing is held but a list of the blocks; a range is made anew from
/// the stores whenever it is read.
class TexelSource : public gaussian::GaussianSource {
 public:
  struct Request {
    const store::GeometryStore* geometry = nullptr;
    std::vector<PageColour> pages;  ///< by page of the geometry
    double sigma = gaussian::kSigmaTexels;
    bool densify = false;  ///< split sparse texels: docs/paper.md
    bool linear = false;   ///< colours in linear light, else sRGB-coded
    /// Adds so much of what a blend of these Gaussians would take away from a texel's colour;
    /// without `densify` only.
    double sharpen = 0;
  };
  /// Lists the blocks and counts their Gaussians: decodes each once, or twice to densify. Takes
  /// job.meter through a stage that ends at `progress_end`. Job and stores must outlive it.
  TexelSource(job::JobContext& job, Request request, double progress_end);
  ~TexelSource() override;

  std::uint64_t count() const override { return first_.back(); }
  std::uint32_t lobes() const override { return 0; }
  void read(std::uint64_t first, std::uint64_t count, store::SplatRows& out,
            store::SplatCounts& filtered) const override;
  std::uint64_t read_bytes() const override { return read_bytes_; }
  PageVector<store::Splat> sample() const override;

  /// Visits Gaussians [first, last) in order; what would have its colour in a UDIM tile without
  /// image is passed over. Needs read_bytes().
  void visit(std::uint64_t first, std::uint64_t last,
             const std::function<void(const TexelGaussian&)>& each) const;
  /// The length that texels are split to; 0: none is.
  double spacing() const { return sampling_.spacing; }

  /// What a read needs where the largest block and colour tile are so large.
  static std::uint64_t read_bytes(std::uint64_t triangles, std::uint64_t chunk_bytes,
                                  std::uint64_t colour_tile_bytes, bool sharpens = false);
  /// The most that the list of blocks takes, and the directory of the store that it is made from.
  static std::uint64_t list_bytes(const surface::GeometryRequest& geometry);

 private:
  struct Block;
  void list_blocks();
  double count_blocks();
  store::GeometryBlock decode(const Block& block) const;
  void find_neighbours(const Block& block, gaussian::TexelNeighbours& neighbours) const;

  job::JobContext& job_;
  const Request request_;
  gaussian::TexelSampling sampling_;
  std::uint64_t read_bytes_ = 0;
  std::vector<runtime::Lease> leases_;
  PageVector<Block> blocks_;
  PageVector<std::uint64_t> first_;  ///< by block: its first Gaussian; and the end
};

/// The most texels that a source's triangles cover, a triangle without any counted as one.
std::uint64_t texel_count_bound(const surface::GeometryRequest& geometry);

/// A Gaussian as the store has it. Nothing for one that it cannot hold; `filtered` says why.
bool to_splat(const TexelGaussian& texel, store::Splat& splat, store::SplatCounts& filtered);

}  // namespace pounce::flow
