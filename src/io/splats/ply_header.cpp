// SPDX-License-Identifier: Apache-2.0
//
// The header is read whole, then judged: what the file is (mesh, points, splats) tells its owner
// more than the first thing that is wrong with it.
#include "io/splats/ply_header.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <limits>
#include <optional>
#include <set>
#include <string_view>

#include "pounce/error.h"

namespace pounce::io {
namespace {

constexpr std::size_t kMostHeaderBytes = 1 << 20;
constexpr std::size_t kFirstRead = 16 << 10;  // degree 3 has 2 KiB
constexpr std::size_t kMostColumns = 4096;

struct Element {
  std::string name;
  std::uint64_t count = 0;
  std::uint64_t row_bytes = 0;  ///< without lists
  bool has_list = false;
  std::vector<PlyColumn> columns;
};

struct Header {
  std::string format;
  std::vector<Element> elements;
  std::uint64_t bytes = 0;
  store::SplatModel model = store::SplatModel::standard;

  const Element* find(std::string_view name) const {
    for (const Element& e : elements) {
      if (e.name == name) return &e;
    }
    return nullptr;
  }
};

std::optional<PlyType> type_of(std::string_view name) {
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

/// Cuts the next word off the front; empty at the end.
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

/// For messages: foreign bytes, made short and printable.
std::string shown(std::string_view text) {
  std::string result;
  for (const char c : text.substr(0, 60)) result += c >= ' ' && c <= '~' ? c : '?';
  return text.size() > 60 ? result + "..." : result;
}

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
        fail(fmt::format("says format version \"{}\", only 1.0 exists", shown(version)));
      }
    } else if (key == "comment" || key == "obj_info") {
      comment(rest);
    } else if (key == "element") {
      element(rest);
    } else if (key == "property") {
      property(rest);
    } else if (!key.empty()) {
      fail(fmt::format("says \"{}\", which is no PLY", shown(text)));
    }
    return false;
  }
  Header& header() { return header_; }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw Error(ErrorKind::input, fmt::format("{}: line {} of the header {}; export the file again",
                                              path_, number_, what));
  }

  /// How the scene was trained; the last one counts.
  void comment(std::string_view rest) {
    std::string key = lower(word(rest));
    if (!key.empty() && key.back() == ':') key.pop_back();
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

  void element(std::string_view rest) {
    Element element;
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

  void property(std::string_view rest) {
    if (header_.elements.empty()) fail("has a property before any element");
    Element& element = header_.elements.back();
    const std::string_view type_name = word(rest);
    if (type_name == "list") {
      const auto length = type_of(word(rest)), item = type_of(word(rest));
      if (!length || !item || word(rest).empty()) fail("has a list without types and name");
      element.has_list = true;
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
      element.row_bytes += ply_type_bytes(*type);
      element.columns.push_back(std::move(column));
    }
    if (element.columns.size() > kMostColumns) fail("has too many columns");
  }

  const std::string& path_;
  Header header_;
  std::set<std::string> names_;  ///< columns of the last element
  std::size_t number_ = 0;
};

Header parse(const ReadFile& file, const std::string& path) {
  HeaderParser parser(path);
  std::string text;
  std::size_t at = 0;
  for (std::size_t wanted = kFirstRead;; wanted = kMostHeaderBytes) {
    const std::size_t have = text.size();
    text.resize(std::min<std::uint64_t>(wanted, file.size_bytes()));
    file.read(have, std::as_writable_bytes(std::span(text)).subspan(have));
    for (std::size_t end; (end = text.find('\n', at)) != std::string::npos;) {
      const bool done = parser.line(std::string_view(text).substr(at, end - at));
      at = end + 1;
      if (!done) continue;
      parser.header().bytes = at;
      return std::move(parser.header());
    }
    if (text.size() == file.size_bytes() || wanted == kMostHeaderBytes) break;
  }
  throw Error(
      ErrorKind::input,
      fmt::format("{}: the PLY header has no \"end_header\" line in its first {} bytes; the "
                  "file was cut off or is something else, export it again",
                  path, text.size()));
}

const PlyColumn* find_column(const std::vector<PlyColumn>& columns, std::string_view name) {
  for (const PlyColumn& column : columns) {
    if (column.name == name) return &column;
  }
  return nullptr;
}

constexpr const char* kWanted =
    "pounce reads the binary little-endian 3DGS PLY that trainers write (x y z, f_dc_0..2, "
    "opacity, "
    "scale_0..2, rot_0..3)";

/// Two bytes are half floats where they are unsigned; signed ones are somebody's own quantisation.
void check_types(const std::vector<PlyColumn>& columns, const std::string& path) {
  for (const PlyColumn& column : columns) {
    if (!is_splat_column(column.name) || column.type != PlyType::i16) continue;
    throw Error(ErrorKind::input,
                fmt::format("{}: its column \"{}\" is of type short (int16), whose scale no splat "
                            "PLY says; export it as float, or as half floats in ushort",
                            path, shown(column.name)));
  }
}

void check_encoding(const Header& header, const std::string& path) {
  const auto fail = [&](const std::string& what) {
    throw Error(ErrorKind::input, path + ": " + what);
  };
  if (header.format == "ascii") {
    fail(fmt::format("an ASCII PLY; {}: export it as binary", kWanted));
  }
  if (header.format == "binary_big_endian") {
    fail(fmt::format("a big-endian PLY; {}: export it as little endian", kWanted));
  }
  if (header.format != "binary_little_endian") {
    fail(fmt::format("its format is \"{}\"; {}", shown(header.format), kWanted));
  }
}

/// What the file is, where it is not what we read.
void check_kind(const Header& header, const std::string& path) {
  const auto fail = [&](const std::string& what) {
    throw Error(ErrorKind::input, path + ": " + what);
  };
  const Element* vertex = header.find("vertex");
  if (vertex == nullptr) {
    fail(fmt::format("the PLY has no element \"vertex\"; {}", kWanted));
  }
  const auto has = [&](const char* name) { return find_column(vertex->columns, name) != nullptr; };
  if (!has("f_dc_0")) {
    for (const char* name : {"face", "tristrips"}) {
      if (const Element* e = header.find(name); e != nullptr && e->count > 0) {
        fail(
            fmt::format("a mesh ({} vertices, {} {} rows), not a splat scene; a PLY is read as "
                        "splats only, convert a mesh to .glb, .gltf or .obj",
                        vertex->count, e->count, name));
      }
    }
    if (!has("scale_0") && !has("rot_0")) {
      fail(fmt::format("a point cloud ({} points without f_dc_0, scale_0, rot_0), not splats; {}",
                       vertex->count, kWanted));
    }
  }
  for (const char* name : {"x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0",
                           "scale_1", "rot_0", "rot_1", "rot_2", "rot_3"}) {
    if (!has(name)) fail(fmt::format("the splat PLY has no column \"{}\"; {}", name, kWanted));
  }
  if (vertex->has_list) {
    fail(fmt::format("its vertices have a list property, which no splat scene has; {}", kWanted));
  }
  check_encoding(header, path);
  if (vertex->count == 0) fail("the splat PLY holds no Gaussians (element vertex 0)");
}

/// a * b + c, or the largest number there is.
std::uint64_t saturated(std::uint64_t a, std::uint64_t b, std::uint64_t c) {
  constexpr std::uint64_t kMost = std::numeric_limits<std::uint64_t>::max();
  if (b != 0 && a > (kMost - c) / b) return kMost;
  return a * b + c;
}

/// Where an element begins, once the file is known to have as many bytes as it says.
std::uint64_t rows_at(const Header& header, std::uint64_t file_bytes, const std::string& path,
                      std::string_view wanted = "vertex") {
  std::uint64_t at = header.bytes, begin = 0;
  bool exact = true;
  for (const Element& element : header.elements) {
    const bool is_vertex = element.name == "vertex";
    if (element.name == wanted) begin = at;
    if (element.has_list) {
      if (begin == 0) {
        throw Error(ErrorKind::input,
                    fmt::format("{}: the element \"{}\" before the Gaussians has rows of no fixed "
                                "size; export the file without it",
                                path, shown(element.name)));
      }
      exact = false;  // rows of any size follow; the Gaussians are all there
      break;
    }
    at = saturated(element.count, element.row_bytes, at);
    if (at > file_bytes) {
      const std::uint64_t whole =
          begin == 0 || element.row_bytes == 0 ? 0 : (file_bytes - begin) / element.row_bytes;
      throw Error(
          ErrorKind::input,
          is_vertex
              ? fmt::format("{}: cut off: the header announces {} Gaussians of {} bytes, the file "
                            "ends at byte {} after {} of them; copy or export it again",
                            path, element.count, element.row_bytes, file_bytes, whole)
              : fmt::format("{}: cut off: the file ends at byte {} inside its element \"{}\"; copy "
                            "or export it again",
                            path, file_bytes, shown(element.name)));
    }
  }
  if (exact && at != file_bytes) {
    throw Error(ErrorKind::input,
                fmt::format("{}: the header announces {} bytes, the file has {}; header and data "
                            "do not belong together, export it again",
                            path, at, file_bytes));
  }
  return begin;
}

std::uint32_t sh_degree(const std::vector<PlyColumn>& columns, const std::string& path) {
  const auto rest = static_cast<std::uint32_t>(
      std::count_if(columns.begin(), columns.end(),
                    [](const PlyColumn& c) { return c.name.starts_with("f_rest_"); }));
  constexpr std::array<std::uint32_t, 5> kColumns{0, 9, 24, 45, 72};
  const auto found = std::find(kColumns.begin(), kColumns.end(), rest);
  if (found == kColumns.end()) {
    throw Error(
        ErrorKind::input,
        fmt::format("{}: {} f_rest columns are no whole degree of spherical harmonics (0, 9, "
                    "24, 45 or 72 are); export it again",
                    path, rest));
  }
  return static_cast<std::uint32_t>(found - kColumns.begin());
}

}  // namespace

std::uint32_t ply_type_bytes(PlyType type) {
  switch (type) {
    case PlyType::i8:
    case PlyType::u8:
      return 1;
    case PlyType::i16:
    case PlyType::u16:
      return 2;
    case PlyType::i32:
    case PlyType::u32:
    case PlyType::f32:
      return 4;
    case PlyType::f64:
      break;
  }
  return 8;
}

const PlyColumn* SplatPlyHeader::find(const std::string& name) const {
  return find_column(columns, name);
}

bool is_splat_column(std::string_view name) {
  constexpr std::array<std::string_view, 14> kSplatColumns{
      "x",     "y",     "z",     "opacity", "scale_0", "scale_1", "scale_2",
      "rot_0", "rot_1", "rot_2", "rot_3",   "nx",      "ny",      "nz"};
  return name.starts_with("f_dc_") || name.starts_with("f_rest_") ||
         std::find(kSplatColumns.begin(), kSplatColumns.end(), name) != kSplatColumns.end();
}

bool is_ply(const ReadFile& file) {
  std::array<char, 4> start{};
  if (file.size_bytes() < start.size()) return false;
  file.read(0, std::as_writable_bytes(std::span(start)));
  const std::string_view begins(start.data(), start.size());
  return begins == "ply\n" || begins == "ply\r" || begins == "ply ";
}

bool holds_splats(const ReadFile& file, const std::string& path) {
  try {
    const Header header = parse(file, path);
    const Element* vertex = header.find("vertex");
    return vertex != nullptr && (find_column(vertex->columns, "f_dc_0") != nullptr ||
                                 find_column(vertex->columns, "packed_position") != nullptr);
  } catch (const Error& e) {
    if (e.kind() != ErrorKind::input) throw;
    return false;
  }
}

SplatPlyHeader read_splat_ply_header(const ReadFile& file, const std::string& path) {
  if (file.size_bytes() == 0) {
    throw Error(ErrorKind::input, path + ": the file is empty; export it again");
  }
  if (!is_ply(file)) {
    throw Error(ErrorKind::input,
                fmt::format("{}: does not begin like a PLY file; {}", path, kWanted));
  }
  const Header header = parse(file, path);
  check_kind(header, path);
  const Element& vertex = *header.find("vertex");
  SplatPlyHeader result;
  result.rows_at = rows_at(header, file.size_bytes(), path);
  result.splats = vertex.count;
  result.row_bytes = static_cast<std::uint32_t>(vertex.row_bytes);
  check_types(vertex.columns, path);
  result.columns = vertex.columns;
  result.sh_degree = sh_degree(vertex.columns, path);
  result.model = header.model;
  return result;
}

bool is_compressed_ply(const ReadFile& file, const std::string& path) {
  try {
    const Header header = parse(file, path);
    const Element* vertex = header.find("vertex");
    return vertex != nullptr && find_column(vertex->columns, "packed_position") != nullptr;
  } catch (const Error& e) {
    if (e.kind() != ErrorKind::input) throw;
    return false;
  }
}

CompressedPlyHeader read_compressed_ply_header(const ReadFile& file, const std::string& path) {
  const Header header = parse(file, path);
  const auto fail = [&](const std::string& what) {
    throw Error(ErrorKind::input,
                fmt::format("{}: the compressed PLY {}; export it again", path, what));
  };
  const auto element = [&](const char* name) {
    const Element* found = header.find(name);
    if (found == nullptr) fail(fmt::format("has no element \"{}\"", name));
    if (found->has_list) fail(fmt::format("has a list in its element \"{}\"", name));
    return found;
  };
  const auto column = [&](const Element& of, const std::string& name, PlyType type) {
    const PlyColumn* found = find_column(of.columns, name);
    if (found == nullptr) fail(fmt::format("has no column \"{}\"", name));
    if (found->type != type) fail(fmt::format("has a column \"{}\" of an unknown type", name));
    return found->offset;
  };
  check_encoding(header, path);
  const Element &chunk = *element("chunk"), &vertex = *element("vertex");
  CompressedPlyHeader result;
  result.splats = vertex.count;
  if (vertex.count == 0) fail("holds no Gaussians (element vertex 0)");
  result.model = header.model;
  result.rows_at = rows_at(header, file.size_bytes(), path);
  result.chunks_at = rows_at(header, file.size_bytes(), path, "chunk");
  result.row_bytes = static_cast<std::uint32_t>(vertex.row_bytes);
  result.chunk_bytes = static_cast<std::uint32_t>(chunk.row_bytes);
  if (const std::uint64_t chunks = (vertex.count - 1) / 256 + 1; chunk.count < chunks) {
    fail(fmt::format("has {} chunks of 256, its {} Gaussians need {}", chunk.count, vertex.count,
                     chunks));
  }
  constexpr std::array<const char*, kCompressedBounds> kBounds{
      "min_x",       "min_y",       "min_z",       "max_x",       "max_y",       "max_z",
      "min_scale_x", "min_scale_y", "min_scale_z", "max_scale_x", "max_scale_y", "max_scale_z",
      "min_r",       "min_g",       "min_b",       "max_r",       "max_g",       "max_b"};
  const bool has_colours = find_column(chunk.columns, "min_r") != nullptr;
  for (std::size_t k = 0; k < (has_colours ? kBounds.size() : 12); ++k)
    result.bounds[k] = column(chunk, kBounds[k], PlyType::f32);
  constexpr std::array<const char*, 4> kPacked{"packed_position", "packed_rotation", "packed_scale",
                                               "packed_color"};
  for (std::size_t k = 0; k < kPacked.size(); ++k)
    result.packed[k] = column(vertex, kPacked[k], PlyType::u32);
  if (const Element* harmonics = header.find("sh")) {
    element("sh");
    if (harmonics->count != vertex.count) {
      fail(
          fmt::format("has {} rows of harmonics for {} Gaussians", harmonics->count, vertex.count));
    }
    result.sh_degree = sh_degree(harmonics->columns, path);
    result.harmonics = static_cast<std::uint32_t>(harmonics->row_bytes);
    result.harmonics_at = rows_at(header, file.size_bytes(), path, "sh");
    if (harmonics->columns.size() != result.harmonics || result.harmonics > 45)
      fail("has harmonics that are not bytes, or other columns among them");
    for (std::uint32_t k = 0; k < result.harmonics; ++k) {
      if (column(*harmonics, fmt::format("f_rest_{}", k), PlyType::u8) != k)
        fail("has harmonics in an unknown order");
    }
  }
  return result;
}

}  // namespace pounce::io
