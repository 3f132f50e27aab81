// SPDX-License-Identifier: Apache-2.0
#include "io/obj/lines.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <string_view>
#include <utility>

#include "pounce/error.h"

namespace pounce::io {
namespace {

constexpr std::size_t kPieceBytes = 1 << 20;
/// Of the names of material files, used or not, until there are too many.
constexpr std::size_t kMaxLibraryBytes = 4 << 20;
constexpr std::size_t kBytesPerLibrary = 64;
constexpr std::size_t kMaxLineBytes = 16 << 20;
constexpr std::size_t kMaxNameBytes = 4096;  // of what o, g, usemtl and mtllib say

bool is_space(char c) { return c == ' ' || c == '\t'; }

/// Takes the next word off the front of `rest`; empty at the end.
std::string_view next_word(std::string_view& rest) {
  std::size_t first = 0;
  while (first < rest.size() && is_space(rest[first])) ++first;
  std::size_t last = first;
  while (last < rest.size() && !is_space(rest[last])) ++last;
  const std::string_view word = rest.substr(first, last - first);
  rest.remove_prefix(last);
  return word;
}

bool is_finite_number(std::string_view word) {
  if (word.starts_with('+')) word.remove_prefix(1);
  double value = 0;
  const auto result = std::from_chars(word.data(), word.data() + word.size(), value);
  if (result.ptr != word.data() + word.size()) return false;
  // Out of a double's range may be tiny (fine) or huge (found when the value is used).
  return result.ec == std::errc::result_out_of_range ||
         (result.ec == std::errc() && std::isfinite(value));
}

/// Counts different keys in 16 KiB: each hash goes to one of 2^14 registers, which keep the longest
/// run of leading zeros they met; their harmonic mean tells the count (HyperLogLog, with linear
/// counting for few keys).
class DistinctCounter {
 public:
  void add(std::uint64_t key) {
    key = (key ^ (key >> 31)) * 0x9E3779B97F4A7C15ULL;
    key = (key ^ (key >> 29)) * 0xBF58476D1CE4E5B9ULL;
    key ^= key >> 32;
    auto& slot = registers_[key >> (64 - kBits)];
    const int run = std::countl_zero((key << kBits) | 1) + 1;
    slot = std::max(slot, static_cast<std::uint8_t>(run));
  }
  double count() const {
    double sum = 0, empty = 0;
    for (const std::uint8_t run : registers_) {
      sum += std::ldexp(1.0, -run);
      empty += run == 0 ? 1 : 0;
    }
    constexpr double kSize = std::size_t{1} << kBits;
    const double estimate = 0.7213 / (1 + 1.079 / kSize) * kSize * kSize / sum;
    return estimate < 2.5 * kSize && empty > 0 ? kSize * std::log(kSize / empty) : estimate;
  }

 private:
  static constexpr int kBits = 14;
  std::array<std::uint8_t, std::size_t{1} << kBits> registers_{};
};

/// Counts statements and what they hold.
class ObjCounter {
 public:
  void add(std::string_view statement) {
    const std::uint64_t line_bytes = statement.size() + 1;
    counts_.longest_line_bytes = std::max(counts_.longest_line_bytes, line_bytes);
    std::string_view rest = statement;
    const std::string_view word = next_word(rest);
    if (word == "v") ++counts_.positions;
    if (word == "vt") ++counts_.texcoords;
    if (word == "vn") ++counts_.normals;
    if (word == "f") add_face(rest);
    if (word == "mtllib") add_library(rest);
    if (word == "o" || word == "g") {
      ++counts_.names;
      counts_.name_bytes += line_bytes;
      (word == "o" ? object_ : group_) = hash_of(rest) + 1;
      part_counted_ = false;
      if (word == "g") counts_.most_groups = std::max(counts_.most_groups, words_of(rest));
    } else if (word == "usemtl") {
      ++counts_.uses;
      counts_.use_bytes += line_bytes;
      material_ = hash_of(rest);
    } else {
      return;
    }
    counts_.longest_name_bytes = std::max(counts_.longest_name_bytes, line_bytes);
  }
  /// What the names of material files take that were met so far.
  std::uint64_t library_bytes() const { return library_bytes_; }
  ObjCounts finish() {
    const auto rounded_up = static_cast<std::uint64_t>(distinct_.count() * 1.05) + 16;
    counts_.distinct_corners = std::min(counts_.corners, rounded_up);
    const auto parts = static_cast<std::uint64_t>(parts_.count() * 1.05) + 16;
    counts_.distinct_parts = std::min(counts_.names + 1, parts);
    const auto materials = static_cast<std::uint64_t>(materials_.count() * 1.05) + 16;
    counts_.distinct_materials = std::min(counts_.uses + 1, materials);
    return std::move(counts_);
  }

 private:
  static std::uint64_t hash_of(std::string_view text) {
    std::uint64_t hash = 0;
    for (const char c : text) hash = (hash + static_cast<unsigned char>(c)) * 0x100000001B3ULL;
    return hash * 0xD6E8FEB86659FD93ULL;
  }
  static std::uint64_t words_of(std::string_view rest) {
    std::uint64_t count = 0;
    while (!next_word(rest).empty()) ++count;
    return count;
  }
  std::uint64_t corner_hash(std::string_view word) const {
    std::uint64_t hash = 0;
    for (const char c : word) {
      hash = (hash + static_cast<unsigned char>(c)) * 0x100000001B3ULL;
      // Negative indices mean something else after each new vertex.
      if (c == '-') hash += (counts_.positions * 31 + counts_.texcoords) * 31 + counts_.normals;
    }
    return hash;
  }

  void add_face(std::string_view rest) {
    ++counts_.faces;
    materials_.add(material_);
    std::uint64_t corners = 0;
    for (std::string_view word = next_word(rest); !word.empty(); word = next_word(rest)) {
      ++corners;
      distinct_.add(corner_hash(word));
    }
    counts_.corners += corners;
    counts_.most_corners = std::max(counts_.most_corners, corners);
    if (part_counted_) return;
    parts_.add(object_ * 31 + group_);
    part_counted_ = true;
  }

  /// One name with spaces in it, or several.
  void add_library(std::string_view rest) {
    while (!rest.empty() && is_space(rest.front())) rest.remove_prefix(1);
    if (rest.size() > kMaxNameBytes) return;  // reading refuses it
    const auto add_one = [&](std::string_view name) {
      if (name.empty() || !counts_.libraries.emplace(name).second) return;
      library_bytes_ += name.size() + kBytesPerLibrary;
    };
    add_one(rest);
    for (std::size_t at = 0; at < rest.size();) {
      const std::size_t end = std::min(rest.find(' ', at), rest.size());
      add_one(rest.substr(at, end - at));
      at = end + 1;
    }
  }

  ObjCounts counts_;
  DistinctCounter distinct_, parts_, materials_;
  std::uint64_t object_ = 0, group_ = 0;  ///< hashes of the names in use
  std::uint64_t material_ = 0;            ///< hash of the one in use
  bool part_counted_ = false;
  std::uint64_t library_bytes_ = 0;
};

}  // namespace

ObjText::ObjText(const std::string& path) : path_(path), file_(posix_file_system().open(path)) {}

void ObjText::fail(const std::string& what) const {
  throw Error(ErrorKind::input,
              fmt::format("{}: line {}: {}; repair the line or export the model again", path_,
                          line_, what));
}

bool ObjText::next_raw_line(std::string& out) {
  bool any = false;
  for (;;) {
    if (at_ == piece_.size()) {
      const std::uint64_t left = file_->size_bytes() - offset_;
      if (left == 0) break;
      piece_.resize(std::min<std::uint64_t>(left, kPieceBytes));
      file_->read(offset_, std::as_writable_bytes(std::span(piece_)));
      offset_ += piece_.size();
      at_ = 0;
    }
    any = true;
    const char* begin = piece_.data() + at_;
    const std::size_t left = piece_.size() - at_;
    const auto* end = static_cast<const char*>(std::memchr(begin, '\n', left));
    const std::size_t size = end == nullptr ? left : static_cast<std::size_t>(end - begin);
    if (out.size() + size > kMaxLineBytes) {
      line_ = raw_lines_ + 1;
      fail("longer than 16 MiB, which no OBJ line is");
    }
    out.append(begin, size);
    at_ += size;
    if (end != nullptr) {
      ++at_;
      break;
    }
  }
  if (any) ++raw_lines_;
  while (!out.empty() && (out.back() == '\r' || is_space(out.back()))) out.pop_back();
  return any;
}

bool ObjText::next(std::string& out) {
  out.clear();
  line_ = raw_lines_ + 1;
  if (!next_raw_line(out)) return false;
  // A library's name may end in a backslash only by accident; every other statement goes on.
  while (!out.empty() && out.back() == '\\') {
    out.back() = ' ';
    if (!next_raw_line(out)) break;
  }
  constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
  if (line_ == 1 && out.starts_with(kByteOrderMark)) out.erase(0, kByteOrderMark.size());
  return true;
}

ObjLines::ObjLines(const std::string& path) : path_(path), file_(path) {}

void ObjLines::check_numbers(std::string_view rest, int needed, int at_most,
                             const char* what) const {
  for (int i = 0; i < at_most; ++i) {
    const std::string_view word = next_word(rest);
    if (word.empty() && i >= needed) return;
    if (word.empty()) fail(fmt::format("{} has {} numbers, but needs {}", what, i, needed));
    if (!is_finite_number(word)) {
      fail(fmt::format("{} holds \"{}\", which is not a finite number", what, word.substr(0, 40)));
    }
  }
}

/// Also blanks slashes with no number after them ("1//"): tinyobjloader would take the next
/// corner's.
void ObjLines::check_face(std::string_view rest) {
  for (std::string_view word = next_word(rest); !word.empty(); word = next_word(rest)) {
    const char* at = word.data();
    const char* const end = at + word.size();
    for (int part = 0; part < 3; ++part) {
      int value = 0;
      const auto result = std::from_chars(at, end, value);
      if (result.ec == std::errc()) {
        if (value == 0) fail(fmt::format("the corner \"{}\" has index 0; OBJ counts from 1", word));
        at = result.ptr;
      } else if (part == 0 || result.ec == std::errc::result_out_of_range) {
        fail(fmt::format("the corner \"{}\" has no valid index", word.substr(0, 60)));
      }
      if (at == end) break;
      if (*at != '/' || part == 2)
        fail(fmt::format("\"{}\" is no corner of a face", word.substr(0, 60)));
      ++at;
    }
    for (const char* last = end - 1; *last == '/'; --last)
      text_[static_cast<std::size_t>(last - text_.data())] = ' ';
  }
}

/// tinyobjloader splits the file name at spaces; if the whole of it names a file, its spaces are
/// escaped.
void ObjLines::quote_material_library(std::string_view rest) {
  while (!rest.empty() && is_space(rest.front())) rest.remove_prefix(1);
  std::string name(rest);
  std::replace(name.begin(), name.end(), '\\', '/');
  std::error_code error;
  const bool whole =
      std::filesystem::exists(std::filesystem::path(path_).parent_path() / name, error);
  text_ = "mtllib ";
  for (const char c : name) {
    if (whole && c == ' ') text_ += '\\';
    text_ += c;
  }
}

bool ObjLines::next_checked_line() {
  while (file_.next(text_)) {
    std::string_view rest(text_);
    const std::string word(next_word(rest).substr(0, 8));
    const std::size_t rest_bytes = rest.size();
    if (word == "v") {
      check_numbers(rest, 3, 3, "a vertex");
    } else if (word == "vt") {
      check_numbers(rest, 1, 2, "a texture coordinate");
    } else if (word == "vn") {
      check_numbers(rest, 3, 3, "a normal");
    } else if (word == "f") {
      check_face(rest);
    } else if (word == "mtllib") {
      quote_material_library(rest);
    } else if (word == "g" && rest.empty()) {
      text_ = "g default";
    } else if (word == "o" && rest.empty()) {
      text_ = "o default";
    } else if (word != "usemtl" && word != "o" && word != "g") {
      continue;
    }
    const bool has_names = word != "f" && word[0] != 'v';
    if (has_names && rest_bytes > kMaxNameBytes) {
      fail(fmt::format("names of more than {} bytes, which no model has", kMaxNameBytes));
    }
    // tinyobjloader would see another line, which nobody has checked.
    if (has_names) std::replace(text_.begin(), text_.end(), '\r', ' ');
    text_ += '\n';
    return true;
  }
  return false;
}

ObjLines::int_type ObjLines::underflow() {
  if (failure_ != nullptr) return traits_type::eof();
  try {
    if (!next_checked_line()) return traits_type::eof();
  } catch (...) {
    failure_ = std::current_exception();
    return traits_type::eof();
  }
  setg(text_.data(), text_.data(), text_.data() + text_.size());
  return traits_type::to_int_type(text_[0]);
}

ObjCounts count_obj(const std::string& path) {
  ObjText file(path);
  ObjCounter counter;
  for (std::string statement; file.next(statement);) {
    counter.add(statement);
    if (counter.library_bytes() > kMaxLibraryBytes) refuse_libraries(path);
  }
  return counter.finish();
}

void refuse_libraries(const std::string& path) {
  throw Error(ErrorKind::input, fmt::format("{}: names more than {} material files; split the "
                                            "model or leave out those that no face uses",
                                            path, kMaxLibraries));
}

}  // namespace pounce::io
