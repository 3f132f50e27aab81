// SPDX-License-Identifier: Apache-2.0
//
// A pack is written once, front to back, and read in any order; docs/tile-format.md has its bytes.
// The reader believes nothing. A checksum says that bytes are those that were written, but a chunk
// may still be the wrong one: of another kind, another place, another pack. So a chunk's checksum
// is computed with its own offset in place of the checksum, and its header repeats kind, sizes and
// half of the pack's key. Sizes are held against what a pack can be before memory is taken for
// them.
//
// A writer whose append failed does not know what the file holds, so it refuses to go on; a pack
// without a footer is no pack.
//
// Versions are not converted: a pack is a cache entry, and another version is built again under its
// own folder. The version is told before all else, since it decides what the other bytes mean.
#include "store/pack/pack.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <utility>

#include "pounce/error.h"
#include "store/pack/pack_layout.h"

namespace pounce::store {
namespace {

[[noreturn]] void damaged(const std::string& name, std::uint64_t offset, const std::string& what) {
  throw Error(ErrorKind::damaged_store,
              fmt::format("{}: damaged at byte {}: {}; delete it or run with --no-cache", name,
                          offset, what));
}

void check_size(const ReadFile& file, const std::string& name) {
  const std::uint64_t least = kPackHeaderBytes + kPackFooterBytes;
  if (file.size_bytes() < least) {
    damaged(name, file.size_bytes(),
            fmt::format("the file ends here, but a pack has at least {} bytes", least));
  }
}

/// A file cut off or of something else altogether is told from a damaged one: the message is what
/// a user sees who points at the wrong file. Checks magic and end checksum, which headers and
/// footers of every version have in the same places.
void check_frame(std::span<const std::byte, 64> bytes, const std::array<char, 8>& magic,
                 const std::string& name, std::uint64_t offset) {
  if (std::memcmp(bytes.data(), magic.data(), magic.size()) != 0) {
    damaged(name, offset, fmt::format("expected \"{}\"", std::string(magic.data(), 8)));
  }
  if (get_u64(bytes.data() + kEndChecksumOffset) != checksum(bytes.first<kEndChecksumOffset>())) {
    damaged(name, offset, "its checksum does not match");
  }
}

Hash128 get_key(const std::byte* from) { return {get_u64(from), get_u64(from + 8)}; }

/// What is wrong with a chunk that was read from where `ref` says, header and padding included;
/// null: nothing. Its checksum's place is overwritten.
const char* wrong_with(std::span<std::byte> chunk, const ChunkRef& ref, ChunkKind kind,
                       const Hash128& key) {
  const std::uint64_t sum = get_u64(chunk.data() + kChunkChecksumOffset);
  if (get_u32(chunk.data()) != kChunkMagic) return "no chunk begins here";
  if (chunk_checksum(chunk, ref.offset) != sum) return "the chunk's checksum does not match";
  if (get_u32(chunk.data() + 4) != static_cast<std::uint32_t>(kind) ||
      get_u32(chunk.data() + 8) != ref.raw_bytes || get_u32(chunk.data() + 12) != ref.stored_bytes)
    return "the chunk has a different kind or size than its index states";
  // A file system that mixed up blocks of two packs of like sizes would pass all of the above.
  if (get_u64(chunk.data() + 24) != key.lo) return "the chunk belongs to another pack";
  // Every byte is checked: what a reader ignores a later version could not use.
  const auto padding = chunk.subspan(kChunkHeaderBytes + ref.stored_bytes);
  const bool is_clear =
      std::all_of(padding.begin(), padding.end(), [](std::byte b) { return b == std::byte{0}; });
  return is_clear ? nullptr : "the padding is not zero";
}

/// The chunk that a header states, and its kind, if any chunk may state this.
std::optional<std::pair<ChunkKind, ChunkRef>> stated_chunk(
    std::span<const std::byte, kChunkHeaderBytes> header, std::uint64_t offset) {
  const std::uint32_t kind = get_u32(header.data() + 4);
  const ChunkRef ref{offset, get_u32(header.data() + 12), get_u32(header.data() + 8)};
  const bool is_known = kind >= 1 && kind <= static_cast<std::uint32_t>(ChunkKind::encoded);
  if (!is_known || ref.stored_bytes > kLargestChunkBytes || ref.raw_bytes > kLargestChunkBytes)
    return std::nullopt;
  return std::pair(static_cast<ChunkKind>(kind), ref);
}

/// Marks the end of a header or footer by its checksum.
void seal(std::span<std::byte, 64> frame) {
  put_u64(frame.data() + kEndChecksumOffset, checksum(frame.first<kEndChecksumOffset>()));
}

}  // namespace

PackWriter::PackWriter(std::unique_ptr<WriteFile> file, PackKind kind, const Hash128& key)
    : file_(std::move(file)), kind_(kind), key_(key) {
  std::array<std::byte, kPackHeaderBytes> header{};
  std::memcpy(header.data(), kPackMagic.data(), kPackMagic.size());
  put_u32(header.data() + 8, kFormatVersion);
  put_u32(header.data() + 12, static_cast<std::uint32_t>(kind));
  put_u64(header.data() + 16, key.hi);
  put_u64(header.data() + 24, key.lo);
  seal(header);
  write(header);
}

PackWriter::PackWriter(std::unique_ptr<WriteFile> file, PackKind kind, const Hash128& key,
                       const PackScan& so_far)
    : file_(std::move(file)),
      kind_(kind),
      key_(key),
      size_(so_far.size_bytes),
      chunks_(so_far.chunks) {}

void PackWriter::write(std::span<const std::byte> bytes) {
  // An append that throws may have written a part, and size_ would be wrong for what follows.
  // Threads that share a writer under a lock may try again before all of them know: whoever is
  // heard first has the reason to tell.
  if (failure_) std::rethrow_exception(failure_);
  try {
    file_->append(bytes);
  } catch (...) {
    failure_ = std::current_exception();
    throw;
  }
  size_ += bytes.size();
}

ChunkRef PackWriter::append(ChunkKind kind, std::span<const std::byte> stored,
                            std::uint32_t raw_bytes) {
  if (finished_ || stored.size() > kLargestChunkBytes || raw_bytes > kLargestChunkBytes) {
    throw Error(ErrorKind::internal,
                fmt::format("a pack cannot store a chunk of {} bytes, {} stored{} (please report)",
                            raw_bytes, stored.size(), finished_ ? ", once finished" : ""));
  }
  // Composed in memory and written at once: an offset is part of its checksum, and a chunk that is
  // half written is then all that a failure leaves.
  const ChunkRef ref{size_, static_cast<std::uint32_t>(stored.size()), raw_bytes};
  chunk_.assign(chunk_file_bytes(ref.stored_bytes), std::byte{0});
  put_u32(chunk_.data(), kChunkMagic);
  put_u32(chunk_.data() + 4, static_cast<std::uint32_t>(kind));
  put_u32(chunk_.data() + 8, ref.raw_bytes);
  put_u32(chunk_.data() + 12, ref.stored_bytes);
  put_u64(chunk_.data() + 24, key_.lo);
  if (!stored.empty()) std::memcpy(chunk_.data() + kChunkHeaderBytes, stored.data(), stored.size());
  const std::uint64_t sum = chunk_checksum(chunk_, ref.offset);
  put_u64(chunk_.data() + kChunkChecksumOffset, sum);
  write(chunk_);
  ++chunks_;
  return ref;
}

void PackWriter::finish(const ChunkRef& directory) {
  if (finished_) throw Error(ErrorKind::internal, "a pack was finished twice (please report)");
  // The footer repeats the file's length: a copy that was cut off, or has something after its end,
  // is told from a sound pack by 64 bytes.
  std::array<std::byte, kPackFooterBytes> footer{};
  std::memcpy(footer.data(), kFooterMagic.data(), kFooterMagic.size());
  put_u64(footer.data() + 8, directory.offset);
  put_u32(footer.data() + 16, directory.stored_bytes);
  put_u32(footer.data() + 20, directory.raw_bytes);
  put_u64(footer.data() + 24, chunks_);
  put_u64(footer.data() + 32, size_ + kPackFooterBytes);
  put_u64(footer.data() + 40, key_.hi);
  put_u64(footer.data() + 48, key_.lo);
  seal(footer);
  write(footer);
  finished_ = true;
  std::vector<std::byte>().swap(chunk_);
}

PackInfo read_pack_info(const ReadFile& file, const std::string& name) {
  check_size(file, name);
  std::array<std::byte, kPackHeaderBytes> header{};
  file.read(0, header);
  check_frame(header, kPackMagic, name, 0);
  PackInfo info;
  info.version = get_u32(header.data() + 8);
  if (info.version != kFormatVersion) {
    damaged(name, 8,
            fmt::format("format version {}, this program reads version {}", info.version,
                        kFormatVersion));
  }
  // Another version is told before anything else: its other fields may mean something else.
  const std::uint32_t kind = get_u32(header.data() + 12);
  if (kind < 1 || kind > 5) damaged(name, 12, fmt::format("{} is not a known kind of pack", kind));
  info.kind = static_cast<PackKind>(kind);
  info.key = get_key(header.data() + 16);
  if (std::any_of(header.begin() + 32, header.begin() + kEndChecksumOffset,
                  [](std::byte b) { return b != std::byte{0}; })) {
    damaged(name, 32, "reserved bytes are not zero");
  }
  return info;
}

PackReader::PackReader(std::unique_ptr<ReadFile> file, std::string name, PackKind kind,
                       const Hash128& key)
    : file_(std::move(file)),
      name_(std::move(name)),
      key_(key),
      is_growing_(false),
      size_(file_->size_bytes()) {
  // The footer is written last: a file that has a sound one is complete.
  read_header(kind);
  read_footer();
  check_ref(directory_);
}

PackReader::PackReader(const PackWriter& writer, std::string name)
    : file_(writer.file().reader()),
      name_(std::move(name)),
      key_(writer.key()),
      is_growing_(true),
      size_(file_->size_bytes()) {}

void PackReader::damaged(std::uint64_t offset, const std::string& what) const {
  store::damaged(name_, offset, what);
}

void PackReader::read_raw(std::uint64_t offset, std::span<std::byte> out) const {
  file_->read(offset, out);
  bytes_read_.fetch_add(out.size(), std::memory_order_relaxed);
}

void PackReader::read_header(PackKind kind) {
  const PackInfo info = read_pack_info(*file_, name_);
  bytes_read_.fetch_add(kPackHeaderBytes, std::memory_order_relaxed);
  if (info.kind != kind) {
    damaged(12,
            fmt::format("it is a pack of kind {}, expected {}",
                        static_cast<std::uint32_t>(info.kind), static_cast<std::uint32_t>(kind)));
  }
  if (info.key != key_) {
    damaged(16, fmt::format("it holds {}, expected {}", to_hex(info.key), to_hex(key_)));
  }
}

void PackReader::read_footer() {
  const std::uint64_t at = size_ - kPackFooterBytes;
  std::array<std::byte, kPackFooterBytes> footer{};
  read_raw(at, footer);
  check_frame(footer, kFooterMagic, name_, at);
  directory_ = {get_u64(footer.data() + 8), get_u32(footer.data() + 16),
                get_u32(footer.data() + 20)};
  chunks_ = get_u64(footer.data() + 24);
  if (get_u64(footer.data() + 32) != size_) {
    damaged(at, fmt::format("it was written with {} bytes and now has {}",
                            get_u64(footer.data() + 32), size_));
  }
  if (get_key(footer.data() + 40) != key_) damaged(at, "the footer has a different key");
}

/// Everything about a reference that can be known before memory is taken for it.
void PackReader::check_ref(const ChunkRef& ref) const {
  const std::uint64_t end = is_growing_ ? file_->size_bytes() : size_ - kPackFooterBytes;
  if (ref.stored_bytes > kLargestChunkBytes || ref.raw_bytes > kLargestChunkBytes) {
    damaged(ref.offset,
            fmt::format("a chunk of {} bytes, {} stored, exceeds the largest possible size",
                        ref.raw_bytes, ref.stored_bytes));
  }
  if (ref.offset < kPackHeaderBytes || ref.offset % kChunkAlignment != 0 || ref.offset > end ||
      chunk_file_bytes(ref.stored_bytes) > end - ref.offset) {
    damaged(ref.offset, fmt::format("a chunk of {} bytes does not fit there", ref.stored_bytes));
  }
}

StoredChunk PackReader::read(const ChunkRef& ref, ChunkKind kind) const {
  check_ref(ref);
  // One read for header, payload and padding, since each costs a system call.
  UnsetBytes chunk(chunk_file_bytes(ref.stored_bytes));
  read_raw(ref.offset, chunk);
  if (const char* what = wrong_with(chunk, ref, kind, key_)) damaged(ref.offset, what);
  const std::span<const std::byte> payload(chunk.data() + kChunkHeaderBytes, ref.stored_bytes);
  return {std::move(chunk), payload};
}

std::uint64_t PackReader::verify() const {
  // From chunk to chunk by their own headers, not by any index: every byte of the file is seen.
  const std::uint64_t end = size_ - kPackFooterBytes;
  std::uint64_t at = kPackHeaderBytes;
  std::uint64_t count = 0;
  bool directory_seen = false;
  while (at < end) {
    if (end - at < kChunkHeaderBytes) damaged(at, "no chunk fits here");
    std::array<std::byte, kChunkHeaderBytes> header{};
    read_raw(at, header);
    const std::uint32_t kind = get_u32(header.data() + 4);
    if (kind < 1 || kind > 5) damaged(at, fmt::format("{} is not a known kind of chunk", kind));
    const ChunkRef ref{at, get_u32(header.data() + 12), get_u32(header.data() + 8)};
    read(ref, static_cast<ChunkKind>(kind));
    directory_seen |= ref == directory_;
    at += chunk_file_bytes(ref.stored_bytes);
    ++count;
  }
  if (count != chunks_ || !directory_seen) {
    damaged(end, fmt::format("it holds {} chunks, but the footer states {}{}", count, chunks_,
                             directory_seen ? "" : " and an invalid directory"));
  }
  return count;
}

// --- unfinished packs ----------------------------------------------------------------------------

PackScan scan_pack(
    const ReadFile& file, PackKind kind, const Hash128& key,
    const std::function<bool(ChunkKind, const ChunkRef&, std::span<const std::byte> stored,
                             const PackScan& behind)>& take) {
  PackScan sound;
  try {
    const std::uint64_t end = file.size_bytes();
    const PackInfo info = read_pack_info(file, "an unfinished pack");
    if (info.kind != kind || info.key != key) return {};
    sound.size_bytes = kPackHeaderBytes;
    std::vector<std::byte> chunk;
    while (end - sound.size_bytes >= kChunkHeaderBytes) {
      const std::uint64_t at = sound.size_bytes;
      std::array<std::byte, kChunkHeaderBytes> header{};
      file.read(at, header);
      const auto stated = stated_chunk(header, at);
      if (!stated) break;
      const auto& [chunk_kind, ref] = *stated;
      const std::uint64_t bytes = chunk_file_bytes(ref.stored_bytes);
      if (bytes > end - at) break;
      chunk.resize(bytes);
      file.read(at, chunk);
      if (wrong_with(chunk, ref, chunk_kind, key) != nullptr) break;
      const PackScan behind{at + bytes, sound.chunks + 1, {}};
      if (!take(chunk_kind, ref, std::span(chunk).subspan(kChunkHeaderBytes, ref.stored_bytes),
                behind))
        break;
      sound = behind;
    }
  } catch (const Error& e) {
    // Whatever is wrong from here on: what was sound before it stays so.
    if (e.kind() != ErrorKind::damaged_store && e.kind() != ErrorKind::storage) throw;
    if (e.kind() == ErrorKind::storage) sound.unread = e;
  }
  return sound;
}

}  // namespace pounce::store
