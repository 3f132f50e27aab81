// SPDX-License-Identifier: Apache-2.0
#include "outcome/not_written.h"

#include <algorithm>

namespace pounce::outcome {
namespace {

bool is_any_written(const Report& report, int udim) {
  const auto has = [&](const TargetReport& target) {
    return std::any_of(target.images.begin(), target.images.end(), [&](const ImageReport& image) {
      return image.udim == udim && image.state == "written";
    });
  };
  return std::any_of(report.targets.begin(), report.targets.end(), has);
}

}  // namespace

void not_written(const std::string& path, Report& report) {
  for (TargetReport& target : report.targets) {
    for (ImageReport& image : target.images) {
      if (image.path != path || image.state != "written") continue;
      image.state = "not written";
      for (ChannelReport& channel : report.channels) {
        if (channel.name == image.channel) --channel.images;
      }
      if (!is_any_written(report, image.udim)) std::erase(report.udims, image.udim);
    }
  }
}

}  // namespace pounce::outcome
