// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <catch2/catch.hpp>
#include <fstream>
#include <string>

#include "core/portable_math.h"
#include "io/splats/scene.h"
#include "pounce/error.h"
#include "support/splat_encoders.h"
#include "support/test_data.h"

namespace pounce::io {

struct ReadScene {
  SplatSceneInfo info;
  store::SplatRows rows;
  store::SplatCounts filtered{};
  std::uint64_t count(store::SplatFilter filter) const {
    return filtered[static_cast<std::size_t>(filter)];
  }
  float sh(std::size_t splat, std::size_t k) const {
    return half_to_float(rows.sh.at(splat * 3 * rows.lobes + k));
  }
};

/// Everything, in reads of different lengths, which must add up.
inline ReadScene read_scene(const std::string& path, std::uint32_t lobes = 0,
                            const Axes& axes = {}) {
  const auto scene = open_splat_scene(path, axes);
  const test::TempFolder scratch;
  scene->prepare({&posix_file_system(), scratch.path().string()}, [] {});
  ReadScene result;
  result.info = scene->info();
  result.rows.lobes = lobes;
  const std::uint64_t total = result.info.splats;
  for (std::uint64_t first = 0, step = 1; first < total; first += step, step = step * 3 + 1) {
    scene->read(first, std::min(step, total - first), result.rows, result.filtered);
  }
  std::uint64_t out = result.rows.splats.size();
  for (const std::uint64_t count : result.filtered) out += count;
  CHECK(out == total);
  CHECK(result.rows.sh.size() == result.rows.splats.size() * 3 * lobes);
  return result;
}

inline std::string write_bytes(const test::TempFolder& folder, const std::string& name,
                               const std::string& bytes) {
  std::ofstream(folder.file(name), std::ios::binary) << bytes;
  return folder.file(name);
}

/// What is wrong with a file, "" if nothing is. Anything but Error(input) fails the test.
inline std::string splat_problem(const std::string& path) {
  try {
    read_scene(path, 8);
  } catch (const Error& e) {
    INFO(e.what());
    CHECK(e.kind() == ErrorKind::input);
    CHECK(std::string(e.what()).find(path) == 0);
    return e.what();
  }
  return "";
}

}  // namespace pounce::io
