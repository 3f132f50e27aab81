// SPDX-License-Identifier: Apache-2.0
//
// Decodes images for pounce in a process that can do nothing else. Started by the library, with the
// socket as its standard input.
#include <cstring>
#include <iostream>

#include "io/sandbox/serve.h"

int main(int argc, char** argv) {
  const bool is_plain = argc == 2 && std::strcmp(argv[1], "--serve") == 0;
  const bool has_module = argc == 2 && std::strcmp(argv[1], "--serve-module") == 0;
  if (!is_plain && !has_module) {
    std::cerr
        << "pounce-decoder: decodes images for pounce, which starts it; run `pounce --help`\n";
    return 2;
  }
  return pounce::io::serve_images(0, has_module);
}
