// SPDX-License-Identifier: Apache-2.0
//
// What scenes are wrapped in: gzip (SPZ 1 to 3), Zstandard (SPZ 4) and ZIP (SOG).
//
// The streams are decoded from their beginning, a piece at a time, in memory that does not depend
// on how much comes out: the caller says how much is wanted, so a file that inflates to terabytes
// costs no more than what its header was found plausible for. zlib and zstd are trusted with
// damaged bytes; what they report becomes an error that names the file.
//
// An archive of a scene holds entries that are stored as they are (images gain nothing by being
// packed again), so reading it is finding them. The directory at the end is what counts: writers
// that do not know sizes beforehand leave zeros in the headers before the entries, and a local
// header is read for its own length alone. Entries must lie apart, before the directory and within
// the file: a few bytes that stand for many entries are how archives grow without end.
//
// Of ZIP a scene needs three records of fixed layout. All else (compression, encryption, ZIP64,
// several parts) is refused by name, with what to do about it.
#include "io/splats/unpack.h"

#include <fmt/format.h>
#include <zlib.h>
#include <zstd.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <new>
#include <set>

#include "io/problems.h"

namespace pounce::io {
namespace {

constexpr std::uint64_t kPieceBytes = 64 << 10;
constexpr int kMostWindowLog = 27;  // what `zstd -d` takes unasked; larger frames are refused
constexpr std::uint64_t kZstdOverhead = 1 << 20;  // measured: below 500 KiB beside the window

[[noreturn]] void fail(const std::string& name, const std::string& what) {
  refuse(name, "{}; copy or export it again", what);
}

/// The compressed bytes, a piece at a time.
class Pieces {
 public:
  Pieces(const ReadFile& file, std::uint64_t offset, std::uint64_t size)
      : file_(file), at_(offset), end_(offset + size), bytes_(kPieceBytes) {}
  bool at_end() const { return at_ == end_; }
  std::span<const std::byte> next() {
    const auto piece = std::span(bytes_).first(std::min(kPieceBytes, end_ - at_));
    file_.read(at_, piece);
    at_ += piece.size();
    return piece;
  }

 private:
  const ReadFile& file_;
  std::uint64_t at_, end_;
  PageVector<std::byte> bytes_;
};

constexpr std::uint32_t kLocalMark = 0x04034B50, kEntryMark = 0x02014B50, kEndMark = 0x06054B50;
constexpr std::uint32_t kZip64LocatorMark = 0x07064B50;
constexpr std::size_t kLocalBytes = 30, kEntryBytes = 46, kEndBytes = 22, kZip64LocatorBytes = 20;
constexpr std::size_t kMostComment = 65535;
constexpr std::size_t kMostEntries = 4096;
constexpr std::uint32_t kMostDirectoryBytes = 1 << 20;
constexpr std::uint16_t kEncrypted = 1 << 0 | 1 << 6 | 1 << 13;  // of the flags

constexpr const char* kAgain = "download it or export it again";

/// Little-endian fields of a piece of the archive.
class Fields {
 public:
  explicit Fields(std::span<const std::byte> bytes) : bytes_(bytes) {}
  std::uint16_t u16(std::size_t at) const { return number<std::uint16_t>(at); }
  std::uint32_t u32(std::size_t at) const { return number<std::uint32_t>(at); }
  std::uint64_t u64(std::size_t at) const { return number<std::uint64_t>(at); }
  std::string text(std::size_t at, std::size_t count) const {
    return {reinterpret_cast<const char*>(bytes_.data()) + at, count};
  }

 private:
  template <class T>
  T number(std::size_t at) const {
    T value;
    std::memcpy(&value, bytes_.subspan(at, sizeof value).data(), sizeof value);
    return value;
  }
  std::span<const std::byte> bytes_;
};

/// Where the list of entries is. Everything is read through it and not from front to back: local
/// headers may lack sizes, and what stands between entries belongs to nobody.
struct Directory {
  std::uint64_t at = 0;
  std::uint32_t bytes = 0;
  std::uint16_t entries = 0;
};

/// Finds the record at the end of the archive, before a comment of any length.
Directory find_directory(const ReadFile& file, const std::string& path) {
  const std::uint64_t size = file.size_bytes();
  const std::size_t tail_bytes = static_cast<std::size_t>(
      std::min<std::uint64_t>(size, kEndBytes + kMostComment + kZip64LocatorBytes));
  std::vector<std::byte> tail(tail_bytes);
  file.read(size - tail_bytes, tail);
  const Fields fields(tail);
  if (tail_bytes < kEndBytes) refuse(path, "is not a complete ZIP archive; {}", kAgain);
  std::size_t end = tail_bytes - kEndBytes;
  // From the end: the mark may stand in a comment, but then the comment's length does not fit.
  while (fields.u32(end) != kEndMark || fields.u16(end + 20) != tail_bytes - kEndBytes - end) {
    if (end == 0)
      refuse(path, "has no directory at its end, so this ZIP archive is incomplete; {}", kAgain);
    --end;
  }
  Directory directory;
  directory.entries = fields.u16(end + 10);
  directory.bytes = fields.u32(end + 12);
  directory.at = fields.u32(end + 16);
  const bool has_locator =
      end >= kZip64LocatorBytes && fields.u32(end - kZip64LocatorBytes) == kZip64LocatorMark;
  // Fields of all ones say that ZIP64 has the number elsewhere.
  if (has_locator || directory.entries == 0xFFFF || directory.bytes == 0xFFFFFFFF ||
      directory.at == 0xFFFFFFFF)
    refuse(
        path,
        "is a ZIP64 archive, which is not supported; unpack it and specify the file in its folder");
  if (fields.u16(end + 4) != 0 || fields.u16(end + 6) != 0 ||
      fields.u16(end + 8) != directory.entries)
    refuse(path, "is one of several parts of a ZIP archive; join them first");
  if (directory.entries > kMostEntries || directory.bytes > kMostDirectoryBytes) {
    refuse(path, "lists {} entries in {} bytes; a scene has at most {} in {}", directory.entries,
           directory.bytes, kMostEntries, kMostDirectoryBytes);
  }
  if (directory.at + directory.bytes > size - tail_bytes + end)
    refuse(path, "has a directory that extends beyond its end; {}", kAgain);
  return directory;
}

/// An entry and all that is its own: from its local header to its last byte.
struct Place {
  std::uint64_t begin = 0, end = 0;
  std::size_t entry = 0;
};

/// A name for messages: its first bytes, without what would upset a terminal.
std::string shown_name(const std::string& name) {
  std::string text = name.substr(0, 80);
  for (char& c : text)
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7F) c = '?';
  return text.size() < name.size() ? text + "..." : text;
}

/// Goes through the directory of an archive.
class DirectoryReader {
 public:
  DirectoryReader(const ReadFile& file, const std::string& path, const Directory& directory)
      : file_(file), path_(path), directory_(directory), bytes_(directory.bytes) {
    file.read(directory.at, bytes_);
  }

  /// The next entry, without its place, and where its local header begins.
  StoredEntry next(std::uint32_t* header_at) {
    ++number_;
    const std::span<const std::byte> left = std::span(bytes_).subspan(at_);
    const Fields fields(left);
    if (left.size() < kEntryBytes || fields.u32(0) != kEntryMark) refuse_directory();
    const std::size_t name_bytes = fields.u16(28);
    const std::size_t entry_bytes = kEntryBytes + name_bytes + fields.u16(30) + fields.u16(32);
    if (left.size() < entry_bytes) refuse_directory();
    StoredEntry entry;
    entry.name = fields.text(kEntryBytes, name_bytes);
    entry.bytes = fields.u32(24);
    *header_at = fields.u32(42);
    const std::uint16_t method = fields.u16(10);
    if ((fields.u16(8) & kEncrypted) != 0)
      refuse_entry(entry, "is encrypted; unpack the archive and specify the file in its folder");
    if (method != 0) {
      refuse_entry(entry, fmt::format("is compressed (method {}), but only stored entries are "
                                      "supported; unpack the archive, or pack it again with zip -0",
                                      method));
    }
    if (entry.bytes == 0xFFFFFFFF || *header_at == 0xFFFFFFFF)
      refuse_entry(entry, "uses ZIP64, which is not supported; unpack the archive");
    // Stored means that packed and unpacked sizes are the same.
    if (fields.u32(20) != entry.bytes) refuse_directory();
    at_ += entry_bytes;
    return entry;
  }

  /// Finds the bytes of the entry whose local header is at `header_at`.
  Place locate(std::uint64_t header_at, StoredEntry& entry) const {
    const std::string outside = fmt::format("is outside of it; {}", kAgain);
    if (header_at + kLocalBytes > directory_.at) refuse_entry(entry, outside);
    std::array<std::byte, kLocalBytes> bytes;
    file_.read(header_at, bytes);
    const Fields local(bytes);
    if (local.u32(0) != kLocalMark)
      refuse_entry(entry, fmt::format("is not where its directory states; {}", kAgain));
    // Sizes are the directory's, lengths of name and extra field the local header's: the two may
    // differ.
    entry.at = header_at + kLocalBytes + local.u16(26) + local.u16(28);
    if (entry.at + entry.bytes > directory_.at) refuse_entry(entry, outside);
    return {header_at, entry.at + entry.bytes, 0};
  }

 private:
  [[noreturn]] void refuse_directory() const {
    refuse(path_, "its directory is damaged at entry {} of {}; {}", number_, directory_.entries,
           kAgain);
  }
  [[noreturn]] void refuse_entry(const StoredEntry& entry, const std::string& what) const {
    refuse(path_, "its entry \"{}\" {}", shown_name(entry.name), what);
  }

  const ReadFile& file_;
  const std::string& path_;
  const Directory& directory_;
  std::vector<std::byte> bytes_;
  std::size_t at_ = 0;
  std::uint32_t number_ = 0;
};

/// Entries that share bytes are no archive that a program writes: a small file could hold any
/// amount.
void refuse_overlaps(const std::string& path, const std::vector<StoredEntry>& entries,
                     std::vector<Place> places) {
  // If any two overlap, two neighbours in the order of where they begin do.
  std::sort(places.begin(), places.end(),
            [](const Place& a, const Place& b) { return a.begin < b.begin; });
  for (std::size_t i = 1; i < places.size(); ++i) {
    if (places[i].begin >= places[i - 1].end) continue;
    refuse(path, "its entries \"{}\" and \"{}\" overlap; {}",
           shown_name(entries[places[i - 1].entry].name), shown_name(entries[places[i].entry].name),
           kAgain);
  }
}

}  // namespace

// zlib is told to expect a gzip header, and compares length and checksum at the end of the member.
struct GzipReader::State {
  State(const ReadFile& file, const std::string& reader_name)
      : name(reader_name), pieces(file, 0, file.size_bytes()) {
    constexpr int kGzipWrapper = 16;
    if (inflateInit2(&stream, MAX_WBITS + kGzipWrapper) != Z_OK) throw std::bad_alloc();
  }
  ~State() { inflateEnd(&stream); }
  State(const State&) = delete;
  State& operator=(const State&) = delete;

  std::string name;
  Pieces pieces;
  z_stream stream{};
  bool ended = false;
};

GzipReader::GzipReader(const ReadFile& file, const std::string& name)
    : state_(std::make_unique<State>(file, name)) {}
GzipReader::~GzipReader() = default;

std::size_t GzipReader::read(std::span<std::byte> out) {
  State& s = *state_;
  // As much as is asked for, or less where the member ends: the caller decides how much may come
  // out.
  std::size_t done = 0;
  while (done < out.size() && !s.ended) {
    // zlib keeps what it has not used of a piece; only then is the next one read.
    if (s.stream.avail_in == 0 && !s.pieces.at_end()) {
      const auto piece = s.pieces.next();
      // zlib's interface is older than const.
      s.stream.next_in = const_cast<Bytef*>(reinterpret_cast<const Bytef*>(piece.data()));
      s.stream.avail_in = static_cast<uInt>(piece.size());
    }
    const auto room = static_cast<uInt>(std::min<std::size_t>(out.size() - done, 1 << 30));
    s.stream.next_out = reinterpret_cast<Bytef*>(out.data() + done);
    s.stream.avail_out = room;
    const int code = inflate(&s.stream, Z_NO_FLUSH);
    done += room - s.stream.avail_out;
    if (code == Z_STREAM_END) {
      s.ended = true;
    } else if (code == Z_MEM_ERROR) {
      throw std::bad_alloc();
      // No progress and no more input: the member has no end.
    } else if (code == Z_BUF_ERROR || (code == Z_OK && s.stream.avail_out == room &&
                                       s.stream.avail_in == 0 && s.pieces.at_end())) {
      fail(s.name, "its gzip data are truncated");
    } else if (code != Z_OK) {
      fail(s.name, fmt::format("its gzip data are damaged ({})",
                               s.stream.msg != nullptr ? s.stream.msg : "no details from zlib"));
    }
  }
  return done;
}

// The window is the only memory that a frame decides on; it is limited here and asked for in
// bytes().
struct ZstdReader::State {
  State(const ReadFile& file, std::uint64_t offset, std::uint64_t size,
        const std::string& reader_name)
      : name(reader_name), pieces(file, offset, size), context(ZSTD_createDCtx()) {
    if (context == nullptr) throw std::bad_alloc();
    ZSTD_DCtx_setParameter(context, ZSTD_d_windowLogMax, kMostWindowLog);
  }
  ~State() { ZSTD_freeDCtx(context); }
  State(const State&) = delete;
  State& operator=(const State&) = delete;

  std::string name;
  Pieces pieces;
  ZSTD_DCtx* context;
  ZSTD_inBuffer in{};
  bool ended = false;
};

ZstdReader::ZstdReader(const ReadFile& file, std::uint64_t offset, std::uint64_t size,
                       const std::string& name)
    : state_(std::make_unique<State>(file, offset, size, name)) {}
ZstdReader::~ZstdReader() = default;

// A frame has to end where its stream does: bytes behind it would be a second one, which the format
// does not have.
std::size_t ZstdReader::read(std::span<std::byte> out) {
  State& s = *state_;
  ZSTD_outBuffer to{out.data(), out.size(), 0};
  while (to.pos < to.size && !s.ended) {
    if (s.in.pos == s.in.size && !s.pieces.at_end()) {
      const auto piece = s.pieces.next();
      s.in = {piece.data(), piece.size(), 0};
    }
    const std::size_t before = to.pos, input = s.in.pos;
    const std::size_t left = ZSTD_decompressStream(s.context, &to, &s.in);
    if (ZSTD_isError(left) != 0) {
      fail(s.name, fmt::format("its zstd data are damaged ({})", ZSTD_getErrorName(left)));
    }
    if (left == 0) {
      s.ended = true;
      if (s.in.pos != s.in.size || !s.pieces.at_end())
        fail(s.name, "bytes follow the last zstd frame");
    } else if (to.pos == before && s.in.pos == input && s.pieces.at_end()) {
      fail(s.name, "its zstd data are truncated");
    }
  }
  return to.pos;
}

std::uint64_t ZstdReader::bytes(const ReadFile& file, std::uint64_t offset, std::uint64_t size) {
  // Frame: magic, descriptor, then the window's size as a power of two and eighths of it, or, where
  // the whole content is the window, the content's size.
  // Read off the frame before any decoder sees it: the memory is leased first.
  std::array<std::byte, 13> head{};
  file.read(offset, std::span(head).first(std::min<std::uint64_t>(size, head.size())));
  const auto descriptor = std::to_integer<unsigned>(head[4]);
  const unsigned dictionary = std::array<unsigned, 4>{0, 1, 2, 4}[descriptor & 3];
  const Fields at(std::span<const std::byte>(head).subspan(5));
  std::uint64_t window = 0;
  if ((descriptor >> 5 & 1) == 0) {
    const auto code = std::to_integer<unsigned>(head[5]);
    window = std::uint64_t{1} << (10 + (code >> 3));
    window += window / 8 * (code & 7);
  } else if (dictionary == 0) {  // nothing that is read has one
    const unsigned width = descriptor >> 6;
    window = width == 0   ? std::to_integer<unsigned>(head[5])
             : width == 1 ? at.u16(0) + 256U
             : width == 2 ? at.u32(0)
                          : at.u64(0);
  }
  return round_to_pages(std::min(window, std::uint64_t{1} << kMostWindowLog)) + kZstdOverhead;
}

// An archive begins with an entry, or, if it is empty, with the record of its end.
bool is_zip(const ReadFile& file) {
  if (file.size_bytes() < kEndBytes) return false;
  std::array<std::byte, 4> start;
  file.read(0, start);
  const std::uint32_t mark = Fields(start).u32(0);
  return mark == kLocalMark || mark == kEndMark;
}

// The directory first, then each local header for the length of its name and extra field, which may
// differ from those in the directory.
std::vector<StoredEntry> read_stored_zip(const ReadFile& file, const std::string& path) {
  const Directory directory = find_directory(file, path);
  DirectoryReader reader(file, path, directory);
  std::vector<StoredEntry> entries;
  std::vector<Place> places;
  // A name that stands twice would be one file to some readers and another to others.
  std::set<std::string> names;
  for (std::uint32_t i = 0; i < directory.entries; ++i) {
    std::uint32_t header_at = 0;
    StoredEntry entry = reader.next(&header_at);
    Place place = reader.locate(header_at, entry);
    if (entry.name.ends_with('/') && entry.bytes == 0) continue;
    if (!names.insert(entry.name).second)
      refuse(path, "has two entries \"{}\"; {}", shown_name(entry.name), kAgain);
    place.entry = entries.size();
    places.push_back(place);
    entries.push_back(std::move(entry));
  }
  refuse_overlaps(path, entries, std::move(places));
  return entries;
}

}  // namespace pounce::io
