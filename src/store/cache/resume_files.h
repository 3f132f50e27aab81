// SPDX-License-Identifier: Apache-2.0
//
// Files of results that a job which died has left for the next run (docs/decisions/058-resume.md):
// their names, and who removes those that nobody goes on with.
#pragma once

#include <cstdint>
#include <string>

#include "core/file.h"
#include "core/hash.h"
#include "store/cache/cache_space.h"

namespace pounce::store {

std::string resume_name(const Hash128& key);

/// Are there any in this folder? No, too, where it may not be looked into.
bool has_resume_files(FileSystem& files, const std::string& folder);

struct RemovedFiles {
  std::uint64_t files = 0, bytes = 0;
};
/// Removes from a folder those that no process is at work on, that are this user's own and that
/// nobody has touched for so long.
RemovedFiles remove_resume_files(FileSystem& files, const std::string& folder,
                                 std::int64_t oldest_ns);

/// Notes in a cache that a job leaves such files in this folder, so that whoever tidies the cache
/// finds them. Where that cannot be noted, the next job in the folder removes them.
void note_resume_folder(FileSystem& files, const CacheLayout& layout, const std::string& folder);
/// Removes them in all folders that this user's jobs have noted, and the notes.
RemovedFiles remove_noted_files(FileSystem& files, const CacheLayout& layout);

}  // namespace pounce::store
