// SPDX-License-Identifier: Apache-2.0
//
// A target as a model with new textures: its images wait in a scratch file, one after the other,
// until all are there and the model can be written around them.
//
// A GLB states all sizes before its first byte, and pages are finished one by one, so images cannot
// be written where they belong. They are encoded as soon as they are finished, since results go
// with their page (docs/stages/7-model.md).
//
// The model is planned twice: while planning, with a texture for each material and channel, to know
// its files and its memory; and when it is written, with those that found anything. A material that
// found nothing keeps its textures.
#include "flow/write/model.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <optional>
#include <set>

#include "planning/name_patterns.h"

namespace pounce::flow {
namespace {

std::string stem(const std::string& path) { return std::filesystem::path(path).stem().string(); }

/// Materials may have names that give the same file name: the later ones are numbered.
void make_distinct(std::vector<std::vector<planning::ImageOutput>>& images) {
  std::set<std::string> seen;
  for (auto& channel : images) {
    for (planning::ImageOutput& image : channel) {
      const std::string wanted = image.path;
      for (int n = 2; !seen.insert(image.path).second; ++n) {
        // Before the channel: "base.MATERIAL-2.CHANNEL.png".
        const std::size_t dot = wanted.rfind('.', wanted.rfind('.') - 1);
        image.path = fmt::format("{}-{}{}", wanted.substr(0, dot), n, wanted.substr(dot));
      }
    }
  }
}

}  // namespace

ModelOutput::ModelOutput(const std::string& pattern, const planning::SourcePlan& plan,
                         bool allow_external, planning::TargetPlan& target) {
  request_.target = target.path;
  request_.allow_external = allow_external;
  request_.output = planning::expand_pattern(pattern, {{"TARGET", stem(target.path)}});
  request_.uv_set = target.requests.front().front().pages.front().uv_set;
  make_distinct(target.images);
  // Images of a GLB are no files of their own. Those of a .gltf are, and io::plan_model() lists
  // them.
  target.outputs.clear();
  for (std::size_t c = 0; c < plan.channels.size(); ++c) {
    textures_.emplace_back();
    shows_alpha_.push_back(plan.channels[c].shows_alpha);
    for (std::size_t page = 0; page < target.pages.size(); ++page) {
      const planning::ImageOutput& image = target.images[c][page];
      if (!image.coverage_path.empty()) target.outputs.push_back(image.coverage_path);
      textures_.back().push_back({target.pages[page].material.value(), plan.channels[c].channel,
                                  plan.channels[c].material_factor, image.path});
    }
    request_.textures.insert(request_.textures.end(), textures_.back().begin(),
                             textures_.back().end());
  }
  const io::ModelPlan model = io::plan_model(request_);
  request_.textures.clear();  // until they have images
  least_bytes_ = model.least_bytes;
  target.inputs.insert(target.inputs.end(), model.inputs.begin(), model.inputs.end());
  target.outputs.insert(target.outputs.end(), model.outputs.begin(), model.outputs.end());
  target.warnings.insert(target.warnings.end(), model.warnings.begin(), model.warnings.end());
}

WriteFile& ModelOutput::sink(job::JobContext& job) {
  if (scratch_ == nullptr) scratch_ = job.scratch_place().create();
  return *scratch_;
}

void ModelOutput::add(std::size_t channel, std::size_t page, const WrittenTexels& written) {
  // Images follow each other in the scratch file: where one ends, the next begins.
  const std::uint64_t before =
      places_.empty() ? 0 : places_.back().offset_bytes + places_.back().size_bytes;
  places_.push_back({before, scratch_->size_bytes() - before});
  io::ModelTexture& texture = request_.textures.emplace_back(textures_[channel][page]);
  if (shows_alpha_[channel]) {
    const bool veils = written.has_veils || texture.factor[3] < 1;
    texture.alpha = veils               ? io::ModelAlpha::blend
                    : written.has_holes ? io::ModelAlpha::mask
                                        : io::ModelAlpha::as_it_is;
  }
}

std::vector<std::string> ModelOutput::write(job::JobContext& job) {
  const runtime::Lease lease(job.budget, least_bytes_, "writing " + request_.output);
  const auto images = sink(job).reader();
  io::write_model(request_, *images, places_);
  job.report.bytes_written += sink(job).size_bytes();
  scratch_.reset();
  return io::plan_model(request_).outputs;
}

}  // namespace pounce::flow
