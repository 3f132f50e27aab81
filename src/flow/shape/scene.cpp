// SPDX-License-Identifier: Apache-2.0
//
// The surface of a scene:
//
//   scene ─▶ splat store ─▶ views from 48 sides ─▶ signed distance ─▶ surface
//
// The first two steps are those of a transfer, and a transfer of the same scene finds the store.
// What follows is small, whatever the scene is: a field of some million cubes, and a surface of as
// many triangles as it has cells.
#include "flow/shape/scene.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "flow/stores/gaussian_store.h"
#include "flow/stores/splats.h"
#include "flow/stores/views.h"
#include "gaussian/splat_statistics.h"
#include "job/run_job.h"
#include "meshing/field.h"
#include "planning/describe_job.h"
#include "planning/load_mesh.h"
#include "planning/name_patterns.h"
#include "planning/plan.h"
#include "views/kernels.h"

namespace pounce::flow {
namespace {

// Shares of the progress that this takes.
constexpr double kAfterSorting = 0.3, kAfterViews = 0.85;

constexpr std::uint32_t kViews = 48;
/// Of the box's diagonal: pixels finer than this show the scene's noise (docs/decisions/067).
constexpr double kPixel = 2.6e-3;
/// Of the first look from within: nearer to what is seen than this nobody knows on which side of it
/// a place is.
constexpr float kFreeCells = meshing::kTruncation / 2;
constexpr float kNearAir = 3;        ///< cells
constexpr double kLeastPart = 0.02;  ///< of the largest part's area
constexpr int kSmoothing = 3;
constexpr float kAround = 0.03F;  ///< of the longest side, around all that is looked at

class SceneShape {
 public:
  SceneShape(job::JobContext& job, const TransferOptions& options, const MeshShape& shape,
             double end)
      : job_(job),
        output_(options.output),
        request_(planning::splat_request(options)),
        shape_(shape),
        end_(end) {}

  SourceSurface make() {
    const planning::SceneFacts facts = plan();
    std::shared_ptr<store::SplatStore> store;
    {
      const StageTimer timer(job_.clock, "precondition");
      const job::ScratchPack runs_go(job_, store::PackKind::splats);
      bool cached = false;
      store = splat_store(job_, request_, &cached, kAfterSorting * end_);
      directory_ = count_splat_store(job_, *store, cached);
    }
    const Box3f box = object_box(*store);
    SourceSurface made;
    made.surface = surface_of(store, box);
    made.origin = facts.origin;
    made.room = std::move(surface_);
    return made;
  }

 private:
  planning::SceneFacts plan() {
    const StageTimer timer(job_.clock, "read");
    planning::SceneFacts facts = scene_facts(request_);
    for (const std::string& file : facts.files) planning::add_input(file, job_.report);
    planning::refuse_over_input(output_, facts.files);
    planning::move_to_origin(facts.origin, request_);
    origin_ = facts.origin;
    job_.report.origin = {facts.origin.x, facts.origin.y, facts.origin.z};
    for (const std::string& assumption : facts.assumptions) job_.note(assumption);
    job_.note(planning::origin_note(request_.path, facts.origin));
    const std::uint64_t contexts = job_.threads * store::Compressor::context_bytes();
    const std::array<job::LeastMemory, 3> needs{
        {{facts.least_bytes, "sorting " + request_.path},
         {scene_views_least_bytes(facts.lobes, facts.splats),
          "drawing " + request_.path + " from all around"},
         {field_bytes() + usual_surface_bytes(), "the surface of " + request_.path}}};
    const auto most = *std::max_element(
        needs.begin(), needs.end(), [](const auto& a, const auto& b) { return a.bytes < b.bytes; });
    require_least(job_, {most.bytes + contexts, most.why}, 0);
    contexts_ = runtime::Lease(job_.budget, contexts, "the compressors");
    return facts;
  }

  /// At most: of a cube of cells, and of a view's depths.
  std::uint64_t field_bytes() const {
    const std::uint64_t corners = shape_.cells + std::uint64_t{2};
    const std::uint64_t edge = views::Grid::kMostAcross * std::uint64_t{views::kTileEdge};
    const std::uint64_t of_air = shape_.inside ? 1 : 0;
    return corners * corners * corners * (sizeof(std::int32_t) + sizeof(std::uint16_t) + of_air) +
           round_to_pages(edge * edge * sizeof(std::uint16_t));
  }
  /// Before it is known: as large as four sides of the cube.
  std::uint64_t usual_surface_bytes() const {
    return surface_bytes(std::uint64_t{8} * shape_.cells * shape_.cells);
  }

  /// Where nearly all of the scene is: of all blocks, weighed by their Gaussians, without the
  /// outermost hundredth at each end.
  Box3f object_box(const store::SplatStore& store) const {
    constexpr double kOutside = 0.01;
    std::array<std::vector<std::pair<float, std::uint32_t>>, 3> lows, highs;
    for (std::uint32_t t = 0; t < store.directory().tiles.size(); ++t) {
      for (const store::SplatEntry& entry : store.read_index(t, job_.compressor())) {
        const std::array<float, 3> lo{entry.box.lo.x, entry.box.lo.y, entry.box.lo.z},
            hi{entry.box.hi.x, entry.box.hi.y, entry.box.hi.z};
        for (std::size_t k = 0; k < 3; ++k) {
          lows[k].emplace_back(lo[k], entry.splats);
          highs[k].emplace_back(-hi[k], entry.splats);
        }
      }
    }
    const auto end = [&](std::vector<std::pair<float, std::uint32_t>>& ends) {
      std::sort(ends.begin(), ends.end());
      const double wanted = kOutside * static_cast<double>(store.directory().splats);
      double passed = 0;
      for (const auto& [at, splats] : ends) {
        passed += splats;
        if (passed > wanted) return at;
      }
      return ends.back().first;
    };
    Box3f box{{end(lows[0]), end(lows[1]), end(lows[2])},
              {-end(highs[0]), -end(highs[1]), -end(highs[2])}};
    if (request_.keep.box) {
      const Box3f& asked = *request_.keep.box;
      box.lo = {std::max(box.lo.x, asked.lo.x), std::max(box.lo.y, asked.lo.y),
                std::max(box.lo.z, asked.lo.z)};
      box.hi = {std::min(box.hi.x, asked.hi.x), std::min(box.hi.y, asked.hi.y),
                std::min(box.hi.z, asked.hi.z)};
    }
    const Vec3f size = box.hi - box.lo;
    const float longest = std::max({size.x, size.y, size.z});
    if (!is_usable_size(longest)) {
      throw Error(ErrorKind::input,
                  fmt::format("{}: spans {:g} units, of which no surface can be made; scale it, or "
                              "choose what is wanted of it with --box",
                              request_.path, std::max(longest, 0.0F)));
    }
    return box.grown(kAround * longest);
  }

  meshing::Surface surface_of(const std::shared_ptr<store::SplatStore>& store, const Box3f& box) {
    const double diagonal = length(Vec3d(box.hi) - Vec3d(box.lo));
    views::Grid grid(box, static_cast<float>(kPixel * diagonal), kViews);
    const Vec3f inside = shape_.inside ? air_point(box) : Vec3f{};
    if (shape_.inside) grid.begin_within(inside);
    const store::SplatDirectory& scene = store->directory();
    ViewsRequest request;
    request.scene = store;
    request.drawing = {scene.model == store::SplatModel::antialiased,
                       gaussian::fine_edge(scene.typical_size), false};
    request.kernels = &views::view_kernels({});
    request.views = kViews;
    request.path = request_.path;
    std::unique_ptr<ColourCache> drawn;
    {
      const StageTimer timer(job_.clock, "views");
      job_.meter.begin("views", grid.image(views::kSceneSamples).tiles_y(), "rows",
                       kAfterViews * end_);
      bool cached = false;
      drawn = drawn_scene(job_, request, grid, &cached);
      job_.report.views = grid.views();
      job_.meter.end(cached);
    }
    const StageTimer timer(job_.clock, "surface");
    job_.meter.begin("surface", grid.views() * (shape_.inside ? 2 : 1), "views", end_);
    const meshing::Lattice lattice(box, shape_.cells);
    const std::string name = "the surface of " + request_.path;
    const std::size_t pixels = std::size_t{grid.edge()} * grid.edge();
    const runtime::Lease lease(job_.budget,
                               meshing::Field::bytes(lattice) +
                                   round_to_pages(pixels * sizeof(std::uint16_t)) +
                                   (shape_.inside ? meshing::Air::bytes(lattice) : 0),
                               name);
    meshing::Field field(lattice);
    PageVector<std::uint16_t> depths(pixels);
    const auto add_all = [&](const meshing::Air* air) {
      for (std::uint32_t view = 0; view < grid.views(); ++view) {
        read_depths(grid, *drawn, view, depths);
        if (air != nullptr) meshing::forget_solid(grid, *air, view, depths);
        tbb::parallel_for(std::uint32_t{0}, lattice.corners[2], [&](std::uint32_t z) {
          field.add(grid, {view, depths}, z, z + 1);
        });
        job_.meter.advance(1);
      }
    };
    add_all(nullptr);
    if (shape_.inside) {
      // What a view shows that begins in a wall or in a cupboard is not seen from the room.
      std::optional<meshing::Air> air = air_around(field, inside, kFreeCells);
      const float away = length(air->start() - inside);
      if (away > kNearAir * lattice.cell) {
        job_.warn(
            fmt::format("{}: the point of --inside is in something solid; air that is {:g} "
                        "units away was taken for the room's",
                        request_.path, away));
      }
      field.clear();
      add_all(&*air);
      air.reset();
      air = air_around(field, inside, 0);
      field.keep_air(*air);
    }
    if (shape_.close) field.close();
    const std::uint64_t most = field.most_triangles();
    const std::uint64_t left =
        shape_.detail ? most : std::min<std::uint64_t>(most, shape_.triangles);
    surface_ =
        runtime::Lease(job_.budget, std::max(surface_bytes(most), unfolding_bytes(left)), name);
    meshing::Surface surface = field.surface();
    job_.meter.end();
    return surface;
  }

  Vec3f air_point(const Box3f& box) const {
    if (!shape_.inside->at) return (box.lo + box.hi) * 0.5F;
    const auto& [x, y, z] = *shape_.inside->at;
    const Vec3d at{x, y, z}, lo = Vec3d(box.lo) + origin_, hi = Vec3d(box.hi) + origin_;
    const bool is_within =
        x >= lo.x && y >= lo.y && z >= lo.z && x <= hi.x && y <= hi.y && z <= hi.z;
    if (!is_within) {
      throw Error(
          ErrorKind::usage,
          fmt::format("--inside {:g},{:g},{:g}: outside of {}, which goes from {:g},{:g},{:g} "
                      "to {:g},{:g},{:g}; give a point in the air of the room",
                      x, y, z, request_.path, lo.x, lo.y, lo.z, hi.x, hi.y, hi.z));
    }
    return Vec3f(at - origin_);
  }
  std::optional<meshing::Air> air_around(const meshing::Field& field, Vec3f point,
                                         float cells) const {
    auto air = field.air_around(point, cells, [this] { job_.meter.throw_if_cancelled(); });
    if (!air) {
      throw Error(ErrorKind::input, request_.path +
                                        ": nothing is seen from the point of --inside; give one in "
                                        "the air of the room");
    }
    return air;
  }

  static void read_depths(const views::Grid& grid, const ColourCache& drawn, std::uint32_t view,
                          PageVector<std::uint16_t>& depths) {
    constexpr auto kHalf = static_cast<std::uint16_t>(views::kAlphaSteps / 2);
    const std::size_t edge = grid.edge();
    std::fill(depths.begin(), depths.end(), views::kNoDepth);
    for (std::uint32_t y = 0; y < grid.tiles_across(); ++y) {
      const auto row = drawn.index(grid.tile_row(view, y));
      for (std::uint32_t x = 0; x < grid.tiles_across(); ++x) {
        if (store::is_left_out((*row)[x])) continue;
        const auto tile = drawn.block((*row)[x]);
        for (std::size_t r = 0; r < std::size_t{views::kTileEdge}; ++r) {
          const std::uint16_t* from =
              samples_of(*tile) +
              ((r + views::kApron) * views::kStoredEdge + views::kApron) * views::kSceneSamples;
          std::uint16_t* const to = &depths[(y * std::size_t{views::kTileEdge} + r) * edge +
                                            x * std::size_t{views::kTileEdge}];
          for (std::size_t c = 0; c < std::size_t{views::kTileEdge};
               ++c, from += views::kSceneSamples)
            if (from[3] >= kHalf) to[c] = from[4];
        }
      }
    }
  }

  job::JobContext& job_;
  const std::string output_;
  planning::SplatRequest request_;
  const MeshShape& shape_;
  const double end_;
  Vec3d origin_;  ///< of the scene's coordinates
  runtime::Lease contexts_, directory_, surface_;
};

}  // namespace

SourceSurface surface_of_scene(job::JobContext& job, const TransferOptions& options,
                               const MeshShape& shape, double end) {
  SourceSurface made = SceneShape(job, options, shape, end).make();
  const StageTimer timer(job.clock, "surface");
  meshing::keep_large_parts(made.surface, kLeastPart);
  meshing::smooth(made.surface, kSmoothing);
  if (made.surface.triangles.empty()) {
    throw Error(ErrorKind::input,
                options.source +
                    (shape.inside ? ": no surface is seen from the point of --inside"
                                  : ": no surface is seen from outside; a room needs --inside, an "
                                    "open scene --box around one object, a faint one "
                                    "--min-opacity"));
  }
  return made;
}

}  // namespace pounce::flow
