// SPDX-License-Identifier: Apache-2.0
//
// A job asks for the same file many times, from code that knows nothing of the job: readers of
// glTF, OBJ, splats. If each of them opened the name, a file replaced in between would give a mesh
// of one version and a hash of another, and the cache would keep that for good. So what was opened
// first stays open, and open_input() hands it out again. The list is found by a thread-local
// pointer: files are opened far down (a buffer of a glTF, a material library of an OBJ), and a
// parameter for it would go through every reader although none of them has a choice to make.
#include "core/input_file.h"

#include <algorithm>
#include <utility>

namespace pounce {
namespace {

thread_local InputFiles* current = nullptr;

/// One of several that read a kept file.
class SharedFile final : public ReadFile {
 public:
  explicit SharedFile(std::shared_ptr<const ReadFile> file) : file_(std::move(file)) {}
  std::uint64_t size_bytes() const override { return file_->size_bytes(); }
  void read(std::uint64_t offset, std::span<std::byte> out) const override {
    file_->read(offset, out);
  }

 private:
  std::shared_ptr<const ReadFile> file_;
};

bool is_same(const std::optional<FileStatus>& a, const std::optional<FileStatus>& b) {
  return a && b && is_unchanged(*a, *b);
}

}  // namespace

InputFiles::InputFiles() : before_(std::exchange(current, this)) {}

InputFiles::~InputFiles() {
  // Mostly the newest one; whoever outlives it must not lead back to it.
  InputFiles** at = &current;
  while (*at != this) at = &(*at)->before_;
  *at = before_;
}

InputFiles::Kept* InputFiles::find(const std::string& path) {
  const auto found =
      std::find_if(kept_.begin(), kept_.end(), [&](const Kept& kept) { return kept.path == path; });
  return found != kept_.end() ? &*found : nullptr;
}

std::shared_ptr<const ReadFile> InputFiles::get(const std::string& path) {
  const std::lock_guard lock(mutex_);
  ++uses_;
  if (Kept* const kept = find(path)) {
    kept->used = uses_;
    return kept->file;
  }
  FileSystem& files = posix_file_system();
  const auto status = files.status(path);
  Kept opened{path, files.open(path), status, uses_};
  // Who had the name before and after it was opened is the one that was opened.
  if (!is_same(status, files.status(path))) opened.status = {};
  // Open files are limited per process. The one used longest ago is given up; readers that still
  // have it keep it open.
  if (kept_.size() < kMostKept) return kept_.emplace_back(std::move(opened)).file;
  Kept& oldest = *std::min_element(kept_.begin(), kept_.end(),
                                   [](const Kept& a, const Kept& b) { return a.used < b.used; });
  return (oldest = std::move(opened)).file;
}

bool InputFiles::is_in_place(const std::string& path) {
  const std::lock_guard lock(mutex_);
  const Kept* const kept = find(path);
  return kept == nullptr || is_same(kept->status, posix_file_system().status(path));
}

SharesInputs::SharesInputs(InputFiles& files) : before_(std::exchange(current, &files)) {}

SharesInputs::~SharesInputs() { current = before_; }

std::unique_ptr<ReadFile> open_input(const std::string& path) {
  // No list outside of a job: tools and tests open what they name.
  if (current == nullptr) return posix_file_system().open(path);
  return std::make_unique<SharedFile>(current->get(path));
}

bool is_input_in_place(const std::string& path) {
  return current == nullptr || current->is_in_place(path);
}

}  // namespace pounce
