// SPDX-License-Identifier: Apache-2.0
//
// What tasks of one job leave for each other: packs of results of a part of an image, each of a
// process of its own, in a folder that all of them see (docs/decisions/059-farm.md).
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/file.h"
#include "core/hash.h"
#include "job/job_context.h"
#include "pounce/error.h"
#include "store/blocks/result_index.h"
#include "store/pack/pack.h"

namespace pounce::job {

/// The parts of one page of a pass. Not thread-safe.
class PartFiles {
 public:
  /// `key`: of all that decides what the results are.
  PartFiles(JobContext& job, const Hash128& key);

  /// Counts as made what the parts have, as far as each of them is sound and can be read.
  void count(store::ResultIndex& index) const;
  /// The same, and copies it behind what is in a pack. Returns why the system could not read all of
  /// it, if it could not.
  std::optional<Error> copy(store::ResultIndex& index, store::PackWriter& to) const;
  /// A pack of this process. Whoever makes the same part at once has one of its own.
  struct NewPart {
    std::unique_ptr<store::PackWriter> writer;
    std::string path;
  };
  NewPart create() const;
  /// All of its share is in it, or in parts that were there when it was begun.
  void finish(NewPart& part) const;
  /// There is nothing on this page, and no file will say so.
  void note_empty() const;
  bool is_empty() const;
  /// Removes those of all pages: the images are there. What notes that pages are empty stays.
  static void sweep(JobContext& job);

 private:
  /// A record of a part, and the chunks that it names.
  struct Piece {
    const ReadFile& file;
    const store::ResultRecord& record;
    std::span<const store::ChunkRef> chunks;
    std::span<const std::byte> stored;  ///< the record itself
  };
  std::optional<Error> read(const store::ResultGrid& grid,
                            const std::function<void(const Piece&)>& visit) const;
  std::vector<std::unique_ptr<ReadFile>> open() const;
  std::vector<std::string> names() const;
  std::string path(const std::string& name) const;

  JobContext& job_;
  const Hash128 key_;
  const std::string prefix_;
};

}  // namespace pounce::job
