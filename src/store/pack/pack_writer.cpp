// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <utility>

#include "pounce/error.h"
#include "store/pack/pack.h"
#include "store/pack/pack_layout.h"

namespace pounce::store {

struct PackWriter::Impl {
  std::unique_ptr<WriteFile> file;
  PackKind kind;
  Hash128 key;
  std::uint64_t size = 0;  // what was appended, whatever the file buffers
  std::uint64_t chunks = 0;
  bool finished = false;
  bool broken = false;           // an append failed: what the file holds is not known any more
  std::vector<std::byte> chunk;  // one chunk as it goes to the file, reused

  void append(std::span<const std::byte> bytes) {
    if (broken) {
      throw Error(ErrorKind::storage, "a pack cannot be continued after a failed write; run again");
    }
    broken = true;
    file->append(bytes);
    broken = false;
    size += bytes.size();
  }
};

PackWriter::PackWriter(std::unique_ptr<WriteFile> file, PackKind kind, const Hash128& key)
    : impl_(std::make_unique<Impl>()) {
  impl_->file = std::move(file);
  impl_->kind = kind;
  impl_->key = key;
  std::array<std::byte, kPackHeaderBytes> header{};
  std::memcpy(header.data(), kPackMagic.data(), kPackMagic.size());
  put_u32(header.data() + 8, kFormatVersion);
  put_u32(header.data() + 12, static_cast<std::uint32_t>(kind));
  put_u64(header.data() + 16, key.hi);
  put_u64(header.data() + 24, key.lo);
  put_u64(header.data() + kEndChecksumOffset,
          checksum(std::span(header).first<kEndChecksumOffset>()));
  impl_->append(header);
}

PackWriter::~PackWriter() = default;

ChunkRef PackWriter::append(ChunkKind kind, std::span<const std::byte> stored,
                            std::uint32_t raw_bytes) {
  if (impl_->finished || stored.size() > kLargestChunkBytes || raw_bytes > kLargestChunkBytes) {
    throw Error(ErrorKind::internal,
                fmt::format("a pack cannot take a chunk of {} bytes, {} stored{} (please report)",
                            raw_bytes, stored.size(), impl_->finished ? ", once finished" : ""));
  }
  const ChunkRef ref{impl_->size, static_cast<std::uint32_t>(stored.size()), raw_bytes};
  std::vector<std::byte>& chunk = impl_->chunk;
  chunk.assign(chunk_file_bytes(ref.stored_bytes), std::byte{0});
  put_u32(chunk.data(), kChunkMagic);
  put_u32(chunk.data() + 4, static_cast<std::uint32_t>(kind));
  put_u32(chunk.data() + 8, ref.raw_bytes);
  put_u32(chunk.data() + 12, ref.stored_bytes);
  put_u64(chunk.data() + 24, impl_->key.lo);
  if (!stored.empty()) std::memcpy(chunk.data() + kChunkHeaderBytes, stored.data(), stored.size());
  const std::uint64_t sum = chunk_checksum(chunk, ref.offset);
  put_u64(chunk.data() + kChunkChecksumOffset, sum);
  impl_->append(chunk);
  ++impl_->chunks;
  return ref;
}

void PackWriter::finish(const ChunkRef& directory) {
  if (impl_->finished)
    throw Error(ErrorKind::internal, "a pack was finished twice (please report)");
  std::array<std::byte, kPackFooterBytes> footer{};
  std::memcpy(footer.data(), kFooterMagic.data(), kFooterMagic.size());
  put_u64(footer.data() + 8, directory.offset);
  put_u32(footer.data() + 16, directory.stored_bytes);
  put_u32(footer.data() + 20, directory.raw_bytes);
  put_u64(footer.data() + 24, impl_->chunks);
  put_u64(footer.data() + 32, impl_->size + kPackFooterBytes);
  put_u64(footer.data() + 40, impl_->key.hi);
  put_u64(footer.data() + 48, impl_->key.lo);
  put_u64(footer.data() + kEndChecksumOffset,
          checksum(std::span(footer).first<kEndChecksumOffset>()));
  impl_->append(footer);
  impl_->finished = true;
  std::vector<std::byte>().swap(impl_->chunk);
}

std::uint64_t PackWriter::size_bytes() const { return impl_->size; }
WriteFile& PackWriter::file() { return *impl_->file; }
PackKind PackWriter::kind() const { return impl_->kind; }
const Hash128& PackWriter::key() const { return impl_->key; }
bool PackWriter::finished() const { return impl_->finished; }

}  // namespace pounce::store
