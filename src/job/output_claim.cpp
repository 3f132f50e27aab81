// SPDX-License-Identifier: Apache-2.0
//
// Who makes an output, where several jobs are to make it: the holder of the lock on a hidden file
// beside it (docs/decisions/039-output-claims.md).
//
// All or none, so that nobody holds one output while waiting for another. A lock that cannot be had
// because the file system has none, or the folder cannot be written, counts as free; the job then
// behaves as if it were alone.
#include "job/output_claim.h"

#include <algorithm>
#include <filesystem>
#include <utility>

#include "core/file.h"
#include "io/files/output_file.h"
#include "pounce/error.h"

namespace pounce::job {
namespace {

/// The lock on one output; its file goes with it.
class Lock {
 public:
  Lock(std::unique_ptr<io::NewFolders> folders, std::string path, std::unique_ptr<FileLock> lock)
      : folders_(std::move(folders)), path_(std::move(path)), lock_(std::move(lock)) {}
  ~Lock() {
    try {
      posix_file_system().remove(path_);
    } catch (const Error&) {
      // It is then a leftover, which the next job with this output removes.
    }
  }
  Lock(const Lock&) = delete;
  Lock& operator=(const Lock&) = delete;

 private:
  std::unique_ptr<io::NewFolders> folders_;  ///< those that are still empty go last
  std::string path_;
  std::unique_ptr<FileLock> lock_;
};

}  // namespace

std::optional<OutputClaim> OutputClaim::take(std::vector<std::string> outputs,
                                             std::string* holder) {
  // In one order for all jobs: of two that want the same outputs one gets them all.
  std::sort(outputs.begin(), outputs.end());
  outputs.erase(std::unique(outputs.begin(), outputs.end()), outputs.end());
  FileSystem& files = posix_file_system();
  OutputClaim claim;
  for (const std::string& output : outputs) {
    const std::filesystem::path place = io::output_place(output);
    if (place.empty()) continue;  // whoever writes it says what is wrong
    const std::string folder = place.has_parent_path() ? place.parent_path().string() : ".";
    const std::string path =
        (std::filesystem::path(folder) / io::claim_name(place.filename().string())).string();
    try {
      auto folders = std::make_unique<io::NewFolders>(folder);
      auto lock = files.try_lock(path);
      if (lock == nullptr) {
        if (holder != nullptr) *holder = lock_holder(files, path);
        return std::nullopt;
      }
      claim.locks_.push_back(std::make_shared<Lock>(std::move(folders), path, std::move(lock)));
    } catch (const Error&) {
      // No locks here; and a folder that cannot be written is told of when it is.
    }
  }
  return claim;
}

}  // namespace pounce::job
