// SPDX-License-Identifier: Apache-2.0
//
// A scene's file as a source of Gaussians: rows in any order, hashed once, sorted into a store.
#include "flow/build/splats.h"

#include <algorithm>

#include "flow/build/find_store.h"
#include "flow/build/gaussian_store.h"
#include "io/splats/scene.h"

namespace pounce::flow {
namespace {

class SceneGaussians : public GaussianSource {
 public:
  explicit SceneGaussians(const io::SplatScene& scene) : scene_(scene) {}
  std::uint64_t count() const override { return scene_.info().splats; }
  void read(std::uint64_t first, std::uint64_t count, PageVector<store::Splat>& out,
            store::SplatCounts& filtered) const override {
    store::SplatRows rows;
    rows.splats.swap(out);
    scene_.read(first, count, rows, filtered);
    out.swap(rows.splats);
  }
  std::uint64_t read_bytes() const override { return scene_.read_bytes(); }
  PageVector<store::Splat> sample() const override {
    static_assert(io::kSampleSplats <= kSampleSplats);
    return io::sample(scene_);
  }

 private:
  const io::SplatScene& scene_;
};

/// Hash of the whole file, in pieces.
Hash128 hash_file(JobContext& job, const ReadFile& file) {
  constexpr std::uint64_t kPiece = 1 << 20;
  const runtime::Lease lease(job.budget, kPiece, "hashing the source");
  PageVector<std::byte> bytes(std::min(kPiece, file.size_bytes()));
  Hasher hash;
  for (std::uint64_t at = 0; at < file.size_bytes(); at += bytes.size()) {
    const auto piece =
        std::span(bytes).first(std::min<std::uint64_t>(bytes.size(), file.size_bytes() - at));
    file.read(at, piece);
    hash.add(std::span<const std::byte>(piece));
    job.meter.advance(0);  // stops here if the caller asked to
  }
  return hash.digest();
}

Hash128 store_key(JobContext& job, const SplatRequest& request) {
  Hasher hash;
  hash.add(std::string_view("splats"));
  hash.add(store::kFormatVersion);
  hash.add(kGaussianStoreVersion);
  if (job.stores->persistent()) {
    const Hash128 content = job.content_hash(request.path, 0, 0, [&] {
      return hash_file(job, *posix_file_system().open(request.path));
    });
    hash.add(content.hi);
    hash.add(content.lo);
  } else {  // nobody will look for it: spare the second reading of a file of many GB
    hash.add(std::string_view(request.path));
  }
  hash.add(to_text(request.axes));
  return hash.digest();
}

}  // namespace

std::unique_ptr<store::SplatStore> splat_store(JobContext& job, const SplatRequest& request,
                                               bool* cached, double progress_end) {
  const auto scene = io::open_splat_scene(request.path, request.axes);
  const SceneGaussians source(*scene);
  job.meter.begin("precondition", 2 * source.count(), "Gaussians", progress_end);
  const GaussianStoreRequest build{&source,
                                   store_key(job, request),
                                   request.path,
                                   {source.count(), scene->info().model},
                                   request.run_splats,
                                   request.fan_in};
  auto store = find_store(
      job, store::PackKind::splats, build.key, [&](std::unique_ptr<store::PackReader> pack) {
        return std::make_unique<store::SplatStore>(std::move(pack), build.facts, job.compressor());
      });
  *cached = store != nullptr;
  if (!*cached) {
    scene->prepare(job.scratch_folder, [&] { job.meter.advance(0); });
    store = build_gaussian_store(job, build);
  }
  job.meter.end();
  report_filtered(job, *store);
  return store;
}

std::uint64_t splat_least_bytes(const SplatRequest& request) {
  const auto scene = io::open_splat_scene(request.path, request.axes);
  return gaussian_store_least_bytes(scene->info().splats, scene->read_bytes());
}

std::uint64_t splat_count(const SplatRequest& request) {
  return io::open_splat_scene(request.path, request.axes)->info().splats;
}

}  // namespace pounce::flow
