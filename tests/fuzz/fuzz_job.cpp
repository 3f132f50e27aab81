// SPDX-License-Identifier: Apache-2.0
//
// Whole jobs on what readers let through: odd numbers must do no harm on their way to a picture. An
// input is a mesh or a splat scene (told by its first bytes) and takes part as the source, as the
// target, or as both; textures are pounce's own, so that no foreign decoder is tested.
#include "flow/transfer.h"
#include "fuzz/gltf_input.h"
#include "pounce/transfer.h"
#include "support/memory_file_system.h"

namespace pounce::fuzz {
namespace {

// 2 x 2 grey texels.
constexpr std::string_view kTexture = "P5\n2 2\n255\n\x10\x60\xA0\xFF";
constexpr std::string_view kSquare =
    "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n";

std::string write_input(const Folder& folder, std::string_view input) {
  if (input.starts_with("ply")) return folder.write("m.ply", input);
  if (input.starts_with("glTF") || input.starts_with("{"))
    return folder.write("m.glb", file_bytes(input));
  const Parts parts = split(input);
  folder.write("m.mtl", parts.second);
  return folder.write("m.obj", parts.first);
}

void run(const Folder& folder, const std::string& source, const std::string& target,
         double max_distance) {
  TransferOptions options;
  options.source = source;
  options.targets = {target};
  options.output = folder.path("o.png");
  if (!source.ends_with(".ply"))
    options.material.textures = {{Channel::base_color, folder.path("t.pgm")}};
  options.image.size = ImageSize{24, 20};
  options.search.max_distance = Length{max_distance, true};
  options.channels.transferred = {Channel::base_color};
  options.resources.memory_bytes = 128 << 20;
  options.resources.threads = 1;
  options.resources.use_cache = false;
  options.resources.temp_dir = folder.path("");
  const auto in_memory = test::make_memory_file_system();
  flow::transfer(options, {.files = in_memory.get()});
}

}  // namespace
}  // namespace pounce::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace pounce;
  static const fuzz::Folder folder;
  static const std::string buffer = folder.write("m.bin", std::string(4096, '\x3C'));
  static const std::string texture = folder.write("t.pgm", fuzz::kTexture);
  static const std::string square = folder.write("square.obj", fuzz::kSquare);
  const std::string input = fuzz::write_input(folder, fuzz::text_of(data, size));
  fuzz::attempt([&] { fuzz::run(folder, input, square, 50); });
  if (input.ends_with(".ply")) return 0;
  fuzz::attempt([&] { fuzz::run(folder, square, input, 5); });
  fuzz::attempt([&] { fuzz::run(folder, input, input, 1e-3); });
  return 0;
}
