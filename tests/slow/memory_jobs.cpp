// SPDX-License-Identifier: Apache-2.0
//
// Does what plan() names as the least memory work? Random jobs, each run with that least, with a
// page less and with budgets around it, without a cache. A line per job that is not as promised;
// the exit status is 1 if there was one.
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <utility>

#include "pounce/transfer.h"
#include "support/many_threads.h"
#include "support/random.h"

namespace pounce::test {
namespace {

namespace fs = std::filesystem;

/// How a mesh uses its images.
enum class Uvs { chart, shared, heaped, tiles };

struct Job {
  TransferOptions options;
  std::string what;
};

class Maker {
 public:
  Maker(std::uint64_t seed, const fs::path& folder) : random_(seed), folder_(folder) {}

  Job make() {
    Job job;
    TransferOptions& o = job.options;
    const bool splats = random_.one_in(6);
    const bool tiles = random_.one_in(4);
    const bool several = random_.one_in(5);
    job.what = splats ? "splats" : "mesh";
    if (splats) {
      o.source = splat_scene();
    } else {
      o.source = mesh("source", uvs(false), job.what);
      const std::vector<Channel> all{Channel::base_color, Channel::occlusion, Channel::emissive};
      const std::size_t channels = random_.one_in(3) ? 3 : 1;
      for (std::size_t c = 0; c < channels; ++c) {
        o.channels.transferred.push_back(all[c]);
        o.material.textures.push_back({all[c], image("texture" + std::to_string(c))});
      }
    }
    for (int t = 0; t < (several ? 2 : 1); ++t)
      o.targets.push_back(mesh("target" + std::to_string(t), uvs(tiles), job.what));
    const bool onto = !tiles && o.channels.transferred.size() < 2 && random_.one_in(4);
    o.output =
        (folder_ / (std::string(onto ? "out" : "out.<CHANNEL>") + (several ? ".<TARGET>" : "") +
                    (tiles ? ".<UDIM>" : "") + (random_.one_in(4) ? ".exr" : ".png")))
            .string();
    const auto edge = [&] {
      return static_cast<std::uint32_t>(random_.one_in(4) ? random_.whole(1000, 3000)
                                                          : random_.whole(30, 500));
    };
    o.image.size = ImageSize{edge(), edge()};
    if (o.output.ends_with(".exr"))
      o.image.depth = random_.one_in(2) ? Depth::float32 : Depth::half;
    if (random_.one_in(3)) o.image.padding_px = static_cast<std::uint32_t>(random_.below(300));
    if (onto) {
      o.composite.onto = (folder_ / "old.png").string();
      write_image(o.composite.onto, *o.image.size, 3);
    }
    // A large map takes seconds, several times over.
    const bool maps = !splats && !several && !onto && o.channels.transferred.size() == 1 &&
                      std::uint64_t{o.image.size->width} * o.image.size->height < 100'000;
    if (maps && random_.one_in(2)) {
      o.image.map_output =
          (folder_ / (std::string("map") + (tiles ? ".<UDIM>" : "") + ".exr")).string();
      job.what += " map";
    }
    o.resources.threads = static_cast<unsigned>(random_.whole(1, 8));
    o.resources.use_cache = false;
    job.what +=
        " " + std::to_string(o.image.size->width) + "x" + std::to_string(o.image.size->height) +
        " " + std::to_string(o.channels.transferred.size()) + "ch " +
        std::to_string(o.resources.threads) + "t" + (o.composite.onto.empty() ? "" : " onto");
    return job;
  }

 private:
  Uvs uvs(bool tiles) {
    if (tiles) return Uvs::tiles;
    const auto kind = random_.below(4);
    return kind == 0 ? Uvs::shared : kind == 1 ? Uvs::heaped : Uvs::chart;
  }

  /// A wavy sheet of up to 5000 cells, as OBJ.
  std::string mesh(const std::string& name, Uvs uvs, std::string& what) {
    const auto cells = static_cast<int>(
        std::exp(random_.between(static_cast<double>(random_.below(2)) * 7.0, 8.8)));
    const int across = std::max(1, static_cast<int>(std::sqrt(cells))), down = across + 1;
    const double heap = random_.between(0.02, 0.3);
    const std::string path = (folder_ / (name + ".obj")).string();
    std::ofstream obj(path);
    for (int j = 0; j <= down; ++j) {
      for (int i = 0; i <= across; ++i) {
        const double u = 1.0 * i / across, v = 1.0 * j / down;
        obj << "v " << u << ' ' << v << ' ' << 0.01 * std::sin(9 * u + 5 * v) << '\n';
        switch (uvs) {
          case Uvs::chart:
            obj << "vt " << 0.02 + 0.96 * u << ' ' << 0.02 + 0.96 * v << '\n';
            break;
          case Uvs::shared:  // every two cells the same texels
            obj << "vt " << (i % 2) * 0.9 << ' ' << (j % 2) * 0.9 << '\n';
            break;
          case Uvs::heaped:  // all on a few texels
            obj << "vt " << (i % 2) * heap << ' ' << (j % 2) * heap << '\n';
            break;
          case Uvs::tiles:
            obj << "vt " << 2.98 * u + 0.01 << ' ' << 1.98 * v + 0.01 << '\n';
            break;
        }
      }
    }
    for (int j = 0; j < down; ++j) {
      for (int i = 0; i < across; ++i) {
        const int a = j * (across + 1) + i + 1, b = a + across + 1;
        obj << "f " << a << '/' << a << ' ' << a + 1 << '/' << a + 1 << ' ' << b + 1 << '/' << b + 1
            << "\nf " << a << '/' << a << ' ' << b + 1 << '/' << b + 1 << ' ' << b << '/' << b
            << '\n';
      }
    }
    const char* const names[] = {"chart", "shared", "heaped", "tiles"};
    what += " " + std::to_string(2 * across * down) + names[static_cast<int>(uvs)];
    return path;
  }

  void write_image(const std::string& path, ImageSize size, std::uint32_t channels) {
    std::string samples(std::size_t{size.width} * size.height * channels, '\0');
    for (char& s : samples) s = static_cast<char>(random_.bits());
    // A PPM by any name: the reader goes by content.
    std::ofstream(path, std::ios::binary) << 'P' << (channels == 3 ? 6 : 5) << '\n'
                                          << size.width << ' ' << size.height << "\n255\n"
                                          << samples;
  }

  std::string image(const std::string& name) {
    const std::string path = (folder_ / (name + ".ppm")).string();
    const auto edge = static_cast<std::uint32_t>(
        std::exp(random_.between(static_cast<double>(random_.below(2)) * 6.5, 7.3)));
    write_image(path, {edge, edge}, 3);
    return path;
  }

  std::string splat_scene() {
    const std::string path = (folder_ / "scene.ply").string();
    const auto count = static_cast<int>(std::exp(random_.between(2.0, 10.5)));
    std::ofstream ply(path, std::ios::binary);
    ply << "ply\nformat binary_little_endian 1.0\nelement vertex " << count << '\n';
    for (const char* name : {"x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0",
                             "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"})
      ply << "property float " << name << '\n';
    ply << "end_header\n";
    const float size = static_cast<float>(std::log(0.5 / std::sqrt(count)));
    for (int i = 0; i < count; ++i) {
      const float row[14] = {random_.between(0.F, 1.F),
                             random_.between(0.F, 1.F),
                             random_.between(-.01F, .01F),
                             random_.between(-1.F, 1.F),
                             0,
                             0,
                             2,
                             size,
                             size,
                             size - 2,
                             1,
                             0,
                             0,
                             0};
      ply.write(reinterpret_cast<const char*>(row), sizeof row);
    }
    return path;
  }

  Random random_;
  fs::path folder_;
};

/// What became of a run: "" for well, else the message; internal errors begin with "INTERNAL".
std::string outcome(TransferOptions options, std::uint64_t memory_bytes) {
  options.resources.memory_bytes = memory_bytes;
  try {
    transfer(options);
    return "";
  } catch (const Error& e) {
    return (e.kind() == ErrorKind::budget ? "" : "INTERNAL ") + std::string(e.what());
  } catch (const std::exception& e) {
    return std::string("INTERNAL ") + e.what();
  }
}

/// Is everything as promised? Says so, if not.
bool keeps_promises(Job job, std::uint64_t seed) {
  std::string what = "seed " + std::to_string(seed) + " (" + job.what + ")";
  job.options.resources.memory_bytes = 2ULL << 30;
  PlanReport named;
  try {
    named = plan(job.options);
  } catch (const Error& e) {
    std::printf("%s: no plan: %s\n", what.c_str(), e.what());
    return e.kind() != ErrorKind::internal;
  }
  const std::uint64_t least = named.least_memory_bytes;
  what += " least " + std::to_string(least) + " for " +
          fs::path(named.least_memory_for).filename().string();
  bool good = true;
  const auto complain = [&](const std::string& how, const std::string& message) {
    std::printf("%s: %s: %s\n", what.c_str(), how.c_str(), message.c_str());
    std::fflush(stdout);
    good = false;
  };
  if (const std::string m = outcome(job.options, least); !m.empty()) complain("the least", m);
  if (outcome(job.options, least - 4096).empty()) complain("a page less", "it works");
  Random random(seed ^ 0x5555);
  for (int i = 0; i < 2; ++i) {
    const auto other = static_cast<std::uint64_t>(static_cast<double>(least) *
                                                  random.between(i == 0 ? 0.5 : 1.0, 1.5));
    const std::string m = outcome(job.options, other);
    if (m.starts_with("INTERNAL") || (other > least && !m.empty()))
      complain(std::to_string(other), m);
  }
  return good;
}

/// What paints through the map that a job wrote.
Job applied(const Job& job) {
  Job apply = job;
  TransferOptions& o = apply.options;
  o.source = std::exchange(o.image.map_output, "");
  o.targets.clear();
  o.image.size.reset();
  apply.what = "apply after " + job.what;
  return apply;
}

bool check(std::uint64_t seed, const fs::path& folder) {
  const Job job = Maker(seed, folder).make();
  if (!keeps_promises(job, seed)) return false;
  if (job.options.image.map_output.empty()) return true;
  const std::string failure = outcome(job.options, 2ULL << 30);
  if (failure.empty()) return keeps_promises(applied(job), seed);
  std::printf("seed %llu: no map: %s\n", static_cast<unsigned long long>(seed), failure.c_str());
  return false;
}

int run(std::uint64_t jobs, std::uint64_t first) {
  const fs::path folder = fs::temp_directory_path() / ("pounce-memory-" + std::to_string(getpid()));
  std::uint64_t bad = 0;
  for (std::uint64_t seed = first; seed < first + jobs; ++seed) {
    fs::create_directories(folder);
    if (!check(seed, folder)) ++bad;
    fs::remove_all(folder);
  }
  std::printf("%llu of %llu jobs kept what their plans promised\n",
              static_cast<unsigned long long>(jobs - bad), static_cast<unsigned long long>(jobs));
  return bad == 0 ? 0 : 1;
}

}  // namespace
}  // namespace pounce::test

int main(int argc, char** argv) {
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  const auto number = [&](int i, std::uint64_t usual) {
    return argc > i ? std::strtoull(argv[i], nullptr, 10) : usual;
  };
  return pounce::test::run(number(1, 300), number(2, 1));
}
