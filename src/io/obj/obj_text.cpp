// SPDX-License-Identifier: Apache-2.0
//
// OBJ and MTL as text: statements and words; and the statements of an OBJ counted.
//
// Files of this kind are written by hand, by scripts and by thirty years of programs, so lines may
// end in any of three ways, be joined by a backslash and be of any length. ObjText gives them out
// one by one, in memory that a limit per line bounds.
//
// What a mesh will take is found by counting its statements (obj_cost()), in a pass of its own that
// sees exactly the statements that reading will see. Exact counts of different things would need
// the memory that is to be foretold: a corner may be named by any number of faces, a group by any
// number of statements. So these are estimated from hashes in 16 KiB each and rounded up by 5 %,
// which is six standard errors. The order of a bound is: what the mesh keeps, then the lists of the
// file, the tables that find equal corners, and what smoothing normals needs where some are
// missing.
//
// An OBJ library was here first. It read "nan" and missing numbers as 0 without a word, and its
// memory could not be foretold, so the statements were split here before it saw them anyway
// (docs/decisions/021).
#include "io/obj/obj_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <mutex>
#include <span>
#include <utility>

#include "core/input_file.h"
#include "io/obj/materials.h"
#include "io/problems.h"
#include "io/read_mesh.h"

namespace pounce::io {
namespace {

constexpr std::size_t kPieceBytes = 256 << 10;
// A face of a million corners fits into 16 MiB; an MTL has nothing of that kind.
constexpr std::size_t kMaxObjLineBytes = 16 << 20, kMaxMtlLineBytes = 1 << 20;

/// Of the names of material files, used or not, until there are too many.
constexpr std::size_t kMaxLibraryBytes = 4 << 20;
constexpr std::size_t kBytesPerLibrary = 64;
/// In the mesh, and the tables that find it.
constexpr std::uint64_t kMeshBytesPerMaterial = sizeof(mesh::Material) + 1024;
/// Of an image: the heads of its texts, and what a problem says beside the model's name.
constexpr std::uint64_t kBytesPerImage = 128;
/// Of the face at hand: its corners while their list grows, their vertices, the triangles.
constexpr std::uint64_t kBytesPerFaceCorner = 60;

/// Counts different keys in 16 KiB: each hash goes to one of 2^14 registers, which keep the longest
/// run of leading zeros they met; their harmonic mean tells the count (HyperLogLog, with linear
/// counting for few keys).
class DistinctCounter {
 public:
  void add(std::uint64_t key) {
    // Mixed well first: the registers judge by the highest bits.
    key = (key ^ (key >> 31)) * 0x9E3779B97F4A7C15ULL;
    key = (key ^ (key >> 29)) * 0xBF58476D1CE4E5B9ULL;
    key ^= key >> 32;
    auto& slot = registers_[key >> (64 - kBits)];
    const int run = std::countl_zero((key << kBits) | 1) + 1;
    slot = std::max(slot, static_cast<std::uint8_t>(run));
  }
  // The standard formula and its constant for many registers; with few keys, empty registers tell
  // more.
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
    std::string_view rest = statement;
    const std::string_view word = next_word(rest);
    if (word == "v") {
      ++counts_.positions;
      counts_.has_colours = counts_.has_colours || word_count(rest) >= kColouredVertexWords;
    }
    if (word == "vt") ++counts_.texcoords;
    if (word == "vn") ++counts_.normals;
    if (word == "f") add_face(rest);
    if (word == "mtllib") add_libraries(rest);
    if (word == "o" || word == "g") {
      ++counts_.names;
      counts_.name_bytes += line_bytes;
      (word == "o" ? object_ : group_) = hash_of(rest) + 1;
      part_counted_ = false;
      if (word == "g") counts_.most_groups = std::max(counts_.most_groups, word_count(rest));
    } else if (word == "usemtl") {
      ++counts_.uses;
      counts_.use_bytes += line_bytes;
      material_ = hash_of(rest);
      material_counted_ = false;
    } else {
      return;
    }
    counts_.longest_name_bytes = std::max(counts_.longest_name_bytes, line_bytes);
  }
  /// What the names of material files take that were met so far.
  std::uint64_t library_bytes() const { return library_bytes_; }
  ObjCounts finish(std::uint64_t longest_line_bytes) {
    counts_.longest_line_bytes = longest_line_bytes;
    const auto rounded_up = static_cast<std::uint64_t>(distinct_.count() * 1.05) + 16;
    counts_.distinct_corners = std::min(counts_.corners, rounded_up);
    const auto parts = static_cast<std::uint64_t>(parts_.count() * 1.05) + 16;
    counts_.distinct_parts = std::min(counts_.names + 1, parts);
    const auto materials = static_cast<std::uint64_t>(materials_.count() * 1.05) + 16;
    counts_.distinct_materials = std::min(counts_.uses + 1, materials);
    return std::move(counts_);
  }

 private:
  // Only for estimates: two names with one hash count as one, which the 5 % cover.
  static std::uint64_t hash_of(std::string_view text) {
    std::uint64_t hash = 0;
    for (const char c : text) hash = (hash + static_cast<unsigned char>(c)) * 0x100000001B3ULL;
    return hash * 0xD6E8FEB86659FD93ULL;
  }
  /// A word of a face.
  struct CornerWord {
    std::size_t slashes = 0;
    bool is_relative = false;
  };
  // Of the text, not of the numbers: "1/1" and "01/1" count as two, which errs upwards.
  std::uint64_t corner_hash(std::string_view text, CornerWord corner) const {
    std::uint64_t hash = text.size();
    const auto mix = [&](std::uint64_t letters) {
      hash = (hash ^ letters) * 0xD6E8FEB86659FD93ULL;
      hash ^= hash >> 32;
    };
    for (; text.size() >= sizeof(std::uint64_t); text.remove_prefix(sizeof(std::uint64_t))) {
      std::uint64_t letters = 0;
      std::memcpy(&letters, text.data(), sizeof letters);
      mix(letters);
    }
    std::uint64_t letters = 0;
    for (std::size_t i = 0; i < text.size(); ++i)
      letters |= std::uint64_t{static_cast<unsigned char>(text[i])} << (8 * i);
    if (!text.empty()) mix(letters);
    // The mix of the three counts stands for what a negative index would lead to: it means
    // something else after each new vertex.
    if (corner.is_relative)
      hash += (counts_.positions * 31 + counts_.texcoords) * 31 + counts_.normals;
    return hash;
  }

  void add_face(std::string_view rest) {
    ++counts_.faces;
    std::uint64_t corners = 0;
    const char* at = rest.data();
    const char* const end = at + rest.size();
    // Letter by letter, once: half of a file's bytes are here.
    for (;;) {
      while (at != end && is_blank(*at)) ++at;
      if (at == end) break;
      const char* const first = at;
      CornerWord corner;
      for (; at != end && !is_blank(*at); ++at) {
        corner.slashes += *at == '/' ? 1 : 0;
        corner.is_relative = corner.is_relative || *at == '-';
      }
      ++corners;
      distinct_.add(corner_hash({first, static_cast<std::size_t>(at - first)}, corner));
      if (corner.slashes < 2 || at[-1] == '/') counts_.lacks_normals = true;
    }
    counts_.corners += corners;
    counts_.triangles += corners > 2 ? corners - 2 : 0;
    counts_.most_corners = std::max(counts_.most_corners, corners);
    if (!material_counted_) materials_.add(material_);
    if (!part_counted_) parts_.add(object_ * 31 + group_);
    material_counted_ = part_counted_ = true;
  }

  void add_libraries(std::string_view rest) {
    if (rest.size() > kMaxNameBytes) return;  // reading refuses it
    for (std::string& name : library_names(name_in(rest))) {
      const std::size_t name_bytes = name.size();
      if (counts_.libraries.insert(std::move(name)).second)
        library_bytes_ += name_bytes + kBytesPerLibrary;
    }
  }

  ObjCounts counts_;
  DistinctCounter distinct_, parts_, materials_;
  std::uint64_t object_ = 0, group_ = 0;  ///< hashes of the names in use
  std::uint64_t material_ = 0;            ///< hash of the one in use
  bool part_counted_ = false, material_counted_ = false;
  std::uint64_t library_bytes_ = 0;
};

/// What its material files need, and what the mesh keeps of them: the images of its materials.
struct LibraryCost {
  std::uint64_t reading_bytes = 0, kept_bytes = 0;
};

LibraryCost library_cost(const std::string& path, const MeshReading& reading,
                         const ObjCounts& counts) {
  const AssetFolder folder(path, reading.allow_external);
  std::set<std::string> files;
  for (const std::string& name : counts.libraries) {
    if (const auto file = material_library(path, folder, name)) files.insert(*file);
  }
  LibraryCost cost;
  MtlSize all;
  std::uint64_t folder_bytes = 0;
  for (const std::string& file : files) {
    try {
      const MtlSize size = mtl_size(file);
      all.bytes += size.bytes;
      all.longest_line_bytes = std::max(all.longest_line_bytes, size.longest_line_bytes);
      all.textures += size.textures;
      all.texture_bytes += size.texture_bytes;
      all.longest_texture_bytes = std::max(all.longest_texture_bytes, size.longest_texture_bytes);
      folder_bytes = std::max<std::uint64_t>(folder_bytes, file.size());
    } catch (const Error&) {
      // Reading it says what is wrong.
    }
  }
  const std::uint64_t images = std::min(all.textures, counts.distinct_materials * kMaxMtlTextures);
  const std::uint64_t names = std::min(all.texture_bytes, images * all.longest_texture_bytes);
  // Path, label and, of one that is not there, a problem that names the model.
  cost.kept_bytes =
      images * (sizeof(mesh::ImageRef) + 2 * folder_bytes + path.size() + kBytesPerImage) +
      2 * names;
  // The list of images while it grows, and the table that finds them by path; the line at hand.
  cost.reading_bytes = all.bytes + 4 * all.longest_line_bytes +
                       images * (2 * sizeof(mesh::ImageRef) + folder_bytes + kBytesPerImage) +
                       names;
  return cost;
}

}  // namespace

ObjText::ObjText(const std::string& path, Kind kind)
    : path_(path), kind_(kind), file_(open_input(path)) {}

void ObjText::fail(const std::string& what) const {
  refuse(path_, "line {}: {}; repair the line or export the model again", line_, what);
}

bool ObjText::next_piece() {
  const std::uint64_t left = file_->size_bytes() - offset_;
  if (left == 0) return false;
  const std::size_t bytes = std::min<std::uint64_t>(left, kPieceBytes);
  if (room_.empty()) room_ = UnsetBytes(bytes);
  file_->read(offset_, std::span<std::byte>(room_).first(bytes));
  piece_ = {reinterpret_cast<const char*>(room_.data()), bytes};
  constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
  has_cr_ = piece_.find('\r') != std::string_view::npos;
  at_ = offset_ == 0 && piece_.starts_with(kByteOrderMark) ? kByteOrderMark.size() : 0;
  next_lf_ = std::min(piece_.find('\n', at_), piece_.size());
  offset_ += piece_.size();
  return true;
}

// A statement that is a line of the piece at hand, which ends with LF: nearly all of them. False:
// append_line() is to take it.
bool ObjText::take_line(std::string_view& out) {
  if (after_cr_ || at_ >= piece_.size()) return false;
  const std::size_t end = piece_.find('\n', at_);
  if (end == std::string_view::npos) return false;
  std::string_view line = piece_.substr(at_, end - at_);
  if (has_cr_) {
    if (line.ends_with('\r')) line.remove_suffix(1);
    if (line.find('\r') != std::string_view::npos) return false;
  }
  const std::size_t bytes = line.size();
  while (!line.empty() && is_blank(line.back())) line.remove_suffix(1);
  if (line.ends_with('\\')) return false;
  longest_bytes_ = std::max<std::uint64_t>(longest_bytes_, bytes);
  at_ = end + 1;
  ++lines_ended_;
  out = line;
  return true;
}

// One line without its end, added to what there is of the statement. Lines are counted as an editor
// counts them, whatever ends them, so that messages name the right one.
bool ObjText::append_line() {
  std::string& out = statement_;
  const std::size_t most_bytes = kind_ == Kind::obj ? kMaxObjLineBytes : kMaxMtlLineBytes;
  bool any = false;
  for (bool ended = false; !ended && (at_ < piece_.size() || next_piece());) {
    // CR LF is one end, and the piece may end between the two.
    if (std::exchange(after_cr_, false) && piece_[at_] == '\n') {
      ++at_;
      continue;
    }
    any = true;
    // Searched for once: where lines end with CR alone, the next LF may be far.
    if (next_lf_ < at_) next_lf_ = std::min(piece_.find('\n', at_), piece_.size());
    const std::string_view line = piece_.substr(at_, next_lf_ - at_);
    const std::size_t size = std::min(line.find('\r'), line.size());
    if (out.size() + size > most_bytes) {
      line_ = lines_ended_ + 1;
      fail(fmt::format("longer than {} MiB; this is not a text file of this format",
                       most_bytes >> 20));
    }
    out.append(line, 0, size);
    at_ += size;
    ended = at_ < piece_.size();
    if (ended) {
      ++lines_ended_;
      after_cr_ = piece_[at_++] == '\r';
    }
  }
  longest_bytes_ = std::max<std::uint64_t>(longest_bytes_, out.size());
  while (!out.empty() && is_blank(out.back())) out.pop_back();
  return any;
}

bool ObjText::next(std::string_view& out) {
  line_ = lines_ended_ + 1;
  if (take_line(out)) return true;
  std::string& text = statement_;
  text.clear();
  if (!append_line()) return false;
  // A comment that ends in a backslash is a comment: whoever wrote it did not mean the next line.
  // Statements of an MTL are not continued.
  const bool may_go_on =
      kind_ == Kind::obj && text[std::min(text.find_first_not_of(" \t"), text.size())] != '#';
  while (may_go_on && !text.empty() && text.back() == '\\') {
    text.back() = ' ';
    if (!append_line()) break;
  }
  out = text;
  return true;
}

std::size_t word_count(std::string_view rest) {
  std::size_t words = 0;
  while (!next_word(rest).empty()) ++words;
  return words;
}

// One blank ends the keyword, and what follows is the name, blanks and all. A zero byte ends it, as
// it would in a C program.
std::string name_in(std::string_view rest) {
  rest = rest.substr(0, rest.find('\0'));
  return std::string(rest.substr(std::min<std::size_t>(1, rest.size())));
}

namespace {

/// The files that were counted last: whoever asks what a mesh will take reads it next, and reserves
/// what was counted. Thread-safe.
class CountedFiles {
 public:
  std::optional<ObjCounts> find(const std::string& path, const FileStatus& status) {
    const std::lock_guard lock(mutex_);
    for (const Counted& file : files_) {
      if (file.path == path && is_unchanged(file.status, status)) return file.counts;
    }
    return std::nullopt;
  }
  void add(const std::string& path, const FileStatus& status, const ObjCounts& counts) {
    const std::lock_guard lock(mutex_);
    files_[next_++ % files_.size()] = {path, status, counts};
  }

 private:
  struct Counted {
    std::string path;
    FileStatus status;
    ObjCounts counts;
  };

  std::mutex mutex_;
  std::array<Counted, 4> files_;  ///< the one longest ago is replaced
  std::size_t next_ = 0;
};

// Bounds of names are checked while counting, so that this pass cannot take what it is to foretell.
ObjCounts counted(const std::string& path) {
  ObjText file(path, ObjText::Kind::obj);
  ObjCounter counter;
  for (std::string_view statement; file.next(statement);) {
    counter.add(statement);
    if (counter.library_bytes() > kMaxLibraryBytes) refuse_libraries(path);
  }
  return counter.finish(file.longest_bytes());
}

}  // namespace

// A file that is written to within a tick of its clock may be taken for the one that was counted:
// then a reader reserves too little or too much.
ObjCounts count_obj(const std::string& path) {
  static CountedFiles files;
  const auto before = posix_file_system().status(path);
  if (before) {
    if (auto counts = files.find(path, *before)) return *std::move(counts);
  }
  ObjCounts counts = counted(path);
  if (before) files.add(path, *before, counts);
  return counts;
}

MeshCost obj_cost(const std::string& path, const MeshReading& reading) {
  const ObjCounts counts = count_obj(path);
  const std::uint64_t triangles = counts.triangles;
  // Where normals are missing, every corner may become a vertex of its own.
  // Smoothing parts vertices whose triangles meet at a sharp angle: how many, only reading finds
  // out.
  const bool smooth = counts.lacks_normals;
  const std::uint64_t corner_keys = counts.distinct_corners;
  const std::uint64_t vertices = smooth ? counts.corners : corner_keys;
  const bool with_colours = reading.vertex_colours && counts.has_colours;
  const std::uint64_t per_vertex =
      12 + 12 + 16 + (counts.texcoords > 0 ? 8 + 1 : 0) + (with_colours ? 16 : 0);
  MeshCost cost;
  // Names, what points at them, and while reading the tables that find them again.
  const std::uint64_t name_bytes =
      std::min(counts.name_bytes, 2 * counts.distinct_parts * counts.longest_name_bytes);
  const std::uint64_t runs = std::min(counts.names, counts.faces) * sizeof(mesh::Parts::Run);
  const std::uint64_t part_groups =
      counts.distinct_parts * (1 + std::min<std::uint64_t>(counts.most_groups, kMaxGroups)) * 4;
  const std::uint64_t materials = std::min<std::uint64_t>(counts.distinct_materials, kMaxMaterials);
  const std::uint64_t material_name_bytes =
      std::min(counts.use_bytes, materials * counts.longest_name_bytes);
  const LibraryCost libraries = library_cost(path, reading, counts);
  cost.kept_bytes = vertices * per_vertex + triangles * 16 + runs + counts.distinct_parts * 128 +
                    part_groups + materials * kMeshBytesPerMaterial + material_name_bytes +
                    libraries.kept_bytes + name_bytes * 8 + (1U << 20);
  const std::uint64_t lists =
      counts.positions * (with_colours ? 28 : 12) + counts.texcoords * 8 + counts.normals * 12;
  // Keys and links; slots, which only corners of crowded positions have, while they double: one and
  // a half times what is in use.
  const std::uint64_t corner_set = corner_keys * (12 + 4 + 6 * 4) + counts.positions * 4;
  // Smoothing: triangles by position, renumbered triangles, copies, and the arrays while they grow.
  const std::uint64_t smoothing = smooth ? counts.positions * 8 + triangles * (12 + 12) +
                                               corner_keys * (8 + per_vertex) +
                                               (vertices - corner_keys) * (3 * 16 + 3 * 4)
                                         : 0;
  const std::uint64_t part_tables =
      counts.distinct_parts * 280 + part_groups + name_bytes * 32 + runs;
  // The set of corners is gone when smoothing begins, so only the larger of the two counts.
  cost.peak_bytes = cost.kept_bytes + part_tables + lists + std::max(corner_set, smoothing) +
                    libraries.reading_bytes + 3 * material_name_bytes +
                    counts.most_corners * kBytesPerFaceCorner + 3 * counts.longest_line_bytes +
                    (4U << 20);  // pieces of the files, names of material files
  return cost;
}

}  // namespace pounce::io
