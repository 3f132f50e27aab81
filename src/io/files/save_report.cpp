// SPDX-License-Identifier: Apache-2.0
#include <cstdio>

#include "core/own_errors.h"
#include "io/files/output_file.h"
#include "pounce/report.h"

namespace pounce {

void save_report(const Report& report, const std::string& path) {
  with_own_errors([&] {
    const std::string text = to_json(report);
    io::OutputFile file(path);
    std::fwrite(text.data(), 1, text.size(), file.stream());
    file.commit();
  });
}

}  // namespace pounce
