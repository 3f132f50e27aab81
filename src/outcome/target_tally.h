// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/bounds.h"
#include "planning/plan.h"
#include "pounce/options.h"
#include "pounce/report.h"
#include "projection/mesh_fit.h"
#include "projection/splat_fit.h"
#include "store/blocks/geometry_store.h"
#include "store/blocks/result_records.h"

namespace pounce::outcome {

/// What the texels of a page found.
using PageFound = store::ResultCounts;

/// What warnings must know of the source.
struct SourceFacts {
  const planning::SourcePlan* plan = nullptr;
  std::string box_name;         ///< what the box that finish() is told is the box of
  std::string cure;             ///< what helps where texels do not reach it
  bool is_mesh = false;         ///< whether it fits can be asked of its surface
  bool has_own_target = false;  ///< a hit map, which knows nothing of what was not hit
};

/// Counts what one target got into the report, image by image as they are made, and says in the end
/// what a user should know of it. Not thread-safe.
class TargetTally {
 public:
  /// The source's plan, `target` and `report` must outlive it; `min_coverage_percent`: below that
  /// it has not found enough. `model`: the path of a model output, else empty.
  TargetTally(double min_coverage_percent, SourceFacts source, const planning::TargetPlan& target,
              std::string model, Report& report);

  /// How a splat scene lies at this target.
  void fits(const projection::SplatFit& fit) {
    target().fit = fit.fit;
    target().scene_offset = fit.middle;
    target().scene_spread = fit.spread;
    scene_distance_ = fit.distance;
    is_scene_ = true;
  }
  /// Of a mesh that is projected: do so few texels lie at it that somebody should ask whether it
  /// fits? If not, it does. To be called once all pages are added.
  bool is_in_question();
  /// How a mesh lies at this target.
  void fits(const projection::MeshFit& fit) {
    target().fit = fit.fit;
    mesh_fit_ = fit;
  }
  /// A page's store; of several passes the first one counts.
  void vectorized(std::uint32_t page, const store::GeometryDirectory& directory);
  /// A page of a pass with so many texels; `result` is null where there was nothing to project.
  void add_page(std::size_t pass, std::uint32_t page, std::uint64_t texels,
                const PageFound* result);
  /// Of the page that was added last, an image was written: as a file, or into what becomes the
  /// model.
  void wrote(std::size_t channel, std::uint64_t filled);
  void wrote_page(std::uint32_t page);  ///< all its images of a pass
  /// An image that was to be made turned out to be there.
  void keeps(std::size_t channel, std::uint32_t page);
  /// The model was written, with all such images.
  void wrote_model();
  /// So much surface the target has. To be called once all pages are added.
  void spreads(double area);
  /// Of a mesh that was projected, how far away other layers of it lie (surface::layer_gaps()).
  /// To be called once all pages are added.
  void layers(std::span<const float> gaps);
  /// Warns of what was not found; `source` is where the source lies.
  void finish(const Box3f& source);

 private:
  TargetReport& target() { return report_.targets.back(); }
  ImageReport describe(std::size_t channel, std::size_t page) const;
  void count(const TexelCounts& counts, std::size_t channel);
  bool any_kept() const;
  bool has_enough() const;
  void warn_of_empty_pages();
  void warn_of_little(const Box3f& source);
  bool is_beyond() const;
  std::string distance_to_give() const;
  std::string cure() const;
  bool is_misfit() const;
  void warn_of_misfit(const std::string& places);
  bool is_doubtful() const;
  void warn_of_doubt(const std::string& places);
  void warn_of_pose();
  void warn_of_waste();
  void warn_of_layers();
  void warn_of_opposed();
  void warn(const std::string& text) { report_.warnings.push_back(target_.path + ": " + text); }

  const double min_coverage_percent_;
  const SourceFacts source_;
  const planning::SourcePlan& plan_;
  const planning::TargetPlan& target_;
  const std::string model_;
  Report& report_;
  Box3f box_;
  projection::MeshFit mesh_fit_;
  std::uint64_t distance_steps_ = 0;  ///< PageFound's, of the texels of its distances
  bool is_scene_ = false;             ///< what was projected is a splat scene
  double scene_distance_ = 0;         ///< of a splat scene from this target, at most places
  /// What the first channel of a page that is made found there, or that some channel was written.
  enum class PageState : std::uint8_t { unseen, empty, found };
  static constexpr std::size_t kNone = SIZE_MAX;
  std::vector<PageState> page_states_;
  std::uint64_t image_texels_ = 0;  ///< of the images that are counted
  std::size_t pages_counted_ = 0;
  std::uint32_t longest_edge_ = 0;  ///< of these images
  std::vector<bool> page_vectorized_;
  std::uint32_t page_ = 0;             ///< that was added last
  std::size_t page_begin_ = 0;         ///< images of the page that was added last begin here
  std::size_t first_counted_ = kNone;  ///< of those: whose counts are the target's
  std::vector<std::pair<std::size_t, std::size_t>> in_model_;  ///< (image, channel), not there yet
};

/// Adds the nodes of a page's graph to those of all pages, which have the same graph.
void add_nodes(const std::vector<NodeReport>& page, std::vector<NodeReport>& all);

/// What the distances at which a target found its source say: a sentence for a warning, or nothing.
std::string judge_distances(const DistanceCounts& distances);

}  // namespace pounce::outcome
