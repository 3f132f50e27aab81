// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "flow/project/pieces.h"
#include "job/job_context.h"
#include "outcome/target_tally.h"
#include "shading/result_block.h"
#include "store/pack/pack.h"

namespace pounce::flow {

/// Encodes and compresses a finished result block of channel `c` and block `b` into the work.
void finish_block(job::JobContext& job, const shading::TexelFormat& format,
                  const shading::ResultBlock& result, std::size_t c, std::size_t b,
                  PieceWork& work);

/// The results of one page.
struct PageResult : outcome::PageFound {
  std::unique_ptr<store::PackReader> pack;  ///< scratch; empty when the page has no texels
  /// [channel][block_y * blocks_x + block_x]; raw_bytes == 0: nothing covered there.
  std::vector<std::vector<store::ChunkRef>> blocks;
  std::vector<std::uint64_t> clipped;  ///< [channel]
  std::vector<NodeReport> nodes;       ///< of the graph that made it
};

/// Collects the result blocks of one page, in any order, in a scratch pack. Not thread-safe.
class ResultCollector {
 public:
  ResultCollector(job::JobContext& job, const store::GeometryStore& target, std::size_t channels);
  std::uint64_t store(const PieceWork& work);  ///< returns the bytes that were written
  PageResult finish();
  /// Bytes of the index of a page's results.
  static std::uint64_t index_bytes(const mesh::Lattice& page, std::size_t channels);

 private:
  job::JobContext& job_;
  const store::GeometryStore& target_;
  std::uint32_t across_;
  runtime::Lease index_lease_;
  std::unique_ptr<store::PackWriter> writer_;
  PageResult result_;
};

}  // namespace pounce::flow
