// SPDX-License-Identifier: Apache-2.0
//
// An output that is there already: is it whole, and which job made it?
//
// --skip-existing asks this of thousands of files before a job begins, so nothing is decoded and
// little is read. Every format says in its own way where it ends: PNG has a last chunk, JPEG a last
// marker, EXR and TIFF tell the places of all their pixels, GLB its length, and JSON closes what it
// opened. The job's hash is plain text near the start of a PNG, JPEG and EXR, in the first
// directory of a TIFF, and in the JSON of a model.
//
// The files may be anything: cut off, of another format, made to mislead. Reading beyond the end
// throws, loops have limits where a file could lead them in a circle, and every error means "no":
// then the output is made again, and whoever makes it says what is wrong.
//
// "Whole" means that a job was not interrupted while it wrote, no more: whether pixels are the
// right ones is what the job's hash answers. A file that was written by something else may be
// whole, and has no hash.
//
// A modification time alone would not do: a checkout renews it, and a copy may keep it. So the
// job's hash decides, and time only where a file has none (docs/decisions/029).
#include "io/files/finished_output.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <exception>
#include <filesystem>
#include <fstream>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <string_view>
#include <utility>
#include <vector>

#include "core/file.h"
#include "io/files/asset_file.h"
#include "pounce/version.h"

namespace pounce::io {
namespace {

using namespace std::string_view_literals;

constexpr std::string_view kExrMagic = "\x76\x2f\x31\x01"sv;

/// The numbers and texts of a file, read piece by piece. What lies beyond its end throws.
class Bytes {
 public:
  explicit Bytes(const ReadFile& file) : file_(&file) {}
  bool big_endian = false;

  std::uint64_t size() const { return file_->size_bytes(); }
  bool has(std::uint64_t at, std::uint64_t count) const {
    return at <= size() && count <= size() - at;
  }

  std::uint64_t number(std::uint64_t at, std::size_t size) {
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < size; ++i) {
      const std::size_t digit = big_endian ? size - 1 - i : i;
      value |= std::to_integer<std::uint64_t>(byte(at + i)) << 8 * digit;
    }
    return value;
  }
  /// Up to the next zero, which is not in it; no longer than any name is.
  std::string text(std::uint64_t at) {
    constexpr std::size_t kLongest = 256;
    std::string found;
    while (found.size() < kLongest && byte(at) != std::byte{})
      found += static_cast<char>(byte(at++));
    return found;
  }
  bool has_text(std::uint64_t at, std::string_view text) {
    return std::all_of(text.begin(), text.end(),
                       [&](char c) { return static_cast<char>(byte(at++)) == c; });
  }

 private:
  std::byte byte(std::uint64_t at) {
    // One piece at a time: numbers of one place are near each other, and places are far apart.
    if (at < begin_ || at >= begin_ + piece_.size()) {
      piece_.resize(static_cast<std::size_t>(
          std::clamp<std::uint64_t>(size() - std::min(at, size()), 1, kPieceBytes)));
      file_->read(at, piece_);
      begin_ = at;
    }
    return piece_[static_cast<std::size_t>(at - begin_)];
  }

  static constexpr std::uint64_t kPieceBytes = 4096;
  const ReadFile* file_;
  std::uint64_t begin_ = 0;
  std::vector<std::byte> piece_;  ///< of the file, from there
};

/// Chunks of (length, type, data, checksum), IEND the last.
bool is_whole_png(Bytes& file) {
  constexpr std::string_view kSignature = "\x89PNG\r\n\x1a\n"sv;
  file.big_endian = true;
  if (!file.has_text(0, kSignature) || !file.has_text(12, "IHDR")) return false;
  // Ends by itself: every chunk moves on by 12 bytes at least, and must lie within the file.
  for (std::uint64_t at = kSignature.size();;) {
    const std::uint64_t length = file.number(at, 4);
    if (!file.has(at, length + 12)) return false;
    if (file.has_text(at + 4, "IEND")) return true;
    at += length + 12;
  }
}

/// Segments of (marker, length, data) to the first scan; the last marker is near the end, where
/// some programs add something. Within scans no byte looks like it.
bool is_whole_jpeg(Bytes& file) {
  constexpr std::uint64_t kStart = 0xFFD8, kScan = 0xFFDA, kEnd = 0xFFD9, kTail = 64 << 10;
  file.big_endian = true;
  if (file.number(0, 2) != kStart) return false;
  std::uint64_t at = 2;
  while (file.number(at, 2) != kScan) {
    if (file.number(at, 1) != 0xFF) return false;
    const bool fills = file.number(at + 1, 1) == 0xFF;
    at += fills ? 1 : 2 + file.number(at + 2, 2);
  }
  const std::uint64_t tail = file.size() - std::min(file.size(), kTail);
  for (at = std::max(at + 2, tail); at + 2 <= file.size(); ++at) {
    if (file.number(at, 2) == kEnd) return true;
  }
  return false;
}

/// The headers of an EXR's parts: what is needed to tell how long its last chunk is.
struct ExrHeaders {
  bool several = false, deep = false;
  std::vector<bool> tiled;  ///< by part
  std::uint64_t end = 0;
};

/// Attributes of (name, type, length, value) up to an empty name; an empty header ends several.
ExrHeaders read_exr_headers(Bytes& file) {
  constexpr std::uint64_t kTiled = 0x200, kDeep = 0x800, kSeveral = 0x1000;
  const std::uint64_t flags = file.number(4, 4);
  ExrHeaders found;
  found.several = (flags & kSeveral) != 0;
  found.deep = (flags & kDeep) != 0;
  std::uint64_t at = 8;
  do {
    // Of one part the version says whether it has tiles; of several, each header does.
    bool tiled = (flags & kTiled) != 0;
    for (std::string name = file.text(at); !name.empty(); name = file.text(at)) {
      at += name.size() + 1;
      at += file.text(at).size() + 1;
      const std::uint64_t length = file.number(at, 4);
      if (name == "type" && found.several) tiled = file.has_text(at + 4, "tiled");
      at += 4 + length;
    }
    ++at;
    found.tiled.push_back(tiled);
  } while (found.several && file.number(at, 1) != 0);
  found.end = found.several ? at + 1 : at;
  return found;
}

/// The places of all chunks follow the headers, zeros until the file is finished, and the first
/// chunk follows these.
bool is_whole_exr(Bytes& file) {
  if (!file.has_text(0, kExrMagic)) return false;
  const ExrHeaders headers = read_exr_headers(file);
  std::uint64_t first = std::numeric_limits<std::uint64_t>::max(), last = 0;
  // The table has no length of its own: it ends where the first chunk begins, wherever that is in
  // it.
  for (std::uint64_t at = headers.end; at < first; at += 8) {
    const std::uint64_t chunk = file.number(at, 8);
    if (chunk <= at || chunk >= file.size()) return false;
    first = std::min(first, chunk);
    last = std::max(last, chunk);
  }
  // pounce writes none; that all places are there is what can be said of them.
  if (headers.deep) return true;  // their chunks have lengths of other kinds
  // The chunk that lies farthest back was written last: if it is whole, all are.
  const std::uint64_t part = headers.several ? file.number(last, 4) : 0;
  if (part >= headers.tiled.size()) return false;
  // Its part, its row or its tile and level, its length.
  const std::uint64_t length_at =
      last + (headers.several ? 4 : 0) + (headers.tiled[static_cast<std::size_t>(part)] ? 16 : 4);
  return file.has(length_at + 4, file.number(length_at, 4));
}

/// A chain of directories, each with the places and lengths of its image's strips or tiles.
class Tiff {
 public:
  explicit Tiff(Bytes& file) : file_(file) {
    file.big_endian = file.has_text(0, "MM");
    big_ = file.number(2, 2) == 43;
    starts_well_ = (file.has_text(0, "II") || file.big_endian) && (big_ || file.number(2, 2) == 42);
  }

  bool is_whole() {
    // All images of the chain, levels included: a file that was cut off in its last level is not
    // whole.
    constexpr int kMostImages = 65536;  // a chain may be a circle
    if (!starts_well_) return false;
    std::uint64_t at = first_directory();
    if (at == 0) return false;
    for (int image = 0; at != 0 && image < kMostImages; ++image) {
      const Directory fields = directory(at);
      if (fields.end == 0 || !holds_all(fields)) return false;
      at = file_.number(fields.end, word());
    }
    return true;
  }

  /// Where the description in its first directory lies, and its bytes; 0 and 0 if it has none.
  std::pair<std::uint64_t, std::uint64_t> description() {
    constexpr std::uint64_t kDescription = 270;
    const Directory fields = directory(first_directory());
    for (std::uint64_t field = fields.begin; field < fields.end; field += field_bytes()) {
      if (file_.number(field, 2) == kDescription)
        return {file_.number(field + 4 + word(), word()), file_.number(field + 4, word())};
    }
    return {};
  }

 private:
  static constexpr std::uint64_t kMostFields = 4096;  // as libtiff

  /// The values of a field, read as they are asked for.
  struct Numbers {
    Bytes file;
    std::uint64_t at, count;
    std::size_t size;
    std::uint64_t operator[](std::uint64_t i) { return file.number(at + i * size, size); }
  };

  struct Directory {
    std::uint64_t begin = 0, end = 0;  ///< of its fields; 0 = too many of them
  };

  std::size_t word() const { return big_ ? 8 : 4; }
  std::uint64_t field_bytes() const { return big_ ? 20 : 12; }
  std::uint64_t first_directory() { return file_.number(big_ ? 8 : 4, word()); }
  Directory directory(std::uint64_t at) {
    const std::uint64_t fields = file_.number(at, big_ ? 8 : 2), begin = at + (big_ ? 8 : 2);
    return fields > kMostFields ? Directory{} : Directory{begin, begin + fields * field_bytes()};
  }

  /// Are all the pixels of a directory's image within the file?
  bool holds_all(const Directory& fields) {
    // Without lengths a place is held against the file's end alone.
    std::optional<Numbers> places, lengths;
    for (std::uint64_t field = fields.begin; field < fields.end; field += field_bytes()) {
      if (!holds_values(field)) return false;
      const std::uint64_t tag = file_.number(field, 2);
      if (tag == 273 || tag == 324) places = numbers(field);   // of strips, of tiles
      if (tag == 279 || tag == 325) lengths = numbers(field);  // a very old file has none
    }
    if (!places || places->count == 0 || (lengths && lengths->count != places->count)) return false;
    for (std::uint64_t i = 0; i < places->count; ++i) {
      if (!file_.has((*places)[i], lengths ? (*lengths)[i] : 1)) return false;
    }
    return true;
  }

  /// Are a field's values within the file? They may be what ends it.
  bool holds_values(std::uint64_t field) {
    constexpr std::array<std::uint8_t, 19> kBytes{1, 1, 1, 2, 4, 8, 1, 1, 2, 4,
                                                  8, 4, 8, 4, 1, 1, 8, 8, 8};
    const std::uint64_t type = file_.number(field + 2, 2), count = file_.number(field + 4, word());
    const std::uint64_t size = kBytes[type < kBytes.size() ? static_cast<std::size_t>(type) : 0];
    if (count > file_.size()) return false;
    return count * size <= word() ||
           file_.has(file_.number(field + 4 + word(), word()), count * size);
  }

  /// They are in the field, if there is room, or elsewhere.
  Numbers numbers(std::uint64_t field) {
    constexpr std::uint64_t kShort = 3, kLong8 = 16;
    const std::uint64_t type = file_.number(field + 2, 2);
    const std::size_t size = type == kShort ? 2 : type == kLong8 ? 8 : 4;
    const std::uint64_t count = file_.number(field + 4, word());
    std::uint64_t at = field + 4 + word();
    // What fits into the field's own word is there; else the word says where.
    if (count > word() / size) at = file_.number(at, word());
    return {file_, at, count, size};
  }

  Bytes& file_;
  bool big_ = false, starts_well_ = false;
};

/// A parser that keeps nothing: brackets that are closed are what a finished file has.
bool is_whole_gltf(const std::string& path) {
  std::ifstream text(path, std::ios::binary);
  return nlohmann::json::accept(text);
}

/// By the ending, since that is the format that a job would write; what has another one inside is
/// not its output.
bool is_whole(const std::string& path) {
  const std::string ending = lower_ending(path);
  if (ending == ".gltf") return is_whole_gltf(path);
  const std::unique_ptr<ReadFile> file = posix_file_system().open(path);
  Bytes bytes(*file);
  if (ending == ".png") return is_whole_png(bytes);
  if (ending == ".jpg" || ending == ".jpeg") return is_whole_jpeg(bytes);
  if (ending == ".exr") return is_whole_exr(bytes);
  if (ending == ".tx" && bytes.has_text(0, kExrMagic)) return is_whole_exr(bytes);
  if (ending == ".tif" || ending == ".tiff" || ending == ".tx") return Tiff(bytes).is_whole();
  if (ending == ".glb") return bytes.has_text(0, "glTF") && bytes.number(8, 4) == bytes.size();
  return false;
}

constexpr std::string_view kInImage = "pounce:job=";
constexpr std::string_view kInModel = "\"pounce\":{\"job\":\"";
constexpr std::size_t kDigits = 32;
/// The texts of an image stand before its pixels; a preview or profile may come before them.
constexpr std::uint64_t kImageHeadBytes = 64 << 10;
constexpr std::size_t kWindow = 64 << 10;

std::string read_text(const ReadFile& file, std::uint64_t at, std::uint64_t most) {
  if (at >= file.size_bytes()) return {};
  std::string text(static_cast<std::size_t>(std::min(most, file.size_bytes() - at)), '\0');
  file.read(at, std::as_writable_bytes(std::span(text)));
  return text;
}

std::optional<std::string> digits_after(std::string_view text, std::string_view prefix) {
  for (std::size_t at = text.find(prefix); at != std::string_view::npos;
       at = text.find(prefix, at + 1)) {
    const std::string_view digits = text.substr(at + prefix.size(), kDigits);
    const bool whole = digits.size() == kDigits &&
                       digits.find_first_not_of("0123456789abcdef") == std::string_view::npos;
    if (whole) return std::string(digits);
  }
  return std::nullopt;
}

/// A text of any length, window by window.
std::optional<std::string> search(const ReadFile& file, std::uint64_t begin, std::uint64_t end,
                                  std::string_view prefix) {
  end = std::min(end, file.size_bytes());
  // Windows overlap by what is looked for, or a mark across a border would be missed.
  const std::size_t overlap = prefix.size() + kDigits;
  for (std::uint64_t at = begin; at < end; at += kWindow) {
    const std::string window =
        read_text(file, at, std::min<std::uint64_t>(kWindow + overlap, end - at));
    if (auto found = digits_after(window, prefix)) return found;
  }
  return std::nullopt;
}

/// Where pounce itself writes it: a mark elsewhere in the file is somebody else's text.
std::optional<std::string> search_file(const std::string& path) {
  const std::unique_ptr<ReadFile> file = posix_file_system().open(path);
  // By content here, not by ending: a .tx may be TIFF or EXR.
  const std::string head = read_text(*file, 0, 20);
  Bytes bytes(*file);
  // Of a GLB only its JSON: a mark within its buffers is somebody's data.
  if (head.starts_with("glTF")) return search(*file, 20, 20 + bytes.number(12, 4), kInModel);
  if (lower_ending(path) == ".gltf") return search(*file, 0, file->size_bytes(), kInModel);
  // Little-endian, as pounce writes them.
  if (head.starts_with("II*\0"sv) || head.starts_with("II+\0"sv)) {
    const auto [at, length] = Tiff(bytes).description();
    return search(*file, at, at + std::min(length, kImageHeadBytes), kInImage);
  }
  return search(*file, 0, kImageHeadBytes, kInImage);
}

}  // namespace

std::string software_name() { return "pounce " POUNCE_VERSION; }

std::string job_description(const std::string& job) { return fmt::format("{}{}", kInImage, job); }

std::string job_extras(const std::string& job) {
  return fmt::format("{{\"job\":\"{}\",\"software\":\"{}\"}}", job, software_name());
}

std::optional<std::string> read_job(const std::string& path) noexcept {
  try {
    return search_file(path);
  } catch (const std::exception&) {
    return std::nullopt;  // whoever makes or reads the file says what is wrong with it
  }
}

bool is_whole_file(const std::string& path) noexcept {
  try {
    return std::filesystem::is_regular_file(path) && is_whole(path);
  } catch (const std::exception&) {
    return false;  // it ends too early; or whoever makes it anew says what is wrong with it
  }
}

}  // namespace pounce::io
