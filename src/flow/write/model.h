// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "flow/write/images.h"
#include "io/model/model_writer.h"
#include "planning/plan.h"

namespace pounce::flow {

/// One target that is written as a model: its images go to a scratch file, one after the other, and
/// from there into the model.
class ModelOutput {
 public:
  /// Plans it: `target` gets the model's files as its outputs and inputs, and its warnings.
  ModelOutput(const std::string& pattern, const planning::SourcePlan& plan, bool allow_external,
              planning::TargetPlan& target);

  const std::string& path() const { return request_.output; }
  void set_job(const std::string& hash) { request_.job = hash; }  ///< see JobHash
  const std::string& job() const { return request_.job; }
  /// Memory that write() needs.
  std::uint64_t least_bytes() const { return least_bytes_; }

  /// Where the next image goes.
  WriteFile& sink(job::JobContext& job);
  /// What was written to the sink since the last call is the image of this channel and page.
  void add(std::size_t channel, std::size_t page, const WrittenTexels& written);
  /// Writes the model with the images that were added. Returns the files.
  std::vector<std::string> write(job::JobContext& job);

 private:
  io::ModelRequest request_;
  std::vector<std::vector<io::ModelTexture>> textures_;  ///< [channel][page]
  std::vector<bool> shows_alpha_;                        ///< by channel
  std::uint64_t least_bytes_ = 0;
  std::unique_ptr<WriteFile> scratch_;
  std::vector<io::EncodedImage> places_;  ///< by request_.textures
};

}  // namespace pounce::flow
