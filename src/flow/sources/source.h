// SPDX-License-Identifier: Apache-2.0
//
// What a job takes appearance from. A kind of source is a class behind one interface, and the job
// knows no other difference between kinds: another kind is one more file here and a line in
// open_source().
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/bounds.h"
#include "flow/project/page_colour.h"
#include "flow/project/page_projector.h"
#include "flow/stores/block_readers.h"
#include "flow/stores/views.h"
#include "job/job_context.h"
#include "job/run_job.h"
#include "job/test_knobs.h"
#include "planning/disk.h"
#include "planning/plan.h"
#include "planning/seen_images.h"
#include "projection/splat_fit.h"
#include "store/blocks/geometry_store.h"
#include "surface/strewn_places.h"

namespace pounce::flow {

/// A part of the progress bar.
struct ProgressRange {
  double begin = 0, end = 1;
};

/// The source of a job: the same for all its targets. First it is planned, then built, then put in
/// front of one page of a target after the other. Not thread-safe, but for what it projects.
class Source {
 public:
  virtual ~Source() = default;
  Source(const Source&) = delete;
  Source& operator=(const Source&) = delete;

  // --- planning: meshes and headers are read, no image and no Gaussian ---------------------------

  /// Decides channels, sizes and passes, and adds what that needs of memory and disk. What a user
  /// should know goes to the job's report; what he must hear before any work is thrown.
  /// `check_order` is told the source's mesh, if there is one, before anything is missed in it.
  virtual void make_plan(job::MemoryNeeds& needs, planning::DiskPlan& disk,
                         const std::function<void(const mesh::Mesh&)>& check_order) = 0;
  const planning::SourcePlan& plan() const { return plan_; }
  const std::vector<std::string>& files() const { return files_; }  ///< that it is made of
  /// Says that a target is there, planned; its mesh may go afterwards.
  virtual void meet(const planning::TargetPlan&, const mesh::Mesh&) {}
  /// Memory of what planning left behind, until build() has run.
  virtual std::uint64_t held_bytes() const { return 0; }
  virtual void lease_held() {}  ///< takes that from the budget
  /// What reading the file takes, as it is read again beside each target; 0: nothing.
  virtual std::uint64_t reading_bytes() const { return 0; }
  /// Each step of build(), beside compressors, held_bytes() and a target's mesh.
  virtual std::vector<job::LeastMemory> build_needs() const = 0;
  /// What stays of all stores while they are open.
  virtual std::uint64_t directory_bytes() const = 0;
  /// The least that putting it in front of one block of a target needs, for one pass.
  virtual std::uint64_t project_least_bytes(std::size_t pass) const = 0;

  // --- stores ------------------------------------------------------------------------------------

  /// Builds the stores or finds them in the cache. `targets`: all of the job. What planning held is
  /// gone afterwards: from here on the stores are read, never the inputs. `ahead` needs nothing of
  /// the source, and is made if threads and memory would else be idle; it may stay unmade.
  virtual void build(ProgressRange range, const planning::TargetDetail& targets,
                     const BesideImages& ahead) = 0;
  /// What a pass has read of the store that it reads most, so far.
  virtual std::uint64_t bytes_read(std::size_t pass) const = 0;
  virtual Box3f box() const = 0;  ///< where it lies
  /// How often a tile's part of an index was read, so far.
  virtual std::uint64_t tiles_read() const = 0;

  // --- projection --------------------------------------------------------------------------------

  /// Draws a scene, and the target, from all around, for this target: nothing where texels look
  /// along their normals. `area`: of the mesh.
  virtual std::unique_ptr<SceneViews> views_of(const planning::TargetPlan&, const mesh::Mesh&,
                                               double /*area*/, ProgressRange) const {
    return nullptr;
  }
  /// What puts it in front of a target, beside the target: of a scene.
  struct Before {
    projection::SplatFit fit;
    const SceneViews* views = nullptr;
  };
  /// Puts it in front of one page of a target, for one pass.
  virtual std::unique_ptr<Projection> projector(std::size_t pass, std::uint32_t page,
                                                const store::GeometryStore& target,
                                                const planning::TargetPlan& target_plan,
                                                const Before& before) const = 0;
  /// What stands for the target of a source that has it in it.
  virtual std::optional<mesh::Mesh> own_target() const { return std::nullopt; }
  /// How many texels of a target's page were to find something.
  virtual std::uint64_t texels_of(const PageResult&, std::uint64_t target_texels) const {
    return target_texels;
  }

  // --- does it fit a target? ---------------------------------------------------------------------

  /// How many places of a target's surface say whether the two fit.
  virtual std::size_t target_places() const = 0;
  /// Does a scene lie at a target? Nothing of other kinds.
  virtual std::optional<projection::SplatFit> fit(std::span<const surface::Place>,
                                                  const planning::TargetPlan&) const {
    return std::nullopt;
  }
  /// Of a mesh: places of its surface, to find whether it fits.
  virtual std::span<const surface::Place> places() const { return {}; }
  /// Of a mesh: how far away other layers of it lie that face alike (surface::layer_gaps()).
  virtual std::span<const float> layer_gaps() const { return {}; }
  /// For warnings: what box() is the box of, and what helps where texels do not reach the source.
  virtual std::string box_name() const { return "The source"; }
  virtual std::string cure() const { return "align them, or raise --max-distance or --max-angle"; }

 protected:
  Source(job::JobContext& job, const TransferOptions& options);
  std::uint64_t result_texel_bytes(std::size_t pass) const;

  job::JobContext& job_;
  const TransferOptions& options_;  ///< for planning alone: what they resolve to is in the plan
  const float min_cosine_;          ///< of --max-angle
  planning::SourcePlan plan_;
  std::vector<std::string> files_;
};

/// The kind that the file and the options ask for. Throws Error(usage) for options of another kind.
/// `job` and `options` must outlive it; `for_model`: the images go into a model.
std::unique_ptr<Source> open_source(job::JobContext& job, const TransferOptions& options,
                                    bool for_model, const job::TestKnobs& knobs);

// --- its images ----------------------------------------------------------------------------------

/// The images of a mesh as columns of colour tiles, open as long as this lives, and what is kept of
/// them.
struct SourceColumns {
  std::vector<std::unique_ptr<ColourCache>> columns;  ///< by SourcePlan::columns
  std::vector<TileColumns> tile_sets;                 ///< by SourcePlan::tile_sets
  std::unique_ptr<ColourLevels> levels;               ///< of all columns
  runtime::Lease whole_lease;                         ///< for what WholeColumn builds
  bool all_cached = true;

  /// What each source page gives to a channel whose source is seen through these lattices.
  std::vector<PageColour> pages_of(const planning::ChannelPlan& channel,
                                   const std::vector<mesh::Lattice>& lattices) const;
  std::uint64_t bytes_read() const;
};

/// What building a planned column takes.
ColourRequest request_of(const planning::ColumnPlan& column);

/// That of each, and the largest decoded tile of them all.
std::vector<job::LeastMemory> column_needs(const planning::SourcePlan& plan);
std::uint64_t colour_tile_bytes(const planning::SourcePlan& plan);

/// What is stored of a plan's columns at first. The rest is made when a lookup asks for it.
struct StoredParts {
  planning::WantedTiles tiles;
  std::vector<std::uint32_t> levels;  ///< not 0: that level in place of the image
};
/// `shown`: what planning::little_shown() names. All of every image where targets see it from too
/// far for tiles alone and not far enough for a level alone, and where the budget has no space for
/// building an image later.
StoredParts stored_parts(const job::JobContext& job, const planning::SourcePlan& plan,
                         const planning::WantedTiles& shown, const planning::TargetDetail& targets);

/// Builds the columns of a plan or finds them in the cache; takes job.meter through a stage whose
/// end is `progress_end`, and counts what was done in job.report. `beside` as in colour_stores().
SourceColumns build_columns(job::JobContext& job, const planning::SourcePlan& plan,
                            const StoredParts& parts, double progress_end,
                            BesideImages* beside = nullptr);

}  // namespace pounce::flow
