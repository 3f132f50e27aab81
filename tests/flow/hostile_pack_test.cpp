// SPDX-License-Identifier: Apache-2.0
//
// A cache that somebody else may write: packs whose checksums are right and whose fields are not.
// Every field of every kind of pack is set to what does most harm; a job must notice and make the
// pack itself, or get through unharmed. Meant to be run with AddressSanitizer as well.
#include <algorithm>
#include <bit>
#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <functional>
#include <limits>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "core/portable_math.h"
#include "pounce/gaussians.h"
#include "pounce/transfer.h"
#include "store/blocks/colour_store.h"
#include "store/blocks/geometry_block.h"
#include "store/blocks/splat_block.h"
#include "support/memory_file_system.h"
#include "support/pack_tree.h"
#include "support/random_scene.h"
#include "support/splat_ply_builder.h"
#include "support/test_data.h"

namespace pounce::test {
namespace {

using Bytes = std::vector<std::byte>;
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();

enum class From { surface, texels, splats };

/// Jobs that share a cache: a transfer, the target's maps, the source as Gaussians.
struct Jobs {
  TempFolder folder;
  std::string cache = folder.file("cache"), pristine = folder.file("pristine");
  TransferOptions transfer_options;
  From from;
  std::vector<Bytes> expected;

  explicit Jobs(From source) : from(source) {
    transfer_options = make_random_scene(folder.path().string(), 41);
    transfer_options.image.size = ImageSize{70, 50};
    transfer_options.output = folder.file("result.png");
    transfer_options.resources.threads = 1;
    transfer_options.resources.memory_bytes = 256 << 20;
    transfer_options.resources.cache_dir = cache;
    if (from == From::splats) make_splats();
    if (from == From::texels) {
      transfer_options.mesh.method = Method::gaussian;
      transfer_options.channels.transferred = {Channel::base_color};
    }
    std::vector<std::string> warnings;
    expected = run(warnings);
    std::filesystem::copy(cache, pristine, std::filesystem::copy_options::recursive);
  }

  void make_splats() {
    SplatPlyBuilder ply;
    ply.columns = SplatPlyBuilder::usual_columns(9);
    for (int i = 0; i < 300; ++i) {
      ply.rows.push_back(SplatPlyBuilder::usual_row(0.01 * i));
      ply.rows.back()["y"] = 0.01 * (i % 17);
      ply.rows.back()["nz"] = i % 2;
      ply.rows.back()["f_rest_1"] = 0.01 * i;
    }
    transfer_options.source = folder.file("scene.ply");
    transfer_options.channels.transferred = {Channel::base_color};
    ply.write(transfer_options.source);
  }

  /// The bytes of all that they write; `warnings` gets what they say.
  std::vector<Bytes> run(std::vector<std::string>& warnings) const {
    std::vector<Bytes> written;
    const auto take = [&](const Report& report) {
      for (const std::string& output : report.outputs)
        written.push_back(read_whole(posix_file_system(), output));
      warnings.insert(warnings.end(), report.warnings.begin(), report.warnings.end());
    };
    take(transfer(transfer_options));
    MapsOptions map_options;
    map_options.target = transfer_options.targets.front();
    map_options.size = *transfer_options.image.size;
    map_options.output = folder.file("map_<CHANNEL>.exr");
    map_options.resources = transfer_options.resources;
    take(maps(map_options));
    if (from == From::splats) return written;
    GaussiansOptions gaussian_options;
    gaussian_options.source = transfer_options.source;
    gaussian_options.output = folder.file("gaussians.ply");
    gaussian_options.resources = transfer_options.resources;
    take(gaussians(gaussian_options));
    return written;
  }

  std::vector<std::string> packs(const std::string& kind) const {
    std::vector<std::string> found;
    for (const auto& entry : std::filesystem::directory_iterator(pristine + "/v3/" + kind)) {
      if (entry.path().extension() == ".pack")
        found.push_back(kind + "/" + entry.path().filename().string());
    }
    std::sort(found.begin(), found.end());
    return found;
  }

  struct Verdict {
    bool noticed = false;  ///< a warning says that the pack is built again
    bool same = false;     ///< every output has the bytes of the pristine run
  };
  /// Runs everything beside one pack that `harm` wrote.
  Verdict judge(const std::string& pack,
                const std::function<void(const std::string&)>& harm) const {
    std::filesystem::remove_all(cache);
    std::filesystem::copy(pristine, cache, std::filesystem::copy_options::recursive);
    // Known hits spare a job the surfaces, known results all else: without them it reads every
    // pack.
    std::filesystem::remove_all(cache + "/v3/hits");
    if (!pack.starts_with("results/")) std::filesystem::remove_all(cache + "/v3/results");
    harm(cache + "/v3/" + pack);
    Verdict verdict;
    std::vector<std::string> warnings;
    verdict.same = run(warnings) == expected;
    verdict.noticed = std::any_of(warnings.begin(), warnings.end(), [](const std::string& w) {
      return w.find("rebuilding it") != std::string::npos;
    });
    return verdict;
  }
  /// What must be noticed, and then does no harm.
  void refuse(const std::string& what, const std::string& pack,
              const std::function<void(const std::string&)>& harm) const {
    const Verdict verdict = judge(pack, harm);
    INFO(what << " in " << pack);
    CHECK(verdict.noticed);
    CHECK(verdict.same);
  }
};

void set_u32(Bytes& raw, std::size_t at, std::uint32_t value) {
  if (at + 4 <= raw.size()) store::put_u32(raw.data() + at, value);
}

/// What a field of 32 bits may be made to say: counts, signs, places, floats.
std::vector<std::uint32_t> harmful(std::uint32_t was) {
  return {0, was + 1, was ^ 1U, 0x7FFFFFFFU, 0x80000000U, 0xFFFFFFFFU, 0x7FC00000U};
}

/// Sets every 32 bits of the directory and of the first pages in turn. No job may fail.
void harm_everywhere(const Jobs& jobs, const std::string& pack) {
  const PackTree tree(jobs.pristine + "/v3/" + pack);
  int cases = 0, noticed = 0;
  const auto try_all = [&](int tile, const Bytes& raw) {
    const std::size_t step = std::max<std::size_t>(4, raw.size() / 60 / 4 * 4);
    // Odd places too: a colour directory has fields of one byte.
    for (std::size_t at = 0; at + 4 <= raw.size(); at += at < 148 ? 4 : step) {
      const std::vector<std::uint32_t> values = harmful(PackTree::u32(raw, at));
      // A third of what could be said, another third of each field: every case is a job.
      for (std::size_t v = cases % 3; v < values.size(); v += 3) {
        const auto verdict = jobs.judge(pack, [&](const std::string& path) {
          tree.write(path, [&](int where, Bytes& page) {
            if (where == tile) set_u32(page, at, values[v]);
          });
        });
        ++cases;
        noticed += verdict.noticed ? 1 : 0;
        // Another picture is harm even where nothing was noticed, then above all.
        if (!verdict.same)
          FAIL_CHECK("another result: " << pack << " tile " << tile << " at " << at << " value "
                                        << values[v]
                                        << (verdict.noticed ? ", noticed" : ", unnoticed"));
      }
    }
  };
  try_all(-1, tree.directory);
  if (!tree.tiles.empty()) try_all(0, tree.tiles.front().page);
  std::printf("FIGURE hostile %s: %d cases, %d noticed\n", pack.c_str(), cases, noticed);
  CHECK(noticed > cases / 4);
}

/// A geometry pack with another first block.
void harm_block(const std::string& pristine, const std::string& path,
                const std::function<void(store::GeometryBlock&)>& harm) {
  PackTree tree(pristine);
  store::GeometryBlock block = store::decode_geometry(tree.tiles[0].blocks[0], "block");
  harm(block);
  store::encode(block, tree.tiles[0].blocks[0]);
  tree.write(path, [&](int tile, Bytes& raw) {
    if (tile == -1) store::put_u32(raw.data() + 52, store::kLargestGeometryBytes);
    if (tile != 0) return;
    store::put_u32(raw.data(), block.page);
    store::put_u32(raw.data() + 4, static_cast<std::uint32_t>(block.x));
    store::put_u32(raw.data() + 8, static_cast<std::uint32_t>(block.y));
    store::put_u32(raw.data() + 12, static_cast<std::uint32_t>(block.triangles.size()));
  });
}

bool is_target(const Jobs& jobs, const std::string& pack) {
  const PackTree tree(jobs.pristine + "/v3/" + pack);
  return !store::decode_geometry(tree.tiles[0].blocks[0], "block").owner.empty();
}

}  // namespace

TEST_CASE("blocks of a geometry pack that cannot be are noticed", "[flow]") {
  const Jobs jobs(From::surface);
  using Block = store::GeometryBlock;
  using Harm = std::function<void(Block&)>;
  const std::vector<std::pair<std::string, Harm>> both{
      {"a page beyond the last", [](Block& b) { b.page = 77; }},
      {"an x far away", [](Block& b) { b.x = 1 << 30; }},
      {"a y far away", [](Block& b) { b.y = INT32_MIN; }},
      {"a position of NaN", [](Block& b) { b.positions[0].x = kNan; }},
      {"an infinite position", [](Block& b) { b.positions[1].z = -kInfinity; }},
      {"a long normal",
       [](Block& b) {
         b.normals[0] = {1e18F, 0, 0};
       }},
      {"a normal of NaN", [](Block& b) { b.normals[0].y = kNan; }},
      {"a UV of NaN", [](Block& b) { b.uvs[0].x = kNan; }},
      {"a UV that spans too much", [](Block& b) { b.uvs[0].y = 3e37F; }},
      {"a triangle that the mesh does not have", [](Block& b) { b.ids[0] = 0xFFFFFFFF; }},
  };
  const std::vector<std::pair<std::string, Harm>> target{
      {"an x beyond the image", [](Block& b) { b.x = 2; }},
      {"an x before the image", [](Block& b) { b.x = -1; }},
      {"a y beyond the image", [](Block& b) { b.y = 1; }},
      {"no runs", [](Block& b) { b.owner.clear(); }},
      {"texels beyond the image", [](Block& b) { b.owner.assign(store::kTexelsPerBlock, 0); }},
      {"no texels", [](Block& b) { b.owner.assign(store::kTexelsPerBlock, store::kNoTriangle); }},
      {"periods that span too much",
       [](Block& b) {
         b.shifts.assign(b.triangles.size(), {INT32_MAX, INT32_MIN});
       }},
  };
  const std::vector<std::pair<std::string, Harm>> source{
      {"runs", [](Block& b) { b.owner.assign(store::kTexelsPerBlock, 0); }},
      {"periods",
       [](Block& b) {
         b.shifts.assign(b.triangles.size(), {1, 1});
       }},
  };
  int targets = 0;
  for (const std::string& pack : jobs.packs("geometry")) {
    const bool side = is_target(jobs, pack);
    targets += side ? 1 : 0;
    auto all = both;
    all.insert(all.end(), (side ? target : source).begin(), (side ? target : source).end());
    for (const auto& [what, harm] : all) {
      jobs.refuse(what, pack, [&](const std::string& path) {
        harm_block(jobs.pristine + "/v3/" + pack, path, harm);
      });
    }
  }
  CHECK(targets == 2);  // of the transfer and of the maps
}

TEST_CASE("records of a geometry pack that cannot be are noticed", "[flow]") {
  const Jobs jobs(From::surface);
  using Block = store::GeometryBlock;
  using Harm = std::function<void(Block&)>;
  const auto first_free = [](const Block& b) {
    return static_cast<std::size_t>(std::find(b.owner.begin(), b.owner.end(), store::kNoTriangle) -
                                    b.owner.begin());
  };
  const std::vector<std::pair<std::string, Harm>> harms{
      {"a step of NaN", [](Block& b) { b.step = kNan; }},
      {"an infinite step", [](Block& b) { b.step = kInfinity; }},
      {"a step that is not a power of two", [](Block& b) { b.step *= 1.5F; }},
      {"a position out of range",
       [](Block& b) { b.records[0].position[1] = store::kLargestPosition + 1; }},
      {"an edge of 0", [](Block& b) { b.records[0].edge = 0; }},
      {"an infinite edge", [](Block& b) { b.records.back().edge = 0x7F80; }},
      {"texels beyond the image",
       [](Block& b) {
         b.owner.assign(store::kTexelsPerBlock, 0);
         b.records.resize(store::kTexelsPerBlock, b.records[0]);
         for (std::size_t t = 0; t < b.owner.size(); ++t)
           b.owner[t] = static_cast<std::uint16_t>(t);
       }},
      {"a texel more",
       [&](Block& b) {
         b.owner[first_free(b)] = 0;
         b.records.push_back(b.records[0]);
       }},
      {"an x beyond the image", [](Block& b) { b.x = 2; }},
      {"a page beyond the last", [](Block& b) { b.page = 77; }},
  };
  for (const std::string& pack : jobs.packs("geometry")) {
    const std::string pristine = jobs.pristine + "/v3/" + pack;
    PackTree tree(pristine);
    const Block block = store::decode_geometry(tree.tiles[0].blocks[0], "block");
    Block records;
    records.page = block.page;
    records.x = block.x;
    records.y = block.y;
    records.step = 0x1p-20F;
    records.owner = block.owner;
    for (auto& owner : records.owner) {
      if (owner == store::kNoTriangle) continue;
      owner = static_cast<std::uint16_t>(records.records.size());
      records.records.push_back({{1 << 19, 1 << 18, 0}, {0, 0}, 0x3C00, {}});
    }
    if (block.owner.empty()) {  // a source has none at all
      records.owner.assign(store::kTexelsPerBlock, store::kNoTriangle);
      records.owner[0] = 0;
      records.records.push_back({{0, 0, 0}, {0, 0}, 0x3C00, {}});
      jobs.refuse("records of a source", pack, [&](const std::string& path) {
        harm_block(pristine, path, [&](Block& b) { b = records; });
      });
      continue;
    }
    for (const auto& [what, harm] : harms) {
      jobs.refuse(what, pack, [&](const std::string& path) {
        harm_block(pristine, path, [&](Block& b) {
          b = records;
          harm(b);
        });
      });
    }
    // What is sound is not noticed, and nothing but another picture.
    const auto verdict = jobs.judge(pack, [&](const std::string& path) {
      harm_block(pristine, path, [&](Block& b) { b = records; });
    });
    CHECK_FALSE(verdict.noticed);
  }
}

TEST_CASE("a chunk at an odd place is no other thing of the same name", "[flow]") {
  // Decoded things are kept under their place in the pack, pages of the index with a low bit set.
  const Jobs jobs(From::surface);
  for (const std::string& pack : jobs.packs("geometry")) {
    const PackTree tree(jobs.pristine + "/v3/" + pack);
    jobs.refuse("a block in place of a page", pack, [&](const std::string& path) {
      std::uint64_t page_at = 0;
      tree.write(path, [&](int tile, Bytes& raw) {
        if (tile == -1) page_at = store::get_u64(raw.data() + tree.at[0]);
      });
      tree.write(path, [&](int tile, Bytes& raw) {
        if (tile == 0) store::put_u64(raw.data() + tree.tiles[0].at[0], page_at | 1);
      });
    });
  }
}

TEST_CASE("blocks that are there twice, or pages in another order, are noticed", "[flow]") {
  const Jobs jobs(From::surface);
  for (const std::string& pack : jobs.packs("geometry")) {
    if (!is_target(jobs, pack)) continue;
    PackTree tree(jobs.pristine + "/v3/" + pack);
    tree.tiles.push_back(tree.tiles.front());
    tree.directory.insert(tree.directory.end(),
                          tree.directory.begin() + static_cast<std::ptrdiff_t>(tree.at[0]) - 24,
                          tree.directory.begin() + static_cast<std::ptrdiff_t>(tree.at[0]) + 20);
    tree.at.push_back(tree.directory.size() - 20);
    store::put_u32(tree.directory.data() + 4, static_cast<std::uint32_t>(tree.tiles.size()));
    jobs.refuse("a tile twice", pack, [&](const std::string& path) { tree.write(path); });
  }
}

TEST_CASE("counts of a geometry pack beyond its mesh and images are noticed", "[flow]") {
  // Nothing but warnings and the report shows them: there they would be lies.
  const Jobs jobs(From::surface);
  constexpr std::uint64_t kPast = std::uint64_t{1} << 40;
  const std::vector<std::pair<std::string, std::size_t>> counts{{"overlapping texels", 16},
                                                                {"slivers", 24},
                                                                {"degenerate triangles", 32},
                                                                {"coincident triangles", 56}};
  for (const std::string& pack : jobs.packs("geometry")) {
    const PackTree tree(jobs.pristine + "/v3/" + pack);
    for (const auto& [what, at] : counts) {
      jobs.refuse(what, pack, [&, place = at](const std::string& path) {
        tree.write(path, [&](int tile, Bytes& raw) {
          if (tile == -1) store::put_u64(raw.data() + place, kPast);
        });
      });
    }
  }
}

TEST_CASE("fields of geometry packs do no harm whatever they say", "[flow]") {
  const Jobs jobs(From::surface);
  std::set<bool> sides;  // the transfer's target and the maps' have the same fields
  for (const std::string& pack : jobs.packs("geometry")) {
    if (sides.insert(is_target(jobs, pack)).second) harm_everywhere(jobs, pack);
  }
}

TEST_CASE("fields of colour packs do no harm whatever they say", "[flow]") {
  const Jobs jobs(From::surface);
  const auto packs = jobs.packs("colour");
  REQUIRE(!packs.empty());
  harm_everywhere(jobs, packs.front());
  const PackTree tree(jobs.pristine + "/v3/" + packs.front());
  const auto directory = [&](std::size_t at, unsigned value) {
    return [&tree, at, value](const std::string& path) {
      tree.write(path, [&](int tile, Bytes& raw) {
        if (tile == -1) raw[at] = static_cast<std::byte>(value);
      });
    };
  };
  // Each byte of the header by itself: fields of one byte, and counts that do not begin at a
  // multiple of four.
  for (std::size_t at = 0; at < 25; ++at) {
    for (const unsigned bit : {1U, 0x80U}) {
      const unsigned value = std::to_integer<unsigned>(tree.directory[at]) ^ bit;
      jobs.refuse("byte " + std::to_string(at), packs.front(), directory(at, value));
    }
  }
  jobs.refuse("a depth that is none", packs.front(), directory(12, 4));
  jobs.refuse("a wrap mode that is none", packs.front(), directory(15, 3));
  jobs.refuse("a huge width", packs.front(), directory(3, 0xFF));
  jobs.refuse("a huge height", packs.front(), directory(7, 0xFF));
}

TEST_CASE("fields of splat packs do no harm whatever they say", "[flow]") {
  const Jobs jobs(From::splats);  // with harmonics of degree 1
  const auto packs = jobs.packs("splats");
  REQUIRE(packs.size() == 1);
  harm_everywhere(jobs, packs.front());
  using Block = store::SplatBlock;
  const std::vector<std::pair<std::string, std::function<void(Block&)>>> blocks{
      {"a mean of NaN", [](Block& b) { b.mean[1][0] = kNan; }},
      {"an infinite mean", [](Block& b) { b.mean[2][0] = kInfinity; }},
      {"a sigma below 0", [](Block& b) { b.sigma[0][0] = -1; }},
      {"an infinite sigma", [](Block& b) { b.sigma[0][0] = kInfinity; }},
      {"no sigma at all", [](Block& b) { b.sigma[0][0] = b.sigma[1][0] = b.sigma[2][0] = 0; }},
      {"a quaternion that turns nothing", [](Block& b) { b.rotation[0][0] = 0; }},
      {"a long quaternion", [](Block& b) { b.rotation[0][0] = 1e18F; }},
      {"an alpha of 0", [](Block& b) { b.alpha[0] = 0; }},
      {"an alpha of 2", [](Block& b) { b.alpha[0] = 2; }},
      {"a colour of NaN", [](Block& b) { b.colour[0][0] = kNan; }},
      {"a long normal", [](Block& b) { b.normal[0][0] = 1e18F; }},
      {"infinite harmonics", [](Block& b) { b.sh[0] = 0x7C00; }},
      {"harmonics of NaN", [](Block& b) { b.sh.back() = 0xFE00; }},
      {"no harmonics", [](Block& b) { b.lobes = 0, b.sh.clear(); }},
      {"harmonics of degree 2", [](Block& b) { b.lobes = 8, b.sh.resize(24 * b.size()); }},
  };
  for (const auto& [what, harm] : blocks) {
    jobs.refuse(what, packs.front(), [&](const std::string& path) {
      PackTree tree(jobs.pristine + "/v3/" + packs.front());
      Block block = store::decode_splats(tree.tiles[0].blocks[0], "block");
      harm(block);
      store::encode(block, tree.tiles[0].blocks[0]);
      tree.write(path);
    });
  }
}

TEST_CASE("fields of packs of texels as Gaussians do no harm whatever they say", "[flow]") {
  const Jobs jobs(From::texels);
  const auto packs = jobs.packs("splats");
  REQUIRE(packs.size() == 1);
  harm_everywhere(jobs, packs.front());  // how many there are is not known before
}

TEST_CASE("fields of packs of results do no harm whatever they say", "[flow]") {
  const Jobs jobs(From::texels);
  const auto packs = jobs.packs("results");
  REQUIRE(packs.size() == 1);
  harm_everywhere(jobs, packs.front());
  const PackTree tree(jobs.pristine + "/v3/" + packs.front());
  REQUIRE(tree.blocks.size() > 1);
  jobs.refuse("a block of another size", packs.front(), [&](const std::string& path) {
    PackTree other = tree;
    other.blocks[1].resize(other.blocks[1].size() - 1);
    other.write(path);
  });
  jobs.refuse("a block that is the directory", packs.front(), [&](const std::string& path) {
    PackTree other = tree;
    other.blocks[1] = other.directory;
    other.write(path);
  });
}

TEST_CASE("float colours that are not finite are noticed", "[flow]") {
  store::ColourDirectory image;
  image.width = image.height = 4;
  image.channels = 1;
  const auto files = test::make_memory_file_system();
  store::Compressor compressor;
  for (const Depth depth : {Depth::half, Depth::float32}) {
    image.depth = depth;
    for (const float sample : {2.0F, -2.0F, 65504.0F, kNan, kInfinity}) {
      Bytes tile(std::size_t{68} * 68 * store::depth_bytes(depth)), raw;
      const std::uint32_t bits =
          depth == Depth::float32 ? std::bit_cast<std::uint32_t>(sample) : float_to_half(sample);
      std::memcpy(tile.data() + 40, &bits, store::depth_bytes(depth));
      store::filter_colours(image, tile, raw);
      files->remove("pack");
      store::ColourStoreWriter writer(
          std::make_unique<store::PackWriter>(files->create("pack"), store::PackKind::colour,
                                              Hash128{1, 2}),
          1);
      std::vector<Bytes> stored(1);
      compressor.compress(raw, stored[0]);
      writer.add_row(0, stored, static_cast<std::uint32_t>(raw.size()), compressor);
      writer.finish(image, compressor);
      const store::ColourStore store(
          std::make_unique<store::PackReader>(files->open("pack"), "pack", store::PackKind::colour,
                                              Hash128{1, 2}),
          image, compressor);
      const auto chunk = store.read_row(0, compressor).front();
      CHECK((error_kind([&] { store.read_tile(chunk, compressor); }) == kDamaged) ==
            !std::isfinite(sample));
    }
  }
}

}  // namespace pounce::test
