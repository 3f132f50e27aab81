// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>

#include "gaussian/gaussian_source.h"
#include "io/splats/scene.h"
#include "job/job_context.h"
#include "planning/plan.h"
#include "store/blocks/splat_store.h"

namespace pounce::flow {

/// The rows of a scene's file as a source of Gaussians. The scene must live, and be prepared before
/// anything is read.
class SceneGaussians : public gaussian::GaussianSource {
 public:
  SceneGaussians(const io::SplatScene& scene, std::uint32_t lobes) : scene_(scene), lobes_(lobes) {}
  std::uint64_t count() const override { return scene_.info().splats; }
  std::uint32_t lobes() const override { return lobes_; }
  void read(std::uint64_t first, std::uint64_t count, store::SplatRows& out,
            store::SplatCounts& filtered) const override {
    scene_.read(first, count, out, filtered);
  }
  std::uint64_t read_bytes() const override { return scene_.read_bytes(); }
  PageVector<store::Splat> sample() const override {
    static_assert(io::kSampleSplats <= kSampleSplats);
    return io::sample(scene_);
  }

 private:
  const io::SplatScene& scene_;
  const std::uint32_t lobes_;
};

/// `poll`: as io::open_splat_scene(), which takes io::kOpenSplatBytes.
planning::SceneFacts scene_facts(
    const planning::SplatRequest& request, const std::function<void()>& poll = [] {});

/// Reads, filters and sorts a scene into a store of blocks, or finds the store in the cache. Takes
/// job.meter through a stage "precondition" whose end is `progress_end`. Adds what was left out to
/// job.report.source_filtered, also where the store was cached. Throws Error(input) where the file
/// is none that we read or no Gaussian of it is of use, Error(budget) below
/// planning::SceneFacts::least_bytes.
std::unique_ptr<store::SplatStore> splat_store(job::JobContext& job,
                                               const planning::SplatRequest& request, bool* cached,
                                               double progress_end);

}  // namespace pounce::flow
