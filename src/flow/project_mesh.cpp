// SPDX-License-Identifier: Apache-2.0
//
// The join of a mesh's store with a target's: source blocks stream past each piece of the target.
//
//   target_stream: read ─▶ search ─▶ blend ─▶ store
//                             │ (join, grid, hit: height after height, batch after batch)
//                           source store
//
// Source tiles are never leased whole: of each, only the blocks whose boxes meet the piece's swept
// boxes are read. A piece that meets more source than its batch holds goes through it batch by
// batch: the best hit of a texel is a minimum, so batches may be cut anywhere. What the leases
// leave keeps decoded source blocks for the next pieces.
#include "flow/project_mesh.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <optional>

#include "flow/find_store.h"
#include "flow/source_cache.h"

namespace pounce::flow {
namespace {

using tiles::kTexelsPerBlock;

constexpr std::uint64_t kPieceScratch = 256 << 10;  // index pages, candidate lists, encode buffers

/// What one source block costs a batch: itself decoded, what it is decoded from, and its share of
/// the grid.
std::uint64_t batch_cost(std::uint64_t triangles, std::uint64_t patches) {
  return source::SourceBlock::decoded_bytes(triangles, patches) + patches * 128;
}

std::uint64_t block_state_bytes(std::uint32_t texels, std::uint32_t triangles,
                                std::uint64_t result_texel_bytes) {
  const std::uint64_t packets = target::TargetBlock::most_packets(texels);
  return packets * (sizeof(target::TexelPacket) + sizeof(projection::HitPacket) +
                    sizeof(RayBundle) + 16) +
         2 * kTexelsPerBlock + std::uint64_t{triangles} * 268 +
         kTexelsPerBlock * result_texel_bytes + texture::kMaskBytes + 4 * kPageBytes;
}

/// How far from a texel a hit can be: looking farther finds nothing, and heights are shares of how
/// far a search looks. A hit lies outside of its triangle by no more than the triangle's size.
float farthest(const Box3f& source, const Box3f& target) {
  if (source.empty() || target.empty()) return 0;
  Box3f both = source;
  both.extend(target);
  const double apart = length(Vec3d(both.hi) - Vec3d(both.lo));
  const double size = length(Vec3d(source.hi) - Vec3d(source.lo));
  return static_cast<float>((apart + size) * 1.001);
}

struct Work : PieceWork {
  projection::SearchState state;
};

class MeshProjector : public PageProjector {
 public:
  MeshProjector(JobContext& job, MeshProjection request)
      : job_(job),
        request_(std::move(request)),
        cache_(job, *request_.source),
        heights_(projection::search_heights(std::min(
            request_.limits.max_distance,
            farthest(request_.source->directory().box, request_.target->directory().box)))) {
    for (const ChannelOutput& channel : request_.channels)
      result_texel_bytes_ += channel.format.texel_bytes();
    cut();
  }

  ~MeshProjector() override { job_.report.tiles_read += cache_.tiles_read(); }

  PageResult project(std::uint32_t page) override {
    return stream_page<Work>(
        job_, *request_.target, target_.pieces, page, request_.channels.size(),
        [&](const Piece& piece) { return read_piece(piece); },
        [&](Work& work) { search_piece(work); }, [&](Work& work) { blend_piece(work); });
  }

 private:
  // --- before the stream -------------------------------------------------------------------------

  std::uint64_t source_least() const {
    const tiles::GeometryDirectory& d = request_.source->directory();
    return batch_cost(d.most_triangles, d.most_patches) + grid::PatchGrid::most_bytes(0) +
           3 * std::uint64_t{d.largest_chunk_bytes};
  }

  std::uint64_t colour_bytes() const {
    std::uint64_t largest = 0;
    for (const ChannelOutput& channel : request_.channels) {
      for (const PageColour& page : channel.pages) largest = std::max(largest, tile_bytes(page));
    }
    return largest * (ColourWindow::kTiles + 2);
  }

  void cut() {
    const std::uint64_t fixed = kPieceScratch + colour_bytes();
    try {
      target_ = cut_target(
          job_, *request_.target, fixed, source_least(), [&](const tiles::BlockEntry& entry) {
            return block_state_bytes(entry.texels, entry.triangles, result_texel_bytes_);
          });
    } catch (const Error& e) {
      if (e.kind() == ErrorKind::budget) check_largest(job_, *request_.source);
      throw;
    }
  }

  // --- the stream --------------------------------------------------------------------------------

  std::shared_ptr<Work> read_piece(const Piece& piece) {
    auto work = std::make_shared<Work>();
    read_packets(job_, *request_.target, piece, request_.smallest_edge,
                 target::TargetBlock::Start::inset, *work, work->state.packets, work->state.groups);
    projection::start(work->state);
    return work;
  }

  /// Height after height: every source block that the open texels may meet goes past them.
  void search_piece(Work& work) {
    // Neighbouring pieces lie about as far from the source: start where the last one found it.
    const float expected = expected_distance_.load(std::memory_order_relaxed);
    for (const float height : heights_) {
      if (work.state.open.empty()) break;
      if (height < expected && height != heights_.back()) continue;
      const auto boxes = projection::open_boxes(work.state, work.blocks.size(), height);
      Box3f all;
      for (const Box3f& box : boxes) all.extend(box);
      std::vector<std::shared_ptr<const source::SourceBlock>> batch;
      std::uint64_t bytes = 0;
      const auto flush = [&] {
        if (!batch.empty()) search_one_batch(batch, all, height, work);
        batch.clear();
        bytes = 0;
      };
      const auto& tiles = request_.source->directory().tiles;
      for (std::uint32_t t = 0; t < tiles.size(); ++t) {
        if (!tiles[t].box.overlaps(all)) continue;
        const auto index = cache_.index(t);
        for (const tiles::BlockEntry& entry : *index) {
          if (!meets(entry, boxes)) continue;
          const std::uint64_t cost = batch_cost(entry.triangles, entry.patches);
          if (bytes + cost > target_.batch_bytes) flush();
          bytes += cost;
          batch.push_back(cache_.block(entry));
        }
      }
      flush();
      projection::close_groups(height, *request_.kernels, work.state);
    }
    expected_distance_.store(projection::middle_distance(work.state), std::memory_order_relaxed);
  }

  static bool meets(const tiles::BlockEntry& entry, const std::vector<Box3f>& boxes) {
    for (std::uint32_t i = 0; i < entry.box_count; ++i) {
      for (const Box3f& box : boxes) {
        if (entry.boxes[i].overlaps(box)) return true;
      }
    }
    return false;
  }

  void search_one_batch(const std::vector<std::shared_ptr<const source::SourceBlock>>& batch,
                        const Box3f& region, float height, Work& work) {
    std::vector<const source::SourceBlock*> blocks;
    for (const auto& block : batch) blocks.push_back(block.get());
    grid::PatchGrid grid(blocks, region);
    projection::search_batch(grid, height, request_.limits, *request_.kernels, work.state);
  }

  // --- colours -----------------------------------------------------------------------------------

  /// Writes the colour of one hit in the output's format and adds the samples that it cannot hold
  /// to `clipped`. False: it met a UDIM tile without image.
  bool store_colour(const ChannelOutput& channel, const projection::HitPacket& hit, int lane,
                    ColourWindow& window, std::byte* out, std::uint64_t& clipped) const {
    const PageColour& page = channel.pages[static_cast<std::size_t>(hit.page[lane])];
    if (page.column == nullptr && page.tile_set == nullptr) {
      clipped += texture::store_texel(channel.format, page.constant, out);
      return true;
    }
    const ColourPlace at =
        window.find(page, {hit.base_x[lane], hit.base_y[lane], hit.frac_x[lane], hit.frac_y[lane]});
    if (at.image == nullptr) return false;
    projection::Taps taps;
    request_.blend(at.rest_x, at.rest_y, taps);
    if (channel.format.keeps(*at.image)) {
      projection::blend_u8(*at.image, at.tile, at.column, at.row, taps, out);
    } else {
      clipped += texture::store_texel(channel.format,
                                      blended(at, taps, channel.format.premultiplied), out);
    }
    return true;
  }

  void blend_piece(Work& work) {
    work.stored.resize(request_.channels.size());
    work.raw_bytes.resize(request_.channels.size());
    work.covered.resize(request_.channels.size());
    projection::count_distances(request_.limits.max_distance, work.state, work.distances);
    work.clipped.resize(request_.channels.size());
    std::vector<std::uint32_t> first_packet(work.blocks.size() + 1, 0);
    for (const auto& packet : work.state.packets) ++first_packet[packet.block + 1];
    for (std::size_t b = 0; b < work.blocks.size(); ++b) first_packet[b + 1] += first_packet[b];
    for (std::size_t c = 0; c < request_.channels.size(); ++c) {
      work.stored[c].resize(work.blocks.size());
      for (std::size_t b = 0; b < work.blocks.size(); ++b) {
        blend_block(work, c, b, first_packet[b], first_packet[b + 1]);
      }
    }
  }

  void blend_block(Work& work, std::size_t c, std::size_t b, std::uint32_t first,
                   std::uint32_t last) {
    const ChannelOutput& channel = request_.channels[c];
    const std::size_t texel_bytes = channel.format.texel_bytes();
    texture::ResultBlock result;
    result.texels.resize(kTexelsPerBlock * texel_bytes);
    ColourWindow window(cache_);
    std::uint64_t covered = 0;
    for (std::uint32_t p = first; p < last; ++p) {
      const projection::HitPacket& hit = work.state.hits[p];
      for (int lane = 0; lane < target::kLanes; ++lane) {
        const std::uint16_t texel = work.state.packets[p].texel[lane];
        if (texel == target::kNoTexel || hit.key[lane] == projection::kNoHit) continue;
        std::byte* const out = result.texels.data() + texel * texel_bytes;
        if (!store_colour(channel, hit, lane, window, out, work.clipped[c])) continue;
        result.cover(texel);
        ++covered;
      }
    }
    work.covered[c] += covered;
    if (covered == 0) return;
    finish_block(job_, channel.format, result, c, b, work);
  }

  JobContext& job_;
  const MeshProjection request_;
  SourceCache cache_;
  std::vector<float> heights_;
  std::atomic<float> expected_distance_{0};
  std::uint64_t result_texel_bytes_ = 0;
  CutTarget target_;
};

}  // namespace

std::unique_ptr<PageProjector> project_mesh(JobContext& job, MeshProjection request) {
  return std::make_unique<MeshProjector>(job, std::move(request));
}

std::uint64_t project_least_bytes(std::uint32_t most_triangles, std::uint32_t most_patches,
                                  std::uint32_t largest_chunk_bytes,
                                  std::uint64_t result_texel_bytes,
                                  std::uint64_t colour_tile_bytes) {
  return kPieceScratch + colour_tile_bytes * (ColourWindow::kTiles + 2) +
         batch_cost(most_triangles, most_patches) + 3 * std::uint64_t{largest_chunk_bytes} +
         block_state_bytes(kTexelsPerBlock, tiles::kMostTrianglesPerBlock, result_texel_bytes);
}

}  // namespace pounce::flow
