// SPDX-License-Identifier: Apache-2.0
//
// A map is rows of texels, shading wants blocks: 64 rows at a time are read, cut into blocks side
// by side, and stored. Reading is what takes time, since a decoder gives one row after the other;
// the next job on the same map finds the store in the cache.
#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <string_view>
#include <vector>

#include "core/hash.h"
#include "core/page_pool.h"
#include "flow/stores/build_stores.h"
#include "flow/stores/find_store.h"
#include "io/image/read.h"
#include "mesh/lattice.h"
#include "projection/hit_block.h"
#include "store/pack/pack_layout.h"

namespace pounce::flow {
namespace {

using mesh::kBlockEdge;

/// Of the rules that a map's hits follow: others are other hits.
constexpr std::string_view kRules = "hits of a map 1";

Hash128 key_of(job::JobContext& job, const MapRequest& request) {
  const Hash128 content = job::file_hash(job, request.path);
  Hasher hash;
  hash.add(kRules);
  hash.add(store::kFormatVersion);
  hash.add(content);
  hash.add(std::uint64_t{request.source_pages});
  hash.add(request.max_distance);
  return hash.digest();
}

std::uint64_t band_bytes(ImageSize size) {
  return std::uint64_t{kBlockEdge} * size.width * sizeof(projection::HitMapTexel);
}

struct StoredBlock {
  std::vector<std::byte> stored;  ///< empty: nothing was hit
  std::uint32_t raw_bytes = 0;
};

class MapConversion {
 public:
  MapConversion(job::JobContext& job, const MapRequest& request)
      : job_(job),
        request_(request),
        lease_(job.budget, map_hits_bytes(request), "reading " + request.path),
        reader_(request.path, {projection::kHitMapNames.begin(), projection::kHitMapNames.end()}),
        grid_(request.size),
        rows_(band_bytes(request.size)),
        blocks_(grid_.across) {
    const io::ImageInfo& info = reader_.info();
    if (info.width != request.size.width || info.height != request.size.height ||
        info.depth != Depth::float32)
      throw Error(ErrorKind::input, request.path + ": the file changed while it was read");
  }

  std::unique_ptr<store::PackWriter> run(std::unique_ptr<store::PackWriter> pack) {
    store::HitStoreWriter writer(std::move(pack), grid_);
    for (std::uint32_t by = 0; by < grid_.down; ++by) {
      const std::uint32_t first = by * kBlockEdge;
      const std::uint32_t count = std::min<std::uint32_t>(kBlockEdge, request_.size.height - first);
      reader_.read_rows(count, rows_.data());
      tbb::parallel_for(std::uint32_t{0}, grid_.across,
                        [&](std::uint32_t bx) { blocks_[bx] = block(bx, by, count); });
      for (std::uint32_t bx = 0; bx < grid_.across; ++bx) {
        if (!blocks_[bx].stored.empty())
          writer.add(bx, by, blocks_[bx].stored, blocks_[bx].raw_bytes);
      }
      job_.meter.advance(0);  // stops here if the caller asked to
    }
    return writer.finish(job_.compressor());
  }

 private:
  StoredBlock block(std::uint32_t bx, std::uint32_t by, std::uint32_t rows) {
    constexpr std::size_t kValues = std::tuple_size_v<projection::HitMapTexel>;
    const std::uint32_t left = bx * kBlockEdge;
    projection::MapWindow window;
    const std::span texels(reinterpret_cast<const float*>(rows_.data()),
                           rows_.size() / sizeof(float));
    window.texels = texels.subspan(left * kValues);
    window.stride = request_.size.width;
    window.width = std::min<std::uint32_t>(kBlockEdge, request_.size.width - left);
    window.height = rows;
    const projection::HitBlock hits = projection::hits_of_map(
        window, request_.source_pages, request_.max_distance,
        fmt::format("{}: texels from ({}, {}) on", request_.path, left, by * kBlockEdge));
    StoredBlock out;
    if (hits.size() == 0) return out;
    std::vector<std::byte> raw;
    projection::encode(hits, raw);
    out.raw_bytes = static_cast<std::uint32_t>(raw.size());
    job_.compressor().compress(raw, out.stored, store::kScratchLevel);
    return out;
  }

  job::JobContext& job_;
  const MapRequest& request_;
  runtime::Lease lease_;
  io::ImageReader reader_;
  const store::HitGrid grid_;
  PageVector<std::byte> rows_;
  std::vector<StoredBlock> blocks_;  ///< of one row of them
};

}  // namespace

std::unique_ptr<store::HitStore> map_hits(job::JobContext& job, const MapRequest& request,
                                          bool* cached) {
  const Hash128 key = key_of(job, request);
  const store::HitStore::Facts facts{request.size, request.source_pages, projection::kMostHitBytes};
  auto found =
      find_store(job, store::PackKind::hits, key, [&](std::unique_ptr<store::PackReader> pack) {
        return std::make_unique<store::HitStore>(std::move(pack), facts, job.compressor());
      });
  *cached = found != nullptr;
  if (*cached) return found;
  auto pack = job.stores->create(
      store::PackKind::hits, key,
      fmt::format("hits of a map, {} x {}", request.size.width, request.size.height));
  return std::make_unique<store::HitStore>(
      job.stores->publish(MapConversion(job, request).run(std::move(pack))), facts,
      job.compressor());
}

std::uint64_t map_hits_bytes(const MapRequest& request) {
  const store::HitGrid grid(request.size);
  // A row of blocks as they are read and as they are stored, and what is encoded just now.
  return request.decoder_bytes + 2 * round_to_pages(band_bytes(request.size)) + grid.index_bytes() +
         (4ULL << 20);
}

}  // namespace pounce::flow
