// SPDX-License-Identifier: Apache-2.0
//
// Splat scenes into stores: the same bytes whatever the budget, the runs and the threads, in the
// order of one stable sort; what is left out is counted; large Gaussians stay out of the way of
// small ones.
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <map>

#include "core/portable_math.h"
#include "flow/stores/splats.h"
#include "io/splats/ply_scene.h"
#include "sorting/splat_sort.h"
#include "support/bytes.h"
#include "support/memory_file_system.h"
#include "support/random.h"
#include "support/splat_ply_builder.h"
#include "support/test_data.h"

namespace pounce::flow {

using sorting::KeyedSplat;
using sorting::sort_by_key;
namespace {

using store::Splat;
using test::SplatPlyBuilder;

struct Job {
  std::unique_ptr<FileSystem> memory = test::make_memory_file_system();
  job::JobRun run;
  job::JobContext context;
  explicit Job(std::uint64_t budget, unsigned threads = 2, Progress* progress = nullptr)
      : run(progress), context(budget, run) {
    context.files = memory.get();
    context.stores = store::StoreFolder::open_cache(*context.files, "/cache");
    context.scratch = store::StoreFolder::make_scratch(*context.files, "/");
    context.threads = threads;
  }
};

/// A wavy sheet of small Gaussians, with large and broken ones and strays among them.
SplatPlyBuilder scene(int count, std::uint64_t seed = 1) {
  test::Random random(seed);
  SplatPlyBuilder ply;
  for (int i = 0; i < count; ++i) {
    auto row = SplatPlyBuilder::usual_row(random.between(-2.0, 2.0));
    row["y"] = random.between(-1.0, 1.0);
    row["z"] = 0.2 * std::sin(4 * row["x"]) + random.between(-0.01, 0.01);
    for (const char* scale : {"scale_0", "scale_1", "scale_2"})
      row[scale] = random.between(-6.0, -4.0);
    if (random.one_in(50)) row["scale_1"] = random.between(-3.0, 2.0);
    for (const char* rot : {"rot_0", "rot_1", "rot_2", "rot_3"})
      row[rot] = random.between(-1.0, 1.0);
    row["f_dc_0"] = random.between(-1.0, 1.0);
    row["opacity"] = random.between(-7.0, 7.0);
    if (random.one_in(300)) row["y"] = 1e7;
    if (random.one_in(300)) row["z"] = std::nan("");
    if (random.one_in(100)) row["x"] = row["y"] = row["z"] = 0.25;  // equal keys
    ply.rows.push_back(row);
  }
  return ply;
}

std::vector<std::byte> store_bytes(Job& job) {
  auto& files = *job.context.files;
  auto names = files.list("/cache/v3/splats");
  std::erase_if(names, [](const std::string& name) { return !name.ends_with(".pack"); });
  REQUIRE(names.size() == 1);
  return test::read_whole(files, "/cache/v3/splats/" + names[0]);
}

std::vector<Splat> all_splats(const store::SplatStore& store) {
  store::Compressor compressor;
  std::vector<Splat> splats;
  for (std::uint32_t t = 0; t < store.directory().tiles.size(); ++t) {
    for (const auto& entry : store.read_index(t, compressor)) {
      const auto block = store.read_block(entry, compressor);
      for (std::size_t i = 0; i < block.size(); ++i) splats.push_back(block.splat(i));
    }
  }
  return splats;
}

template <class Work>
void with_threads(unsigned threads, const Work& work) {
  const tbb::global_control more(tbb::global_control::max_allowed_parallelism, 8);
  tbb::task_arena(static_cast<int>(threads)).execute(work);
}

TEST_CASE("a splat store has the same bytes at any threads, budget and runs", "[flow]") {
  const test::TempFolder folder;
  const std::string path = folder.file("s.ply");
  scene(60000).write(path);
  struct How {
    unsigned threads;
    std::uint64_t budget, run;
    std::size_t fan_in;
  };
  const std::uint64_t least = scene_facts({path, {}}).least_bytes;
  CAPTURE(least);
  std::vector<std::byte> first;
  for (const How& how :
       {How{1, 1ULL << 30, 0, 0}, How{2, 1ULL << 30, 0, 0}, How{8, 1ULL << 30, 0, 0},
        How{1, least, 0, 0}, How{2, least, 0, 0}, How{8, least, 0, 0}, How{2, 64 << 20, 1000, 0},
        How{2, 64 << 20, 777, 2}, How{8, 64 << 20, 5000, 3}, How{1, 64 << 20, 60000, 0}}) {
    CAPTURE(how.threads, how.budget, how.run, how.fan_in);
    Job job(how.budget, how.threads);
    bool cached = true;
    planning::SplatRequest request{path, {}};
    request.run_splats = how.run;
    request.fan_in = how.fan_in;
    with_threads(how.threads, [&] { splat_store(job.context, request, &cached, 1); });
    CHECK_FALSE(cached);
    CHECK(job.context.budget.leased_peak() <= how.budget);
    CHECK(job.context.budget.leased() == 0);
    const auto bytes = store_bytes(job);
    if (first.empty()) first = bytes;
    CHECK((bytes == first));
  }
}

TEST_CASE("an external sort is std::stable_sort of the file", "[flow]") {
  const test::TempFolder folder;
  const std::string path = folder.file("s.ply");
  scene(20000, 5).write(path);
  const io::SplatPly ply(path);
  store::SplatRows rows;
  store::SplatCounts filtered{};
  ply.read(0, ply.header().splats, rows, filtered);
  PageVector<Splat>& splats = rows.splats;
  const store::SplatLattice lattice(splats);
  for (Splat& s : splats) store::round_for_store(s);
  const auto key = [&](const Splat& s) { return lattice.key(s); };
  std::erase_if(splats, [&](const Splat& s) { return lattice.filter(s).has_value(); });
  std::stable_sort(splats.begin(), splats.end(),
                   [&](const Splat& a, const Splat& b) { return key(a) < key(b); });

  Job job(16 << 20);
  planning::SplatRequest request{path, {}};
  request.run_splats = GENERATE(19U, 500U, 20000U);
  request.fan_in = GENERATE(2U, 7U, 100U);
  request.fades = gaussian::FadeIsolated::of_no_scene;
  bool cached;
  const auto store = splat_store(job.context, request, &cached, 1);
  const auto found = all_splats(*store);
  REQUIRE(found.size() == splats.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    if (!(found[i] == splats[i])) FAIL("Gaussian " << i << " of " << found.size());
  }
}

TEST_CASE("harmonics stay with their Gaussians whatever the runs", "[flow]") {
  const test::TempFolder folder;
  const int degree = GENERATE(1, 2, 3);
  const int lobes = (degree + 1) * (degree + 1) - 1;
  SplatPlyBuilder ply = scene(3000, 6);
  ply.columns = SplatPlyBuilder::usual_columns(3 * lobes, GENERATE(false, true));
  for (std::size_t i = 0; i < ply.rows.size(); ++i) {
    ply.rows[i]["f_dc_1"] = static_cast<double>(i) / 256;  // who is who, in 16 bits
    ply.rows[i]["f_rest_0"] = 0.25 * static_cast<double>(i % 512);
    ply.rows[i]["f_rest_" + std::to_string(3 * lobes - 1)] = static_cast<double>(i / 512);
    ply.rows[i]["nz"] = i % 3 == 0 ? 1 : 0;
  }
  ply.write(folder.file("s.ply"));
  Job job(16 << 20);
  planning::SplatRequest request{folder.file("s.ply"), {}};
  request.harmonics = SphericalHarmonics::normal;
  request.run_splats = GENERATE(100U, 3000U);
  request.fan_in = GENERATE(2U, 64U);
  bool cached;
  const auto store = splat_store(job.context, request, &cached, 1);
  REQUIRE(store->directory().lobes == static_cast<std::uint32_t>(lobes));
  store::Compressor compressor;
  std::size_t seen = 0;
  for (std::uint32_t t = 0; t < store->directory().tiles.size(); ++t) {
    for (const auto& entry : store->read_index(t, compressor)) {
      const auto block = store->read_block(entry, compressor);
      const std::size_t last = (3 * static_cast<std::size_t>(lobes) - 1) * block.size();
      for (std::size_t i = 0; i < block.size(); ++i, ++seen) {
        const double at = (static_cast<double>(block.colour[1][i]) - 0.5) / 0.28209479177387814;
        const auto who = static_cast<int>(std::lround(at * 256));
        if (half_to_float(block.sh[i]) != 0.25F * static_cast<float>(who % 512) ||
            half_to_float(block.sh[last + i]) != static_cast<float>(who / 512)) {
          FAIL("Gaussian " << who);
        }
      }
    }
  }
  CHECK(seen == store->directory().splats);
}

TEST_CASE("a store holds the harmonics that its mode wants", "[flow]") {
  const test::TempFolder folder;
  SplatPlyBuilder ply = scene(500, 8);
  ply.columns = SplatPlyBuilder::usual_columns(45);
  ply.write(folder.file("s.ply"));
  Job job(64 << 20);
  bool cached;
  planning::SplatRequest request{folder.file("s.ply"), {}};
  const auto lobes = [&](SphericalHarmonics harmonics) {
    request.harmonics = harmonics;
    CHECK(scene_facts(request).lobes ==
          splat_store(job.context, request, &cached, 1)->directory().lobes);
    return scene_facts(request).lobes;
  };
  CHECK(lobes(SphericalHarmonics::dc) == 0);
  CHECK(lobes(SphericalHarmonics::mean) == 8);
  CHECK_FALSE(cached);
  CHECK(lobes(SphericalHarmonics::normal) == 15);
  CHECK_FALSE(cached);
  CHECK(lobes(SphericalHarmonics::mean) == 8);
  CHECK(cached);
  ply.columns = SplatPlyBuilder::usual_columns(24);
  request.path = folder.file("other.ply");
  ply.write(request.path);
  CHECK(lobes(SphericalHarmonics::mean) == 8);
  CHECK_FALSE(cached);
  CHECK(lobes(SphericalHarmonics::normal) == 8);
  CHECK(cached);  // the same coefficients, used in another way
}

TEST_CASE("what the user does not want is left out and makes another store", "[flow]") {
  const test::TempFolder folder;
  SplatPlyBuilder ply;
  for (int i = 0; i < 1000; ++i) {
    auto row = SplatPlyBuilder::usual_row(0.01 * i);
    row["opacity"] = i % 10 == 0 ? -2 : 2;  // 100 of alpha 0.1192
    row["scale_1"] = i % 10 == 1 ? 0 : -3;  // 100 of sigma 1
    ply.rows.push_back(row);
  }
  ply.write(folder.file("s.ply"));
  Job job(64 << 20);
  bool cached;
  const auto left = [&](const gaussian::SplatKeep& keep, store::SplatFilter why) {
    planning::SplatRequest request{folder.file("s.ply"), {}};
    request.keep = keep;
    request.near_is_asked = true;
    const auto directory = splat_store(job.context, request, &cached, 1)->directory();
    CHECK(directory.splats + directory.filtered[static_cast<std::size_t>(why)] == 1000);
    return directory.splats;
  };
  using store::SplatFilter;
  gaussian::SplatKeep keep;
  CHECK(left(keep, SplatFilter::faint) == 1000);
  keep.min_alpha = 0.119F;
  CHECK(left(keep, SplatFilter::faint) == 1000);
  CHECK_FALSE(cached);
  keep.min_alpha = 0.1193F;
  CHECK(left(keep, SplatFilter::faint) == 900);
  CHECK_FALSE(cached);
  CHECK(left(keep, SplatFilter::faint) == 900);
  CHECK(cached);
  keep = {};
  keep.max_sigma = 1;
  CHECK(left(keep, SplatFilter::too_large) == 1000);
  keep.max_sigma = 0.999F;
  CHECK(left(keep, SplatFilter::too_large) == 900);
  CHECK_FALSE(cached);
  keep = {};
  keep.box = Box3f{{1.995F, -1, -1}, {2.995F, 1, 1}};
  CHECK(left(keep, SplatFilter::outside_box) == 100);
  keep.box->hi.x = 3.005F;
  CHECK(left(keep, SplatFilter::outside_box) == 101);
  CHECK_FALSE(cached);
  keep = {};
  mesh::Mesh target;  // at x = 5; the discs reach 0.3 along x
  target.positions = {{5, 0, 0}, {5, 1, 0}, {5, 0, 1}};
  target.triangles = {{0, 1, 2}};
  keep.near = {std::make_shared<gaussian::NearSurface>(target, 0.1)};
  const std::uint64_t near = left(keep, SplatFilter::out_of_reach);
  // From 4.6 to 5.4 at least, 80; cells of 0.02 (1.2 / 64) make it a few more.
  CHECK(near >= 80);
  CHECK(near <= 88);
}

TEST_CASE("nothing that is near a surface is said to be far", "[flow]") {
  test::Random random(12);
  mesh::Mesh target;
  for (int t = 0; t < 40; ++t) {
    const Vec3f at{random.between(-2.0F, 2.0F), random.between(-1.0F, 1.0F),
                   random.between(-5.0F, 5.0F)};
    const auto first = static_cast<std::uint32_t>(target.positions.size());
    for (int corner = 0; corner < 3; ++corner) {
      target.positions.push_back(at + Vec3f{random.between(-0.3F, 0.3F),
                                            random.between(-0.3F, 0.3F),
                                            random.between(-0.3F, 0.3F)});
    }
    target.triangles.push_back({first, first + 1, first + 2});
  }
  constexpr double kDistance = 0.2;
  const gaussian::NearSurface surface(target, kDistance);
  std::size_t far = 0;
  for (int i = 0; i < 20000; ++i) {
    // A point of a triangle, moved: the box around it meets the surface within the distance.
    const auto& corners = target.triangles[random.below(target.triangles.size())];
    float u = random.between(0.0F, 1.0F), v = random.between(0.0F, 1.0F);
    if (u + v > 1) u = 1 - u, v = 1 - v;
    const Vec3f on = target.positions[corners[0]] * (1 - u - v) + target.positions[corners[1]] * u +
                     target.positions[corners[2]] * v;
    Vec3f away{random.between(-1.0F, 1.0F), random.between(-1.0F, 1.0F),
               random.between(-1.0F, 1.0F)};
    away = away * (random.between(0.0F, 0.2F) / length(away));
    const Vec3f at = on + away;
    REQUIRE(surface.meets(Box3f{at, at}));
    const Vec3f anywhere{random.between(-3.0F, 3.0F), random.between(-2.0F, 2.0F),
                         random.between(-6.0F, 6.0F)};
    far += surface.meets(Box3f{anywhere, anywhere}) ? 0 : 1;
  }
  CHECK(far > 14000);
  CHECK(gaussian::NearSurface(target, 1e38).meets(Box3f{{1e30F, 0, 0}, {1e30F, 0, 0}}));
  CHECK_FALSE(gaussian::NearSurface(mesh::Mesh{}, 1).meets(Box3f{{0, 0, 0}, {0, 0, 0}}));
}

TEST_CASE("runs that are all alike, empty or single merge in order", "[flow]") {
  const test::TempFolder folder;
  SplatPlyBuilder ply;
  for (int i = 0; i < 2000; ++i) {
    auto row = SplatPlyBuilder::usual_row(0.5);
    row["f_dc_0"] = i;                           // who is who
    if (i / 100 % 3 == 1) row["opacity"] = -20;  // runs of nothing
    ply.rows.push_back(row);
  }
  const std::string path = folder.file("s.ply");
  ply.write(path);
  Job job(16 << 20);
  planning::SplatRequest request{path, {}};
  request.run_splats = GENERATE(1U, 100U, 5000U);
  request.fan_in = GENERATE(2U, 64U);
  bool cached;
  const auto store = splat_store(job.context, request, &cached, 1);
  const auto found = all_splats(*store);
  REQUIRE(found.size() == 1300);
  CHECK(std::is_sorted(found.begin(), found.end(),
                       [](const Splat& a, const Splat& b) { return a.colour.x < b.colour.x; }));
  CHECK(job.context.report.source_filtered.at("transparent") == 700);
}

TEST_CASE("a sort by key is stable and whole", "[flow]") {
  test::Random random(3);
  const std::size_t count = GENERATE(0U, 1U, 2U, 5000U);
  PageVector<KeyedSplat> splats, scratch;
  for (std::uint32_t i = 0; i < count; ++i)
    splats.push_back({random.one_in(2) ? random.below(100) << 40 : random.bits(), i});
  auto expected = splats;
  std::stable_sort(expected.begin(), expected.end(),
                   [](const KeyedSplat& a, const KeyedSplat& b) { return a.key < b.key; });
  sort_by_key(splats, scratch);
  REQUIRE(splats.size() == count);
  for (std::size_t i = 0; i < count; ++i)
    CHECK((splats[i].key == expected[i].key && splats[i].index == expected[i].index));
}

TEST_CASE("strays are counted, and do not touch the others", "[flow]") {
  const test::TempFolder folder;
  SplatPlyBuilder ply = scene(5000, 9);
  std::erase_if(ply.rows, [](SplatPlyBuilder::Row& row) {
    return row["y"] > 100 || std::isnan(row["z"]) || row["opacity"] < 0;
  });
  const std::size_t sound = ply.rows.size();
  const auto add = [&](double x, double scale) {
    auto row = SplatPlyBuilder::usual_row(x);
    row["scale_1"] = scale;
    ply.rows.push_back(row);
  };
  add(2.2e7, -3);
  add(-8.5e6, -3);
  add(0, 15);     // 3e6 across: larger than any use
  add(3000, -3);  // a landscape behind an object: stays
  ply.write(folder.file("s.ply"));
  Job job(32 << 20);
  bool cached;
  const auto store = splat_store(job.context, {folder.file("s.ply"), {}}, &cached, 1);
  const auto& directory = store->directory();
  CHECK(directory.splats == sound + 1);
  using store::SplatFilter;
  CHECK(directory.filtered[static_cast<std::size_t>(SplatFilter::far)] == 2);
  CHECK(directory.filtered[static_cast<std::size_t>(SplatFilter::exploded)] == 1);
  CHECK(job.context.report.source_filtered ==
        std::map<std::string, std::uint64_t>{{"exploded", 1}, {"far", 2}});
  CHECK(directory.middle_box.hi.x < 2);
  CHECK(directory.middle_box.hi.x > 1.4);
}

TEST_CASE("a city is no stray: a scene of any extent keeps all it has", "[flow]") {
  // Half of the Gaussians on a cube of 10 cm, the others over 2 km: nothing is dropped.
  const test::TempFolder folder;
  test::Random random(4);
  SplatPlyBuilder ply;
  for (int i = 0; i < 4000; ++i) {
    const double reach = i % 2 == 0 ? 0.05 : 1000;
    auto row = SplatPlyBuilder::usual_row(random.between(-reach, reach));
    row["y"] = random.between(-reach, reach);
    row["z"] = 1e5 + random.between(-reach, reach);
    ply.rows.push_back(row);
  }
  ply.write(folder.file("s.ply"));
  Job job(32 << 20);
  bool cached;
  const auto store = splat_store(job.context, {folder.file("s.ply"), {}}, &cached, 1);
  CHECK(store->directory().splats == 4000);
}

TEST_CASE("boxes hold their blocks, and large Gaussians do not widen those of small ones",
          "[flow]") {
  const test::TempFolder folder;
  scene(80000, 2).write(folder.file("s.ply"));
  Job job(64 << 20);
  bool cached;
  const auto store = splat_store(job.context, {folder.file("s.ply"), {}}, &cached, 1);
  store::Compressor compressor;
  std::uint32_t last_class = 0;
  std::size_t small_blocks = 0, classes = 1;
  for (std::uint32_t t = 0; t < store->directory().tiles.size(); ++t) {
    const auto& tile = store->directory().tiles[t];
    CHECK(tile.size_class >= last_class);
    if (tile.size_class != last_class) ++classes;
    last_class = tile.size_class;
    for (const auto& entry : store->read_index(t, compressor)) {
      CHECK(entry.splats > 0);
      CHECK(entry.splats <= 4096);
      const auto block = store->read_block(entry, compressor);
      Box3f box;
      for (std::size_t i = 0; i < block.size(); ++i) box.extend(store::splat_box(block.splat(i)));
      CHECK(box == entry.box);
      CHECK(tile.box.lo.x <= box.lo.x);
      CHECK(tile.box.hi.y >= box.hi.y);
      if (entry.size_class > 0) continue;
      // The median of the largest of three sigmas is about e^-4.4; the first class ends at the
      // power of two above it, doubled: 1/32. Some Gaussians of this scene have a sigma of 7.
      Box3f means;
      for (std::size_t i = 0; i < block.size(); ++i) means.extend(block.splat(i).mean);
      CHECK(means.lo.x - box.lo.x < 3.01 / 32);
      CHECK(box.hi.y - means.hi.y < 3.01 / 32);
      ++small_blocks;
    }
  }
  CHECK(classes >= 3);
  CHECK(small_blocks >= 15);
}

TEST_CASE("a store is found again, and axes make another", "[flow]") {
  const test::TempFolder folder;
  scene(3000).write(folder.file("s.ply"));
  Job job(64 << 20);
  bool cached;
  planning::SplatRequest request{folder.file("s.ply"), {}};
  const auto store = splat_store(job.context, request, &cached, 1);
  CHECK_FALSE(cached);
  const auto filtered = job.context.report.source_filtered;
  CHECK_FALSE(filtered.empty());
  job.context.report.source_filtered.clear();
  splat_store(job.context, request, &cached, 1);
  CHECK(cached);
  CHECK(job.context.report.source_filtered == filtered);
  request.axes = parse_axes("x,-y,-z");
  const auto turned = splat_store(job.context, request, &cached, 1);
  CHECK_FALSE(cached);
  const Box3f box = store->directory().middle_box, other = turned->directory().middle_box;
  CHECK(other.lo.y == -box.hi.y);
  CHECK(other.hi.z == -box.lo.z);
}

TEST_CASE("a budget below the least is refused, the least works for a long file", "[flow]") {
  const test::TempFolder folder;
  scene(100).write(folder.file("s.ply"));
  const planning::SplatRequest request{folder.file("s.ply"), {}};
  CHECK(scene_facts(request).least_bytes < (16 << 20));
  Job job(1 << 20);
  bool cached;
  CHECK(test::error_kind([&] { splat_store(job.context, request, &cached, 1); }) ==
        static_cast<int>(ErrorKind::budget));
}

TEST_CASE("a scene of nothing but broken Gaussians is refused with the reasons", "[flow]") {
  const test::TempFolder folder;
  SplatPlyBuilder ply;
  for (int i = 0; i < 3; ++i) ply.rows.push_back(SplatPlyBuilder::usual_row(std::nan("")));
  ply.write(folder.file("s.ply"));
  Job job(64 << 20);
  bool cached;
  std::string message;
  CHECK(test::error_kind(
            [&] {
              splat_store(job.context, {folder.file("s.ply"), {}}, &cached, 1);
            },
            &message) == static_cast<int>(ErrorKind::input));
  CHECK(message.find("3 not finite") != std::string::npos);
}

TEST_CASE("a caller who asks to stop while a scene is read or merged is heard", "[flow]") {
  const test::TempFolder folder;
  scene(30000).write(folder.file("s.ply"));
  const std::uint64_t after = GENERATE(0U, 20000U, 40000U, 55000U);
  Progress progress;
  progress.on_event = [&](const ProgressEvent& event) {
    if (event.done >= after) progress.cancel();
  };
  Job job(64 << 20, 2, &progress);
  planning::SplatRequest request{folder.file("s.ply"), {}};
  request.run_splats = 1000;
  bool cached;
  const int kind = test::error_kind([&] { splat_store(job.context, request, &cached, 1); });
  // Events are a few a second: a late wish may find nothing left to stop.
  CHECK((kind == static_cast<int>(ErrorKind::cancelled) || (after > 0 && kind == 0)));
  CHECK(job.context.budget.leased() == 0);
}

TEST_CASE("the noise of a noisy surface is found", "[flow][external]") {
  const auto data = test::test_data();
  if (!data) return;
  Job job(64 << 20);
  bool cached;
  const auto store = splat_store(
      job.context, {(*data / "splats/noisy_sphere/scene.ply").string(), {}}, &cached, 1);
  CHECK(store->directory().surface_noise == Approx(0.006357).epsilon(0.01));  // as measured
}

}  // namespace
}  // namespace pounce::flow
