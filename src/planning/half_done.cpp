// SPDX-License-Identifier: Apache-2.0
#include "planning/half_done.h"

#include <algorithm>
#include <string_view>

#include "io/files/output_file.h"
#include "job/step_pack.h"
#include "store/blocks/result_records.h"

namespace pounce::planning {
namespace {

/// Raised whenever a program would read the results of an earlier one as other texels, or an
/// earlier one its own: an unfinished job may be gone on with by either.
constexpr std::uint32_t kResultsVersion = 2;

}  // namespace

Hash128 results_key(const SourcePlan& source, const PassPlan& pass, const TargetPlan& target,
                    std::size_t page) {
  Hasher hasher;
  hasher.add(std::string_view("results"));
  hasher.add(store::kFormatVersion);
  hasher.add(kResultsVersion);
  for (const std::size_t c : pass.channels) {
    const ChannelPlan& channel = source.channels[c];
    hasher.add(std::string_view(target.images[c][page].job));
    hasher.add(channel.format.linear);
    hasher.add(channel.format.has_alpha);
    hasher.add(channel.format.premultiplied);
    for (const float value : channel.primaries) hasher.add(double{value});
  }
  return hasher.digest();
}

bool has_work(const TargetPlan& target, const std::vector<std::size_t>& channels,
              std::size_t page) {
  return std::any_of(channels.begin(), channels.end(),
                     [&](std::size_t c) { return !target.images[c][page].keep; });
}

namespace {

bool is_elsewhere(const TargetPlan& target, const std::vector<std::size_t>& channels,
                  std::size_t page) {
  return std::any_of(channels.begin(), channels.end(),
                     [&](std::size_t c) { return target.images[c][page].elsewhere; });
}

}  // namespace

std::vector<HalfDoneImage> half_done(job::JobContext& job, const SourcePlan& source,
                                     const TargetPlan& target) {
  std::vector<HalfDoneImage> found;
  for (const PassPlan& pass : source.passes) {
    for (std::size_t page = 0; page < target.pages.size(); ++page) {
      if (!has_work(target, pass.channels, page)) continue;
      const Hash128 key = results_key(source, pass, target, page);
      const auto file = job::StepPack::find(job, key);
      if (file == nullptr) continue;
      const ImageOutput& image = target.images[pass.channels.front()][page];
      const auto done = store::half_done(*file, key, {image.lattice, pass.channels.size()});
      if (!done) continue;
      const double speed = static_cast<double>(done->texels) / std::max(done->worked_s, 1e-3);
      const std::uint64_t left = done->of_texels - std::min(done->of_texels, done->texels);
      found.push_back({image.path, done->blocks, done->texels, done->of_texels, done->worked_s,
                       static_cast<double>(left) / std::max(speed, 1.0)});
    }
  }
  return found;
}

void remove_what_is_done(job::JobContext& job, const SourcePlan& source, const TargetPlan& target) {
  if (target.kept.empty()) return;
  for (const std::string& path : target.kept) io::remove_leftovers_of(path);
  for (const PassPlan& pass : source.passes) {
    for (std::size_t page = 0; page < target.pages.size(); ++page) {
      if (!has_work(target, pass.channels, page) && !is_elsewhere(target, pass.channels, page))
        job::StepPack::remove(job, results_key(source, pass, target, page));
    }
  }
}

}  // namespace pounce::planning
