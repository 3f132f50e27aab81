// SPDX-License-Identifier: Apache-2.0
//
// Rows of a PLY mesh. A header (io/ply/ply_header.h) names the columns of each element; here
// they get their meanings, by the names that programs give them:
//
//   vertex   x y z, nx ny nz, u v (s t, texture_u texture_v, texture_s texture_t),
//            red green blue alpha (diffuse_red, ...)
//   face     vertex_indices (vertex_index), texcoord (u v of each corner), texnumber
//
// All else is passed over. A row of an element with a list has no fixed size, so a file is walked
// from front to back, twice: first to count, so that the mesh is reserved at its final size.
//
// What a header announces is compared with the bytes of the file before anything is made by it: a
// row has a byte for each of its columns at least. The same goes for the length of a list.
#include "io/ply/rows.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <string_view>
#include <utility>

#include "core/input_file.h"
#include "io/obj/numbers.h"
#include "io/obj/obj_text.h"
#include "io/problems.h"

namespace pounce::io {
namespace {

enum FaceValue : int { kCorners, kTexcoords, kTexture };

constexpr std::array<std::uint32_t, 8> kTypeBytes{1, 1, 2, 2, 4, 4, 4, 8};
constexpr const char* kExport = "export it again";

bool is_whole(PlyType type) { return type < PlyType::f32; }
std::uint64_t bytes_of(PlyType type) { return kTypeBytes[static_cast<std::size_t>(type)]; }

template <class Stored>
double value_of(std::span<const std::byte> raw, bool is_swapped) {
  std::array<std::byte, sizeof(Stored)> bytes;
  std::copy(raw.begin(), raw.end(), bytes.begin());
  if (is_swapped) std::reverse(bytes.begin(), bytes.end());
  return static_cast<double>(std::bit_cast<Stored>(bytes));
}

double value_of(PlyType type, std::span<const std::byte> raw, bool is_swapped) {
  switch (type) {
    case PlyType::i8:
      return value_of<std::int8_t>(raw, is_swapped);
    case PlyType::u8:
      return value_of<std::uint8_t>(raw, is_swapped);
    case PlyType::i16:
      return value_of<std::int16_t>(raw, is_swapped);
    case PlyType::u16:
      return value_of<std::uint16_t>(raw, is_swapped);
    case PlyType::i32:
      return value_of<std::int32_t>(raw, is_swapped);
    case PlyType::u32:
      return value_of<std::uint32_t>(raw, is_swapped);
    case PlyType::f32:
      return value_of<float>(raw, is_swapped);
    case PlyType::f64:
      return value_of<double>(raw, is_swapped);
  }
  return 0;
}

}  // namespace

std::optional<PlyValue> ply_value(std::string_view column) {
  constexpr std::array<std::pair<std::string_view, PlyValue>, 25> kNames{{
      {"x", PlyValue::x},
      {"y", PlyValue::y},
      {"z", PlyValue::z},
      {"nx", PlyValue::nx},
      {"ny", PlyValue::ny},
      {"nz", PlyValue::nz},
      {"u", PlyValue::u},
      {"v", PlyValue::v},
      {"s", PlyValue::u},
      {"t", PlyValue::v},
      {"texture_u", PlyValue::u},
      {"texture_v", PlyValue::v},
      {"texture_s", PlyValue::u},
      {"texture_t", PlyValue::v},
      {"red", PlyValue::red},
      {"green", PlyValue::green},
      {"blue", PlyValue::blue},
      {"alpha", PlyValue::alpha},
      {"r", PlyValue::red},
      {"g", PlyValue::green},
      {"b", PlyValue::blue},
      {"diffuse_red", PlyValue::red},
      {"diffuse_green", PlyValue::green},
      {"diffuse_blue", PlyValue::blue},
      {"diffuse_alpha", PlyValue::alpha},
  }};
  for (const auto& [text, value] : kNames) {
    if (text == column) return value;
  }
  return std::nullopt;
}

/// One pass over the file.
class PlyRows::Reader {
 public:
  explicit Reader(const PlyRows& rows)
      : rows_(rows),
        stream_(rows.path_, rows.header_.bytes, rows.header_.lines),
        is_text_(rows.header_.format == "ascii"),
        is_swapped_((rows.header_.format == "binary_big_endian") ==
                    (std::endian::native == std::endian::little)) {}

  template <class F>
  void vertices(const PlyElement& element, F on_vertex) {
    PlyVertex values{};
    for (row_ = 0; row_ < element.count; ++row_) {
      for (const Column& column : rows_.vertex_) {
        if (column.is_list) {
          skip_list(column);
        } else if (column.value < 0) {
          skip(column.type);
        } else {
          const auto place = static_cast<std::size_t>(column.value);
          values[place] = number(column.type, "vertex");
          if (place <= static_cast<std::size_t>(PlyValue::z) && rows_.content_ == PlyContent::mesh)
            require_finite(values[place], "vertex");
        }
      }
      on_vertex(values);
    }
  }

  template <class F>
  void faces(const PlyElement& element, std::uint64_t vertices, F on_face) {
    PlyFace face;
    for (row_ = 0; row_ < element.count; ++row_) {
      face.texture = 0;
      face.texcoords.clear();
      for (const Column& column : rows_.face_) {
        if (column.value == kCorners && column.is_list) {
          read_corners(column, vertices, face.corners);
        } else if (column.value == kTexcoords && column.is_list) {
          read_texcoords(column, face.texcoords);
        } else if (column.is_list) {
          skip_list(column);
        } else if (column.value == kTexture) {
          face.texture = whole(column.type, "a texture number");
        } else {
          skip(column.type);
        }
      }
      if (!face.texcoords.empty() && face.texcoords.size() != 2 * face.corners.size()) {
        fail(fmt::format("face {} has {} corners, but {} texture coordinates", row_,
                         face.corners.size(), face.texcoords.size()));
      }
      on_face(face);
    }
  }

  /// Passes over the rows of an element that nobody wants.
  void skip_rows(const PlyElement& element) {
    if (!is_text_ && !element.has_list) return stream_.skip(element.count * element.row_bytes);
    for (row_ = 0; row_ < element.count && !element.columns.empty(); ++row_) {
      std::size_t list = 0;
      for (const PlyColumn& column : element.columns) {
        if (!column.name.empty()) {
          skip(column.type);
        } else {
          const PlyList& found = element.lists.at(list++);
          skip_list({true, found.item, found.length, -1});
        }
      }
    }
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    if (is_text_) refuse(rows_.path_, "line {}: {}; {}", stream_.line(), what, kExport);
    refuse(rows_.path_, "{}; {}", what, kExport);
  }
  std::string_view word() {
    const std::string_view found = stream_.word();
    if (found.empty())
      refuse(rows_.path_, "truncated: it ends in line {}; copy or export it again", stream_.line());
    return found;
  }
  /// NaN for what is no number in a text.
  double number(PlyType type, const char*) {
    if (!is_text_) return value_of(type, stream_.bytes(bytes_of(type)), is_swapped_);
    const std::string_view text = word();
    const auto value = to_double(text);
    // Whoever asks for a number that must be one says where it is none. Of points any may be none,
    // but only if that is what is written.
    if (!value && rows_.content_ == PlyContent::points && !is_no_number(text))
      fail(fmt::format("\"{}\" is no number", shown(text)));
    return value.value_or(std::numeric_limits<double>::quiet_NaN());
  }
  /// nan, -inf, 1.#IND and the like.
  static bool is_no_number(std::string_view text) {
    if (text.find('#') != std::string_view::npos) return true;
    if (text.starts_with('-') || text.starts_with('+')) text.remove_prefix(1);
    return text.size() >= 3 &&
           (text[0] == 'n' || text[0] == 'N' || text[0] == 'i' || text[0] == 'I');
  }
  void skip(PlyType type) {
    if (is_text_) {
      word();
    } else {
      stream_.bytes(bytes_of(type));
    }
  }
  void require_finite(double value, const char* what) const {
    if (!std::isfinite(value)) fail(fmt::format("{} {} is not a finite number", what, row_));
  }
  std::int64_t whole(PlyType type, const char* what) {
    const double value = number(type, what);
    constexpr double kMost = 1e15;
    if (!(std::abs(value) <= kMost) || value != std::floor(value))
      fail(fmt::format("face {} has {} that is not a whole number", row_, what));
    return static_cast<std::int64_t>(value);
  }
  /// The length of a list, which the rest of the file has room for.
  std::uint64_t length(const Column& list) {
    const std::int64_t found = whole(list.length, "a list with a length");
    // In a text a number and a blank; at the end of the file there may be no blank.
    const std::uint64_t each = is_text_ ? 2 : bytes_of(list.type);
    if (found < 0 || static_cast<std::uint64_t>(found) > (stream_.left_bytes() + 1) / each) {
      fail(fmt::format("row {} has a list of {} entries, but only {} bytes follow", row_, found,
                       stream_.left_bytes()));
    }
    return static_cast<std::uint64_t>(found);
  }
  void skip_list(const Column& list) {
    const std::uint64_t count = length(list);
    if (!is_text_) return stream_.skip(count * bytes_of(list.type));
    for (std::uint64_t i = 0; i < count; ++i) word();
  }
  void read_corners(const Column& list, std::uint64_t vertices, std::vector<std::uint32_t>& out) {
    out.clear();
    for (std::uint64_t left = length(list); left > 0; --left) {
      const std::int64_t index = whole(list.type, "an index");
      if (index < 0 || static_cast<std::uint64_t>(index) >= vertices) {
        fail(fmt::format("face {} refers to vertex {}, but there are only {}, counted from 0", row_,
                         index, vertices));
      }
      out.push_back(static_cast<std::uint32_t>(index));
    }
  }
  void read_texcoords(const Column& list, std::vector<float>& out) {
    for (std::uint64_t left = length(list); left > 0; --left) {
      out.push_back(static_cast<float>(number(list.type, "face")));
      if (!std::isfinite(out.back()))
        fail(fmt::format("a texture coordinate of face {} is not a finite number", row_));
    }
  }

  const PlyRows& rows_;
  NumberStream stream_;
  bool is_text_, is_swapped_;
  std::uint64_t row_ = 0;
};

PlyRows::PlyRows(const std::string& path, PlyContent content) : path_(path), content_(content) {
  const auto file = open_input(path);
  header_ = read_ply_header(*file, path);
  if (header_.format != "ascii" && header_.format != "binary_little_endian" &&
      header_.format != "binary_big_endian") {
    refuse(path,
           "its format is \"{}\", but PLY has ascii, binary_little_endian and "
           "binary_big_endian; {}",
           shown(header_.format), kExport);
  }
  const PlyElement* vertex = header_.find("vertex");
  const PlyElement* face = header_.find("face");
  const bool wants_faces = content == PlyContent::mesh;
  if (vertex == nullptr || (wants_faces && face == nullptr))
    refuse(path, "the PLY has no vertices or no faces; export a mesh");
  if (wants_faces && vertex > face)
    refuse(path, "the PLY has its faces before its vertices; {}", kExport);
  if (vertex->count > std::numeric_limits<std::uint32_t>::max() - 1)
    refuse(path, "more than 4 billion vertices; split the model");
  columns_.fill(-1);
  find_vertex_columns(*vertex);
  if (wants_faces) find_face_columns(*face);
  check_sizes(file->size_bytes());
}

void PlyRows::find_vertex_columns(const PlyElement& vertex) {
  std::size_t list = 0;
  for (const PlyColumn& column : vertex.columns) {
    if (column.name.empty()) {
      vertex_.push_back({true, vertex.lists[list].item, vertex.lists[list].length, -1});
      ++list;
      continue;
    }
    const auto named = ply_value(column.name);
    int value = named ? static_cast<int>(*named) : -1;
    if (named) {
      int& taken = columns_[static_cast<std::size_t>(value)];
      // Of two spellings of one value the first counts.
      if (taken >= 0)
        value = -1;
      else
        taken = static_cast<int>(vertex_.size());
    }
    vertex_.push_back({false, column.type, PlyType::u8, value});
  }
  for (const PlyValue needed : {PlyValue::x, PlyValue::y, PlyValue::z}) {
    if (!has(needed)) refuse(path_, "the vertices of the PLY lack x, y or z; {}", kExport);
  }
}

void PlyRows::find_face_columns(const PlyElement& face) {
  const PlyList* const corners = ply_corners(face);
  const PlyList* const texcoords = find_list(face, {"texcoord"});
  if (corners == nullptr)
    refuse(path_, "the faces of the PLY have no list vertex_indices; {}", kExport);
  has_texcoords_ = texcoords != nullptr;
  std::size_t list = 0;
  for (const PlyColumn& column : face.columns) {
    if (!column.name.empty()) {
      face_.push_back(
          {false, column.type, PlyType::u8, column.name == "texnumber" ? kTexture : -1});
      continue;
    }
    const PlyList* const found = &face.lists[list++];
    const int value = found == corners ? kCorners : found == texcoords ? kTexcoords : -1;
    if (!is_whole(found->length) || (value == kCorners && !is_whole(found->item))) {
      refuse(path_, "its list \"{}\" counts or names vertices by fractions; {}", shown(found->name),
             kExport);
    }
    face_.push_back({true, found->item, found->length, value});
  }
}

/// A row takes what its numbers take, and a length for each list; in a text two bytes for each.
void PlyRows::check_sizes(std::uint64_t file_bytes) const {
  const bool is_text = header_.format == "ascii";
  // The last number of a text may end the file.
  std::uint64_t left = file_bytes - std::min(header_.bytes, file_bytes) + (is_text ? 1 : 0);
  for (const PlyElement& element : header_.elements) {
    std::uint64_t row = is_text ? 2 * element.columns.size() : element.row_bytes;
    for (const PlyList& list : element.lists) row += is_text ? 0 : bytes_of(list.length);
    if (row == 0) continue;
    if (element.count > left / row) {
      refuse(path_,
             "truncated: its header announces {} rows of the element \"{}\", but the file has room "
             "for {}; copy or export it again",
             element.count, shown(element.name), left / row);
    }
    left -= element.count * row;
  }
}

PlyType PlyRows::type(PlyValue value) const {
  const int column = columns_[static_cast<std::size_t>(value)];
  return column < 0 ? PlyType::f32 : vertex_[static_cast<std::size_t>(column)].type;
}

PlyCounts PlyRows::count() const {
  Reader reader(*this);
  PlyCounts counts;
  counts.vertices = header_.find("vertex")->count;
  for (const PlyElement& element : header_.elements) {
    if (element.name != "face") {
      reader.skip_rows(element);
      continue;
    }
    counts.faces = element.count;
    reader.faces(element, counts.vertices, [&](const PlyFace& face) {
      const std::uint64_t corners = face.corners.size();
      if (corners < 3) return;
      counts.corners += corners;
      counts.triangles += corners - 2;
      counts.most_corners = std::max(counts.most_corners, corners);
    });
    break;  // what follows is not read
  }
  return counts;
}

void PlyRows::read(const std::function<void(const PlyVertex&)>& on_vertex,
                   const std::function<void(const PlyFace&)>& on_face) const {
  Reader reader(*this);
  const std::uint64_t vertices = header_.find("vertex")->count;
  for (const PlyElement& element : header_.elements) {
    if (element.name == "vertex") {
      reader.vertices(element, on_vertex);
      if (content_ == PlyContent::points) break;
    } else if (element.name == "face" && content_ == PlyContent::mesh) {
      reader.faces(element, vertices, on_face);
      break;
    } else {
      reader.skip_rows(element);
    }
  }
}

}  // namespace pounce::io
