// SPDX-License-Identifier: Apache-2.0
#include "flow/shape/write.h"

#include <fmt/format.h>

#include "meshing/fit.h"
#include "meshing/unfold.h"
#include "unwrap/unwrap.h"

namespace pounce::flow {
namespace {

constexpr int kFitting = 4;  // rounds
/// Cosine: what is a fold in a capture's surface.
constexpr double kOnItsFace = 0.2;

}  // namespace

void write_shape(job::JobContext& job, SourceSurface made, const MeshShape& shape, double end,
                 const std::function<std::uint64_t(const io::PlainMesh&)>& write) {
  const StageTimer timer(job.clock, "mesh");
  job.meter.begin("mesh", 1, "meshes", end);
  meshing::Surface& surface = made.surface;
  const auto poll = [&job] { job.meter.throw_if_cancelled(); };
  if (shape.detail) {
    const meshing::Surface dense = made.is_exact ? surface : meshing::Surface{};
    meshing::simplify_within(surface, length_of(*shape.detail, meshing::box_of(surface)));
    if (made.is_exact) meshing::fit(surface, dense, kFitting, poll);
  } else if (made.is_exact) {
    meshing::simplify_fitted(surface, shape.triangles, poll);
  } else {
    meshing::simplify(surface, shape.triangles);
  }
  if (!made.is_exact) meshing::unfold(surface, kOnItsFace);
  const unwrap::Unwrapped flat =
      unwrap::unwrap(surface.positions, surface.triangles, {shape.size, shape.gutter}, poll);
  if (!flat.fits) {
    throw Error(ErrorKind::usage,
                fmt::format("--size {}: too small for {} charts with {} texels between them; raise "
                            "--size, or lower --gutter or --triangles",
                            shape.size, flat.chart_count, shape.gutter));
  }
  const std::vector<Vec3f> normals = meshing::normals_of(surface);
  std::vector<Vec3f> positions, own_normals;
  for (const std::uint32_t v : flat.vertex) {
    positions.push_back(surface.positions[v]);
    own_normals.push_back(normals[v]);
  }
  job.report.bytes_written += write({positions,
                                     own_normals,
                                     flat.uvs,
                                     flat.triangles,
                                     {{"proxy", flat.triangles.size()}},
                                     made.origin});
  job.note(fmt::format("{} triangles in {} charts, which fill {:.0f} % of the image",
                       flat.triangles.size(), flat.chart_count, 100 * flat.fill));
  job.meter.advance(1);
  job.meter.end();
}

}  // namespace pounce::flow
