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
  pounce::transfer({.source = "missing.glb", .targets = {"missing.glb"}, .output = "out.png"});
  std::puts("a transfer of files that are not there ended well");
  return 1;
} catch (const pounce::Error& error) {
  std::printf("as expected: %s\n", error.what());
  return std::string(error.what()).find("missing.glb") == std::string::npos;
}
