// SPDX-License-Identifier: Apache-2.0
//
// The key of hits is made of the keys of both geometry stores: whatever changes a triangle, a UV or
// the size of an image changes one of them. What the source's images hold, how they are filtered
// and what becomes of the result is in none. Limits of the search are added, and no kernel: all
// instruction sets find the same bits.
//
// Hits are written while the search runs, block by block in the order in which pieces finish, by
// the node that stores results. A job that is stopped has published nothing. A job does not need
// them itself, so where the cache cannot take them it goes on without.
#include "flow/project/known_hits.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "core/hash.h"
#include "projection/hit_block.h"

namespace pounce::flow {
namespace {

constexpr std::uint64_t kPieceScratch = 256 << 10;  // index pages, encode buffers
/// Of the rules that hits follow: others are other hits.
constexpr std::string_view kRules = "hits 1";

Hash128 key_of(const MeshProjection& request) {
  Hasher hash;
  hash.add(kRules);
  hash.add(store::kFormatVersion);
  hash.add(request.source->store().pack().key());
  hash.add(request.target->pack().key());
  hash.add(request.limits.max_distance);
  hash.add(request.limits.min_cosine);
  hash.add(request.smallest_edge);
  return hash.digest();
}

ImageSize image_of(const store::GeometryStore& target) {
  const mesh::Lattice& page = target.directory().pages.front();
  return {page.width, page.height};
}

store::HitStore::Facts facts_of(const MeshProjection& request) {
  return {image_of(*request.target), request.source->store().directory().pages.size(),
          projection::kMostHitBytes};
}

projection::HitBlock decoded(const store::HitStore& store, std::span<const std::byte> raw) {
  return projection::decode_hits(raw, store.facts().source_pages, store.pack().name() + ": block");
}

void add_distances(const projection::HitBlock& block, PieceWork& work) {
  for (std::size_t i = 0; i < kDistanceBins; ++i) work.distances[i] += block.distances[i];
  work.distance_steps += block.distance_steps;
}

std::uint64_t known_state_bytes(std::uint32_t texels, std::uint64_t result_texel_bytes) {
  return projection::hit_packets(texels) *
             (sizeof(surface::TexelPacket) + sizeof(projection::HitPacket)) +
         texels * sizeof(surface::TexelAxes) + store::kTexelsPerBlock * result_texel_bytes +
         shading::kMaskBytes + 4 * kPageBytes;
}

/// Shades a page without a search: fetch reads hits instead of texels, and nothing of the source.
/// The graph is that of a search, so pieces, order of results and leases are, too. fetch says at
/// once that there is no more of the source, and a piece goes from there to blend; bin and hit
/// never run.
class KnownMethod {
 public:
  static constexpr PieceSize kPieceSize{32ULL << 20, 1};
  using Work = HitWork;

  KnownMethod(job::JobContext& job, const MeshProjection& request,
              std::shared_ptr<const store::HitStore> hits)
      : job_(&job),
        index_(std::make_shared<TargetIndex>(request.target)),
        hits_(std::move(hits)),
        shading_(job, *request.target, request.channels, request.lookup) {}

  std::uint64_t fixed_bytes() const {
    return kPieceScratch + shading_.lookup_bytes() + HitKeeper::scratch_bytes();
  }
  static std::uint64_t least_batch_bytes() { return 0; }

  BlockCost state_cost(const store::BlockEntry& entry) const {
    return known_state_bytes(entry.texels, shading_.result_texel_bytes());
  }

  void begin(Work& work) const {
    work.blocks = index_->blocks_of(work.piece, job_->compressor());
    std::uint64_t texels = 0;
    for (const store::BlockEntry& entry : work.blocks) texels += entry.texels;
    work.state.packets.reserve(projection::hit_packets(texels) + work.blocks.size());
    work.state.hits.reserve(work.state.packets.capacity());
    work.axes.resize(work.blocks.size());
    for (std::uint32_t b = 0; b < work.blocks.size(); ++b) add_block(b, work);
  }

  static std::uint64_t fetch(Work&) { return 0; }
  static void bin(Work&) {}
  static void hit(Work&) {}
  void blend(Work& work) const { shading_.shade(work); }

 private:
  void add_block(std::uint32_t b, Work& work) const {
    const store::BlockEntry& entry = work.blocks[b];
    // The pack may be anybody's who can write to the cache. More hits than the target's block has
    // texels would exceed the lease of the piece, which counts texels.
    const auto raw = hits_->read(static_cast<std::uint32_t>(entry.x),
                                 static_cast<std::uint32_t>(entry.y), job_->compressor());
    if (raw.empty()) return;
    projection::HitBlock block = decoded(*hits_, raw);
    if (block.size() > entry.texels) index_->target().damaged("a block with more hits than texels");
    projection::append_packets(block, b, work.state.packets, work.state.hits);
    work.axes[b] = std::move(block.axes);
    add_distances(block, work);
  }

  job::JobContext* job_;
  std::shared_ptr<TargetIndex> index_;
  std::shared_ptr<const store::HitStore> hits_;
  HitShading shading_;
};

class KnownHits final : public Projection {
 public:
  KnownHits(job::JobContext& job, const MeshProjection& request,
            std::shared_ptr<const store::HitStore> hits)
      : job_(job),
        hits_(hits),
        index_lease_(job.budget, hits->grid().index_bytes(), "the index of the hits"),
        projector_(job, *request.target, KnownMethod(job, request, std::move(hits))) {}

  PageResult project(ResultCollector& results) override {
    PageResult result = projector_.project(results);
    job_.report.bytes_read += hits_->pack().bytes_read();
    return result;
  }

 private:
  job::JobContext& job_;
  std::shared_ptr<const store::HitStore> hits_;
  runtime::Lease index_lease_;
  PageProjector<KnownMethod> projector_;
};

}  // namespace

void check_store(job::JobContext& job, const store::HitStore& store) {
  for (std::uint32_t y = 0; y < store.grid().down; ++y) {
    for (std::uint32_t x = 0; x < store.grid().across; ++x) {
      const auto raw = store.read(x, y, job.compressor());
      if (!raw.empty()) decoded(store, raw);
    }
    job.meter.advance(0);  // stops here if the caller asked to
  }
}

bool may_keep_hits(const job::JobContext& job, const MeshProjection& request) {
  // One piece for each thread and one more, each with a block as it is while it is encoded, and the
  // search's own memory beside: less than that, and hits would make the search slower.
  constexpr std::uint64_t kPerPiece = 16ULL << 20;
  const std::uint64_t index = store::HitGrid(image_of(*request.target)).index_bytes();
  return job.keeps_stores && job.budget.limit() / (job.threads + 1) >= kPerPiece + 2 * index &&
         std::none_of(request.channels.begin(), request.channels.end(), needs_surface);
}

std::unique_ptr<store::HitStore> find_hits(job::JobContext& job, const MeshProjection& request) {
  return find_store(job, store::PackKind::hits, key_of(request),
                    [&](std::unique_ptr<store::PackReader> pack) {
                      return std::make_unique<store::HitStore>(std::move(pack), facts_of(request),
                                                               job.compressor());
                    });
}

std::unique_ptr<Projection> shade_known(job::JobContext& job, const MeshProjection& request,
                                        std::unique_ptr<store::HitStore> hits) {
  return std::make_unique<KnownHits>(job, request, std::move(hits));
}

std::uint64_t known_least_bytes(std::uint64_t result_texel_bytes, std::uint64_t lookup_bytes) {
  return kPieceScratch + lookup_bytes + HitKeeper::scratch_bytes() +
         known_state_bytes(store::kTexelsPerBlock, result_texel_bytes);
}

HitKeeper::HitKeeper(job::JobContext& job, const MeshProjection& request)
    : job_(job), facts_(facts_of(request)) {
  // The claim on the key, taken by find_hits(), passes to the pack that is created here. Other jobs
  // that want these hits wait until it is published or given up.
  const store::HitGrid grid(facts_.image);
  index_lease_ = runtime::Lease(job.budget, 2 * grid.index_bytes(), "the index of the hits");
  while_stored([&] {
    writer_ = std::make_unique<store::HitStoreWriter>(
        job.stores->create(store::PackKind::hits, key_of(request),
                           fmt::format("hits of a target on a source, {} x {}", facts_.image.width,
                                       facts_.image.height)),
        grid);
  });
}

template <typename Step>
void HitKeeper::while_stored(const Step& step) {
  try {
    step();
  } catch (const Error& e) {
    // A disk that is full costs the next job a search, not this one its result. Everything else,
    // such as a cancelled job, ends it as usual.
    if (e.kind() != ErrorKind::storage) throw;
    writer_.reset();
    refusal_ = e.what();
  }
}

void HitKeeper::encode(HitWork& work, float max_distance) const {
  // By block of the target, not by piece: how pieces are cut depends on the budget, and a later job
  // with another budget must find its blocks.
  work.hits.resize(work.blocks.size());
  work.hit_bytes.resize(work.blocks.size());
  std::vector<std::byte> raw;
  std::size_t first = 0;
  for (std::uint32_t b = 0; b < work.blocks.size(); ++b) {
    std::size_t end = first;
    while (end < work.state.packets.size() && work.state.packets[end].block == b) ++end;
    const auto packets = std::span(work.state.packets).subspan(first, end - first);
    const auto hits = std::span(work.state.hits).subspan(first, end - first);
    first = end;
    const projection::HitBlock block =
        projection::hits_of(packets, hits, work.axes[b], max_distance);
    if (block.size() == 0) continue;
    add_distances(block, work);
    projection::encode(block, raw);
    work.hit_bytes[b] = static_cast<std::uint32_t>(raw.size());
    job_.compressor().compress(raw, work.hits[b], store::kFastLevel, job_.stores_room());
  }
}

void HitKeeper::store(const PieceWork& work) {
  if (writer_ == nullptr) return;
  while_stored([&] {
    for (std::size_t b = 0; b < work.blocks.size(); ++b) {
      if (work.hits[b].empty()) continue;
      writer_->add(static_cast<std::uint32_t>(work.blocks[b].x),
                   static_cast<std::uint32_t>(work.blocks[b].y), work.hits[b], work.hit_bytes[b]);
    }
  });
  // What the cache has no room for would only take that of this job's own scratch.
  if (writer_ == nullptr || !job_.stores->is_kept(writer_->pack())) give_up();
}

void HitKeeper::give_up() {
  is_wanted_ = false;
  writer_.reset();
}

void HitKeeper::publish() {
  if (writer_ != nullptr) {
    while_stored([&] {
      auto pack = std::exchange(writer_, nullptr)->finish(job_.compressor());
      if (job_.stores->is_kept(*pack))
        job_.count_store(*job_.stores->publish(std::move(pack)), false);
    });
  }
  if (!refusal_.empty()) {
    job_.warn(
        fmt::format("hits could not be stored, so the next job will search again: {}", refusal_));
  }
}

std::uint64_t HitKeeper::scratch_bytes() { return 3 * std::uint64_t{projection::kMostHitBytes}; }

std::uint64_t HitKeeper::block_bytes(const store::BlockEntry& entry) {
  // As if nothing compressed, and every texel hit a triangle of its own.
  return 2048 + std::uint64_t{entry.texels} * (sizeof(projection::HitFacet) + 16) +
         std::min<std::uint64_t>(entry.triangles, entry.texels) * sizeof(surface::TexelAxes);
}

}  // namespace pounce::flow
