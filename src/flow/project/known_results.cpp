// SPDX-License-Identifier: Apache-2.0
//
// The results of a page as a pack of the cache. They are those that images are written from, block
// by block of the target and not by piece: how pieces are cut depends on the budget.
//
// The pack may be anybody's who can write to the cache. What its directory says is held against the
// page, and a block is decoded like one of this job: whatever it holds, it is a block of texels.
#include "flow/project/known_results.h"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>
#include <utility>

#include "flow/stores/build_stores.h"
#include "pounce/error.h"
#include "pounce/version.h"

namespace pounce::flow {
namespace {

/// Of how Gaussians are blended: raised whenever a texel changes between two releases.
constexpr std::string_view kRules = "results 1 of pounce " POUNCE_VERSION;

store::ResultGrid grid_of(const KnownPage& page) {
  return {page.target->directory().pages.front(), page.formats.size()};
}

std::uint32_t block_bytes(const shading::TexelFormat& format) {
  return static_cast<std::uint32_t>(shading::kMaskBytes +
                                    store::kTexelsPerBlock * format.texel_bytes());
}

/// The store and how its blocks are decoded.
struct KnownResults {
  store::ResultStore store;
  const std::vector<shading::TexelFormat>* formats;
};

void check_store(job::JobContext& job, const KnownResults& known) {
  const store::PackReader& pack = *known.store.pack;
  shading::ResultBlock block;
  for (std::size_t c = 0; c < known.store.blocks.size(); ++c) {
    for (const store::ChunkRef& chunk : known.store.blocks[c]) {
      if (chunk.raw_bytes == 0) continue;
      shading::decode(pack.read(chunk, store::ChunkKind::block), chunk.raw_bytes,
                      (*known.formats)[c], job.compressor(), pack.name(), block);
    }
    job.meter.advance(0);  // stops here if the caller asked to
  }
}

std::unique_ptr<KnownResults> find_results(job::JobContext& job, const KnownPage& page) {
  store::ResultStore::Facts facts{grid_of(page), {}, page.target->directory().texels};
  for (const shading::TexelFormat& format : page.formats)
    facts.block_bytes.push_back(block_bytes(format));
  return find_store(
      job, store::PackKind::results, page.key, [&](std::unique_ptr<store::PackReader> pack) {
        return std::make_unique<KnownResults>(KnownResults{
            store::ResultStore::open(std::move(pack), facts, job.compressor()), &page.formats});
      });
}

/// Of a directory that is read or written: as it is stored, as a chunk, and before compression.
constexpr std::uint64_t kDirectories = 3;

std::uint64_t index_bytes(const KnownPage& page) {
  return store::ResultStoreWriter::index_bytes(grid_of(page));
}

/// Planning leaves 2 MiB beside what projecting needs at least: a small index has room in these.
/// Any other has where the budget is far above what that is.
bool may_keep(const job::JobContext& job, const KnownPage& page) {
  constexpr std::uint64_t kPerThread = 64ULL << 20, kSmall = 512ULL << 10;
  const std::uint64_t index = (1 + kDirectories) * index_bytes(page);
  const std::uint64_t per_thread = job.budget.limit() / (job.threads + 1);
  return job.keeps_stores && job.keeps_pages &&
         (index <= kSmall || per_thread >= kPerThread + index) &&
         std::none_of(page.formats.begin(), page.formats.end(),
                      [](const auto& format) { return format.transform != nullptr; });
}

class KnownOrMade final : public Projection {
 public:
  KnownOrMade(job::JobContext& job, KnownPage page,
              std::function<std::unique_ptr<Projection>(ResultKeeper*)> make)
      : job_(job), page_(std::move(page)), make_(std::move(make)) {}

  PageResult project(ResultCollector& results) override {
    // Whoever lacks a part, or nothing, is not to wait for a process that makes all of it.
    if (!results.makes_all() || !may_keep(job_, page_)) return make_(nullptr)->project(results);
    if (auto known = find()) {
      job_.count_store(*known->store.pack, true);
      return results.take(std::move(known->store));
    }
    ResultKeeper keeper(job_, page_);
    PageResult result = make_(&keeper)->project(results);
    keeper.publish();
    return result;
  }

 private:
  std::unique_ptr<KnownResults> find() const {
    const runtime::Lease reading(job_.budget, kDirectories * index_bytes(page_),
                                 "the index of the results");
    return find_results(job_, page_);
  }

  job::JobContext& job_;
  const KnownPage page_;
  const std::function<std::unique_ptr<Projection>(ResultKeeper*)> make_;
};

}  // namespace

void begin_key(const Hash128& source, const store::GeometryStore& target, Hasher& hash) {
  hash.add(kRules);
  hash.add(store::kFormatVersion);
  hash.add(source);
  hash.add(target.pack().key());
}

void add_format(const shading::TexelFormat& format, Hasher& hash) {
  const auto& [channels, depth, linear, is_colour, has_alpha, premultiplied, transform] = format;
  hash.add(channels);
  hash.add(depth);
  hash.add(linear);
  hash.add(is_colour);
  hash.add(has_alpha);
  hash.add(premultiplied);
  hash.add(transform == nullptr ? Hash128{} : transform->identity());
}

void add_input(const shading::ColourInput& input, Hasher& hash) {
  const auto& [linear, primaries, transform, is_final] = input;
  hash.add(linear);
  hash.add(primaries.has_value());
  for (const double v : primaries.value_or(Matrix3{})) hash.add(v);
  hash.add(transform == nullptr ? Hash128{} : transform->identity());
  hash.add(is_final);
}

ResultKeeper::ResultKeeper(job::JobContext& job, const KnownPage& page) : job_(job) {
  // The claim on the key, taken by find_results(), passes to the pack that is created here. Other
  // jobs that want these results wait until it is published or gone.
  index_lease_ = runtime::Lease(job.budget, (1 + kDirectories) * index_bytes(page),
                                "the index of the results");
  while_stored([&] {
    const mesh::Lattice& image = page.target->directory().pages.front();
    writer_ = std::make_unique<store::ResultStoreWriter>(
        job.stores->create(
            store::PackKind::results, page.key,
            fmt::format("results of a target's page, {} x {}", image.width, image.height)),
        grid_of(page));
  });
}

template <typename Step>
void ResultKeeper::while_stored(const Step& step) {
  try {
    step();
    if (writer_ != nullptr && !job_.stores->is_kept(writer_->pack())) writer_.reset();
  } catch (const Error& e) {
    // A disk that is full costs the next job its projection, not this one its images. Everything
    // else, such as a cancelled job, ends it as usual.
    if (e.kind() != ErrorKind::storage) throw;
    writer_.reset();
    refusal_ = e.what();
  }
}

void ResultKeeper::store(const PieceWork& work) {
  if (writer_ == nullptr) return;
  counts_.add(work);
  while_stored([&] {
    for (std::size_t c = 0; c < work.stored.size(); ++c) {
      for (std::size_t b = 0; b < work.blocks.size(); ++b) {
        const std::vector<std::byte>& stored = work.stored[c][b];
        if (!stored.empty())
          writer_->add(c, work.blocks[b].x, work.blocks[b].y, stored, work.raw_bytes[c]);
      }
    }
  });
}

void ResultKeeper::publish() {
  if (writer_ != nullptr) {
    while_stored([&] {
      auto pack = std::exchange(writer_, nullptr)->finish(counts_, job_.compressor());
      if (!job_.stores->is_kept(*pack)) return;
      job_.count_store(*job_.stores->publish(std::move(pack)), false);
    });
  }
  if (!refusal_.empty()) {
    job_.warn(fmt::format("results could not be stored, so the next job will project again: {}",
                          refusal_));
  }
}

std::unique_ptr<Projection> known_or_made(
    job::JobContext& job, KnownPage page,
    std::function<std::unique_ptr<Projection>(ResultKeeper*)> make) {
  return std::make_unique<KnownOrMade>(job, std::move(page), std::move(make));
}

}  // namespace pounce::flow
