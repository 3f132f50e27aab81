// SPDX-License-Identifier: Apache-2.0
//
// The header of a PLY: lines of text that describe elements (tables) and their properties
// (columns), then "end_header" and the rows of one element after the other.
//
// It is read whole, then judged, here by its sizes and in ply_scene.cpp by its meaning: what the
// file is (mesh, points, splats) tells its owner more than the first thing that is wrong with it.
//
// A header can announce anything. Its text is limited (1 MiB), the number of elements and columns
// too; counts are multiplied so that they saturate, and compared with the bytes that are there
// before anything is allocated by them.
//
// All header text is looked at before any row is: the size of a row and where rows begin follow
// from every line, and a reader that starts early reads numbers from the wrong columns.
#include "io/ply/ply_header.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <limits>
#include <optional>
#include <set>
#include <span>
#include <utility>

#include "io/problems.h"

namespace pounce::io {
namespace {

constexpr std::size_t kMostHeaderBytes = 1 << 20;
constexpr std::size_t kFirstRead = 16 << 10;  // degree 3 has 2 KiB
constexpr std::size_t kMostColumns = 4096;

std::optional<PlyType> type_of(std::string_view name) {
  // Both spellings are common: the first of the original tools, the second of later ones.
  constexpr std::array<std::pair<std::string_view, PlyType>, 16> kTypes{{
      {"char", PlyType::i8},
      {"int8", PlyType::i8},
      {"uchar", PlyType::u8},
      {"uint8", PlyType::u8},
      {"short", PlyType::i16},
      {"int16", PlyType::i16},
      {"ushort", PlyType::u16},
      {"uint16", PlyType::u16},
      {"int", PlyType::i32},
      {"int32", PlyType::i32},
      {"uint", PlyType::u32},
      {"uint32", PlyType::u32},
      {"float", PlyType::f32},
      {"float32", PlyType::f32},
      {"double", PlyType::f64},
      {"float64", PlyType::f64},
  }};
  for (const auto& [text, type] : kTypes) {
    if (text == name) return type;
  }
  return std::nullopt;
}

/// As PlyType counts them.
constexpr std::array<std::uint32_t, 8> kTypeBytes{1, 1, 2, 2, 4, 4, 4, 8};

/// Cuts the next word off the front; empty at the end. '\r' is a blank: headers written on Windows
/// end their lines with it, although their rows are binary.
std::string_view word(std::string_view& line) {
  const auto blank = [](char c) { return c == ' ' || c == '\t' || c == '\r'; };
  while (!line.empty() && blank(line.front())) line.remove_prefix(1);
  std::size_t end = 0;
  while (end < line.size() && !blank(line[end])) ++end;
  const std::string_view found = line.substr(0, end);
  line.remove_prefix(end);
  return found;
}

std::string lower(std::string_view text) {
  std::string result(text);
  for (char& c : result) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  return result;
}

/// Takes a header line by line: a state machine whose only state is the last element.
class HeaderParser {
 public:
  explicit HeaderParser(const std::string& path) : path_(path) {}

  /// One line without its end; true after end_header.
  bool line(std::string_view text) {
    ++number_;
    std::string_view rest = text;
    const std::string_view key = word(rest);
    if (number_ == 1) {
      if (key != "ply") fail("does not begin with \"ply\"");
    } else if (key == "end_header") {
      return true;
    } else if (key == "format") {
      header_.format = word(rest);
      if (const auto version = word(rest); version != "1.0") {
        fail(fmt::format("states format version \"{}\", but only 1.0 exists", shown(version)));
      }
    } else if (key == "comment" || key == "obj_info") {
      comment(rest);
    } else if (key == "element") {
      element(rest);
    } else if (key == "property") {
      property(rest);
    } else if (!key.empty()) {
      fail(fmt::format("contains \"{}\", which is not PLY", shown(text)));
    }
    return false;
  }
  PlyHeader& header() { return header_; }
  std::size_t lines() const { return number_; }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    refuse(path_, "line {} of the header {}; export the file again", number_, what);
  }

  /// How the scene was trained. No standard has it, so trainers and editors write it as a comment,
  /// each in its own words; comments with other keys or values are somebody else's and ignored.
  /// The last one counts.
  void comment(std::string_view rest) {
    std::string key = lower(word(rest));
    if (!key.empty() && key.back() == ':') key.pop_back();
    if (key == "texturefile") return texture(rest);
    const std::string value = lower(word(rest));
    using store::SplatModel;
    if (key == "splatrendermode") {
      if (value == "default") header_.model = SplatModel::standard;
      if (value == "mip" || value == "antialiased") header_.model = SplatModel::antialiased;
      if (value == "2dgs") header_.model = SplatModel::flat;
    } else if (key == "antialiased") {
      if (value == "1" || value == "true") header_.model = SplatModel::antialiased;
      if (value == "0" || value == "false") header_.model = SplatModel::standard;
    }
  }

  /// Of a mesh: the rest of the line, blanks inside included.
  void texture(std::string_view name) {
    const auto first = std::min(name.find_first_not_of(" \t"), name.size());
    name.remove_prefix(first);
    while (!name.empty() && (name.back() == ' ' || name.back() == '\t' || name.back() == '\r'))
      name.remove_suffix(1);
    if (!name.empty()) header_.textures.emplace_back(name);
  }

  // A count may be any 64-bit number here; ply_rows_at() compares it with the file.
  void element(std::string_view rest) {
    PlyElement element;
    element.name = word(rest);
    const std::string_view count = word(rest);
    const auto [end, code] =
        std::from_chars(count.data(), count.data() + count.size(), element.count);
    if (element.name.empty() || code != std::errc{} || end != count.data() + count.size()) {
      fail("has no name and count after \"element\"");
    }
    if (header_.find(element.name) != nullptr) {
      fail(fmt::format("names the element \"{}\" twice", shown(element.name)));
    }
    if (header_.elements.size() == kMostColumns) fail("has too many elements");
    header_.elements.push_back(std::move(element));
    names_.clear();
  }

  // Offsets follow from the order of the columns. A name that stands twice is refused, since
  // readers would disagree about which of the two counts.
  void property(std::string_view rest) {
    if (header_.elements.empty()) fail("has a property before any element");
    PlyElement& element = header_.elements.back();
    const std::string_view type_name = word(rest);
    if (type_name == "list") {
      const auto length = type_of(word(rest)), item = type_of(word(rest));
      const std::string_view name = word(rest);
      if (!length || !item || name.empty()) fail("has a list without types and a name");
      // Rows with a list have no fixed size: nothing behind them can be found without reading them.
      // A nameless column keeps its place in the count.
      element.has_list = true;
      element.lists.push_back({std::string(name), *length, *item});
      element.columns.push_back({"", PlyType::u8, 0});
    } else {
      const auto type = type_of(type_name);
      if (!type) fail(fmt::format("has the unknown type \"{}\"", shown(type_name)));
      PlyColumn column{std::string(word(rest)), *type,
                       static_cast<std::uint32_t>(element.row_bytes)};
      if (column.name.empty()) fail("has a property without a name");
      if (!names_.insert(column.name).second) {
        fail(fmt::format("names the column \"{}\" twice", shown(column.name)));
      }
      element.row_bytes += kTypeBytes[static_cast<std::size_t>(*type)];
      element.columns.push_back(std::move(column));
    }
    if (element.columns.size() > kMostColumns) fail("has too many columns");
  }

  const std::string& path_;
  PlyHeader header_;
  std::set<std::string> names_;  ///< columns of the last element
  std::size_t number_ = 0;
};

/// a * b + c, or the largest number there is.
std::uint64_t saturated(std::uint64_t a, std::uint64_t b, std::uint64_t c) {
  constexpr std::uint64_t kMost = std::numeric_limits<std::uint64_t>::max();
  // A sum that stays at the largest number is beyond any file, which is all that is asked of it.
  if (b != 0 && a > (kMost - c) / b) return kMost;
  return a * b + c;
}

}  // namespace

const PlyColumn* find_column(const std::vector<PlyColumn>& columns, std::string_view name) {
  for (const PlyColumn& column : columns) {
    if (column.name == name) return &column;
  }
  return nullptr;
}

const PlyElement* PlyHeader::find(std::string_view name) const {
  for (const PlyElement& e : elements) {
    if (e.name == name) return &e;
  }
  return nullptr;
}

const PlyList* find_list(const PlyElement& element, std::initializer_list<std::string_view> names) {
  for (const PlyList& list : element.lists) {
    if (std::find(names.begin(), names.end(), list.name) != names.end()) return &list;
  }
  return nullptr;
}

const PlyList* ply_corners(const PlyElement& face) {
  return find_list(face, {"vertex_indices", "vertex_index"});
}

bool is_ply_mesh(const ReadFile& file, const std::string& path) {
  if (!is_ply(file)) return false;
  try {
    const PlyHeader header = read_ply_header(file, path);
    const PlyElement* face = header.find("face");
    if (face == nullptr || face->count == 0 || ply_corners(*face) == nullptr) return false;
    const PlyElement* vertex = header.find("vertex");
    return vertex == nullptr || (find_column(vertex->columns, "f_dc_0") == nullptr &&
                                 find_column(vertex->columns, "packed_position") == nullptr);
  } catch (const Error& e) {
    if (e.kind() != ErrorKind::input) throw;
    return false;
  }
}

std::string shown(std::string_view text) {
  std::string result;
  for (const char c : text.substr(0, 60)) result += c >= ' ' && c <= '~' ? c : '?';
  return text.size() > 60 ? result + "..." : result;
}

// What follows "ply" has to end the word: text files may begin with it, too.
bool is_ply(const ReadFile& file) {
  std::array<char, 4> start{};
  if (file.size_bytes() < start.size()) return false;
  file.read(0, std::as_writable_bytes(std::span(start)));
  const std::string_view begins(start.data(), start.size());
  return begins == "ply\n" || begins == "ply\r" || begins == "ply ";
}

PlyHeader read_ply_header(const ReadFile& file, const std::string& path) {
  HeaderParser parser(path);
  std::string text;
  std::size_t at = 0;
  // Nearly all headers end in the first piece; only one that does not costs the whole limit.
  for (std::size_t wanted = kFirstRead;; wanted = kMostHeaderBytes) {
    // What was read stays: the second read appends the rest up to the limit.
    const std::size_t have = text.size();
    text.resize(std::min<std::uint64_t>(wanted, file.size_bytes()));
    file.read(have, std::as_writable_bytes(std::span(text)).subspan(have));
    for (std::size_t end; (end = text.find('\n', at)) != std::string::npos;) {
      const bool done = parser.line(std::string_view(text).substr(at, end - at));
      at = end + 1;
      if (!done) continue;
      parser.header().bytes = at;
      parser.header().lines = parser.lines();
      return std::move(parser.header());
    }
    if (text.size() == file.size_bytes() || wanted == kMostHeaderBytes) break;
  }
  refuse(path,
         "the PLY header has no \"end_header\" line in its first {} bytes; the file is truncated "
         "or in another format, export it again",
         text.size());
}

// Elements lie one behind the other, so where one begins follows from the sizes of those before it.
// An element with a list behind the wanted one is fine, one before it hides where that begins.
std::uint64_t ply_rows_at(const PlyHeader& header, std::uint64_t file_bytes,
                          const std::string& path, std::string_view wanted) {
  // Elements of no rows have a place, too; 0 stands for "not met yet", since a header is never
  // empty.
  std::uint64_t at = header.bytes, begin = 0;
  bool exact = true;
  for (const PlyElement& element : header.elements) {
    if (element.name == wanted) begin = at;
    if (element.has_list) {
      if (begin == 0) {
        refuse(path,
               "the element \"{}\" before the Gaussians has rows of variable size; export the file "
               "without it",
               shown(element.name));
      }
      exact = false;  // rows of any size follow; the Gaussians are all there
      break;
    }
    at = saturated(element.count, element.row_bytes, at);
    if (at > file_bytes) {
      const std::uint64_t whole =
          begin == 0 || element.row_bytes == 0 ? 0 : (file_bytes - begin) / element.row_bytes;
      if (element.name == "vertex") {
        refuse(path,
               "truncated: the header states {} Gaussians of {} bytes, but the file ends at byte "
               "{} after {} of them; copy or export it again",
               element.count, element.row_bytes, file_bytes, whole);
      }
      refuse(
          path,
          "truncated: the file ends at byte {} inside its element \"{}\"; copy or export it again",
          file_bytes, shown(element.name));
    }
  }
  // Bytes too many are as bad as too few: every row would be read from a wrong place.
  if (exact && at != file_bytes) {
    refuse(path,
           "the header states {} bytes, but the file has {}; header and data do not match, export "
           "it again",
           at, file_bytes);
  }
  return begin;
}

}  // namespace pounce::io
