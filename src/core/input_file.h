// SPDX-License-Identifier: Apache-2.0
//
// What a job reads that is not its own: meshes, materials, buffers, scenes. A job reads each of
// them several times (what is it, what does it cost, its triangles, its hash), and all of it must
// be of one file, whatever is put in its place meanwhile.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "core/file.h"

namespace pounce {

/// As long as this object lives, a file that its thread opens by open_input() is opened once: who
/// asks again reads the same one, also where another has its name by now. The newest such object of
/// a thread counts; it must die on the thread that made it. Other threads may share it
/// (SharesInputs).
class InputFiles {
 public:
  InputFiles();
  ~InputFiles();
  InputFiles(const InputFiles&) = delete;
  InputFiles& operator=(const InputFiles&) = delete;

 private:
  friend std::unique_ptr<ReadFile> open_input(const std::string& path);
  friend bool is_input_in_place(const std::string& path);
  friend class SharesInputs;
  struct Kept {
    std::string path;
    std::shared_ptr<const ReadFile> file;
    std::optional<FileStatus> status;  ///< of this very file; nothing if its name changed hands
    std::uint64_t used = 0;            ///< when: larger is later
  };
  /// Null if it is not kept. With mutex_ held.
  Kept* find(const std::string& path);
  std::shared_ptr<const ReadFile> get(const std::string& path);
  bool is_in_place(const std::string& path);

  /// A glTF may name any number of buffers, a job any number of targets, and a process has 1,024
  /// descriptors: of more than these the one that was used longest ago is opened again.
  static constexpr std::size_t kMostKept = 64;

  std::mutex mutex_;  ///< guards what follows
  std::vector<Kept> kept_;
  std::uint64_t uses_ = 0;
  InputFiles* before_;  ///< of its own thread alone
};

/// While it lives, its thread opens what it opens by the files of another one's job.
class SharesInputs {
 public:
  explicit SharesInputs(InputFiles& files);
  ~SharesInputs();
  SharesInputs(const SharesInputs&) = delete;
  SharesInputs& operator=(const SharesInputs&) = delete;

 private:
  InputFiles* before_;
};

/// Opens an input for reading. Throws Error(storage) with path and reason. Thread-safe.
std::unique_ptr<ReadFile> open_input(const std::string& path);

/// False if what open_input() gave of that name is another file by now, or was changed.
bool is_input_in_place(const std::string& path);

}  // namespace pounce
