// SPDX-License-Identifier: Apache-2.0
#include "planning/others_outputs.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <thread>
#include <utility>

#include "core/timer.h"
#include "pounce/error.h"

namespace pounce::planning {
namespace {

constexpr auto kLookAgain = std::chrono::milliseconds(50);  // whether others are done

}  // namespace

std::vector<std::string> images_to_make(const SourcePlan& source, const TargetPlan& target,
                                        const Step& step) {
  std::vector<std::string> paths;
  for (const std::size_t c : source.passes[step.pass].channels) {
    const ImageOutput& image = target.images[c][step.page];
    if (!image.keep) paths.push_back(image.path);
  }
  return paths;
}

std::optional<job::OutputClaim> OthersOutputs::claim(const Step& step) {
  const bool shares = policy_.skips_existing && model_.path.empty();
  return job::OutputClaim::take(
      shares ? images_to_make(source_, target_, step) : std::vector<std::string>(), &other_);
}

bool OthersOutputs::is_any_free(const std::vector<Step>& steps) {
  if (!model_.path.empty()) return job::OutputClaim::take({model_.path}).has_value();
  return std::any_of(steps.begin(), steps.end(),
                     [&](const Step& step) { return claim(step).has_value(); });
}

/// Times are not asked here, only recorded jobs: what is younger than the inputs but records no job
/// was decided while planning.
std::vector<std::size_t> OthersOutputs::keep_made(const Step& step) {
  std::vector<std::size_t> channels;
  if (!policy_.skips_existing || !model_.path.empty()) return channels;
  for (const std::size_t c : source_.passes[step.pass].channels) {
    ImageOutput& image = target_.images[c][step.page];
    if (image.keep || job_.run.written_before.count(image.path) > 0 || !is_made(image)) continue;
    image.keep = true;
    job_.report.kept.push_back(image.path);
    if (!image.coverage_path.empty()) job_.report.kept.push_back(image.coverage_path);
    channels.push_back(c);
  }
  return channels;
}

void OthersOutputs::wait() {
  if (!policy_.waits) {
    throw Error(
        ErrorKind::busy,
        fmt::format(
            "{}: {} is writing outputs of this job; run again without --no-wait to wait for it",
            target_.path, other_));
  }
  if (!job_.waiting) job_.waiting = std::make_unique<StageTimer>(job_.clock, "wait");
  job_.meter.wait("waiting for " + other_);
  std::this_thread::sleep_for(kLookAgain);
}

job::OutputClaim OthersOutputs::await_model() {
  for (;;) {
    if (auto claim = job::OutputClaim::take({model_.path}, &other_)) {
      job_.waiting.reset();
      job_.meter.resume();
      return std::move(*claim);
    }
    wait();
  }
}

bool OthersOutputs::keep_made_model() {
  const auto& outputs = target_.outputs;
  // The files beside it come first.
  const bool is_made =
      job_.run.written_before.count(model_.path) == 0 &&
      standing_of(model_.path, model_.job, FileTime::max()) == Standing::same_job &&
      std::all_of(outputs.begin(), outputs.end(), has_content);
  if (!is_made) return false;
  for (auto& images : target_.images) {
    for (ImageOutput& image : images) image.keep = true;
  }
  job_.report.kept.insert(job_.report.kept.end(), outputs.begin(), outputs.end());
  return true;
}

}  // namespace pounce::planning
