// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdio>
#include <string>

#include "pounce/transfer.h"
#include "support/test_data.h"
#include "support/transfer_job.h"
#include "support/whole_image.h"

namespace pounce::test {

/// Every measured figure goes to the log in one form, so that it can be copied from there.
inline void figure(const std::string& name, double value) {
  std::printf("FIGURE %s %.3f\n", name.c_str(), value);
  std::fflush(stdout);
}

/// A transfer without cache in 512 MiB, with its coverage beside it.
inline TransferOptions golden_options(const std::string& source, const std::string& target,
                                      const std::string& output) {
  TransferOptions options = transfer_job(source, target, output, 512);
  options.image.coverage_output = output + ".coverage.png";
  return options;
}

/// $POUNCE_KEEP: a folder where the golden tests leave their pictures for looking at.
inline void keep_picture(const std::string& path, const std::string& name) {
  if (const char* folder = std::getenv("POUNCE_KEEP"); folder != nullptr)
    std::filesystem::copy_file(path, std::filesystem::path(folder) / name,
                               std::filesystem::copy_options::overwrite_existing);
}

}  // namespace pounce::test
