// SPDX-License-Identifier: Apache-2.0
//
// The program as a child process: how much memory it really takes, and what is left when it is
// killed. This test links neither pounce nor its libraries: a child's ru_maxrss starts from its
// parent's size.
#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <regex>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "support/test_data.h"

extern char** environ;  // NOLINT: POSIX declares it nowhere

namespace pounce::test {
namespace {

namespace fs = std::filesystem;
constexpr double kMiB = 1 << 20;

struct Ended {
  int status = 0;  ///< exit status; -signal when killed
  double peak_mib = 0, cpu_s = 0;
};

pid_t start(const std::vector<std::string>& words, const std::string& log) {
  std::vector<char*> arguments;
  for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  posix_spawn_file_actions_addopen(&files, 1, log.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  posix_spawn_file_actions_adddup2(&files, 1, 2);
  pid_t child = 0;
  const int failure =
      posix_spawn(&child, words[0].c_str(), &files, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&files);
  REQUIRE(failure == 0);
  return child;
}

Ended wait_for(pid_t child) {
  int status = 0;
  rusage usage{};
  REQUIRE(wait4(child, &status, 0, &usage) == child);
  const auto seconds = [](timeval t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status),
          static_cast<double>(usage.ru_maxrss) / 1024,
          seconds(usage.ru_utime) + seconds(usage.ru_stime)};
}

std::string content(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

Ended run(const std::vector<std::string>& words, const std::string& log) {
  const Ended ended = wait_for(start(words, log));
  INFO(content(log));
  CHECK(ended.status == 0);
  return ended;
}

const std::string kPounce = POUNCE_BUILD_DIR "/pounce";
const std::string kFixture = POUNCE_BUILD_DIR "/pounce-fixture";

/// Nothing is in a cache that no job uses but what docs/cache.md names, at the place it names.
void check_cache(const std::string& cache) {
  const fs::path top = fs::path(cache) / "v3";
  const std::regex pack("(geometry|colour|results|splats|hits)/[0-9a-f]{32}[.](pack|label)");
  for (const auto& entry : fs::directory_iterator(cache)) CHECK(entry.path() == top);
  std::set<std::string> names;
  for (const auto& entry : fs::recursive_directory_iterator(top)) {
    if (!entry.is_directory()) names.insert(entry.path().lexically_relative(top).string());
  }
  for (const std::string& name : names) {
    CAPTURE(name);
    CHECK((name == "space.lock" || name == "hashes" || std::regex_match(name, pack)));
    // A label never outlives its pack: a run that evicts takes both.
    if (name.ends_with(".label")) CHECK(names.contains(name.substr(0, name.size() - 5) + "pack"));
  }
}

}  // namespace

TEST_CASE("peak memory stays within the budget, measured from outside", "[flow]") {
  const TempFolder folder;
  const std::string log = folder.file("log"), one = folder.file("one"), big = folder.file("big");
  run({kFixture, "one-texel", "-o", one}, log);
  run({kFixture, "head", "-o", big, "--texture", "2048", "--target-size", "64"}, log);
  const Ended base =
      run({kPounce, "transfer", one + "/one_texel_src.glb", one + "/one_texel_target.glb", "-o",
           folder.file("one.png"), "--no-cache", "--threads", "1"},
          log);
  const auto transfer = [&](const std::string& out, const std::string& memory,
                            const std::string& threads) {
    return run(
        {kPounce, "transfer", big + "/head_src.glb", big + "/head_same.glb", "-o", folder.file(out),
         "--size", "4096", "--no-cache", "--memory", memory, "--threads", threads},
        log);
  };
  transfer("free.png", "2GiB", "3");
  const std::string expected = content(folder.file("free.png"));
  REQUIRE(!expected.empty());
  for (const char* threads : {"1", "2"}) {
    const Ended bound = transfer("bound.png", "32MiB", threads);
    std::printf("FIGURE peak RSS at 32 MiB, %s threads: %.1f MiB above %.1f\n", threads,
                bound.peak_mib - base.peak_mib, base.peak_mib);
    CHECK(bound.peak_mib <= base.peak_mib + 1.05 * 32 + 16);
    CHECK((content(folder.file("bound.png")) == expected));
  }
}

TEST_CASE("a run killed at any moment leaves nothing that the next one trusts wrongly", "[flow]") {
  const TempFolder folder;
  const std::string log = folder.file("log"), in = folder.file("in"), out = folder.file("out"),
                    cache = folder.file("cache");
  run({kFixture, "head", "-o", in, "--triangles", "2000", "--texture", "512", "--target-size",
       "64"},
      log);
  fs::create_directory(out);
  const std::vector<std::string> command{kPounce,
                                         "transfer",
                                         in + "/head_src.glb",
                                         in + "/head_same.glb",
                                         "-o",
                                         out + "/result.png",
                                         "--cache",
                                         cache,
                                         "--memory",
                                         "64MiB",
                                         "--size",
                                         "700",
                                         "--threads",
                                         "2"};
  const auto began = std::chrono::steady_clock::now();
  run(command, log);
  const std::chrono::duration<double> whole = std::chrono::steady_clock::now() - began;
  const std::string expected = content(out + "/result.png");
  REQUIRE(!expected.empty());

  std::mt19937 random(3);
  int killed = 0;
  for (int i = 0; i < 40; ++i) {
    fs::remove(out + "/result.png");
    if (i % 2 == 0) fs::remove_all(cache);  // every other time the cache is as the last run left it
    const pid_t child = start(command, log);
    std::this_thread::sleep_for(whole * (static_cast<double>(random()) / 4294967296.0));
    kill(child, SIGKILL);
    const Ended ended = wait_for(child);
    killed += ended.status == -SIGKILL ? 1 : 0;
    if (fs::exists(out + "/result.png")) CHECK((content(out + "/result.png") == expected));
    fs::remove(out + "/result.png");

    CAPTURE(i, ended.status);
    run(command, log);
    CHECK((content(out + "/result.png") == expected));
    CHECK(std::distance(fs::directory_iterator(out), {}) == 1);
    check_cache(cache);
    run({kPounce, "cache", "verify", "--cache", cache}, log);
  }
  std::printf("FIGURE killed %d of 40 runs\n", killed);
  CHECK(killed >= 20);
}

TEST_CASE("a run killed after ten of twenty UDIM tiles leaves those ten whole", "[flow]") {
  const TempFolder folder;
  const std::string log = folder.file("log"), out = folder.file("out");
  run({kFixture, "plane", "-o", folder.file("s.obj"), "--triangles", "3000", "--uv-tiles", "16",
       "--texture", "64"},
      log);
  run({kFixture, "plane", "-o", folder.file("t.obj"), "--triangles", "4000", "--uv-tiles", "20"},
      log);
  const auto command = [&](const std::string& to) {
    return std::vector<std::string>{kPounce,
                                    "transfer",
                                    folder.file("s.obj"),
                                    folder.file("t.obj"),
                                    "-o",
                                    to + "/t.<UDIM>.png",
                                    "--source-texture",
                                    "baseColor=" + folder.file("s.<UDIM>.png"),
                                    "--size",
                                    "300",
                                    "--no-cache"};
  };
  const std::string whole = folder.file("whole");
  fs::create_directory(whole);
  run(command(whole), log);
  // A file is hidden for the moment between its first name and its own; a kill may hit that moment.
  const auto is_hidden = [](const fs::directory_entry& entry) {
    return entry.path().filename().string().front() == '.';
  };
  const auto hidden = [&](const std::string& in) {
    return std::count_if(fs::directory_iterator(in), {}, is_hidden);
  };
  const auto tiles = [&](const std::string& in) {
    return std::distance(fs::directory_iterator(in), {}) - hidden(in);
  };
  REQUIRE(tiles(whole) == 20);
  fs::create_directory(out);
  const pid_t child = start(command(out), log);
  for (int i = 0; tiles(out) < 10 && i < 60000; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  kill(child, SIGKILL);
  const Ended ended = wait_for(child);
  const auto kept = tiles(out);
  std::printf("FIGURE killed with status %d after %d tiles\n", ended.status,
              static_cast<int>(kept));
  CHECK(ended.status == -SIGKILL);
  CHECK(kept >= 10);
  CHECK(kept < 20);
  const auto check_tiles = [&] {
    for (const auto& entry : fs::directory_iterator(out)) {
      if (is_hidden(entry)) continue;
      const std::string name = entry.path().filename().string();
      CAPTURE(name);
      CHECK((content(entry.path().string()) == content(whole + "/" + name)));
    }
  };
  CHECK(hidden(out) <= 1);
  check_tiles();
  run(command(out), log);
  CHECK(tiles(out) == 20);
  CHECK(hidden(out) == 0);
  check_tiles();
}

}  // namespace pounce::test
