// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <cstdio>
#include <fstream>

#include "pounce/compare.h"
#include "pounce/transfer.h"
#include "pounce/version.h"

int main() try {
  std::ofstream("black.pgm") << "P5\n1 1\n255\n\1";
  std::ofstream("gray.pgm") << "P5\n1 1\n255\n\64";
  const pounce::Comparison result = pounce::compare("black.pgm", "gray.pgm");
  std::printf("pounce %s: similarity %.3f\n", POUNCE_VERSION, result.similarity);
  if (std::abs(result.similarity - 0.8) > 1e-6) return 1;
  pounce::TransferOptions options;
  options.source = "plane.obj";
  std::ofstream("plane.obj")
      << "v 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nf 1/1 2/2 3/3\n";
  options.targets = {"plane.obj"};
  options.output = "out.png";
  options.material.textures = {{pounce::Channel::base_color, "gray.pgm"}};
  const pounce::PlanReport plan = pounce::plan(options);
  std::printf("%s takes %llu bytes\n", plan.outputs.at(0).c_str(),
              static_cast<unsigned long long>(plan.least_memory_bytes));
  if (plan.least_memory_bytes == 0 || std::ifstream("out.png")) return 1;
  pounce::transfer({.source = "missing.glb", .targets = {"missing.glb"}, .output = "out.png"});
  std::puts("a transfer of files that are not there ended well");
  return 1;
} catch (const pounce::Error& error) {
  std::printf("as expected: %s\n", error.what());
  return std::string(error.what()).find("missing.glb") == std::string::npos;
}
