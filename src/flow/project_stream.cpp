// SPDX-License-Identifier: Apache-2.0
//
// The join: target pieces stream through the graph, source blocks stream past each piece.
//
//   pump ─▶ read ─▶ search ─▶ blend ─▶ store
//             ▲        │ (join, grid, hit: height after height, batch after batch)
//         target     source                    results
//          store      store                     (scratch)
//
// A piece is a few neighbouring target blocks, cut so that its lease (its texels' state, its
// result, and room for a batch of decoded source blocks) is at most budget / (4 x threads): the
// rest keeps decoded source blocks for the next pieces. Source tiles are never leased whole: of
// each, only the blocks whose boxes meet the piece's swept boxes are read. A piece that meets more
// source than its batch holds goes through it batch by batch: the best hit of a texel is a minimum,
// so batches may be cut anywhere.
#include "flow/project_stream.h"

#include <tbb/flow_graph.h>

#include <algorithm>
#include <atomic>
#include <cmath>

#include "flow/pump.h"
#include "flow/source_cache.h"

namespace pounce::flow {
namespace {

namespace tf = tbb::flow;
using tiles::kTexelsPerBlock;

constexpr std::uint32_t kMostBlocksPerPiece = 8;
constexpr std::uint64_t kColourTilesAtOnce = 8;
constexpr std::uint64_t kLargestShare = 32ULL << 20;  // beyond this a larger batch saves nothing
constexpr std::uint64_t kPieceScratch = 256 << 10;  // index pages, candidate lists, encode buffers

/// Neighbouring blocks of one target tile.
struct Piece {
  std::uint32_t tile = 0, first = 0, count = 0;
};

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
         2 * kTexelsPerBlock + std::uint64_t{triangles} * 220 +
         kTexelsPerBlock * result_texel_bytes + texture::kMaskBytes + 4 * kPageBytes;
}

/// A piece on its way through the graph.
struct Work {
  std::size_t index = 0;
  std::vector<tiles::BlockEntry> blocks;
  std::vector<target::TargetBlock> maps;
  projection::SearchState state;
  /// [channel][block], encoded and compressed; empty: nothing covered.
  std::vector<std::vector<std::vector<std::byte>>> stored;
  std::vector<std::uint32_t> raw_bytes;  ///< [channel]
  std::uint64_t covered = 0;
};
using WorkPtr = std::shared_ptr<Work>;

class Projector {
 public:
  Projector(JobContext& job, const ProjectRequest& request)
      : job_(job),
        request_(request),
        cache_(job, *request.source),
        heights_(projection::search_heights(request.limits.max_distance)) {
    for (const ChannelOutput& channel : request.channels)
      result_texel_bytes_ += channel.format.texel_bytes();
  }

  ProjectResult run() {
    cut_pieces();
    const Lease index_lease(job_.budget,
                            pieces_.size() * (sizeof(Piece) + 8) + result_index_bytes(),
                            "the index of the target");
    check_largest();
    writer_ = job_.scratch->create(tiles::PackKind::results, Hash128{});
    for (std::size_t c = 0; c < request_.channels.size(); ++c)
      result_.channels.push_back(empty_index());
    stream();
    finish();
    return std::move(result_);
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
      for (const PageColour& page : channel.pages) {
        if (page.column != nullptr) largest = std::max(largest, page.column->tile_bytes());
      }
    }
    return largest * (kColourTilesAtOnce + 2);
  }

  /// Cuts each target tile into pieces of whole blocks: few enough that state fits half a share of
  /// the budget.
  void cut_pieces() {
    const std::uint64_t share = std::min(
        kLargestShare, job_.budget.limit() / (4 * std::uint64_t{std::max(job_.threads, 1U)}));
    const std::uint64_t fixed = kPieceScratch + colour_bytes();
    batch_bytes_ = std::max(source_least(), share > fixed ? (share - fixed) / 2 : 0);
    const std::uint64_t state_share =
        share > fixed + batch_bytes_ ? share - fixed - batch_bytes_ : 0;
    const auto& tiles = request_.target->directory().tiles;
    for (std::uint32_t t = 0; t < tiles.size(); ++t) {
      const auto blocks = request_.target->read_index(t, job_.compressor());
      Piece piece{t, 0, 0};
      std::uint64_t state = 0;
      for (std::uint32_t b = 0; b < blocks.size(); ++b) {
        const std::uint64_t more =
            block_state_bytes(blocks[b].texels, blocks[b].triangles, result_texel_bytes_);
        if (piece.count > 0 && (piece.count == kMostBlocksPerPiece || state + more > state_share)) {
          add_piece(piece, fixed + batch_bytes_ + state);
          piece = {t, b, 0};
          state = 0;
        }
        ++piece.count;
        state += more;
      }
      if (piece.count > 0) add_piece(piece, fixed + batch_bytes_ + state);
    }
  }

  void add_piece(const Piece& piece, std::uint64_t cost) {
    pieces_.push_back(piece);
    costs_.push_back(cost);
  }

  void check_largest() {
    if (costs_.empty()) return;
    const Lease fits(job_.budget, *std::max_element(costs_.begin(), costs_.end()),
                     "projecting one block of the target");
  }

  ResultIndex empty_index() const {
    ResultIndex index;
    for (const mesh::Lattice& page : request_.target->directory().pages) {
      index.pages.emplace_back(std::size_t{blocks_across(page.width)} * blocks_across(page.height));
    }
    return index;
  }

  std::uint64_t result_index_bytes() const {
    std::uint64_t blocks = 0;
    for (const mesh::Lattice& page : request_.target->directory().pages) {
      blocks += std::uint64_t{blocks_across(page.width)} * blocks_across(page.height);
    }
    return blocks * sizeof(tiles::ChunkRef) * request_.channels.size();
  }

  static std::uint32_t blocks_across(std::uint32_t texels) {
    return (texels + mesh::kBlockEdge - 1) / mesh::kBlockEdge;
  }

  // --- the stream --------------------------------------------------------------------------------

  void stream() {
    std::size_t stored = 0;
    tf::graph graph;
    tf::function_node<std::size_t, WorkPtr> read(graph, tf::unlimited,
                                                 [&](std::size_t i) { return read_piece(i); });
    tf::function_node<WorkPtr, WorkPtr> search(graph, tf::unlimited, [&](WorkPtr work) {
      search_piece(*work);
      return work;
    });
    tf::function_node<WorkPtr, WorkPtr> blend(graph, tf::unlimited, [&](WorkPtr work) {
      blend_piece(*work);
      return work;
    });
    auto pump = Pump(job_.budget, costs_, [&](std::size_t i) { read.try_put(i); });
    tf::function_node<WorkPtr> store(graph, tf::serial, [&](const WorkPtr& work) {
      store_piece(*work);
      const std::size_t index = work->index;
      *work = Work{};  // its memory goes before its lease does; the graph still holds the object
      ++stored;
      pump.release(index);
    });
    tf::make_edge(read, search);
    tf::make_edge(search, blend);
    tf::make_edge(blend, store);
    pump.admit();
    graph.wait_for_all();  // rethrows
    if (stored != pieces_.size())
      throw Error(ErrorKind::internal, "the projection graph ended early");
  }

  WorkPtr read_piece(std::size_t index) {
    const Piece& piece = pieces_[index];
    auto work = std::make_shared<Work>();
    work->index = index;
    const auto entries = request_.target->read_index(piece.tile, job_.compressor());
    work->blocks.assign(entries.begin() + piece.first, entries.begin() + piece.first + piece.count);
    std::size_t most_packets = 0;
    for (const auto& entry : work->blocks)
      most_packets += target::TargetBlock::most_packets(entry.texels);
    work->state.packets.reserve(most_packets);
    for (std::uint32_t b = 0; b < work->blocks.size(); ++b) {
      const tiles::BlockEntry& entry = work->blocks[b];
      const tiles::GeometryBlock block = request_.target->read_block(entry, job_.compressor());
      work->maps.emplace_back(block, request_.target->directory().pages[entry.page],
                              request_.smallest_edge);
      work->maps.back().make_packets(b, work->state.packets, work->state.groups);
    }
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
          if (bytes + cost > batch_bytes_) flush();
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

  /// The tiles a blend just used: neighbouring texels mostly want the same one.
  class TileWindow {
   public:
    explicit TileWindow(SourceCache& cache) : cache_(cache) {}
    const std::byte* get(const tiles::ColourStore& column, std::uint32_t x, std::uint32_t y) {
      const auto holds = [&](const Slot& slot) {
        return slot.column == &column && slot.x == x && slot.y == y;
      };
      if (holds(slots_[last_])) return slots_[last_].tile->data();
      for (last_ = 0; last_ < slots_.size(); ++last_) {
        if (holds(slots_[last_])) return slots_[last_].tile->data();
      }
      last_ = next_++ % kColourTilesAtOnce;
      Slot& slot = slots_[last_];
      slot.tile = cache_.colours(column, x, y);
      slot.column = &column;
      slot.x = x;
      slot.y = y;
      return slot.tile->data();
    }

   private:
    struct Slot {
      const tiles::ColourStore* column = nullptr;
      std::uint32_t x = 0, y = 0;
      std::shared_ptr<const tiles::ColourTile> tile;
    };
    SourceCache& cache_;
    std::array<Slot, kColourTilesAtOnce> slots_;
    std::size_t last_ = 0;    ///< the slot used last
    std::uint64_t next_ = 0;  ///< counts replacements
  };

  /// Writes the colour of one hit in the output's format.
  void store_colour(const ChannelOutput& channel, const projection::HitPacket& hit, int lane,
                    TileWindow& window, std::byte* out) const {
    const PageColour& page = channel.pages[static_cast<std::size_t>(hit.page[lane])];
    if (page.column == nullptr) {
      texture::store_texel(channel.format, page.constant, out);
      return;
    }
    const tiles::ColourDirectory& image = page.column->directory();
    const projection::Coordinate x =
        projection::placed(hit.base_x[lane], hit.frac_x[lane], image.width, image.wrap_u);
    const projection::Coordinate y =
        projection::placed(hit.base_y[lane], hit.frac_y[lane], image.height, image.wrap_v);
    // Texel -1 belongs to the first tile's apron.
    const std::int32_t tile_x = std::max(x.texel, 0) / mesh::kBlockEdge,
                       tile_y = std::max(y.texel, 0) / mesh::kBlockEdge;
    const std::byte* const tile = window.get(*page.column, static_cast<std::uint32_t>(tile_x),
                                             static_cast<std::uint32_t>(tile_y));
    projection::Taps taps;
    request_.blend(x.rest, y.rest, taps);
    const int column = x.texel - tile_x * mesh::kBlockEdge,
              row = y.texel - tile_y * mesh::kBlockEdge;
    if (channel.format.keeps(image)) {
      projection::blend_u8(image, tile, column, row, taps, out);
    } else {
      texture::store_texel(
          channel.format,
          {projection::blend(image, tile, column, row, taps), image.channels, image.linear}, out);
    }
  }

  void blend_piece(Work& work) {
    work.stored.resize(request_.channels.size());
    work.raw_bytes.resize(request_.channels.size());
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
    TileWindow window(cache_);
    std::uint64_t covered = 0;
    for (std::uint32_t p = first; p < last; ++p) {
      const projection::HitPacket& hit = work.state.hits[p];
      for (int lane = 0; lane < target::kLanes; ++lane) {
        const std::uint16_t texel = work.state.packets[p].texel[lane];
        if (texel == target::kNoTexel || hit.key[lane] == projection::kNoHit) continue;
        store_colour(channel, hit, lane, window, result.texels.data() + texel * texel_bytes);
        result.cover(texel);
        ++covered;
      }
    }
    if (c == 0) work.covered += covered;
    if (covered == 0) return;
    std::vector<std::byte> raw;
    texture::encode(result, channel.format, raw);
    work.raw_bytes[c] = static_cast<std::uint32_t>(raw.size());
    job_.compressor().compress(raw, work.stored[c][b], tiles::kScratchLevel);
  }

  void store_piece(const Work& work) {
    std::uint64_t texels = 0;
    for (std::size_t b = 0; b < work.blocks.size(); ++b) {
      const tiles::BlockEntry& entry = work.blocks[b];
      texels += entry.texels;
      const std::uint32_t across =
          blocks_across(request_.target->directory().pages[entry.page].width);
      const auto slot =
          static_cast<std::size_t>(entry.y) * across + static_cast<std::size_t>(entry.x);
      for (std::size_t c = 0; c < request_.channels.size(); ++c) {
        const auto& stored = work.stored[c][b];
        if (stored.empty()) continue;
        result_.channels[c].pages[entry.page][slot] =
            writer_->append(tiles::ChunkKind::block, stored, work.raw_bytes[c]);
      }
    }
    result_.covered += work.covered;
    job_.meter.advance(texels);
  }

  void finish() {
    job_.report.tiles_read += cache_.tiles_read();
    std::vector<std::byte> nothing(1), stored;
    job_.compressor().compress(nothing, stored);
    writer_->finish(writer_->append(tiles::ChunkKind::directory, stored, 1));
    job_.report.temp_peak_bytes = std::max(job_.report.temp_peak_bytes, writer_->size_bytes());
    result_.pack = job_.scratch->publish(std::move(writer_));
  }

  JobContext& job_;
  const ProjectRequest& request_;
  SourceCache cache_;
  std::vector<float> heights_;
  std::atomic<float> expected_distance_{0};
  std::uint64_t result_texel_bytes_ = 0;
  std::uint64_t batch_bytes_ = 0;
  std::vector<Piece> pieces_;
  std::vector<std::uint64_t> costs_;
  std::unique_ptr<tiles::PackWriter> writer_;
  ProjectResult result_;
};

}  // namespace

ProjectResult project(JobContext& job, const ProjectRequest& request) {
  return Projector(job, request).run();
}

std::uint64_t project_least_bytes(std::uint32_t most_triangles, std::uint32_t most_patches,
                                  std::uint32_t largest_chunk_bytes,
                                  std::uint64_t result_texel_bytes,
                                  std::uint64_t colour_tile_bytes) {
  return kPieceScratch + colour_tile_bytes * (kColourTilesAtOnce + 2) +
         batch_cost(most_triangles, most_patches) + 3 * std::uint64_t{largest_chunk_bytes} +
         block_state_bytes(kTexelsPerBlock, tiles::kMostTrianglesPerBlock, result_texel_bytes);
}

}  // namespace pounce::flow
