// SPDX-License-Identifier: Apache-2.0
//
// Does ImageReader hand out what is in the file? Writes images of every kind with the formats' own
// libraries, from known samples, reads each in several ways, and holds it against these samples and
// against OpenImageIO. Prints what became of them and writes a line for each into corpus.tsv. The
// exit status is 1 if one was read wrong.
#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>
#include <sstream>
#include <string>

#include "corpus.h"
#include "corpus_judge.h"

namespace pounce::test::corpus {
namespace {

namespace fs = std::filesystem;

struct Options {
  std::string folder, record, against, only;
  std::vector<std::string> files;
  std::uint64_t seed = 1;
  Sandbox sandbox = Sandbox::automatic;
};

[[noreturn]] void usage() {
  std::fputs(
      "usage: slow_images FOLDER [--seed N] [--files FOLDER]... [--record FILE] [--against FILE]\n"
      "                   [--only TEXT] [--sandbox auto|on|off]\n"
      "FOLDER takes the images; --files: more images, held against OpenImageIO alone.\n"
      "--record: what was read, to be compared later; --against: compare with such a record.\n"
      "--only: the images whose names hold TEXT.\n",
      stderr);
  std::exit(2);
}

Options options_of(int argc, char** argv) {
  Options options;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (!word.starts_with("--")) {
      if (!options.folder.empty()) usage();
      options.folder = word;
      continue;
    }
    if (++i == argc) usage();
    if (word == "--seed")
      options.seed = std::strtoull(argv[i], nullptr, 10);
    else if (word == "--sandbox")
      options.sandbox = sandbox_from_name(argv[i]).value_or(Sandbox::automatic);
    else if (word == "--files")
      options.files.push_back(argv[i]);
    else if (word == "--record")
      options.record = argv[i];
    else if (word == "--against")
      options.against = argv[i];
    else if (word == "--only")
      options.only = argv[i];
    else
      usage();
  }
  if (options.folder.empty()) usage();
  return options;
}

Entries made_entries() {
  Entries entries;
  for (const auto& add : {add_png, add_jpeg, add_tiff, add_exr, add_webp, add_other}) add(entries);
  std::set<std::string> names;
  for (const Entry& entry : entries) {
    if (names.insert(entry.name).second) continue;
    std::fprintf(stderr, "two images are called %s\n", entry.name.c_str());
    std::exit(2);
  }
  return entries;
}

Entries found_entries(const std::string& folder) {
  std::vector<std::string> paths;
  for (const auto& file : fs::recursive_directory_iterator(folder)) {
    if (file.is_regular_file()) paths.push_back(file.path().lexically_relative(folder).string());
  }
  std::sort(paths.begin(), paths.end());
  Entries entries;
  for (const std::string& path : paths) entries.push_back({"files/" + path, path, "", 0, nullptr});
  return entries;
}

bool is_no_image(const Verdict& verdict) {
  const auto starts = [&](const char* text) { return verdict.note.starts_with(text); };
  return verdict.what == "refused" && (starts("not an image in a supported") ||
                                       starts("the image is empty") || starts("ICO images"));
}

bool is_bad(const Verdict& verdict) {
  return std::any_of(kVerdicts.begin(), kVerdicts.end(),
                     [&](const Kind& kind) { return kind.bad && verdict.what == kind.name; });
}

std::vector<Verdict> judge_all(const Options& options) {
  std::vector<Verdict> verdicts;
  const auto judge_some = [&](const Entries& entries, const std::string& folder) {
    for (const Entry& entry : entries) {
      if (entry.name.find(options.only) == std::string::npos) continue;
      Verdict verdict = judge(entry, folder, options.seed, options.sandbox);
      if (!entry.make && is_no_image(verdict)) continue;
      if (is_bad(verdict)) fmt::print("{}\t{}\t{}\n", verdict.what, verdict.name, verdict.note);
      verdicts.push_back(std::move(verdict));
    }
  };
  judge_some(made_entries(), options.folder);
  for (const std::string& folder : options.files) {
    if (fs::is_directory(folder))
      judge_some(found_entries(folder), folder);
    else
      fmt::print("skipped: there is no folder {}\n", folder);
  }
  return verdicts;
}

/// Of its name: the format, or "files".
std::string group_of(const Verdict& verdict) {
  return verdict.name.substr(0, verdict.name.find_first_of("-/."));
}

void print_table(const std::vector<Verdict>& verdicts) {
  std::vector<std::string> groups;
  std::map<std::pair<std::string, std::string>, int> counts;
  for (const Verdict& verdict : verdicts) {
    const std::string group = group_of(verdict);
    if (std::find(groups.begin(), groups.end(), group) == groups.end()) groups.push_back(group);
    ++counts[{verdict.what, group}];
    ++counts[{verdict.what, "all"}];
  }
  groups.push_back("all");
  fmt::print("{:12}", "");
  for (const std::string& group : groups) fmt::print("{:>6}", group);
  fmt::print("\n");
  for (const Kind& kind : kVerdicts) {
    fmt::print("{:12}", kind.name);
    for (const std::string& group : groups) fmt::print("{:6}", counts[{kind.name, group}]);
    fmt::print("  {}\n", kind.meaning);
  }
}

/// With notes, which may change with every wording, or what is to stay.
void write_lines(const std::vector<Verdict>& verdicts, const std::string& path, bool notes) {
  std::ofstream out(path);
  for (const Verdict& v : verdicts) {
    out << v.name << '\t' << v.what;
    if (notes || v.hash != "-") out << '\t' << v.hash << '\t' << v.info;
    if (notes) out << '\t' << v.note;
    out << '\n';
  }
  if (out.flush()) return;
  std::fprintf(stderr, "%s cannot be written\n", path.c_str());
  std::exit(2);
}

std::map<std::string, Verdict> read_lines(const std::string& path) {
  std::map<std::string, Verdict> verdicts;
  std::ifstream in(path);
  if (!in) {
    std::fprintf(stderr, "%s cannot be read\n", path.c_str());
    std::exit(2);
  }
  for (std::string line; std::getline(in, line);) {
    std::istringstream words(line);
    Verdict v{"", "", "-", "-", ""};
    std::getline(words, v.name, '\t');
    std::getline(words, v.what, '\t');
    std::getline(words, v.hash, '\t');
    std::getline(words, v.info, '\t');
    verdicts[v.name] = v;
  }
  return verdicts;
}

/// How many are not as they were. What was refused, or read wrong, may be read now.
int compare(const std::vector<Verdict>& verdicts, const std::string& path) {
  const std::map<std::string, Verdict> before = read_lines(path);
  int same = 0, changed = 0, newly_read = 0, unknown = 0, mended = 0;
  for (const Verdict& now : verdicts) {
    const auto at = before.find(now.name);
    if (at == before.end()) {
      ++unknown;
      continue;
    }
    const Verdict& then = at->second;
    if (then.hash == now.hash && then.info == now.info) {
      ++same;
    } else if (then.what == "DEFECT" && !is_bad(now)) {
      ++mended;
    } else if (then.hash == "-") {
      ++newly_read;
      fmt::print("read now\t{}\t{}\t{}\n", now.name, now.what, now.info);
    } else {
      ++changed;
      fmt::print("CHANGED\t{}\t{}\n  was {} {}\n  is  {} {} {}\n", now.name,
                 then.hash == now.hash ? "the samples are the same" : "", then.hash, then.info,
                 now.hash, now.info, now.note);
    }
  }
  fmt::print(
      "{}: {} as before, {} changed, {} read now, {} mended, {} not in it; {} of it not seen\n",
      path, same, changed, newly_read, mended, unknown,
      before.size() + static_cast<std::size_t>(unknown) - verdicts.size());
  return changed;
}

int run(const Options& options) {
  fs::create_directories(options.folder);
  const std::vector<Verdict> verdicts = judge_all(options);
  print_table(verdicts);
  write_lines(verdicts, options.folder + "/corpus.tsv", true);
  if (!options.record.empty()) write_lines(verdicts, options.record, false);
  const int changed = options.against.empty() ? 0 : compare(verdicts, options.against);
  const auto bad = std::count_if(verdicts.begin(), verdicts.end(), is_bad);
  fmt::print("{} images, {} bad, {} changed; a line for each is in {}/corpus.tsv\n",
             verdicts.size(), bad, changed, options.folder);
  return bad == 0 && changed == 0 ? 0 : 1;
}

}  // namespace
}  // namespace pounce::test::corpus

int main(int argc, char** argv) {
  return pounce::test::corpus::run(pounce::test::corpus::options_of(argc, argv));
}
