// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <utility>

#include "pounce/error.h"
#include "store/pack/pack.h"
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
            fmt::format("the file ends here, a pack has at least {} bytes", least));
  }
}

/// Checks magic and end checksum, which headers and footers of every version have in the same
/// places.
void check_frame(std::span<const std::byte, 64> bytes, const std::array<char, 8>& magic,
                 const std::string& name, std::uint64_t offset) {
  if (std::memcmp(bytes.data(), magic.data(), magic.size()) != 0) {
    damaged(name, offset, fmt::format("\"{}\" was expected", std::string(magic.data(), 8)));
  }
  if (get_u64(bytes.data() + kEndChecksumOffset) != checksum(bytes.first<kEndChecksumOffset>())) {
    damaged(name, offset, "its checksum does not match");
  }
}

Hash128 get_key(const std::byte* from) { return {get_u64(from), get_u64(from + 8)}; }

}  // namespace

struct PackReader::Impl {
  std::unique_ptr<ReadFile> file;
  std::string name;
  Hash128 key;
  ChunkRef directory;
  std::uint64_t chunks = 0;
  std::uint64_t size = 0;
  mutable std::atomic<std::uint64_t> bytes_read{0};

  void read_raw(std::uint64_t offset, std::span<std::byte> out) const {
    file->read(offset, out);
    bytes_read.fetch_add(out.size(), std::memory_order_relaxed);
  }

  void read_header(PackKind kind) {
    const PackInfo info = read_pack_info(*file, name);
    bytes_read.fetch_add(kPackHeaderBytes, std::memory_order_relaxed);
    if (info.kind != kind) {
      damaged(name, 12,
              fmt::format("it is a pack of kind {}, {} was expected",
                          static_cast<std::uint32_t>(info.kind), static_cast<std::uint32_t>(kind)));
    }
    if (info.key != key) {
      damaged(name, 16, fmt::format("it holds {}, {} was expected", to_hex(info.key), to_hex(key)));
    }
  }

  void read_footer() {
    const std::uint64_t at = size - kPackFooterBytes;
    std::array<std::byte, kPackFooterBytes> footer{};
    read_raw(at, footer);
    check_frame(footer, kFooterMagic, name, at);
    directory = {get_u64(footer.data() + 8), get_u32(footer.data() + 16),
                 get_u32(footer.data() + 20)};
    chunks = get_u64(footer.data() + 24);
    if (get_u64(footer.data() + 32) != size) {
      damaged(name, at,
              fmt::format("it was written with {} bytes and now has {}",
                          get_u64(footer.data() + 32), size));
    }
    if (get_key(footer.data() + 40) != key) damaged(name, at, "the footer has another key");
  }

  /// Everything about a reference that can be known before memory is taken for it.
  void check_ref(const ChunkRef& ref) const {
    const std::uint64_t end = size - kPackFooterBytes;
    if (ref.stored_bytes > kLargestChunkBytes || ref.raw_bytes > kLargestChunkBytes) {
      damaged(name, ref.offset,
              fmt::format("a chunk of {} bytes, {} stored, is larger than any", ref.raw_bytes,
                          ref.stored_bytes));
    }
    if (ref.offset < kPackHeaderBytes || ref.offset % kChunkAlignment != 0 || ref.offset > end ||
        chunk_file_bytes(ref.stored_bytes) > end - ref.offset) {
      damaged(name, ref.offset,
              fmt::format("a chunk of {} bytes cannot lie there", ref.stored_bytes));
    }
  }
};

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
  const std::uint32_t kind = get_u32(header.data() + 12);
  if (kind < 1 || kind > 4) damaged(name, 12, fmt::format("{} is no kind of pack", kind));
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
    : impl_(std::make_unique<Impl>()) {
  impl_->file = std::move(file);
  impl_->name = std::move(name);
  impl_->key = key;
  impl_->size = impl_->file->size_bytes();
  impl_->read_header(kind);
  impl_->read_footer();
  impl_->check_ref(impl_->directory);
}

PackReader::~PackReader() = default;

void PackReader::read(const ChunkRef& ref, ChunkKind kind, std::vector<std::byte>& stored) const {
  impl_->check_ref(ref);
  // Header, payload and padding in one read; the header is cut off again once all is checked.
  stored.resize(chunk_file_bytes(ref.stored_bytes));
  impl_->read_raw(ref.offset, stored);
  const std::uint64_t sum = get_u64(stored.data() + kChunkChecksumOffset);
  if (get_u32(stored.data()) != kChunkMagic) {
    damaged(impl_->name, ref.offset, "no chunk begins here");
  }
  if (chunk_checksum(stored, ref.offset) != sum) {
    damaged(impl_->name, ref.offset, "the chunk's checksum does not match");
  }
  if (get_u32(stored.data() + 4) != static_cast<std::uint32_t>(kind) ||
      get_u32(stored.data() + 8) != ref.raw_bytes ||
      get_u32(stored.data() + 12) != ref.stored_bytes) {
    damaged(impl_->name, ref.offset, "the chunk has another kind or size than its index says");
  }
  if (get_u64(stored.data() + 24) != impl_->key.lo) {
    damaged(impl_->name, ref.offset, "the chunk belongs to another pack");
  }
  const auto payload = stored.begin() + static_cast<std::ptrdiff_t>(kChunkHeaderBytes);
  if (std::any_of(payload + ref.stored_bytes, stored.end(),
                  [](std::byte b) { return b != std::byte{0}; })) {
    damaged(impl_->name, ref.offset, "the padding is not zero");
  }
  stored.erase(stored.begin(), payload);
  stored.resize(ref.stored_bytes);
}

std::uint64_t PackReader::verify() const {
  const std::uint64_t end = impl_->size - kPackFooterBytes;
  std::uint64_t at = kPackHeaderBytes;
  std::uint64_t count = 0;
  bool directory_seen = false;
  std::vector<std::byte> stored;
  while (at < end) {
    if (end - at < kChunkHeaderBytes) damaged(impl_->name, at, "no chunk fits here");
    std::array<std::byte, kChunkHeaderBytes> header{};
    impl_->read_raw(at, header);
    const std::uint32_t kind = get_u32(header.data() + 4);
    if (kind < 1 || kind > 3) damaged(impl_->name, at, fmt::format("{} is no kind of chunk", kind));
    const ChunkRef ref{at, get_u32(header.data() + 12), get_u32(header.data() + 8)};
    read(ref, static_cast<ChunkKind>(kind), stored);
    directory_seen |= ref == impl_->directory;
    at += chunk_file_bytes(ref.stored_bytes);
    ++count;
  }
  if (count != impl_->chunks || !directory_seen) {
    damaged(impl_->name, end,
            fmt::format("it holds {} chunks, the footer says {}{}", count, impl_->chunks,
                        directory_seen ? "" : " and a directory that is none"));
  }
  return count;
}

ChunkRef PackReader::directory() const { return impl_->directory; }
std::uint64_t PackReader::size_bytes() const { return impl_->size; }
std::uint64_t PackReader::bytes_read() const {
  return impl_->bytes_read.load(std::memory_order_relaxed);
}
const std::string& PackReader::name() const { return impl_->name; }

}  // namespace pounce::store
