// SPDX-License-Identifier: Apache-2.0
//
// Where a pack of results is looked for, when it gets its name and how often it goes to the disk.
//
// Three times, from losses that are small beside what they cost: a name after a second (a listing
// of the folder, a sync of it), a write() of what is in the buffer four times a second at most, and
// an fdatasync() every fifteen seconds. So a process that is killed loses what was under way and a
// quarter of a second, and a machine that loses its power fifteen.
//
// The job's scratch folder is the nearest one above its outputs that is there. When the first image
// is written there may be a nearer one, so the folders above are looked into as well.
#include "job/step_pack.h"

#include <fmt/format.h>

#include <filesystem>
#include <utility>

#include "pounce/error.h"
#include "store/cache/resume_files.h"

namespace pounce::job {
namespace {

constexpr auto kFlushEvery = std::chrono::milliseconds(250);
constexpr auto kSyncEvery = std::chrono::seconds(15);
constexpr std::int64_t kOldestNs = 7 * 86'400'000'000'000;  // a week
constexpr int kMostFolders = 8;                             // above the scratch folder

std::string place(const std::string& folder, const std::string& name) {
  return (std::filesystem::path(folder.empty() ? "." : folder) / name).string();
}

/// What `open` finds of this name in the scratch folder or in those above it.
template <class Open>
auto find_earlier(const std::string& folder, const std::string& name, const Open& open)
    -> decltype(open(name)) {
  if (auto file = open(place(folder, name))) return file;
  std::error_code failed;
  std::filesystem::path at = std::filesystem::absolute(folder.empty() ? "." : folder, failed);
  for (int up = 0; !failed && up < kMostFolders && at != at.root_path(); ++up) {
    at = at.parent_path();
    if (auto file = open((at / name).string())) return file;
  }
  return nullptr;
}

}  // namespace

StepPack::StepPack(JobContext& job, store::PackKind kind, const Hash128& key,
                   const Earlier& earlier)
    : job_(job), kind_(kind), key_(key), name_(store::resume_name(key)) {
  auto file = find_earlier(job_.scratch_folder, name_, [&](const std::string& path) {
    return job_.files->reopen_resumable(path);
  });
  // A second attempt believes nothing that was made from what turned out to be damaged; and what is
  // larger than this job may take, as its user says now, is made again as far as that goes.
  const bool is_too_large = job_.scratch_account != nullptr && job_.scratch_account->is_over();
  if (file != nullptr && (job_.begins_again || is_too_large)) {
    file->forget();
  } else if (file != nullptr) {
    go_on(std::move(file), earlier);
  }
  file.reset();  // what is begun below has its room
  if (writer_ == nullptr) begin();
}

std::unique_ptr<ReadFile> StepPack::find(JobContext& job, const Hash128& key) {
  return find_earlier(job.scratch_folder, store::resume_name(key),
                      [&](const std::string& path) { return job.files->open_private(path); });
}

void StepPack::remove(JobContext& job, const Hash128& key) {
  const auto file =
      find_earlier(job.scratch_folder, store::resume_name(key),
                   [&](const std::string& path) { return job.files->reopen_resumable(path); });
  if (file != nullptr) file->forget();
}

bool StepPack::any_left(JobContext& job) {
  std::error_code failed;
  std::filesystem::path at =
      std::filesystem::absolute(job.scratch_folder.empty() ? "." : job.scratch_folder, failed);
  for (int up = 0; !failed && up <= kMostFolders; ++up, at = at.parent_path()) {
    if (store::has_resume_files(*job.files, at.string())) return true;
    if (at == at.root_path()) break;
  }
  return false;
}

void StepPack::go_on(std::unique_ptr<ResumableFile> file, const Earlier& earlier) {
  store::PackScan whole;  // behind the last group
  store::scan_pack(*file->reader(), kind_, key_,
                   [&](store::ChunkKind kind, const store::ChunkRef& ref,
                       std::span<const std::byte> stored, const store::PackScan& behind) {
                     if (!earlier.take(kind, ref, stored)) return false;
                     if (earlier.is_end(kind)) whole = behind;
                     return true;
                   });
  if (whole.size_bytes == 0) return file->forget();
  file->cut(whole.size_bytes);
  file_ = file.get();
  is_kept_ = true;
  writer_ = std::make_unique<store::PackWriter>(std::move(file), kind_, key_, whole);
}

void StepPack::begin() {
  auto file = job_.files->create_resumable(place(job_.scratch_folder, name_));
  file_ = file.get();
  std::unique_ptr<WriteFile> scratch = std::move(file);
  if (scratch == nullptr) scratch = job_.files->create_scratch(job_.scratch_folder);
  writer_ = std::make_unique<store::PackWriter>(std::move(scratch), kind_, key_);
}

void StepPack::keep() {
  const std::string folder = job_.scratch_folder.empty() ? "." : job_.scratch_folder;
  try {
    is_kept_ = file_->keep();
    if (is_kept_) {
      job_.files->sync_folder(folder);
      store::remove_resume_files(*job_.files, folder, kOldestNs);
      note_folder(folder);
    }
  } catch (const Error& e) {
    // A folder that may not be looked into, say: this job does without.
    if (e.kind() != ErrorKind::storage) throw;
    file_->forget();
    is_kept_ = false;
  }
  if (!is_kept_) file_ = nullptr;
}

void StepPack::note_folder(const std::string& folder) const {
  if (job_.cache_folder.empty()) return;
  std::error_code failed;
  const auto place = std::filesystem::absolute(folder, failed).lexically_normal();
  if (!failed)
    store::note_resume_folder(*job_.files, store::CacheLayout(job_.cache_folder), place.string());
}

void StepPack::commit() {
  if (file_ == nullptr) return;
  const auto now = Clock::now();
  if (!is_kept_ && now - begun_ >= job_.keeps_results_after) keep();
  if (!is_kept_) return;
  if (now - synced_ >= kSyncEvery) {
    file_->sync();
    synced_ = flushed_ = Clock::now();
  } else if (now - flushed_ >= kFlushEvery) {
    file_->flush();
    flushed_ = now;
  }
}

std::unique_ptr<store::PackReader> StepPack::reader() const {
  return std::make_unique<store::PackReader>(
      *writer_, fmt::format("{}/(scratch results pack)", job_.scratch_folder));
}

bool StepPack::take_spare(std::uint64_t bytes) {
  if (bytes > job_.spare_scratch_bytes) return false;
  job_.spare_scratch_bytes -= bytes;
  spare_taken_ += bytes;
  return true;
}

void StepPack::forget() noexcept {
  if (file_ != nullptr) file_->forget();
  file_ = nullptr;
  is_kept_ = false;
}

StepPack::~StepPack() {
  job_.spare_scratch_bytes += spare_taken_;
  if (!is_kept_) {
    if (file_ != nullptr) file_->forget();  // where it has had its name from the start
    return;
  }
  try {
    file_->flush();
  } catch (const Error&) {
    // What could not be written is made again by the next run.
  }
}

}  // namespace pounce::job
