// SPDX-License-Identifier: Apache-2.0
//
// OBJ files and the material file beside them: an input is both, with a line "%%" between. What
// begins like a PLY is read as one, what begins like an STL, too.
#include "fuzz/check_mesh.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace pounce;
  static const fuzz::Folder folder;
  const fuzz::Parts parts = fuzz::split(fuzz::text_of(data, size));
  folder.write("m.mtl", parts.second);
  const bool is_stl = parts.first.starts_with("solid") || parts.first.starts_with("STL");
  const std::string path = folder.write(is_stl ? "m.stl" : "m.obj", parts.first);
  fuzz::attempt([&] { fuzz::read_and_check(path); });
  return 0;
}
