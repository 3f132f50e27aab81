// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "flow/plan/plan.h"

namespace pounce::flow {

using FileTime = std::filesystem::file_time_type;

/// When the youngest of these files was changed; what is not there does not count.
FileTime newest(const std::vector<std::string>& files);

/// Is `output` there, and changed after `inputs`? Equal times do not tell, so they mean no.
bool is_up_to_date(const std::string& output, FileTime inputs);

/// --skip-existing: marks the images (ImageOutput::keep) that are there, with their masks, and
/// younger than all they are made from: `meshes`, the channel's source images, the image painted
/// over. What is kept leaves TargetPlan::outputs for TargetPlan::kept. What the job has `made` is
/// no older work.
void keep_existing(const Plan& plan, FileTime meshes, const std::set<std::string>& made,
                   TargetPlan& target);

}  // namespace pounce::flow
