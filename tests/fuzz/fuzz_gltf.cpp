// SPDX-License-Identifier: Apache-2.0
//
// glTF, read as jobs and inspections do.
#include "fuzz/check_mesh.h"
#include "fuzz/gltf_input.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace pounce;
  static const fuzz::Folder folder;
  static const std::string buffer = folder.write("m.bin", std::string(4096, '\x3C'));
  const std::string path = folder.write("m.glb", fuzz::file_bytes(fuzz::text_of(data, size)));
  fuzz::attempt([&] { fuzz::read_and_check(path); });
  return 0;
}
