// SPDX-License-Identifier: Apache-2.0
//
// Nobody writes into a file of another process: then no locks are needed, which not all file
// systems have that machines share, and a task that is thought dead and is not does no harm. What a
// dead one left is read like all else: its records say what it had made.
#include "job/part_files.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <filesystem>
#include <string_view>
#include <utility>

#include "pounce/error.h"

namespace pounce::job {
namespace {

constexpr const char* kPart = ".part";
constexpr const char* kWhole = ".whole.part";  // ends as the others do
constexpr const char* kEmpty = "empty";

/// Of this machine, in letters that file names have.
std::string host_name() {
  std::array<char, 256> name{};
  if (gethostname(name.data(), name.size() - 1) != 0) return "host";
  std::string text(name.data());
  std::replace_if(
      text.begin(), text.end(),
      [](unsigned char c) { return std::isalnum(c) == 0 && c != '-' && c != '.'; }, '_');
  return text.substr(0, 64);
}

}  // namespace

PartFiles::PartFiles(JobContext& job, const Hash128& key)
    : job_(job), key_(key), prefix_(to_hex(key) + ".") {}

std::string PartFiles::path(const std::string& name) const {
  return job_.parts_folder + "/" + prefix_ + name;
}

std::vector<std::string> PartFiles::names() const {
  std::vector<std::string> found;
  if (!job_.files->exists(job_.parts_folder)) return found;
  for (const std::string& name : job_.files->list(job_.parts_folder)) {
    if (name.starts_with(prefix_)) found.push_back(name.substr(prefix_.size()));
  }
  return found;
}

/// First those of tasks that came to their end. Of two that made the same part at once each cut it
/// in its own way: the records of the one that ended are taken, and with them all that it had found
/// when it began; those of the other that name a block again are not.
std::vector<std::unique_ptr<ReadFile>> PartFiles::open() const {
  std::vector<std::unique_ptr<ReadFile>> parts;
  std::vector<std::string> found = names();
  std::erase_if(found, [](const std::string& name) { return !name.ends_with(kPart); });
  std::stable_partition(found.begin(), found.end(),
                        [](const std::string& name) { return name.ends_with(kWhole); });
  for (const std::string& name : found) {
    try {
      parts.push_back(job_.files->open(path(name)));
    } catch (const Error& e) {
      // Another run may have assembled the image meanwhile.
      if (e.kind() != ErrorKind::storage || job_.files->exists(path(name))) throw;
    }
  }
  return parts;
}

std::optional<Error> PartFiles::read(const store::ResultGrid& grid,
                                     const std::function<void(const Piece&)>& visit) const {
  std::optional<Error> unread;
  for (const auto& file : open()) {
    std::vector<store::ChunkRef> waiting;
    const store::PackScan scan =
        store::scan_pack(*file, store::PackKind::results, key_,
                         [&](store::ChunkKind kind, const store::ChunkRef& ref,
                             std::span<const std::byte> stored, const store::PackScan&) {
                           if (kind == store::ChunkKind::block) waiting.push_back(ref);
                           if (kind != store::ChunkKind::record) return true;
                           const auto record = store::decode_record(stored, grid);
                           if (!record) return false;
                           visit({*file, *record, waiting, stored});
                           waiting.clear();
                           return true;
                         });
    if (scan.unread && !unread) unread = scan.unread;
  }
  return unread;
}

void PartFiles::count(store::ResultIndex& index) const {
  const auto unread =
      read(index.grid(), [&](const Piece& piece) { index.take(piece.record, piece.chunks); });
  if (unread) job_.warn(std::string(unread->what()) + "; what it cannot show is made again");
}

std::optional<Error> PartFiles::copy(store::ResultIndex& index, store::PackWriter& to) const {
  std::vector<std::byte> bytes;
  return read(index.grid(), [&](const Piece& piece) {
    if (!index.fits(piece.record, piece.chunks.size())) return;
    std::vector<store::ChunkRef> copies;
    for (const store::ChunkRef& chunk : piece.chunks) {
      bytes.resize(chunk.stored_bytes);
      piece.file.read(chunk.offset + store::kChunkHeaderBytes, bytes);
      copies.push_back(to.append(store::ChunkKind::block, bytes, chunk.raw_bytes));
    }
    to.append(store::ChunkKind::record, piece.stored,
              static_cast<std::uint32_t>(piece.stored.size()));
    index.take(piece.record, copies);
  });
}

PartFiles::NewPart PartFiles::create() const {
  job_.files->make_folders(job_.parts_folder);
  const std::string mine = fmt::format("{}.{}", host_name(), getpid());
  for (int n = 0;; ++n) {  // a process of this number was here before, or is in another container
    const std::string stem = path(fmt::format("{}.{}", mine, n));
    const std::string name = stem + kPart;
    if (job_.files->exists(name) || job_.files->exists(stem + kWhole)) continue;
    std::unique_ptr<WriteFile> file;
    try {
      file = job_.files->create(name);
    } catch (const Error& e) {
      if (e.kind() != ErrorKind::storage || !job_.files->exists(name)) throw;
      continue;
    }
    return {std::make_unique<store::PackWriter>(std::move(file), store::PackKind::results, key_),
            name};
  }
}

void PartFiles::finish(NewPart& part) const {
  part.writer->file().sync();
  const std::string whole =
      part.path.substr(0, part.path.size() - std::string_view(kPart).size()) + kWhole;
  job_.files->rename(part.path, whole);
  job_.files->sync_folder(job_.parts_folder);
  part.path = whole;
}

void PartFiles::note_empty() const {
  job_.files->make_folders(job_.parts_folder);
  if (is_empty()) return;
  try {
    job_.files->create(path(kEmpty))->sync();
  } catch (const Error& e) {
    if (e.kind() != ErrorKind::storage || !is_empty()) throw;  // two at once
  }
}

bool PartFiles::is_empty() const { return job_.files->exists(path(kEmpty)); }

void PartFiles::sweep(JobContext& job) {
  if (job.parts_folder.empty() || !job.files->exists(job.parts_folder)) return;
  for (const std::string& name : job.files->list(job.parts_folder)) {
    if (name.ends_with(kPart)) job.files->remove(job.parts_folder + "/" + name);
  }
  std::error_code ignored;  // it holds what says that pages are empty, or what is not ours
  std::filesystem::remove(job.parts_folder, ignored);
}

}  // namespace pounce::job
