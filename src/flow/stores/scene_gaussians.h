// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "gaussian/gaussian_source.h"
#include "io/splats/scene.h"

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

}  // namespace pounce::flow
