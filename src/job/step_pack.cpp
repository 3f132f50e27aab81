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

namespace pounce::job {
namespace {

constexpr std::string_view kPrefix = ".pounce-", kSuffix = ".resume";
constexpr auto kFlushEvery = std::chrono::milliseconds(250);
constexpr auto kSyncEvery = std::chrono::seconds(15);
constexpr std::int64_t kMostDays = 7;
constexpr int kMostFolders = 8;  // above the scratch folder

std::string place(const std::string& folder, const std::string& name) {
  return (std::filesystem::path(folder.empty() ? "." : folder) / name).string();
}

std::unique_ptr<ResumableFile> find_earlier(FileSystem& files, const std::string& folder,
                                            const std::string& name) {
  if (auto file = files.reopen_resumable(place(folder, name))) return file;
  std::error_code failed;
  std::filesystem::path at = std::filesystem::absolute(folder.empty() ? "." : folder, failed);
  for (int up = 0; !failed && up < kMostFolders && at != at.root_path(); ++up) {
    at = at.parent_path();
    if (auto file = files.reopen_resumable((at / name).string())) return file;
  }
  return nullptr;
}

bool is_resume_name(const std::string& name) {
  return name.starts_with(kPrefix) && name.ends_with(kSuffix);
}

/// Removes what was left in this folder and never gone on with.
void remove_old(FileSystem& files, const std::string& folder) {
  const auto now = std::chrono::duration_cast<std::chrono::nanoseconds>(
                       std::chrono::system_clock::now().time_since_epoch())
                       .count();
  for (const std::string& name : files.list(folder)) {
    if (!is_resume_name(name)) continue;
    const std::string path = place(folder, name);
    const auto status = files.status(path);
    if (!status || now - status->modified_ns < kMostDays * 86'400'000'000'000) continue;
    // Whoever can open it so has it alone: nobody goes on with it meanwhile.
    if (const auto file = files.reopen_resumable(path)) file->forget();
  }
}

}  // namespace

StepPack::StepPack(JobContext& job, store::PackKind kind, const Hash128& key,
                   const Earlier& earlier)
    : job_(job),
      kind_(kind),
      key_(key),
      name_(fmt::format("{}{}{}", kPrefix, to_hex(key), kSuffix)) {
  auto file = find_earlier(*job_.files, job_.scratch_folder, name_);
  // A second attempt believes nothing that was made from what turned out to be damaged.
  if (file != nullptr && job_.begins_again) file->forget();
  if (file != nullptr && !job_.begins_again) go_on(std::move(file), earlier);
  if (writer_ == nullptr) begin();
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
      remove_old(*job_.files, folder);
    }
  } catch (const Error& e) {
    // A folder that may not be looked into, say: this job does without.
    if (e.kind() != ErrorKind::storage) throw;
    file_->forget();
    is_kept_ = false;
  }
  if (!is_kept_) file_ = nullptr;
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

void StepPack::forget() noexcept {
  if (file_ != nullptr) file_->forget();
  file_ = nullptr;
  is_kept_ = false;
}

StepPack::~StepPack() {
  if (!is_kept_) return;
  try {
    file_->flush();
  } catch (const Error&) {
    // What could not be written is made again by the next run.
  }
}

}  // namespace pounce::job
