// SPDX-License-Identifier: Apache-2.0
//
// Splat scenes in one file of any format: headers, Gaussians, and the way of what is read into a
// store's blocks. Half of the mutations of a PLY give the file as many bytes as its header
// announces, else few would get beyond it.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <sstream>
#include <vector>

#include "core/job_space.h"
#include "core/portable_math.h"
#include "fuzz/fuzz_support.h"
#include "gaussian/point_discs.h"
#include "io/splats/scene.h"
#include "pounce/inspect.h"
#include "store/blocks/splat_block.h"
#include "store/blocks/splat_store.h"

namespace pounce::fuzz {
namespace {

using store::Splat;

bool finite(Vec3f v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

void check_splat(const Splat& s) {
  require(finite(s.mean) && finite(s.sigma) && finite(s.colour) && finite(s.normal),
          "Gaussians are finite");
  require(std::min({s.sigma.x, s.sigma.y, s.sigma.z}) >= 0 && store::size_of(s) > 0,
          "Gaussians have a size");
  require(s.alpha > 0 && s.alpha <= 1, "Gaussians have an opacity");
  double length = 0;
  for (const float q : s.rotation) length += double{q} * q;
  require(std::abs(length - 1) < 1e-4, "Gaussians have a rotation");
}

/// What a store does with them: rounded, sorted out, ordered, encoded, decoded.
void store(PageVector<Splat>& splats, const store::SplatLattice& lattice) {
  std::vector<Splat> kept;
  for (Splat& s : splats) {
    check_splat(s);
    store::round_for_store(s);
    if (!lattice.filter(s)) kept.push_back(s);
  }
  std::sort(kept.begin(), kept.end(),
            [&](const Splat& a, const Splat& b) { return lattice.key(a) < lattice.key(b); });
  for (std::size_t at = 0; at < kept.size(); at += store::kMostSplatsPerBlock) {
    const std::size_t count = std::min(store::kMostSplatsPerBlock, kept.size() - at);
    store::SplatBlock block;
    block.assign(std::span(kept).subspan(at, count));
    std::vector<std::byte> raw;
    store::encode(block, raw);
    const store::SplatBlock decoded = [&] {
      try {
        return store::decode_splats(raw, "a block");
      } catch (const Error& e) {
        require(false, e.what());
        throw;
      }
    }();
    for (std::size_t i = 0; i < count; ++i) {
      require(decoded.splat(i) == kept[at + i], "blocks hold what was put into them");
      // Of what is far larger than the scene, everything: it must hold what is in it, no more.
      require(!store::splat_box(kept[at + i]).empty(), "Gaussians are in their boxes");
    }
  }
}

void read(const std::string& path, const std::string& scratch) {
  const auto format = io::source_splat_format(path);
  if (!format) return;  // a GLB of meshes, whatever its name
  if (!format->is_read()) {
    require(!io::why_not_read(path, *format).empty(), "there is a reason");
    return;
  }
  const auto scene = io::open_splat_scene(path, parse_axes("x,-z,-y"));
  constexpr std::uint64_t kMostSplats = 1 << 20;  // a file of a few KB may rightly hold more
  if (scene->info().splats > kMostSplats) return;
  require(!inspect_text(path).empty(), "a scene can be described");
  scene->prepare({&posix_file_system(), scratch}, [] {});
  store::SplatRows rows;
  rows.lobes = store::kMostLobes;
  store::SplatCounts filtered{};
  scene->read(0, scene->info().splats, rows, filtered);
  std::uint64_t count = rows.splats.size();
  for (const std::uint64_t out : filtered) count += out;
  require(count == scene->info().splats, "every row is kept or counted");
  require(rows.sh.size() == rows.splats.size() * 3 * rows.lobes, "every Gaussian has harmonics");
  for (const std::uint16_t half : rows.sh)
    require(std::isfinite(half_to_float(half)), "harmonics are finite");
  if (scene->info().are_points) gaussian::make_discs(rows.splats);
  store(rows.splats, store::SplatLattice(io::sample(*scene)));
}

/// As many bytes as the elements of a header take; most_bytes where it is none or asks for more.
std::size_t announced_bytes(std::string_view file, std::size_t most_bytes) {
  constexpr std::string_view kEnd = "end_header\n";
  const std::size_t end = file.find(kEnd);
  if (end == std::string_view::npos) return most_bytes;
  std::istringstream header{std::string(file.substr(0, end))};
  std::uint64_t total = end + kEnd.size(), count = 0;
  for (std::string line; std::getline(header, line);) {
    std::istringstream words(line);
    std::string key, type;
    words >> key >> type;
    if (key == "element" && !(words >> count)) return most_bytes;
    if (key != "property") continue;
    const auto ends = [&](const char* with) { return type.find(with) != std::string::npos; };
    const std::uint64_t size = ends("char") || ends("t8")                       ? 1
                               : ends("short") || ends("t16")                   ? 2
                               : ends("double") || ends("64") || type == "list" ? 8
                                                                                : 4;
    if (count > most_bytes || (total += count * size) > most_bytes) return most_bytes;
  }
  return total;
}

}  // namespace
}  // namespace pounce::fuzz

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t max_size);

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size,
                                               std::size_t max_size, unsigned seed) {
  using namespace pounce::fuzz;
  size = LLVMFuzzerMutate(data, size, max_size);
  if (seed % 2 == 0) return size;
  const std::size_t wanted = announced_bytes(text_of(data, size), max_size);
  if (wanted == max_size) return size;
  for (std::size_t i = size; i < wanted; ++i) data[i] = data[i - std::min<std::size_t>(i, 56)];
  return wanted;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace pounce;
  static const fuzz::Folder folder;
  // Two formats have no mark of their own: the first byte stands for an ending.
  const char* const name = size > 0 && data[0] == 's'   ? "scene.splat"
                           : size > 0 && data[0] == 'k' ? "scene.ksplat"
                                                        : "scene.ply";
  const bool is_marked = size > 0 && (data[0] == 's' || data[0] == 'k');
  const auto bytes = fuzz::text_of(data, size).substr(is_marked ? 1 : 0);
  const std::string path = folder.write(name, bytes);
  fuzz::attempt([&] { fuzz::read(path, folder.path("")); });
  return 0;
}
