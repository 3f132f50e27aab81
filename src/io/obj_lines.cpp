// SPDX-License-Identifier: Apache-2.0
#include "io/obj_lines.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <string_view>

#include "pounce/error.h"

namespace pounce::io {
namespace {

constexpr std::size_t kPieceBytes = 1 << 20;
constexpr std::size_t kMaxLibraries = 1000;
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

/// Counts statements and corners, one character after the other.
class ObjCounter {
 public:
  void add(char c) {
    ++line_bytes_;
    if (c == '\n') {
      end_of_line();
    } else if (is_space(c) || c == '\r') {
      end_of_word();
      if (is_library_ && library_.size() < kMaxNameBytes) library_ += ' ';
    } else {
      if (first_word_) {
        if (word_size_ < word_.size()) word_[word_size_] = c;
        word_size_ = std::min(word_size_ + 1, word_.size() + 1);
      }
      if (is_library_ && library_.size() < kMaxNameBytes) library_ += c;
      in_word_ = true;
      corner_ = (corner_ + static_cast<unsigned char>(c)) * 0x100000001B3ULL;
      // Negative indices mean something else after each new vertex.
      if (c == '-') corner_ += (counts_.positions * 31 + counts_.texcoords) * 31 + counts_.normals;
    }
    if (c != '\r') last_ = c;
  }
  ObjCounts finish() {
    end_of_line();
    const auto rounded_up = static_cast<std::uint64_t>(distinct_.count() * 1.05) + 16;
    counts_.distinct_corners = std::min(counts_.corners, rounded_up);
    const auto parts = static_cast<std::uint64_t>(parts_.count() * 1.05) + 16;
    counts_.distinct_parts = std::min(counts_.names + 1, parts);
    const auto materials = static_cast<std::uint64_t>(materials_.count() * 1.05) + 16;
    counts_.distinct_materials = std::min(counts_.uses + 1, materials);
    return counts_;
  }

 private:
  bool is_word(std::string_view word) const {
    return word_size_ <= word_.size() && std::string_view(word_.data(), word_size_) == word;
  }
  void end_of_line() {
    end_of_word();
    if (is_library_) counts_.libraries.insert(library_);
    is_library_ = false;
    counts_.most_groups = std::max(counts_.most_groups, groups_);
    groups_ = 0;
    if (!first_word_ && (is_word("o") || is_word("g"))) counts_.name_bytes += line_bytes_;
    counts_.longest_line_bytes = std::max(counts_.longest_line_bytes, line_bytes_);
    line_bytes_ = 0;
    if (last_ == '\\') return;  // the statement goes on
    first_word_ = true;
    word_size_ = 0;
  }
  void end_of_word() {
    if (in_word_ && first_word_) {
      first_word_ = false;
      if (is_word("v")) ++counts_.positions;
      if (is_word("vt")) ++counts_.texcoords;
      if (is_word("vn")) ++counts_.normals;
      if (is_word("f")) start_face();
      if (is_word("o") || is_word("g")) start_name();
      if (is_word("usemtl")) ++counts_.uses, material_ = 0;
      is_library_ = is_word("mtllib") && counts_.libraries.size() < kMaxLibraries;
      library_.clear();
    } else if (in_word_ && is_word("usemtl")) {
      material_ = (material_ + corner_) * 0xD6E8FEB86659FD93ULL;
    } else if (in_word_ && (is_word("o") || is_word("g"))) {
      ++groups_;
      std::uint64_t& hash = is_word("o") ? object_ : group_;
      hash = (hash + corner_) * 0xD6E8FEB86659FD93ULL;
    } else if (in_word_ && is_word("f")) {
      ++counts_.corners;
      distinct_.add(corner_);
    }
    in_word_ = false;
    corner_ = 0;
  }

  void start_face() {
    ++counts_.faces;
    materials_.add(material_);
    if (part_counted_) return;
    parts_.add(object_ * 31 + group_);
    part_counted_ = true;
  }
  void start_name() {
    ++counts_.names;
    (is_word("o") ? object_ : group_) = 1;
    part_counted_ = false;
  }

  ObjCounts counts_;
  DistinctCounter distinct_, parts_, materials_;
  std::uint64_t object_ = 0, group_ = 0;  ///< hashes of the names in use
  std::uint64_t material_ = 0;            ///< hash of the one in use
  std::uint64_t groups_ = 0;              ///< names of the line so far
  bool part_counted_ = false;
  std::array<char, 6> word_{};  ///< the first characters of the line's first word
  std::size_t word_size_ = 0;
  bool is_library_ = false;  ///< a "mtllib" line; library_ is what it says
  std::string library_;
  bool in_word_ = false, first_word_ = true;
  std::uint64_t corner_ = 0;  ///< hash of the word being read
  std::uint64_t line_bytes_ = 0;
  char last_ = 0;
};

}  // namespace

ObjLines::ObjLines(const std::string& path) : path_(path), file_(posix_file_system().open(path)) {}

void ObjLines::fail(const std::string& what) const {
  throw Error(ErrorKind::input,
              fmt::format("{}: line {}: {}; repair the line or export the model again", path_,
                          line_, what));
}

bool ObjLines::next_raw_line(std::string& out) {
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
  for (;;) {
    text_.clear();
    line_ = raw_lines_ + 1;
    if (!next_raw_line(text_)) return false;
    // A library's name may end in a backslash only by accident; every other statement goes on.
    while (!text_.empty() && text_.back() == '\\') {
      text_.back() = ' ';
      if (!next_raw_line(text_)) break;
    }
    std::string_view rest(text_);
    if (line_ == 1 && rest.starts_with("\xEF\xBB\xBF")) rest.remove_prefix(3);
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
    if (text_.starts_with("\xEF\xBB\xBF")) text_.erase(0, 3);
    text_ += '\n';
    return true;
  }
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
  const auto file = posix_file_system().open(path);
  std::vector<char> piece;
  ObjCounter counter;
  const std::uint64_t size = file->size_bytes();
  for (std::uint64_t offset = 0; offset < size; offset += piece.size()) {
    piece.resize(std::min<std::uint64_t>(size - offset, kPieceBytes));
    file->read(offset, std::as_writable_bytes(std::span(piece)));
    for (const char c : piece) counter.add(c);
  }
  return counter.finish();
}

}  // namespace pounce::io
