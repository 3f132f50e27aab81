// SPDX-License-Identifier: Apache-2.0
//
// Does a decoder hand out what is in the file, or what happened to be in memory? Reads images, and
// others that are made from them by damage, each in two processes whose new memory is filled with
// other bytes. An image passes if it is read both times with the same facts and samples, or refused
// both times with the same words, within the memory that a job gives its decoder, and in time.
#include <fmt/format.h>
#include <malloc.h>
#include <sys/resource.h>
#include <sys/time.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "core/hash.h"
#include "io/files/asset_file.h"
#include "io/foreign/module.h"
#include "io/image/header.h"
#include "io/image/read.h"
#include "mutants.h"
#include "pounce/error.h"
#include "unit/io/image_files.h"

namespace pounce::test {
namespace {

namespace fs = std::filesystem;

constexpr std::array kFormats{ImageFormat::bmp, ImageFormat::tga};
/// Of the processor, and of the clock, which others share.
constexpr unsigned kSecondsForEach = 20, kMostSeconds = 300;
/// More are not decoded; their headers are read.
constexpr std::uint64_t kMostSampleBytes = 64 << 20;
/// Files above are not changed: the change would be somewhere in a sea of samples.
constexpr std::uint64_t kMostMutatedBytes = 256 << 10;

struct Options {
  std::vector<std::string> folders;
  std::string keep;
  std::uint64_t mutants = 2000, seed = 1, every = 1;
};

[[noreturn]] void usage() {
  std::fputs(
      "usage: slow_decoders FOLDER... [--mutants N] [--seed N] [--every N] [--keep FOLDER]\n"
      "Reads each image of the folders, and N that are made from them, twice with other bytes in\n"
      "new memory. --every: each N-th image alone; --keep: mutants that fail go there.\n",
      stderr);
  std::exit(2);
}

Options options_of(int argc, char** argv) {
  Options options;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (!word.starts_with("--")) {
      options.folders.push_back(word);
      continue;
    }
    if (++i == argc) usage();
    if (word == "--mutants")
      options.mutants = std::strtoull(argv[i], nullptr, 10);
    else if (word == "--seed")
      options.seed = std::strtoull(argv[i], nullptr, 10);
    else if (word == "--every")
      options.every = std::max(1ULL, std::strtoull(argv[i], nullptr, 10));
    else if (word == "--keep")
      options.keep = argv[i];
    else
      usage();
  }
  if (options.folders.empty()) usage();
  return options;
}

/// An image to read: a file as it is, or a change to it.
struct Case {
  std::string path, format;
  std::uint64_t mutant = 0;  ///< 0: as it is

  std::string bytes(std::uint64_t seed) const {
    std::string all = read_file(path);
    Random random(seed << 32 ^ mutant);
    if (mutant > 0) mutate(all, random);
    return all;
  }
  std::string name() const {
    return mutant == 0 ? path : fmt::format("{} mutant {}", path, mutant);
  }
};

/// "" of what is none.
std::string format_of(const mesh::ImageRef& image) {
  try {
    io::ByteSource bytes(image);
    return io::image_format(bytes, image.path, kFormats);
  } catch (const Error&) {
    return "";
  }
}

std::vector<Case> cases_of(const Options& options) {
  std::vector<Case> cases;
  for (const std::string& folder : options.folders) {
    for (const auto& file : fs::recursive_directory_iterator(folder)) {
      const std::string path = file.path().string();
      const std::string format = file.is_regular_file() ? format_of(at_path(path)) : "";
      if (!format.empty()) cases.push_back({path, format});
    }
  }
  std::sort(cases.begin(), cases.end(),
            [](const Case& a, const Case& b) { return a.path < b.path; });
  std::vector<Case> small;
  for (std::size_t i = 0; i * options.every < cases.size(); ++i)
    cases[i] = cases[i * options.every];
  cases.resize((cases.size() + options.every - 1) / options.every);
  for (const Case& one : cases) {
    if (fs::file_size(one.path) <= kMostMutatedBytes) small.push_back(one);
  }
  Random random(options.seed);
  for (std::uint64_t mutant = 1; !small.empty() && mutant <= options.mutants; ++mutant) {
    cases.push_back(small[random.below(small.size())]);
    cases.back().mutant = mutant;
  }
  return cases;
}

/// How a reading ended.
struct Outcome {
  std::string what;  ///< "read", "refused", "large", or what is wrong
  std::string text;  ///< a hash of all that was handed out, or an error

  bool operator==(const Outcome&) const = default;
  bool is_sound() const { return what == "read" || what == "refused" || what == "large"; }
};

/// From here on the process may take so much more memory than it has; returns what it may take.
void allow_memory(std::uint64_t more_bytes) {
  unsigned long pages = 0;
  if (FILE* const file = std::fopen("/proc/self/statm", "r")) {
    if (std::fscanf(file, "%lu", &pages) != 1) pages = 0;
    std::fclose(file);
  }
  rlimit limit{};
  getrlimit(RLIMIT_AS, &limit);
  limit.rlim_cur = std::min<rlim_t>(limit.rlim_max, pages * 4096 + more_bytes);
  setrlimit(RLIMIT_AS, &limit);
}

/// As io/sandbox limits a decoder.
constexpr std::uint64_t kSlackBytes = 64 << 20;
std::uint64_t opening_bytes(const std::string& format) {
  return (format == "openexr" ? 1280ULL : 128ULL) << 20;
}

/// Adds all that is handed out of these channels. False: too large to be decoded here.
bool add_image(const mesh::ImageRef& image, const std::string& format, Hasher& hasher,
               std::vector<std::string>& left_out) {
  allow_memory(opening_bytes(format));
  io::ImageReader reader(image, {{kFormats.begin(), kFormats.end()}, Sandbox::off});
  const io::ImageInfo& info = reader.info();
  left_out = info.left_out;
  hasher.add(fmt::format("{} {} {} {} {} {} {} {} {} {} {}", info.width, info.height, info.channels,
                         static_cast<int>(info.depth), info.has_alpha, info.premultiplied,
                         info.tile_width, info.tile_height, info.levels, info.colours.problem,
                         info.hits_note));
  for (const std::string& name : info.names) hasher.add(name);
  for (const float number : info.colours.primaries.value_or(Chromaticities{})) hasher.add(number);
  const std::uint64_t row = reader.row_bytes();
  if (row * info.height > kMostSampleBytes || info.decoder_bytes > 4 * kMostSampleBytes)
    return false;
  constexpr std::uint32_t kStrip = 37;
  std::vector<std::byte> rows(row * std::min(kStrip, info.height));
  allow_memory(info.decoder_bytes + kSlackBytes);
  for (std::uint32_t y = 0; y < info.height; y += kStrip) {
    const std::uint32_t count = std::min(kStrip, info.height - y);
    reader.read_rows(count, rows.data());
    hasher.add(std::span<const std::byte>(rows).first(row * count));
  }
  return true;
}

Outcome read(mesh::ImageRef image, const std::string& format) {
  try {
    if (format == "hdr" || format == "bmp" || format == "targa") io::foreign_module("images are");
    Hasher hasher;
    std::vector<std::string> others, ignored;
    if (!add_image(image, format, hasher, others)) return {"large", to_hex(hasher.digest())};
    for (const std::size_t i : {std::size_t{0}, others.size() - 1}) {
      if (format != "openexr" || i >= others.size()) break;
      image.channels = others[i];
      add_image(image, format, hasher, ignored);
    }
    return {"read", to_hex(hasher.digest())};
  } catch (const Error& e) {
    if (e.kind() == ErrorKind::input) return {"refused", e.what()};
    return {e.kind() == ErrorKind::budget ? "MEMORY" : "FAILED", e.what()};
  } catch (const std::exception& e) {
    return {"FAILED", e.what()};
  }
}

/// What is read from the stack before it is written is another byte in each process, too.
[[gnu::noinline]] void fill_stack(int byte) {
  std::array<char, 128 << 10> room;
  std::memset(room.data(), byte, room.size());
  asm volatile("" : : "r"(room.data()) : "memory");
}

/// From here on the process may run for that long.
void allow_seconds(unsigned processor, unsigned clock) {
  const itimerval timer{{0, 0}, {processor, 0}};
  setitimer(ITIMER_PROF, &timer, nullptr);
  alarm(clock);
}

/// Reads one after another, and writes a line for each.
[[noreturn]] void read_all_cases(std::span<const Case> cases, std::uint64_t seed, int fill,
                                 FILE* out) {
  mallopt(M_PERTURB, fill);
  rlimit no_core{0, 0};
  setrlimit(RLIMIT_CORE, &no_core);
  std::freopen("/dev/null", "w", stderr);
  for (const Case& one : cases) {
    const mesh::ImageRef image = in_memory(one.bytes(seed), "the image");
    const std::string format = one.mutant == 0 ? one.format : format_of(image);
    allow_seconds(kSecondsForEach, kMostSeconds);
    fill_stack(fill);
    Outcome outcome = read(image, format);
    allow_seconds(0, 0);
    allow_memory(UINT32_MAX);
    std::replace(outcome.text.begin(), outcome.text.end(), '\n', ' ');
    fmt::print(out, "{}\t{}\n", outcome.what, outcome.text);
    std::fflush(out);
  }
  _exit(0);
}

/// Those of the cases that one process reads before it dies, and what it died of.
std::vector<Outcome> outcomes_until_death(std::span<const Case> cases, std::uint64_t seed,
                                          int fill) {
  std::array<int, 2> ends;
  if (pipe(ends.data()) != 0) throw std::runtime_error("no pipe");
  std::fflush(stdout);
  const pid_t child = fork();
  if (child == 0) {
    close(ends[0]);
    read_all_cases(cases, seed, fill, fdopen(ends[1], "w"));
  }
  close(ends[1]);
  FILE* const in = fdopen(ends[0], "r");
  std::vector<Outcome> outcomes;
  char* line = nullptr;
  std::size_t room = 0;
  while (getline(&line, &room, in) > 0) {
    const std::string text = line;
    const std::size_t tab = text.find('\t');
    outcomes.push_back({text.substr(0, tab), text.substr(tab + 1, text.size() - tab - 2)});
  }
  std::free(line);
  std::fclose(in);
  int status = 0;
  waitpid(child, &status, 0);
  if (outcomes.size() < cases.size()) {
    const bool late =
        WIFSIGNALED(status) && (WTERMSIG(status) == SIGALRM || WTERMSIG(status) == SIGPROF);
    outcomes.push_back({late ? "HANGS" : "CRASHED", fmt::format("status {}", status)});
  } else if (status != 0) {
    throw std::runtime_error(fmt::format("a reader ended with status {}", status));
  }
  return outcomes;
}

std::vector<Outcome> read_with(std::span<const Case> cases, std::uint64_t seed, int fill) {
  std::vector<Outcome> all;
  while (all.size() < cases.size()) {
    const std::vector<Outcome> some = outcomes_until_death(cases.subspan(all.size()), seed, fill);
    all.insert(all.end(), some.begin(), some.end());
  }
  return all;
}

/// Prints what is wrong; returns what became of the image in one word.
std::string judge(const Case& one, const Outcome& first, const Outcome& second,
                  const Options& options) {
  if (first == second && first.is_sound()) return first.what;
  const std::string verdict = !first.is_sound()    ? first.what
                              : !second.is_sound() ? second.what
                                                   : "DIFFERS";
  fmt::print("{}\t{}\n  {} {}\n  {} {}\n", verdict, one.name(), first.what, first.text, second.what,
             second.text);
  if (!options.keep.empty() && one.mutant > 0) {
    fs::create_directories(options.keep);
    write_file(fmt::format("{}/mutant-{}-{}", options.keep, one.mutant,
                           fs::path(one.path).filename().string()),
               one.bytes(options.seed));
  }
  return verdict;
}

int run(const Options& options) {
  const std::vector<Case> cases = cases_of(options);
  const std::vector<Outcome> first = read_with(cases, options.seed, 85);
  const std::vector<Outcome> second = read_with(cases, options.seed, 170);
  std::map<std::string, std::map<std::string, int>> counts;
  int bad = 0;
  for (std::size_t i = 0; i < cases.size(); ++i) {
    const std::string what = judge(cases[i], first[i], second[i], options);
    ++counts[(cases[i].mutant == 0 ? "as they are, " : "changed, ") + cases[i].format][what];
    if (what != "read" && what != "refused" && what != "large") ++bad;
  }
  for (const auto& [group, by_what] : counts) {
    fmt::print("{:24}", group);
    for (const auto& [what, count] : by_what) fmt::print(" {} {}", count, what);
    fmt::print("\n");
  }
  fmt::print("{} images, each read twice: {} defects\n", cases.size(), bad);
  return bad == 0 && !cases.empty() ? 0 : 1;
}

}  // namespace
}  // namespace pounce::test

int main(int argc, char** argv) try {
  return pounce::test::run(pounce::test::options_of(argc, argv));
} catch (const std::exception& e) {
  std::fprintf(stderr, "slow_decoders: %s\n", e.what());
  return 1;
}
