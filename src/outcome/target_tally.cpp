// SPDX-License-Identifier: Apache-2.0
//
// What became of one target, as numbers and as warnings.
//
// A result that is empty, mostly empty or far away is written all the same, but it is hardly what
// somebody wanted: here it is said, with both boxes and the options that would change it.
//
// Pages arrive one after the other, and each pass brings the same page again. The target's own
// numbers are those of the first channel of each page that is written; the other channels count for
// themselves. Otherwise a texel would count once per channel.
//
// Warnings come last, once all pages are known, from the strongest finding to the weakest. One that
// explains the rest ends the list: of a scene that does not fit, distances and coverage say nothing
// more.
#include "outcome/target_tally.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <optional>
#include <utility>

#include "gaussian/splat_statistics.h"

namespace pounce::outcome {
namespace {

/// Of covered texels, in percent: more than this in the farthest quarter of the maximum distance is
/// no surface that lies close (docs/decisions/016-little-found.md).
constexpr std::uint64_t kMostFarPercent = 6;
constexpr std::uint64_t kFewPercent = 50;  // below that a result is hardly what was wanted
/// Below that a scene may be another object's, although it is not known to be: of pairs that belong
/// together nearly all have more (docs/decisions/026-evidence.md).
constexpr double kSureFit = 0.9;
/// UVs that use less of their images are hardly meant so: by Smart UV on hulls of captures 0.006 to
/// 0.14, packed charts of models 0.3 to 0.9.
constexpr double kLittleFill = 0.15;
/// Layers this many times as far apart as target and source are told apart, and this part of a
/// surface may have closer ones: creases have some (docs/decisions/050).
constexpr double kPerLayer = 2, kManyLayers = 1.0 / 64;
constexpr std::uint32_t kLeastSize = 256, kLargestSize = 16384;  // that are proposed
/// A mesh whose texels nearly all find it so near, as a part of the target's size, lies at the
/// target (docs/decisions/016-little-found.md).
constexpr double kAtSurface = 0.004;
constexpr std::uint64_t kMostPercent = 90;
/// A distance that is proposed is so much longer than what it is to reach, or that would lie in its
/// farthest quarter.
constexpr double kDistanceToSpare = 1.5;

std::string text_of(const Box3f& b, Vec3d origin) {
  const Vec3d lo = Vec3d(b.lo) + origin, hi = Vec3d(b.hi) + origin;
  const int digits = origin == Vec3d{} ? 6 : 10;
  return fmt::format("({:.{}g} {:.{}g} {:.{}g})..({:.{}g} {:.{}g} {:.{}g})", lo.x, digits, lo.y,
                     digits, lo.z, digits, hi.x, digits, hi.y, digits, hi.z, digits);
}

double percent(std::uint64_t part, std::uint64_t whole) {
  return 100 * static_cast<double>(part) / static_cast<double>(whole);
}

void add(const TexelCounts& counts, TexelCounts& sum) {
  sum.texels += counts.texels;
  sum.covered += counts.covered;
  sum.empty += counts.empty;
}

/// The axes that do what `second` does to what `first` gives.
Axes then(const Axes& first, const Axes& second) {
  Axes both;
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t from = second.from[i];
    both.from[i] = first.from[from];
    both.sign[i] = static_cast<std::int8_t>(second.sign[i] * first.sign[from]);
  }
  return both;
}

/// What would bring the target to where its source is, step by step.
std::string steps_of(const projection::Pose& pose, double diagonal, Vec3d origin,
                     const Axes& given) {
  constexpr double kShare = 0.005, kScale = 0.005, kDegrees = 0.75, kUnits = 2;
  const projection::PoseParts parts = projection::parts_of(pose);
  std::vector<std::string> steps;
  if (parts.axes != Axes{})
    steps.push_back(fmt::format("rotated with --target-axes {}", to_text(then(given, parts.axes))));
  // A factor of two or more is taken for another unit of length. It is corrected where the model
  // was exported, so it acts about 0, as --target-axes does.
  const bool is_unit = parts.scale > kUnits || parts.scale * kUnits < 1;
  if (is_unit) {
    steps.push_back(fmt::format(
        "scaled by {:.4g} (it is {:.4g} times the source's size along all axes: different units?)",
        parts.scale, 1 / parts.scale));
  } else if (std::abs(parts.scale - 1) > kScale) {
    steps.push_back(fmt::format("scaled by {:.4g}", parts.scale));
  }
  if (parts.degrees > kDegrees) {
    steps.push_back(fmt::format("rotated by {:.1f} degrees about ({:.2f} {:.2f} {:.2f})",
                                parts.degrees, parts.about.x, parts.about.y, parts.about.z));
  }
  // --target-axes and units leave 0 where it is; all else is about the target's middle.
  const Vec3d centre = pose.centre + origin;
  const Vec3d shift = centre + pose.shift - parts.axes.apply(centre) * (is_unit ? parts.scale : 1);
  if (length(shift) > kShare * diagonal * parts.scale)
    steps.push_back(fmt::format("moved by ({:.3g} {:.3g} {:.3g})", shift.x, shift.y, shift.z));
  return fmt::format("{}", fmt::join(steps, ", "));
}

}  // namespace

std::string judge_distances(const DistanceCounts& distances) {
  const std::uint64_t all = std::accumulate(distances.begin(), distances.end(), std::uint64_t{0});
  const std::uint64_t far =
      std::accumulate(distances.end() - static_cast<std::ptrdiff_t>(kDistanceBins / 4),
                      distances.end(), std::uint64_t{0});
  if (far * 100 <= all * kMostFarPercent) return "";
  return fmt::format(
      "{:.0f} % of the covered texels hit the source in the farthest quarter of --max-distance",
      percent(far, all));
}

TargetTally::TargetTally(double min_coverage_percent, SourceFacts source,
                         const planning::TargetPlan& target_plan, std::string model, Report& report)
    : min_coverage_percent_(min_coverage_percent),
      source_(std::move(source)),
      plan_(*source_.plan),
      target_(target_plan),
      model_(std::move(model)),
      report_(report) {
  TargetReport& entry = report_.targets.emplace_back();
  entry.path = target_.path;
  entry.max_distance = double{target_.max_distance};
  page_states_.resize(target_.pages.size());
  page_vectorized_.resize(target_.pages.size());
  if (report_.channels.empty()) {
    for (const planning::ChannelPlan& channel : plan_.channels)
      report_.channels.push_back({channel.name, 0, {}});
  }
  bool any_to_make = false;
  for (std::size_t c = 0; c < target_.images.size(); ++c) {
    for (std::size_t page = 0; page < target_.pages.size(); ++page) {
      if (!target_.images[c][page].keep) {
        any_to_make = true;
        continue;
      }
      if (!target_.images[c][page].elsewhere) keeps(c, static_cast<std::uint32_t>(page));
    }
  }
  entry.enough = min_coverage_percent_ <= 0 || !any_to_make;  // until finish() knows
}

void TargetTally::keeps(std::size_t channel, std::uint32_t page) {
  target().images.push_back(describe(channel, page));
  target().images.back().state = "kept";
}

ImageReport TargetTally::describe(std::size_t channel, std::size_t page) const {
  const planning::ImageOutput& output = target_.images[channel][page];
  ImageReport image;
  image.path = model_.empty() ? output.path : model_;
  image.channel = plan_.channels[channel].name;
  image.material = target_.pages[page].set;
  image.udim = target_.by_tile ? static_cast<int>(target_.pages[page].udim) : 0;
  image.width = output.lattice.width;
  image.height = output.lattice.height;
  return image;
}

void TargetTally::vectorized(std::uint32_t page, const store::GeometryDirectory& directory) {
  if (page_vectorized_[page]) return;
  page_vectorized_[page] = true;
  box_.extend(directory.box);
  target().overlapping += directory.overlapping;
  report_.target_overlapping += directory.overlapping;
}

void TargetTally::add_page(std::size_t pass, std::uint32_t page, std::uint64_t texels,
                           const PageFound* result) {
  const std::vector<std::size_t>& channels = plan_.passes[pass].channels;
  page_ = page;
  page_begin_ = target().images.size();
  first_counted_ = kNone;
  for (std::size_t i = 0; i < channels.size(); ++i) {
    const std::size_t c = channels[i];
    if (target_.images[c][page].keep) continue;
    ImageReport image = describe(c, page);
    const std::uint64_t covered = result == nullptr ? 0 : result->covered[i];
    image.state = covered == 0 ? "empty" : "not written";
    image.counts = {texels, covered, texels - covered, 0};
    // The first channel that is written stands for its page, in whichever pass it comes. Its counts
    // and its distances become the target's.
    if (page_states_[page] == PageState::unseen) {
      image_texels_ += std::uint64_t{image.width} * image.height;
      ++pages_counted_;
      longest_edge_ = std::max({longest_edge_, image.width, image.height});
      first_counted_ = c;
      page_states_[page] = covered == 0 ? PageState::empty : PageState::found;
    }
    count(image.counts, c);
    target().images.push_back(std::move(image));
  }
  if (first_counted_ == kNone || result == nullptr) return;
  for (std::size_t i = 0; i < kDistanceBins; ++i) target().distances[i] += result->distances[i];
  distance_steps_ += result->distance_steps;
}

void TargetTally::count(const TexelCounts& counts, std::size_t channel) {
  add(counts, report_.channels[channel].counts);
  if (channel != first_counted_) return;
  add(counts, target().counts);
  report_.target_texels += counts.texels;
  report_.target_covered += counts.covered;
  report_.target_empty += counts.empty;
}

void TargetTally::wrote(std::size_t channel, std::uint64_t filled) {
  // add_page() has added the entry as "not written". So the report of a job that fails in between
  // names no file that does not exist. Images of a model become files only with the model.
  const std::string name = plan_.channels[channel].name;
  std::vector<ImageReport>& images = target().images;
  const auto image =
      std::find_if(images.begin() + static_cast<std::ptrdiff_t>(page_begin_), images.end(),
                   [&](const ImageReport& one) { return one.channel == name; });
  image->counts.filled = filled;
  page_states_[page_] = PageState::found;
  if (target_.images[channel][page_].painted) {  // it was counted again, and stays as it is
    image->state = "kept";
  } else {
    in_model_.emplace_back(static_cast<std::size_t>(image - images.begin()), channel);
  }
  if (model_.empty()) wrote_model();
  report_.channels[channel].counts.filled += filled;
  if (channel != first_counted_) return;
  target().counts.filled += filled;
  report_.target_filled += filled;
}

void TargetTally::wrote_page(std::uint32_t page) {
  if (!target_.by_tile) return;
  // Sorted, each once: passes and targets bring the same tiles again.
  const auto udim = static_cast<int>(target_.pages[page].udim);
  const auto [at, end] = std::equal_range(report_.udims.begin(), report_.udims.end(), udim);
  if (at == end) report_.udims.insert(at, udim);
}

void TargetTally::wrote_model() {
  for (const auto& [image, channel] : in_model_) {
    target().images[image].state = "written";
    ++report_.channels[channel].images;
  }
  in_model_.clear();
}

void TargetTally::finish(const Box3f& source) {
  const TexelCounts& counts = target().counts;
  if (target().overlapping > 0) {
    warn(fmt::format(
        "{} texels are covered by more than one triangle; the first one in file order is used",
        target().overlapping));
  }
  if (counts.covered > 0) warn_of_empty_pages();
  if (source_.has_own_target) {
    // Where texels that found nothing lie, and how far away what they sought, the map does not say.
    if (counts.covered == 0 && !any_kept())
      warn("no texel of the map shows an image; the result is empty");
  } else {
    if (counts.texels > 0 || !any_kept()) warn_of_little(source);
    warn_of_waste();
  }
  if (!mesh_fit_.better && !mesh_fit_.opposed) warn_of_layers();
  target().enough = has_enough();
}

void TargetTally::spreads(double area) {
  const TexelCounts& counts = target().counts;
  if (counts.texels == 0) return;
  target().fill = static_cast<double>(counts.texels) / static_cast<double>(image_texels_);
  if (pages_counted_ == target_.pages.size() && target_.all_tiles && area > 0)
    target().texel_size = std::sqrt(area / static_cast<double>(counts.texels));
}

void TargetTally::layers(std::span<const float> gaps) {
  const auto& distances = target().distances;
  const auto found =
      static_cast<double>(std::accumulate(distances.begin(), distances.end(), std::uint64_t{0}));
  if (gaps.empty() || found == 0) return;
  constexpr double kSteps = 65536;
  const double mean =
      static_cast<double>(distance_steps_) / kSteps / found * double{target_.max_distance};
  const auto close = std::count_if(gaps.begin(), gaps.end(),
                                   [&](float gap) { return double{gap} < kPerLayer * mean; });
  target().mean_distance = mean;
  target().close_layers = static_cast<double>(close) / static_cast<double>(gaps.size());
}

/// A texel that lies as far from its own layer as from the next one finds either.
void TargetTally::warn_of_layers() {
  const TargetReport& entry = target();
  if (!entry.close_layers || *entry.close_layers < kManyLayers) return;
  warn(fmt::format(
      "{:.1f} % of the source's surface has another layer within {:.2g}, and this target is {:.2g} "
      "from the source on average: some texels may show the wrong layer. Transfer the layers one "
      "by one (--source-mesh, --source-material), or bring the two shapes closer",
      100 * *entry.close_layers, kPerLayer * *entry.mean_distance, *entry.mean_distance));
}

/// A scene's details need texels as large as its Gaussians, and UVs that use their images.
void TargetTally::warn_of_waste() {
  const TargetReport& entry = target();
  // A part of a mesh, or an image that is composited over, leaves most of its texels alone on
  // purpose.
  const bool is_part = target_.painted_over || target_.in_part;
  if (entry.fill > 0 && entry.fill < kLittleFill && !is_part) {
    warn(
        fmt::format("its UVs use only {:.2g} % of the images ({} of {} texels): pack the charts "
                    "more tightly (Blender: UV > Pack Islands, with a small margin)",
                    100 * entry.fill, entry.counts.texels, image_texels_));
  }
  const double ratio =
      report_.gaussian_size > 0 && entry.texel_size ? *entry.texel_size / report_.gaussian_size : 0;
  if (ratio <= gaussian::kFineSizes) return;
  std::uint32_t edge = kLeastSize;
  const double wanted = longest_edge_ * ratio / gaussian::kFineSizes;
  while (edge < wanted && edge < kLargestSize) edge *= 2;
  report_.notes.push_back(
      fmt::format("{}: texels are {:.1f} times as large as the scene's Gaussians (median), so "
                  "finer detail is averaged; --size {} shows more",
                  entry.path, ratio, edge));
}

bool TargetTally::any_kept() const {
  const std::vector<ImageReport>& images = report_.targets.back().images;
  return std::any_of(images.begin(), images.end(),
                     [](const ImageReport& image) { return image.state == "kept"; });
}

/// Every channel by itself: one may have been made alone, or lack images that others have.
bool TargetTally::has_enough() const {
  if (min_coverage_percent_ <= 0) return true;
  std::map<std::string, TexelCounts> channels;
  for (const ImageReport& image : report_.targets.back().images)
    add(image.counts, channels[image.channel]);
  const auto is_enough = [&](const TexelCounts& counts) {
    return static_cast<double>(counts.covered) * 100 >=
           min_coverage_percent_ * static_cast<double>(counts.texels);
  };
  const bool found_any = std::any_of(channels.begin(), channels.end(),
                                     [](const auto& one) { return one.second.texels > 0; });
  return (found_any || any_kept()) &&
         std::all_of(channels.begin(), channels.end(),
                     [&](const auto& one) { return is_enough(one.second); });
}

/// Pages that stay as they were, or have no image, for want of a source.
void TargetTally::warn_of_empty_pages() {
  // One line per material, however many UDIM tiles it has.
  std::map<std::optional<std::uint32_t>, std::vector<std::size_t>> sets;  // by material
  for (std::size_t page = 0; page < page_states_.size(); ++page) {
    if (page_states_[page] == PageState::empty) sets[target_.pages[page].material].push_back(page);
  }
  for (const auto& [material, pages] : sets) {
    const std::string name = fmt::format("material \"{}\"", target_.pages[pages.front()].set);
    if (!model_.empty()) {
      warn(fmt::format("no texel of {} found a source; it is left unchanged", name));
      continue;
    }
    std::vector<std::uint32_t> udims;
    for (const std::size_t page : pages) udims.push_back(target_.pages[page].udim);
    std::sort(udims.begin(), udims.end());
    warn(fmt::format("no texel of UDIM {}{} found a source; no image was written",
                     planning::udim_list(udims), material ? " of " + name : ""));
  }
}

/// A result that is empty, half empty or far from its source is hardly what was wanted: say what
/// may be wrong, and with which options it changes.
void TargetTally::warn_of_little(const Box3f& source) {
  const TexelCounts& counts = target().counts;
  if (counts.texels == 0) return warn("its UVs cover no texel centre; the result is empty");
  const std::string places =
      fmt::format("{} spans {}, the target {}", source_.box_name, text_of(source, plan_.origin),
                  text_of(box_, plan_.origin));
  if (is_misfit()) return warn_of_misfit(places);
  if (mesh_fit_.better) warn_of_pose();
  if (mesh_fit_.opposed && counts.covered * 100 < counts.texels * kFewPercent) warn_of_opposed();
  if (counts.covered == 0) {
    return warn(fmt::format("no texel found a source within {:g}: the result is empty. {}; {}",
                            target_.max_distance, places, cure()));
  }
  if (is_doubtful()) warn_of_doubt(places);
  const bool is_little = counts.covered * 100 < counts.texels * kFewPercent;
  if (is_little) {
    warn(
        fmt::format("only {:.2f} % of its texels ({} of {}) found a source within {:g}. {}; {}; "
                    "--coverage shows where",
                    percent(counts.covered, counts.texels), counts.covered, counts.texels,
                    target_.max_distance, places, cure()));
  }
  const std::string far = judge_distances(target().distances);
  if (far.empty()) return;
  warn(fmt::format(
      "{} ({:g}): either the source is farther away ({}), or this is a different object and its "
      "colours are arbitrary. {}",
      far, target_.max_distance,
      is_beyond() ? fmt::format("use {}", distance_to_give()) : "raise --max-distance", places));
}

/// Is there more of a scene than texels reach?
bool TargetTally::is_beyond() const { return scene_distance_ > double{target_.max_distance}; }

std::string TargetTally::distance_to_give() const {
  return fmt::format("--max-distance {:.2g}", kDistanceToSpare * scene_distance_);
}

/// What may be done about a source that texels do not reach.
std::string TargetTally::cure() const {
  if (is_beyond())
    return fmt::format(
        "the scene's surface is up to {:.2g} from the target's: align them, or use {}",
        scene_distance_, distance_to_give());
  return source_.cure;
}

bool TargetTally::is_misfit() const {
  const std::optional<double> fit = report_.targets.back().fit;
  return is_scene_ && fit && *fit < kLeastFit;
}

bool TargetTally::is_doubtful() const {
  const std::optional<double> fit = report_.targets.back().fit;
  return is_scene_ && fit && *fit < kSureFit;
}

/// The texture is written, but somebody should look at it.
void TargetTally::warn_of_doubt(const std::string& places) {
  warn(
      fmt::format("the scene may not match this target (fit {:.2f} of 1; below {:g} is unusual): "
                  "one may have parts that the other lacks, be shifted, rotated or scaled by a few "
                  "per cent, or be another object of similar shape. {}; check the texture before "
                  "you use it, and --channels baseColor,confidence,distance",
                  *target().fit, kSureFit, places));
}

bool TargetTally::is_in_question() {
  const TexelCounts& counts = target().counts;
  // A cheap question before an expensive one: the search for a better pose is made only if few
  // texels lie at the surface.
  if (!source_.is_mesh || counts.texels == 0) return false;
  // In whole sixteenths of the maximum distance.
  const double bin = double{target_.max_distance} / kDistanceBins;
  const auto bins = static_cast<std::size_t>(
      std::min<double>(kAtSurface * target_.diagonal / bin, kDistanceBins));
  const auto& found = target().distances;
  const std::uint64_t near = std::accumulate(
      found.begin(), found.begin() + static_cast<std::ptrdiff_t>(bins), std::uint64_t{0});
  const bool is_asked = near * 100 < counts.texels * kMostPercent;
  if (!is_asked) target().fit = 1;
  return is_asked;
}

/// The source lies much nearer to the target where that is moved.
void TargetTally::warn_of_pose() {
  const projection::MeshFit& fit = mesh_fit_;
  const std::string steps = steps_of(*fit.better, target_.diagonal, plan_.origin, target_.axes);
  if (steps.empty()) return;
  warn(
      fmt::format("only {:.0f} % of its surface coincides with the source's (fit {:.2f} of 1); "
                  "{:.0f} % would if the target were {}: align the two",
                  100 * fit.lie_near, fit.fit, 100 * fit.would_lie_near, steps));
}

void TargetTally::warn_of_opposed() {
  const bool is_known = mesh_fit_.target_inward != mesh_fit_.source_inward;
  warn(fmt::format(
      "its normals point opposite to the source's where the two coincide{}: flip the normals of {}",
      is_known ? fmt::format(", and those of the {} point inward",
                             mesh_fit_.target_inward ? "target" : "source")
               : "",
      is_known && mesh_fit_.source_inward ? "the source"
      : is_known                          ? "the target"
                                          : "one of them"));
}

/// What a texel finds of another object is found by chance, so this says all there is to say.
void TargetTally::warn_of_misfit(const std::string& places) {
  const TexelCounts& counts = target().counts;
  warn(fmt::format(
      "the scene does not match this target's surface (fit {:.2f} of 1): {:.2f} % of its texels "
      "are covered. {}; if they show the same object, align them (--source-axes, scale, units), or "
      "{} if the surface is farther away than {:g}; --min-confidence 0 shows all that was found",
      *target().fit, percent(counts.covered, counts.texels), places,
      is_beyond() ? fmt::format("use {}", distance_to_give()) : "raise --max-distance",
      target_.max_distance));
}

}  // namespace pounce::outcome
