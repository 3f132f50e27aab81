// SPDX-License-Identifier: Apache-2.0
#include "tiles/store_folder.h"

#include <fmt/format.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <map>
#include <mutex>
#include <tuple>
#include <utility>

#include "pounce/error.h"

namespace pounce::tiles {
namespace {

constexpr std::array kKinds = {PackKind::geometry, PackKind::colour, PackKind::results,
                               PackKind::splats};

const char* folder_name(PackKind kind) {
  switch (kind) {
    case PackKind::geometry:
      return "geometry";
    case PackKind::colour:
      return "colour";
    case PackKind::results:
      return "results";
    case PackKind::splats:
      return "splats";
  }
  throw Error(ErrorKind::internal, "a pack of no kind (please report)");
}

void require_finished(const PackWriter* writer) {
  if (writer == nullptr || !writer->finished()) {
    throw Error(ErrorKind::internal, "an unfinished pack was published (please report)");
  }
}

/// A file under a temporary name: removed with this object unless it was published under its real
/// one.
class PartFile final : public WriteFile {
 public:
  PartFile(FileSystem& files, std::string path)
      : files_(files), path_(std::move(path)), file_(files.create(path_)) {}
  ~PartFile() override {
    if (published_) return;
    try {
      file_.reset();
      files_.remove(path_);
    } catch (const Error&) {
      // It stays as a leftover, which the next run removes.
    }
  }

  void append(std::span<const std::byte> bytes) override { file_->append(bytes); }
  std::uint64_t size_bytes() const override { return file_->size_bytes(); }
  void sync() override { file_->sync(); }
  std::unique_ptr<ReadFile> reader() const override { return file_->reader(); }

  /// From here on the content is on the disk and the file has its real name.
  void publish(const std::string& to) {
    file_->sync();
    files_.rename(path_, to);
    published_ = true;
  }

 private:
  FileSystem& files_;
  const std::string path_;
  std::unique_ptr<WriteFile> file_;
  bool published_ = false;
};

class CacheFolder final : public StoreFolder {
 public:
  CacheFolder(FileSystem& files, std::string root, std::unique_ptr<FileLock> lock)
      : files_(files), root_(std::move(root)), lock_(std::move(lock)) {
    // We hold the lock, so whatever lies here belongs to a run that is dead.
    for (const std::string& name : files_.list(root_ + "/tmp")) {
      files_.remove(root_ + "/tmp/" + name);
    }
  }

  std::unique_ptr<PackReader> find(PackKind kind, const Hash128& key,
                                   std::string* warning) override {
    const std::string path = path_of(kind, key);
    if (!files_.exists(path)) return nullptr;
    try {
      auto reader = std::make_unique<PackReader>(files_.open(path), path, kind, key);
      std::vector<std::byte> stored;
      reader->read(reader->directory(), ChunkKind::directory, stored);
      return reader;
    } catch (const Error& e) {
      if (e.kind() != ErrorKind::damaged_store) throw;
      files_.remove(path);
      if (warning != nullptr) {
        *warning += fmt::format("{}{} (removed; it is built again)", warning->empty() ? "" : "\n",
                                e.what());
      }
      return nullptr;
    }
  }

  std::unique_ptr<PackWriter> create(PackKind kind, const Hash128& key) override {
    const std::string path = fmt::format("{}/tmp/{}-{}.part", root_, ::getpid(), next_part_++);
    return std::make_unique<PackWriter>(std::make_unique<PartFile>(files_, path), kind, key);
  }

  std::unique_ptr<PackReader> publish(std::unique_ptr<PackWriter> writer) override {
    require_finished(writer.get());
    auto* part = dynamic_cast<PartFile*>(&writer->file());
    if (part == nullptr) {
      throw Error(ErrorKind::internal, "a pack of another store was published (please report)");
    }
    const std::string path = path_of(writer->kind(), writer->key());
    part->publish(path);
    files_.sync_folder(folder_of(writer->kind()));
    return std::make_unique<PackReader>(files_.open(path), path, writer->kind(), writer->key());
  }

  void discard(PackKind kind, const Hash128& key) override { files_.remove(path_of(kind, key)); }
  bool persistent() const override { return true; }

 private:
  std::string folder_of(PackKind kind) const { return root_ + "/" + folder_name(kind); }
  std::string path_of(PackKind kind, const Hash128& key) const {
    return folder_of(kind) + "/" + to_hex(key) + ".pack";
  }

  FileSystem& files_;
  const std::string root_;  // with the version
  const std::unique_ptr<FileLock> lock_;
  std::atomic<std::uint64_t> next_part_{0};
};

class ScratchStore final : public StoreFolder {
 public:
  ScratchStore(FileSystem& files, std::string folder) : files_(files), folder_(std::move(folder)) {}

  std::unique_ptr<PackReader> find(PackKind kind, const Hash128& key, std::string*) override {
    const std::lock_guard lock(mutex_);
    const auto found = packs_.find(Name(kind, key.hi, key.lo));
    return found == packs_.end() ? nullptr : open(*found->second);
  }

  std::unique_ptr<PackWriter> create(PackKind kind, const Hash128& key) override {
    return std::make_unique<PackWriter>(files_.create_scratch(folder_), kind, key);
  }

  std::unique_ptr<PackReader> publish(std::unique_ptr<PackWriter> writer) override {
    require_finished(writer.get());
    auto reader = open(*writer);
    const std::lock_guard lock(mutex_);
    const Name name(writer->kind(), writer->key().hi, writer->key().lo);
    packs_[name] = std::move(writer);
    return reader;
  }

  void discard(PackKind kind, const Hash128& key) override {
    const std::lock_guard lock(mutex_);
    packs_.erase(Name(kind, key.hi, key.lo));
  }
  bool persistent() const override { return false; }

 private:
  using Name = std::tuple<PackKind, std::uint64_t, std::uint64_t>;

  std::unique_ptr<PackReader> open(PackWriter& writer) const {
    return std::make_unique<PackReader>(
        writer.file().reader(),
        fmt::format("{}/(scratch {} pack)", folder_, folder_name(writer.kind())), writer.kind(),
        writer.key());
  }

  FileSystem& files_;
  const std::string folder_;
  std::mutex mutex_;  // guards packs_
  std::map<Name, std::unique_ptr<PackWriter>> packs_;
};

}  // namespace

std::unique_ptr<StoreFolder> StoreFolder::open_cache(FileSystem& files, const std::string& root) {
  const std::string versioned = fmt::format("{}/v{}", root, kFormatVersion);
  files.make_folders(versioned);
  auto lock = files.try_lock(versioned + "/lock");
  if (!lock) return nullptr;
  files.make_folders(versioned + "/tmp");
  for (const PackKind kind : kKinds) files.make_folders(versioned + "/" + folder_name(kind));
  return std::make_unique<CacheFolder>(files, versioned, std::move(lock));
}

std::unique_ptr<StoreFolder> StoreFolder::make_scratch(FileSystem& files,
                                                       const std::string& folder) {
  return std::make_unique<ScratchStore>(files, folder);
}

}  // namespace pounce::tiles
