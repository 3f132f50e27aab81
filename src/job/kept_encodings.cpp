// SPDX-License-Identifier: Apache-2.0
#include "job/kept_encodings.h"

#include "pounce/error.h"
#include "store/blocks/result_records.h"

namespace pounce::job {

bool KeptEncodings::find(std::uint32_t block, const Hash128& rows,
                         std::vector<std::byte>& encoded) {
  const auto found = blocks_.find({image_, block});
  if (found == blocks_.end() || found->second.rows != rows) return false;
  chunk_ = {};  // no third copy beside the chunk and what is returned of it
  const store::StoredChunk chunk = reader_->read(found->second.chunk, store::ChunkKind::encoded);
  const auto bytes = chunk.payload().subspan(store::kEncodedRowsBytes);
  encoded.assign(bytes.begin(), bytes.end());
  return true;
}

void KeptEncodings::put(std::uint32_t block, const Hash128& rows,
                        std::span<const std::byte> encoded) {
  if (is_full_) return;
  store::encode(store::EncodedRows{image_, block, rows}, chunk_);
  chunk_.insert(chunk_.end(), encoded.begin(), encoded.end());
  if (!pack_.take_spare(chunk_.size() + store::kChunkHeaderBytes)) {
    is_full_ = true;
    return;
  }
  try {
    pack_.writer().append(store::ChunkKind::encoded, chunk_,
                          static_cast<std::uint32_t>(chunk_.size()));
    pack_.commit();
  } catch (const Error& e) {
    // This job needs them not: a disk that has no room for them may have some for the image.
    if (e.kind() != ErrorKind::storage) throw;
    is_full_ = true;
  }
}

}  // namespace pounce::job
