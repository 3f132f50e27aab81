// SPDX-License-Identifier: Apache-2.0
//
// A mesh in front of a target: exact hits on its facets.
//
//   fetch: the join. Source tiles are never leased whole: of each, only the blocks whose boxes meet
//          the piece's swept boxes are read
//   bin:   a grid over the patches of the batch
//   hit:   the hit kernels; with a height's last batch, what nothing farther can improve is closed
//   blend: each winner's texel in its image, in the winner's frame; of a channel that is of the
//          surface itself, where the winner was met, and so are the colours of vertices
//
// A piece that meets more source than its batch holds goes through it batch by batch: the best hit
// of a texel is a minimum, so batches may be cut anywhere. What the leases leave keeps decoded
// source blocks for the next pieces.
#include "flow/project/mesh.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <optional>

#include "flow/project/block_walk.h"
#include "flow/project/packet_blend.h"
#include "flow/project/page_projector.h"
#include "flow/stores/find_store.h"
#include "surface/texel_frames.h"

namespace pounce::flow {
namespace {

using store::kTexelsPerBlock;

constexpr std::uint64_t kPieceScratch = 256 << 10;  // index pages, candidate lists, encode buffers

/// What one source block costs a batch: itself decoded, what it is decoded from, and its share of
/// the grid.
std::uint64_t batch_cost(std::uint64_t triangles, std::uint64_t patches, bool with_shape) {
  return surface::SourceBlock::decoded_bytes(triangles, patches, with_shape) + patches * 128;
}

/// What blending asks for: the tiles that it keeps and one on its way, or the making of a level.
std::uint64_t colour_bytes(std::uint64_t tile_bytes) {
  return tile_bytes * (ColourWindow::kTiles + 2) + ColourLevels::making_bytes(tile_bytes);
}

std::uint64_t block_state_bytes(std::uint32_t texels, std::uint32_t triangles,
                                std::uint64_t result_texel_bytes, bool with_shape) {
  const std::uint64_t packets = surface::TargetBlock::most_packets(texels);
  const std::uint64_t shape = with_shape ? projection::SurfacePoints::most_bytes(packets) +
                                               surface::TexelFrames::bytes(triangles)
                                         : 0;
  return shape +
         packets * (sizeof(surface::TexelPacket) + sizeof(projection::HitPacket) +
                    sizeof(RayBundle) + 16) +
         2 * kTexelsPerBlock + triangles * (268 + sizeof(surface::TexelAxes)) +
         surface::TargetBlock::record_bytes(triangles == 0 ? texels : 0) +
         kTexelsPerBlock * result_texel_bytes + shading::kMaskBytes + 4 * kPageBytes;
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

bool is_tinted(const ChannelOutput& channel) {
  return std::any_of(channel.pages.begin(), channel.pages.end(),
                     [](const PageColour& page) { return page.tinted; });
}

class SurfaceMethod {
 public:
  /// Blocks are met once, whatever the batch: a larger one saves nothing. Few blocks stay in the
  /// core's cache from node to node, and the pool of pages has their memory ready for the next.
  static constexpr PieceSize kPieceSize{32ULL << 20, 2};

  struct Work : PieceWork {
    projection::SearchState state;
    std::vector<std::vector<surface::TexelAxes>> axes;  ///< by block
    std::size_t height = 0;                             ///< index of the height at hand
    std::optional<BlockWalk<SurfaceCache>> walk;        ///< over the blocks of this height
    std::vector<std::shared_ptr<const surface::SourceBlock>> batch;
    std::optional<grid::PatchGrid> grid;  ///< over the batch
    projection::SurfacePoints points;     ///< of channels that need them
  };

  SurfaceMethod(job::JobContext& job, MeshProjection request)
      : job_(&job),
        request_(std::move(request)),
        heights_(projection::search_heights(std::min(
            request_.limits.max_distance, farthest(request_.source->store().directory().box,
                                                   request_.target->directory().box)))) {
    for (const ChannelOutput& channel : request_.channels) {
      result_texel_bytes_ += channel.format.texel_bytes();
      with_shape_ = with_shape_ || channel.shape || is_tinted(channel);
    }
  }

  std::size_t channels() const { return request_.channels.size(); }

  std::uint64_t fixed_bytes() const {
    std::uint64_t largest = 0;
    for (const ChannelOutput& channel : request_.channels) {
      for (const PageColour& page : channel.pages) largest = std::max(largest, tile_bytes(page));
    }
    return kPieceScratch + colour_bytes(largest);
  }

  std::uint64_t least_batch_bytes() const {
    const store::GeometryDirectory& d = request_.source->store().directory();
    return batch_cost(d.most_triangles, d.most_patches, with_shape_) +
           grid::PatchGrid::most_bytes(0) + 3 * std::uint64_t{d.largest_chunk_bytes};
  }

  std::uint64_t state_bytes(const store::BlockEntry& entry) const {
    return block_state_bytes(entry.texels, entry.triangles, result_texel_bytes_, with_shape_);
  }

  void begin(Work& work) const {
    read_packets(*job_, *request_.target, request_.smallest_edge,
                 surface::TargetBlock::Start::inset, work, work.state.packets, work.state.groups,
                 &work.axes);
    projection::start(work.state);
    if (with_shape_) work.points.start(work.state.packets.size());
    // Neighbouring pieces lie about as far from the source: start where the last one found it.
    const float expected = neighbours_->distance.load(std::memory_order_relaxed);
    while (work.height + 1 < heights_.size() && heights_[work.height] < expected) ++work.height;
  }

  /// Height after height: every source block that the open texels may meet goes past them.
  std::uint64_t fetch(Work& work) const {
    work.grid.reset();
    work.batch.clear();
    while (!work.state.open.empty() && work.height < heights_.size()) {
      if (!work.walk) {
        work.walk.emplace(*request_.source, projection::open_boxes(work.state, work.blocks.size(),
                                                                   heights_[work.height]));
      }
      if (!work.walk->done()) return take(work);
      end_height(work);
    }
    neighbours_->distance.store(projection::middle_distance(work.state), std::memory_order_relaxed);
    return 0;
  }

  static void bin(Work& work) {
    std::vector<const surface::SourceBlock*> blocks;
    for (const auto& block : work.batch) blocks.push_back(block.get());
    work.grid.emplace(blocks, work.walk->region());
  }

  void hit(Work& work) const {
    projection::search_batch(*work.grid, heights_[work.height], request_.limits, *request_.kernels,
                             work.state);
    if (with_shape_) work.points.follow(work.state, work.batch);
    if (work.walk->done()) end_height(work);
  }

  void blend(Work& work) const {
    work.stored.resize(request_.channels.size());
    work.raw_bytes.resize(request_.channels.size());
    work.covered.resize(request_.channels.size());
    work.distance_steps =
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

 private:
  std::uint64_t take(Work& work) const {
    work.batch = work.walk->take(work.batch_bytes, [&](const store::BlockEntry& entry) {
      return batch_cost(entry.triangles, entry.patches, with_shape_);
    });
    std::uint64_t bytes = 0;
    for (const auto& block : work.batch) {
      bytes += surface::SourceBlock::decoded_bytes(block->facets.size(), block->patches.size(),
                                                   with_shape_);
    }
    return bytes;
  }

  void end_height(Work& work) const {
    projection::close_groups(heights_[work.height], *request_.kernels, work.state);
    work.walk.reset();
    ++work.height;
  }

  // --- colours -----------------------------------------------------------------------------------

  /// What blending a block goes on with from packet to packet.
  struct BlockBlend {
    ColourWindow window;
    PacketBlend packet;
  };

  static projection::Footprint footprint(const Work& work, std::size_t packet, int lane) {
    const surface::TexelPacket& texels = work.state.packets[packet];
    return footprint_at(work.state.hits[packet], texels, work.axes[texels.block], lane);
  }

  /// Writes the colour of one hit in the output's format and adds the samples that it cannot hold
  /// to `clipped`. False: it met a UDIM tile without image.
  bool store_colour(const ChannelOutput& channel, const Work& work, std::size_t packet, int lane,
                    BlockBlend& blend, std::byte* out, std::uint64_t& clipped) const {
    if (blend.packet.has_texel(lane)) {
      std::memcpy(out, blend.packet.texel(lane), channel.format.texel_bytes());
      return true;
    }
    const projection::HitPacket& hit = work.state.hits[packet];
    const PageColour& page = channel.pages[static_cast<std::size_t>(hit.page[lane])];
    std::optional<shading::Factor> vertices;
    if (page.tinted) vertices = vertex_factor(work.points[packet].colour(lane));
    const shading::Factor* const tint = vertices ? &*vertices : nullptr;
    if (page.column == nullptr && page.tile_set == nullptr) {
      clipped +=
          shading::store_texel(channel.format, constant_value(page, tint, channel.format), out);
      return true;
    }
    if (blend.packet.has_samples(lane)) {
      clipped += shading::store_texel(
          channel.format, lanes_value(page, blend.packet, lane, channel.format, tint), out);
      return true;
    }
    const PageImage image = image_at(page, place_of(hit, lane));
    if (image.column == nullptr) return false;
    const auto lookups = image.lookups(footprint(work, packet, lane));
    if (lookups.single() && image.input == nullptr && !page.factor && !vertices &&
        channel.format.keeps(image.directory())) {
      const ColourPlace at = blend.window.find(image);
      projection::Taps taps;
      request_.blend(at.rest_x, at.rest_y, taps);
      projection::sharpen(lookups.sharpening, at.rest_x, at.rest_y, taps);
      projection::blend_u8(*at.image, at.tile, at.column, at.row, taps, out);
    } else {
      clipped += shading::store_texel(
          channel.format, value(page, image, lookups, channel.format, blend.window, tint), out);
    }
    return true;
  }

  /// What was looked up with the lanes beside it.
  static shading::TexelValue lanes_value(const PageColour& page, const PacketBlend& packet,
                                         int lane, const shading::TexelFormat& format,
                                         const shading::Factor* tint = nullptr) {
    const PageImage& image = packet.image(lane);
    return value_of(page, image.directory(), image.input, packet.samples(lane),
                    stays_premultiplied(image.directory(), image.input, format), format, tint);
  }

  shading::TexelValue value(const PageColour& page, const PageImage& image,
                            const projection::FootprintLookups& lookups,
                            const shading::TexelFormat& format, ColourWindow& window,
                            const shading::Factor* tint = nullptr) const {
    if (!lookups.single())
      return window.average(page, image, lookups, request_.blend, format, *request_.levels, tint);
    const ColourPlace at = window.find(image);
    projection::Taps taps;
    request_.blend(at.rest_x, at.rest_y, taps);
    projection::sharpen(lookups.sharpening, at.rest_x, at.rest_y, taps);
    return blended(page, at, taps, format, tint);
  }

  /// What the pages of a channel give at a hit. Nothing: it met a UDIM tile without image.
  std::optional<shading::TexelValue> page_value(const ChannelOutput& channel, const Work& work,
                                                std::size_t packet, int lane,
                                                BlockBlend& blend) const {
    const projection::HitPacket& hit = work.state.hits[packet];
    const PageColour& page = channel.pages[static_cast<std::size_t>(hit.page[lane])];
    if (page.column == nullptr && page.tile_set == nullptr) return page.constant;
    shading::TexelFormat straight = channel.format;
    straight.premultiplied = false;
    if (blend.packet.has_samples(lane)) return lanes_value(page, blend.packet, lane, straight);
    const PageImage image = image_at(page, place_of(hit, lane));
    if (image.column == nullptr) return std::nullopt;
    return value(page, image, image.lookups(footprint(work, packet, lane)), straight, blend.window);
  }

  /// The same as store_colour() for a channel of the surface itself. `frames` are of
  /// the texel's block, where it is a normal map.
  bool store_shape(const ChannelOutput& channel, const Work& work, std::uint32_t p, int lane,
                   const surface::TexelFrames* frames, BlockBlend& blend, std::byte* out,
                   std::uint64_t& clipped) const {
    const ShapeOutput& shape = *channel.shape;
    const projection::SurfacePacket& surface = work.points[p];
    if (!is_normal(shape)) {
      clipped += shading::store_texel(channel.format, baked_value(shape, surface, lane), out);
      return true;
    }
    const projection::HitPacket& hit = work.state.hits[p];
    const auto map = page_value(channel, work, p, lane, blend);
    if (!map) return false;
    const TangentFrame target = frames->frame(work.state.packets[p].texel[lane]);
    clipped += shading::store_texel(
        channel.format,
        transferred_normal(shape, hit.page[lane], *map, surface.frame(lane), target), out);
    return true;
  }

  /// The frames of a block's texels, read again: only a normal map needs them.
  struct BlockFrames {
    store::GeometryBlock block;
    surface::TexelFrames frames;
    BlockFrames(job::JobContext& job, const store::GeometryStore& target,
                const store::BlockEntry& entry)
        : block(target.read_block(entry, job.compressor())),
          frames(block, target.directory().pages[entry.page]) {}
  };

  void blend_block(Work& work, std::size_t c, std::size_t b, std::uint32_t first,
                   std::uint32_t last) const {
    const ChannelOutput& channel = request_.channels[c];
    const std::size_t texel_bytes = channel.format.texel_bytes();
    shading::ResultBlock result;
    result.texels.resize(kTexelsPerBlock * texel_bytes);
    BlockBlend blend{{}, {*request_.lanes, request_.blend, *request_.levels}};
    std::uint64_t covered = 0;
    std::optional<BlockFrames> own;
    if (channel.shape && is_normal(*channel.shape))
      own.emplace(*job_, *request_.target, work.blocks[b]);
    for (std::uint32_t p = first; p < last; ++p) {
      const projection::HitPacket& hit = work.state.hits[p];
      const surface::TexelPacket& texels = work.state.packets[p];
      if (!channel.shape || is_normal(*channel.shape)) {
        blend.packet.look_up(channel.pages, hit, texels, work.axes[texels.block], channel.format,
                             !channel.shape, blend.window);
      }
      for (int lane = 0; lane < surface::kLanes; ++lane) {
        if (!is_hit(hit, texels, lane)) continue;
        const std::uint16_t texel = texels.texel[lane];
        std::byte* const out = result.texels.data() + texel * texel_bytes;
        const bool has_value =
            channel.shape ? store_shape(channel, work, p, lane, own ? &own->frames : nullptr, blend,
                                        out, work.clipped[c])
                          : store_colour(channel, work, p, lane, blend, out, work.clipped[c]);
        if (!has_value) continue;
        result.cover(texel);
        ++covered;
      }
    }
    work.covered[c] += covered;
    if (covered == 0) return;
    finish_block(*job_, channel.format, result, c, b, work);
  }

  /// How far away the piece before found the source. Only saves work.
  struct Neighbours {
    std::atomic<float> distance{0};
  };

  job::JobContext* job_;
  MeshProjection request_;
  std::vector<float> heights_;
  std::shared_ptr<Neighbours> neighbours_ = std::make_shared<Neighbours>();
  std::uint64_t result_texel_bytes_ = 0;
  bool with_shape_ = false;  ///< is some channel of the surface itself?
};

/// Says damaged, not too little memory, where the source lies about its largest blocks.
class CheckedProjection : public Projection {
 public:
  CheckedProjection(job::JobContext& job, const MeshProjection& request)
      : job_(job),
        source_(request.source->store()),
        projector_(job, *request.target, SurfaceMethod(job, request)) {}

  PageResult project() override {
    try {
      return projector_.project();
    } catch (const Error& e) {
      if (e.kind() == ErrorKind::budget) check_largest(job_, source_);
      throw;
    }
  }

 private:
  job::JobContext& job_;
  const store::GeometryStore& source_;
  PageProjector<SurfaceMethod> projector_;
};

}  // namespace

std::unique_ptr<Projection> project_mesh(job::JobContext& job, const MeshProjection& request) {
  return std::make_unique<CheckedProjection>(job, request);
}

std::uint64_t project_least_bytes(std::uint32_t most_triangles, std::uint32_t most_patches,
                                  std::uint32_t largest_chunk_bytes,
                                  std::uint64_t result_texel_bytes, std::uint64_t colour_tile_bytes,
                                  bool with_shape) {
  return kPieceScratch + colour_bytes(colour_tile_bytes) +
         batch_cost(most_triangles, most_patches, with_shape) +
         3 * std::uint64_t{largest_chunk_bytes} +
         block_state_bytes(kTexelsPerBlock, store::kMostTrianglesPerBlock, result_texel_bytes,
                           with_shape);
}

}  // namespace pounce::flow
