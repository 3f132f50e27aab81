// SPDX-License-Identifier: Apache-2.0
//
// The poster's two baselines, as plainly as they are named there, on a share of the work: both cost
// triangles x texels, so the whole is the share's time times its number (counter "whole_s").
// Looking colours up is left out.
//
//   ray cast    every texel's ray, both ways, against every source triangle; the nearest hit wins
//   per face    every source triangle projects its texture onto the texels in its box, grown by the
//               search distance, along their normals; the nearest triangle wins
#include <cmath>
#include <limits>
#include <optional>

#include "bench_input.h"

namespace pounce::bench {
namespace {

constexpr std::size_t kTexelShare = 256, kFaceShare = 64;

struct Face {
  Vec3f corner, e1, e2;
  Box3f box;
};

std::vector<Face> faces_of(const mesh::Mesh& mesh) {
  std::vector<Face> faces;
  faces.reserve(mesh.triangles.size());
  for (const auto& t : mesh.triangles) {
    const Vec3f a = mesh.positions[t[0]], b = mesh.positions[t[1]], c = mesh.positions[t[2]];
    Face face{a, b - a, c - a, {}};
    for (const Vec3f p : {a, b, c}) face.box.extend(p);
    faces.push_back(face);
  }
  return faces;
}

/// Where the line p + t n goes through a face (Moeller and Trumbore).
std::optional<float> hit(const Face& face, Vec3f p, Vec3f n) {
  const Vec3f h = cross(n, face.e2);
  const float det = dot(face.e1, h);
  if (std::abs(det) < 1e-20F) return std::nullopt;
  const float inverse = 1 / det;
  const Vec3f s = p - face.corner;
  const float u = dot(s, h) * inverse;
  if (u < 0 || u > 1) return std::nullopt;
  const Vec3f q = cross(s, face.e1);
  const float v = dot(n, q) * inverse;
  if (v < 0 || u + v > 1) return std::nullopt;
  return dot(face.e2, q) * inverse;
}

void set_counters(benchmark::State& state, std::size_t share, double pairs) {
  state.counters["whole_s"] = benchmark::Counter(
      1 / static_cast<double>(share),
      benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
  count_work(state, "pair", pairs);
}

void baseline_ray_cast(benchmark::State& state) {
  PreparedJob& job = prepared_job(Shape::same, state.range(0));
  const std::vector<Face> faces = faces_of(job.source);
  const std::vector<TargetTexel> texels = target_texels(job);
  for (auto _ : state) {
    float sum = 0;
    for (std::size_t i = 0; i < texels.size(); i += kTexelShare) {
      float nearest = job.target_plan.max_distance;
      for (const Face& face : faces) {
        const auto t = hit(face, texels[i].position, texels[i].normal);
        if (t && std::abs(*t) < nearest) nearest = std::abs(*t);
      }
      sum += nearest;
    }
    benchmark::DoNotOptimize(sum);
  }
  set_counters(
      state, kTexelShare,
      static_cast<double>(texels.size() / kTexelShare) * static_cast<double>(faces.size()));
}
BENCHMARK(baseline_ray_cast)->Arg(1024)->Unit(benchmark::kMillisecond);

void baseline_per_face(benchmark::State& state) {
  PreparedJob& job = prepared_job(Shape::same, state.range(0));
  const std::vector<Face> faces = faces_of(job.source);
  const std::vector<TargetTexel> texels = target_texels(job);
  const float reach = job.target_plan.max_distance;
  std::vector<float> nearest(texels.size());
  for (auto _ : state) {
    nearest.assign(texels.size(), reach);
    for (std::size_t f = 0; f < faces.size(); f += kFaceShare) {
      const Face& face = faces[f];
      const Vec3f lo = face.box.lo - Vec3f{reach, reach, reach},
                  hi = face.box.hi + Vec3f{reach, reach, reach};
      for (std::size_t i = 0; i < texels.size(); ++i) {
        const Vec3f p = texels[i].position;
        if (p.x < lo.x || p.y < lo.y || p.z < lo.z || p.x > hi.x || p.y > hi.y || p.z > hi.z)
          continue;
        const auto t = hit(face, p, texels[i].normal);
        if (t && std::abs(*t) < nearest[i]) nearest[i] = std::abs(*t);
      }
    }
    benchmark::DoNotOptimize(nearest.data());
  }
  set_counters(state, kFaceShare,
               static_cast<double>(texels.size()) * static_cast<double>(faces.size() / kFaceShare));
}
BENCHMARK(baseline_per_face)->Arg(1024)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace pounce::bench
