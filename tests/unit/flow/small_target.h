// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "job/job_context.h"
#include "store/blocks/geometry_store.h"
#include "store/cache/store_folder.h"
#include "support/memory_file_system.h"

namespace pounce::test {

/// A job whose files are in memory.
struct SmallJob {
  std::unique_ptr<FileSystem> files = make_memory_file_system();
  job::JobRun run{nullptr};
  job::JobContext context;
  explicit SmallJob(std::uint64_t budget, unsigned threads = 1) : context(budget, run) {
    context.files = files.get();
    context.scratch_folder = "/";
    context.scratch = store::StoreFolder::make_scratch(*files, "/");
    context.threads = threads;
  }
};

/// A target of one page, by tile the covered texels of its blocks. The blocks themselves are not
/// to be decoded: they hold one byte.
inline store::GeometryStore small_target(SmallJob& job, const mesh::Lattice& page,
                                         const std::vector<std::vector<std::uint32_t>>& tiles) {
  store::GeometryStoreWriter writer(
      job.context.scratch->create(store::PackKind::geometry, Hash128{1, 2}));
  store::Compressor& compressor = job.context.compressor();
  std::vector<std::byte> stored;
  compressor.compress(std::vector<std::byte>(1), stored);
  store::GeometryDirectory directory;
  const auto across = static_cast<std::int32_t>((page.width + 63) / 64);
  std::int32_t place = 0;
  for (const std::vector<std::uint32_t>& blocks : tiles) {
    for (const std::uint32_t texels : blocks) {
      store::BlockEntry entry;
      entry.x = place % across;
      entry.y = place++ / across;
      entry.triangles = entry.box_count = 1;
      entry.texels = texels;
      entry.boxes[0] = {{0, 0, 0}, {1, 1, 1}};
      directory.texels += texels;
      writer.add_block(entry, stored, 1);
    }
    writer.end_tile(compressor);
  }
  directory.pages = {page};
  directory.page_texels = {directory.texels};
  return {job.context.scratch->publish(writer.finish(directory, compressor)),
          {true, directory.pages, 1000, 1000},
          compressor};
}

}  // namespace pounce::test
