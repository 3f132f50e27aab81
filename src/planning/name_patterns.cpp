// SPDX-License-Identifier: Apache-2.0
//
// Names of outputs from patterns: <CHANNEL>, <MATERIAL>, <TARGET>, <UDIM> and <UVTILE>.
//
// Names come from files, so they are made safe as parts of a path; and no two outputs may have one.
#include "planning/name_patterns.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <set>

#include "io/files/output_file.h"
#include "pounce/error.h"

namespace pounce::planning {

bool has_token(const std::string& pattern, const std::string& token) {
  return pattern.find("<" + token + ">") != std::string::npos;
}

std::string expand_pattern(const std::string& pattern,
                           const std::map<std::string, std::string>& values) {
  std::string out;
  // In one pass over the pattern: a value that looks like a token, such as a material called
  // "<UDIM>", is not expanded again.
  for (std::size_t at = 0; at < pattern.size();) {
    const std::size_t close = pattern[at] == '<' ? pattern.find('>', at) : std::string::npos;
    if (close == std::string::npos) {
      out += pattern[at++];
      continue;
    }
    const std::string token = pattern.substr(at + 1, close - at - 1);
    const auto value = values.find(token);
    if (value == values.end()) {
      std::string known;
      for (const auto& [name, unused] : values) known += (known.empty() ? "<" : ", <") + name + ">";
      throw Error(ErrorKind::usage,
                  fmt::format("{}: unknown token <{}> (known here: {})", pattern, token, known));
    }
    out += value->second;
    at = close + 1;
  }
  return out;
}

const std::string& output_of(const TransferOptions& options, Channel channel) {
  if (channel == Channel::hits) return options.image.map_output;
  for (const ChannelOutput& own : options.image.channel_outputs) {
    if (own.channel == channel) return own.path;
  }
  return options.output;
}

std::string file_name_part(const std::string& name) {
  // A material may be called "../../x" or nothing at all. Other characters stay: file systems have
  // them.
  std::string out = name;
  for (char& c : out) {
    if (c == '/' || c == '\\' || static_cast<unsigned char>(c) < 32) c = '_';
  }
  return out.empty() || out == "." || out == ".." ? "_" : out;
}

namespace {

/// Every file is made anew in its folder, also where it replaces one: can it be? A folder that is
/// missing is made when there is something to put into it.
void check_folder(const std::string& path, std::set<std::string>& checked) {
  // Through links, to where the file really is written.
  const std::string place = io::output_place(path);
  if (place.empty()) {
    throw Error(ErrorKind::storage, path + ": is a broken link; choose another name");
  }
  const std::string folder = std::filesystem::path(place).parent_path().string();
  if (!checked.insert(folder).second) return;  // a set has thousands of images in one
  const std::string there = io::existing_folder(folder);
  std::error_code ignored;
  if (!std::filesystem::is_directory(there, ignored)) {
    throw Error(ErrorKind::storage,
                fmt::format("{}: {} is not a folder; choose another", path, there));
  }
  if (::access(there.c_str(), W_OK | X_OK) == 0) return;
  const char* const reason = std::strerror(errno);
  throw Error(
      ErrorKind::storage,
      folder.empty() || there == folder
          ? fmt::format("{}: cannot create files in the folder {}: {}", path, there, reason)
          : fmt::format("{}: cannot create the folder {} in {}: {}", path, folder, there, reason));
}

}  // namespace

void check_outputs(const std::vector<std::string>& paths, const std::string& cure) {
  namespace fs = std::filesystem;
  std::set<std::string> seen, folders;
  for (const std::string& path : paths) {
    // By spelling, since the files need not exist yet.
    if (!seen.insert(fs::path(path).lexically_normal().string()).second) {
      throw Error(ErrorKind::usage,
                  fmt::format("two images would be written to {}: {}", path, cure));
    }
    check_folder(path, folders);
    std::error_code problem;
    const bool taken = fs::is_directory(path, problem);
    if (problem == std::errc::filename_too_long) {
      throw Error(
          ErrorKind::usage,
          path + ": the file name is too long; shorten it, or the names its tokens expand to");
    }
    if (taken) {
      throw Error(ErrorKind::storage, fmt::format("{}: is a folder; name a file in it", path));
    }
    if (fs::exists(path, problem) && !fs::is_regular_file(path, problem)) {
      throw Error(ErrorKind::storage,
                  path + ": exists but is not a regular file; choose another name");
    }
  }
}

void refuse_over_input(const std::string& output, const std::vector<std::string>& inputs) {
  // By identity, not by name: links and relative paths may lead to the same file. An output that
  // does not exist yet is equivalent to nothing.
  for (const std::string& input : inputs) {
    std::error_code ignored;
    if (!input.empty() && std::filesystem::equivalent(output, input, ignored))
      throw Error(ErrorKind::usage, output + ": is also an input; write to another file");
  }
}

std::string model_image_pattern(const std::string& output) {
  for (const char* token : {"UDIM", "UVTILE", "CHANNEL", "MATERIAL"}) {
    if (!has_token(output, token)) continue;
    throw Error(ErrorKind::usage, fmt::format("{}: a model contains every material and channel, "
                                              "and UVs wrap around in its images; remove <{}>",
                                              output, token));
  }
  const std::string base = std::filesystem::path(output).replace_extension().string();
  return base + ".<MATERIAL>.<CHANNEL>.png";
}

// --- sets of UDIM tiles --------------------------------------------------------------------------
//
// Names of UDIM tiles in both directions: a pattern becomes the name of a tile, and the name of one
// tile becomes the pattern of its set.
//
// A name may have several numbers ("scan_2023_skin.1001.png"). Exporters put the tile last, so the
// last one counts, and the number of a tile counts before "u1_v1". Whether a set is meant at all is
// not decided here.

namespace {

bool is_digit(char c) { return c >= '0' && c <= '9'; }

/// The number whose digits begin at `at`, and the place behind them; 0 for none, or one too long.
std::uint32_t number_at(const std::string& text, std::size_t& at) {
  std::uint32_t number = 0;
  const std::size_t begin = at;
  for (; at < text.size() && is_digit(text[at]); ++at)
    // Longer runs of digits are no UDIM. They are read to their end, so that their tail is not one
    // either.
    number = at - begin < 4 ? number * 10 + static_cast<std::uint32_t>(text[at] - '0') : 0;
  return number;
}

std::optional<mesh::UvTile> uvtile_at(const std::string& text, std::size_t& at) {
  const std::size_t begin = at++;
  const std::uint32_t column = number_at(text, at);
  if (column == 0 || text.compare(at, 2, "_v") != 0) return std::nullopt;
  at += 2;
  const std::uint32_t row = number_at(text, at);
  const mesh::UvTile tile{static_cast<std::int32_t>(column) - 1,
                          static_cast<std::int32_t>(row) - 1};
  if (row == 0 || text.substr(begin, at - begin) != mesh::uvtile_name(tile)) return std::nullopt;
  return tile;
}

}  // namespace

bool is_tile_pattern(const std::string& path) {
  return has_token(path, "UDIM") || has_token(path, "UVTILE");
}

std::string tile_path(const std::string& pattern, mesh::UvTile tile) {
  return expand_pattern(pattern, {{"UDIM", std::to_string(mesh::udim_number(tile).value_or(0))},
                                  {"UVTILE", mesh::uvtile_name(tile)}});
}

std::optional<NamedTile> named_tile(const std::string& path) {
  if (path.find('<') != std::string::npos) return std::nullopt;  // it would not stay a name
  const std::filesystem::path whole(path);
  const std::string name = whole.filename().string();
  const std::size_t stem = whole.stem().string().size();
  const auto with = [&](std::size_t begin, std::size_t end, const char* token) {
    return (whole.parent_path() / (name.substr(0, begin) + token + name.substr(end))).string();
  };
  std::optional<NamedTile> by_number, by_tile;
  for (std::size_t at = 0; at < stem;) {
    const std::size_t begin = at;
    if (is_digit(name[at])) {
      const std::uint32_t number = number_at(name, at);
      if (at - begin == 4 && at <= stem && number >= mesh::kFirstUdim)
        by_number = NamedTile{with(begin, at, "<UDIM>"), mesh::udim_tile(number)};
    } else if (name[at] == 'u') {
      const auto tile = uvtile_at(name, at);
      if (tile && at <= stem) by_tile = NamedTile{with(begin, at, "<UVTILE>"), *tile};
      // The letter may be part of a word ("skull"); what follows it is looked at again.
      if (!tile) at = begin + 1;
    } else {
      ++at;
    }
  }
  return by_number ? by_number : by_tile;
}

}  // namespace pounce::planning
