// SPDX-License-Identifier: Apache-2.0
//
// Images: what is told, hidden and refused before a decoder is called. The decoders are
// OpenImageIO's, and are tested there.
#include "fuzz/fuzz_image.h"

#include <cstring>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace pounce;
  std::vector<std::byte> bytes(size);
  if (size > 0) std::memcpy(bytes.data(), data, size);
  fuzz::attempt([&] { fuzz::guard_image(fuzz::in_memory(std::move(bytes), "image.tga")); });
  return 0;
}
