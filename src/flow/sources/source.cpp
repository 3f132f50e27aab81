// SPDX-License-Identifier: Apache-2.0
//
// Which kind of source a job has. From here on nobody asks: each kind knows what it is.
//
// A cosine of the C library may differ in its last place from machine to machine. It is computed
// once, here, and not per texel (docs/same-bytes.md).
#include "flow/sources/source.h"

#include <cmath>
#include <numbers>

#include "flow/sources/map_source.h"
#include "flow/sources/scene_source.h"
#include "flow/sources/surface_source.h"
#include "flow/sources/texels_source.h"

namespace pounce::flow {

std::uint64_t Source::result_texel_bytes(std::size_t pass) const {
  std::uint64_t bytes = 0;
  for (const std::size_t c : plan_.passes[pass].channels)
    bytes += plan_.channels[c].format.texel_bytes();
  return bytes;
}

Source::Source(job::JobContext& job, const TransferOptions& options)
    : job_(job),
      options_(options),
      min_cosine_(
          static_cast<float>(std::cos(options.search.max_angle_deg * std::numbers::pi / 180))) {}

std::unique_ptr<Source> open_source(job::JobContext& job, const TransferOptions& options,
                                    bool for_model, const job::TestKnobs& knobs) {
  if (planning::is_hit_map(options.source)) return std::make_unique<MapSource>(job, options, knobs);
  if (planning::is_splat_scene(options.source)) {
    planning::refuse_mesh_options(options);
    return std::make_unique<SceneSource>(job, options, for_model, knobs);
  }
  planning::refuse_splat_options(options);
  if (options.mesh.method == Method::gaussian)
    return std::make_unique<TexelsSource>(job, options, for_model, knobs);
  return std::make_unique<SurfaceSource>(job, options, for_model, knobs);
}

}  // namespace pounce::flow
