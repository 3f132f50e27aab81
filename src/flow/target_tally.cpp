// SPDX-License-Identifier: Apache-2.0
#include "flow/target_tally.h"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>

namespace pounce::flow {
namespace {

/// Of covered texels, in percent: more than this in the farthest quarter of the maximum distance is
/// no surface that lies close (docs/decisions/016-little-found.md).
constexpr std::uint64_t kMostFarPercent = 6;
constexpr std::uint64_t kFewPercent = 50;  // below that a result is hardly what was wanted

std::string text_of(const Box3f& b) {
  return fmt::format("({:g} {:g} {:g})..({:g} {:g} {:g})", b.lo.x, b.lo.y, b.lo.z, b.hi.x, b.hi.y,
                     b.hi.z);
}

double percent(std::uint64_t part, std::uint64_t whole) {
  return 100 * static_cast<double>(part) / static_cast<double>(whole);
}

void add(const TexelCounts& counts, TexelCounts& sum) {
  sum.texels += counts.texels;
  sum.covered += counts.covered;
  sum.empty += counts.empty;
}

}  // namespace

std::string judge_distances(const DistanceCounts& distances) {
  const std::uint64_t all = std::accumulate(distances.begin(), distances.end(), std::uint64_t{0});
  const std::uint64_t far =
      std::accumulate(distances.end() - static_cast<std::ptrdiff_t>(kDistanceBins / 4),
                      distances.end(), std::uint64_t{0});
  if (far * 100 <= all * kMostFarPercent) return "";
  return fmt::format(
      "{:.0f} % of the covered texels found their surface in the farthest quarter of "
      "--max-distance",
      percent(far, all));
}

TargetTally::TargetTally(const TransferOptions& options, const Plan& plan,
                         const TargetPlan& target_plan, std::string model, Report& report)
    : options_(options),
      plan_(plan),
      target_(target_plan),
      model_(std::move(model)),
      report_(report) {
  TargetReport& entry = report_.targets.emplace_back();
  entry.path = target_.path;
  entry.max_distance = double{target_.max_distance};
  if (report_.channels.empty()) {
    for (const ChannelPlan& channel : plan_.channels)
      report_.channels.push_back({channel_name(channel.channel), 0, {}});
  }
  for (std::size_t c = 0; c < target_.images.size(); ++c) {
    for (std::size_t page = 0; page < target_.pages.size(); ++page) {
      if (!target_.images[c][page].keep) continue;
      any_kept_ = true;
      entry.images.push_back(describe(c, page));
      entry.images.back().state = "kept";
    }
  }
}

ImageReport TargetTally::describe(std::size_t channel, std::size_t page) const {
  const ImageOutput& output = target_.images[channel][page];
  const bool has_tiles = target_.requests.front().tile_pages.has_value();
  ImageReport image;
  image.path = model_.empty() ? output.path : model_;
  image.channel = channel_name(plan_.channels[channel].channel);
  image.material = target_.pages[page].set;
  image.udim = has_tiles ? static_cast<int>(target_.pages[page].udim) : 0;
  image.width = output.lattice.width;
  image.height = output.lattice.height;
  return image;
}

void TargetTally::vectorized(const tiles::GeometryDirectory& directory) {
  box_ = directory.box;
  target().overlapping = directory.overlapping;
  report_.target_overlapping += directory.overlapping;
  if (directory.overlapping > 0) {
    warn(fmt::format(
        "{} texels are claimed by more than one triangle; the first in file order has them",
        directory.overlapping));
  }
}

void TargetTally::add_page(std::size_t pass, std::uint32_t page, std::uint64_t texels,
                           const PageResult* result) {
  const std::vector<std::size_t>& channels = plan_.passes[pass].channels;
  page_begin_ = target().images.size();
  for (std::size_t i = 0; i < channels.size(); ++i) {
    const std::size_t c = channels[i];
    if (target_.images[c][page].keep) continue;
    ImageReport image = describe(c, page);
    image.state = "empty";
    const std::uint64_t covered = result == nullptr ? 0 : result->covered[i];
    image.counts = {texels, covered, texels - covered, 0};
    const bool is_first = pass == 0 && target().images.size() == page_begin_;
    if (is_first) first_counted_ = c;
    count(image.counts, c, is_first);
    target().images.push_back(std::move(image));
  }
  if (pass != 0 || result == nullptr) return;
  for (std::size_t i = 0; i < kDistanceBins; ++i) target().distances[i] += result->distances[i];
}

void TargetTally::count(const TexelCounts& counts, std::size_t channel, bool is_first) {
  add(counts, report_.channels[channel].counts);
  if (!is_first) return;
  add(counts, target().counts);
  report_.target_texels += counts.texels;
  report_.target_covered += counts.covered;
  report_.target_empty += counts.empty;
}

void TargetTally::wrote(std::size_t channel, std::uint64_t filled) {
  const std::string name = channel_name(plan_.channels[channel].channel);
  std::vector<ImageReport>& images = target().images;
  const auto image =
      std::find_if(images.begin() + static_cast<std::ptrdiff_t>(page_begin_), images.end(),
                   [&](const ImageReport& one) { return one.channel == name; });
  image->state = "written";
  image->counts.filled = filled;
  ++report_.channels[channel].images;
  report_.channels[channel].counts.filled += filled;
  if (channel != first_counted_) return;
  target().counts.filled += filled;
  report_.target_filled += filled;
}

void TargetTally::finish(const Box3f& source) {
  const TexelCounts& counts = target().counts;
  if (counts.covered > 0) warn_of_empty_pages();
  if (counts.texels > 0 || !any_kept_) warn_of_little(source);
  const bool nothing_done = counts.texels == 0 && any_kept_;
  target().enough =
      nothing_done || options_.min_coverage_percent <= 0 ||
      (counts.texels > 0 && static_cast<double>(counts.covered) * 100 >=
                                options_.min_coverage_percent * static_cast<double>(counts.texels));
}

/// Pages that stay as they were, or have no image, for want of a source.
void TargetTally::warn_of_empty_pages() {
  const std::string first = report_.channels.front().name;
  std::vector<std::uint32_t> udims;
  for (const ImageReport& image : target().images) {
    if (image.state != "empty" || image.channel != first) continue;
    if (!model_.empty()) {
      warn(fmt::format("no texel of material \"{}\" found a source; it stays as it was",
                       image.material));
    } else {
      udims.push_back(static_cast<std::uint32_t>(image.udim));
    }
  }
  if (!udims.empty()) {
    warn(fmt::format("no texel of UDIM {} found a source; no image was written for that",
                     udim_list(udims)));
  }
}

/// A result that is empty, half empty or far from its source is hardly what was wanted: say what
/// may be wrong, and with which options it changes.
void TargetTally::warn_of_little(const Box3f& source) {
  const TexelCounts& counts = target().counts;
  if (counts.texels == 0) return warn("its UVs cover no texel centre; the result is empty");
  const std::string places =
      fmt::format("The source spans {}, the target {}", text_of(source), text_of(box_));
  if (counts.covered == 0) {
    return warn(fmt::format(
        "no texel found a source within {:g}: the result is empty. {}; align them, or raise "
        "--max-distance or --max-angle",
        target_.max_distance, places));
  }
  const bool is_little = counts.covered * 100 < counts.texels * kFewPercent;
  if (is_little) {
    warn(
        fmt::format("only {:.2f} % of its texels ({} of {}) found a source within {:g}. {}; align "
                    "them, or raise --max-distance or --max-angle; --coverage shows where",
                    percent(counts.covered, counts.texels), counts.covered, counts.texels,
                    target_.max_distance, places));
  }
  const std::string far = judge_distances(target().distances);
  if (far.empty()) return;
  warn(
      fmt::format("{} ({:g}): either the source lies farther away, then raise it, or this is "
                  "another object, then colours are by chance. {}",
                  far, target_.max_distance, places));
}

}  // namespace pounce::flow
