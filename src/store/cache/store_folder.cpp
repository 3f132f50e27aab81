// SPDX-License-Identifier: Apache-2.0
//
// The tile cache: one folder, several processes, no server.
//
//   who                   has locked
//   reads a pack          the pack, shared
//   writes a pack         its part in tmp, shared (the lock stays with the file when it is
//                         renamed), and the key's lock file, exclusively
//   waits for a pack      nothing
//   makes room            space.lock, exclusively, for a look around and what follows from it
//   removes a file        that file, exclusively: nobody else has it open
//
// All locks are flock()s: they end with their process, however it ends, so there are no time-outs
// and nothing to clean up by hand. Nobody waits for a key while holding one (a store that has
// claimed a key makes its own copy of the next one instead), and space.lock is held by nobody who
// waits: no deadlock.
//
// A pack's life: find() misses and claims the key; create() opens a part under a name of this
// process; publish() syncs it and gives it its real name, in one step, without replacing. So a name
// stands for a whole pack or for nothing, whenever a process dies. Whoever waits for a key looks
// for the pack again once it has the key.
//
// Nothing here may fail a job that could run without a cache: what does not fit the limit, may not
// be written or is damaged goes to the scratch store of the process, with a note.
#include "store/cache/store_folder.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <map>
#include <mutex>
#include <set>
#include <thread>
#include <tuple>
#include <utility>

#include "pounce/error.h"
#include "store/cache/cache_space.h"

namespace pounce::store {
namespace {

constexpr auto kLookAgain = std::chrono::milliseconds(50);
constexpr auto kTidiedAway = std::chrono::milliseconds(2);

double mebibytes(std::uint64_t bytes) { return static_cast<double>(bytes) / (1 << 20); }

using Name = std::tuple<PackKind, std::uint64_t, std::uint64_t>;
Name name_of(PackKind kind, const Hash128& key) { return {kind, key.hi, key.lo}; }

constexpr std::uint64_t kCopyBytes = 1 << 20;

/// A pack of the cache while it is being written: a file under a temporary name that grows as far
/// as the cache's limit lets it. Where it does not, its content moves to a nameless scratch file,
/// the name goes, and writing continues there. Removed with this object unless it was published.
/// Not thread-safe.
class CachePart final : public WriteFile {
 public:
  /// `file` is the one at `path`, held. `claim` is the lock on the pack's key, may be null.
  CachePart(FileSystem& files, CacheSpace& space, std::string path, std::unique_ptr<WriteFile> file,
            std::string scratch_folder, std::unique_ptr<FileLock> claim)
      : files_(files),
        space_(space),
        path_(std::move(path)),
        scratch_folder_(std::move(scratch_folder)),
        claim_(std::move(claim)),
        file_(std::move(file)) {}
  ~CachePart() override {
    if (!named_) return;
    try {
      files_.remove(path_);
    } catch (const Error&) {
      // It stays as a leftover, which the next run removes.
    }
  }

  void append(std::span<const std::byte> bytes) override {
    const std::uint64_t size = file_->size_bytes() + bytes.size();
    if (!in_scratch_ && size > reserved_bytes_) {
      reserved_bytes_ = space_.reserve(path_, reserved_bytes_, size);
      // 0 means refused. What was written so far is copied: the reader of a pack sees one file.
      if (reserved_bytes_ == 0) move_to_scratch();
    }
    file_->append(bytes);
  }
  std::uint64_t size_bytes() const override { return file_->size_bytes(); }
  void sync() override { file_->sync(); }
  std::unique_ptr<ReadFile> reader() const override { return file_->reader(); }

  bool in_scratch() const { return in_scratch_; }
  /// Brings the content to the disk and gives the file its real name; if that exists already, this
  /// one's name goes.
  void publish(const std::string& to) {
    const std::uint64_t size = file_->size_bytes();
    file_->sync();
    // UINT64_MAX stands for "without limit", where nothing was reserved.
    if (reserved_bytes_ != UINT64_MAX) {
      files_.resize(path_, size);  // what was reserved and not needed
      file_->sync();
    }
    if (!files_.rename_new(path_, to)) files_.remove(path_);
    named_ = false;
  }
  /// Lets others have the key.
  void release_claim() { claim_.reset(); }

 private:
  void move_to_scratch() {
    auto scratch = files_.create_scratch(scratch_folder_);
    if (const std::uint64_t size = file_->size_bytes(); size > 0) {
      const auto written = file_->reader();
      std::vector<std::byte> piece;
      for (std::uint64_t at = 0; at < size; at += piece.size()) {
        piece.resize(static_cast<std::size_t>(std::min(kCopyBytes, size - at)));
        written->read(at, piece);
        scratch->append(piece);
      }
    }
    file_ = std::move(scratch);
    in_scratch_ = true;
    files_.remove(path_);
    named_ = false;
  }

  FileSystem& files_;
  CacheSpace& space_;
  const std::string path_;
  const std::string scratch_folder_;
  std::unique_ptr<FileLock> claim_;
  std::unique_ptr<WriteFile> file_;
  std::uint64_t reserved_bytes_ = 0;
  bool in_scratch_ = false, named_ = true;
};

/// The lock on a key; its file goes with it.
class Claim final : public FileLock {
 public:
  Claim(FileSystem& files, std::string path, std::unique_ptr<FileLock> lock,
        std::shared_ptr<std::atomic<int>> count)
      : files_(files), path_(std::move(path)), lock_(std::move(lock)), count_(std::move(count)) {
    ++*count_;
  }
  ~Claim() override {
    // The name first, then the lock: the other way round, a process that has just locked the file
    // would lose its name to this one.
    try {
      files_.remove(path_);
    } catch (const Error&) {
      // An empty lock file that stays hurts nobody; the next run removes it.
    }
    lock_.reset();
    --*count_;
  }

 private:
  FileSystem& files_;
  const std::string path_;
  std::unique_ptr<FileLock> lock_;
  std::shared_ptr<std::atomic<int>> count_;
};

/// The cache as one process sees it. What does not fit, or may not be written, goes to a scratch
/// store of its own, so that a job never fails for want of a cache.
class CacheFolder final : public StoreFolder {
 public:
  CacheFolder(FileSystem& files, CacheLayout layout, CacheOptions options, bool read_only)
      : files_(files),
        layout_(std::move(layout)),
        options_(std::move(options)),
        read_only_(read_only),
        space_(files, layout_, options_.limit_bytes, nullptr),
        unkept_(make_scratch(files, options_.scratch_folder)) {
    if (read_only_) {
      notes_.push_back(layout_.folder() +
                       ": not writable; packs are read from it, but none are added");
    }
  }

  std::unique_ptr<PackReader> find(PackKind kind, const Hash128& key,
                                   std::string* warning) override {
    if (auto pack = unkept_->find(kind, key, warning)) return pack;
    std::string damage;
    if (is_left_out(kind, key)) return nullptr;
    if (auto pack = open_sound(layout_, kind, key, &damage)) {
      const std::lock_guard lock(mutex_);
      from_second_.erase(name_of(kind, key));
      return pack;
    }
    if (auto pack = find_second(kind, key)) return pack;
    bool removed = false;
    if (!read_only_ && adds(kind)) {
      auto claim = claim_key(kind, key);
      // Somebody may have made it, or made it anew, before the key was ours.
      damage.clear();
      if (auto pack = open_sound(layout_, kind, key, &damage)) return pack;
      if (!damage.empty()) removed = discard(kind, key);
      const std::lock_guard lock(mutex_);
      if (damage.empty() || removed) claims_[name_of(kind, key)] = std::move(claim);
    }
    if (!damage.empty() && warning != nullptr) {
      *warning += fmt::format("{}{} ({}; rebuilding it)", warning->empty() ? "" : "\n", damage,
                              removed ? "removed" : "ignored");
    }
    return nullptr;
  }

  void give_up(PackKind kind, const Hash128& key) override {
    const std::lock_guard lock(mutex_);
    claims_.erase(name_of(kind, key));
  }

  std::unique_ptr<PackWriter> create(PackKind kind, const Hash128& key,
                                     const std::string& label) override {
    if (read_only_ || !adds(kind) || is_left_out(kind, key))
      return unkept_->create(kind, key, label);
    std::unique_ptr<FileLock> claim;
    {
      const std::lock_guard lock(mutex_);
      claim = std::move(claims_[name_of(kind, key)]);
      claims_.erase(name_of(kind, key));
      if (!label.empty()) labels_[name_of(kind, key)] = label;
    }
    for (;;) {
      const std::string path =
          fmt::format("{}/{}-{}.part", layout_.parts_folder(), ::getpid(), next_part_++);
      // None: another store of this process has the name, or a namesake on another machine.
      if (auto file = files_.create_held(path)) {
        return std::make_unique<PackWriter>(
            std::make_unique<CachePart>(files_, space_, path, std::move(file),
                                        options_.scratch_folder, std::move(claim)),
            kind, key);
      }
    }
  }

  std::unique_ptr<PackReader> publish(std::unique_ptr<PackWriter> writer) override {
    auto* part = writer == nullptr ? nullptr : dynamic_cast<CachePart*>(&writer->file());
    if (part == nullptr && writer != nullptr &&
        (read_only_ || !adds(writer->kind()) || is_left_out(writer->kind(), writer->key()))) {
      return unkept_->publish(std::move(writer));
    }
    if (part == nullptr || !writer->finished()) {
      throw Error(ErrorKind::internal,
                  "an unfinished pack, or one of another store, was published (please report)");
    }
    const PackKind kind = writer->kind();
    const Hash128 key = writer->key();
    if (part->in_scratch()) {
      note_unkept(writer->size_bytes());
      part->release_claim();
      return unkept_->publish(std::move(writer));
    }
    // The label first: without a pack it is litter, which goes when room is looked for. A pack
    // without a label, as a process that dies between the two would leave it, is never made again.
    const std::string path = layout_.pack(kind, key);
    write_label(kind, key);
    part->publish(path);
    files_.sync_folder(layout_.kind_folder(kind));
    auto file = files_.open_held(path);
    if (file == nullptr) file = part->reader();  // removed again already: it is still open here
    return std::make_unique<PackReader>(std::move(file), path, kind, key);
  }

  bool is_kept(const PackWriter& writer) override {
    const auto* part = dynamic_cast<const CachePart*>(&writer.file());
    if (part == nullptr) return false;
    if (part->in_scratch()) note_unkept(writer.size_bytes());
    return !part->in_scratch();
  }

  bool discard(PackKind kind, const Hash128& key) override {
    unkept_->discard(kind, key);
    {
      // The second cache is not ours to mend: what it has is made here.
      const std::lock_guard lock(mutex_);
      if (from_second_.erase(name_of(kind, key)) > 0) {
        second_left_out_.insert(name_of(kind, key));
        return false;
      }
    }
    try {
      if (!read_only_) {
        files_.remove(layout_.pack(kind, key));
        return true;
      }
    } catch (const Error&) {
      // Another user's, in a folder where each removes their own.
    }
    const std::lock_guard lock(mutex_);
    left_out_.insert(name_of(kind, key));
    return false;
  }

  void add_new(PackKind kind, bool adds) override {
    const std::lock_guard lock(mutex_);
    if (adds) {
      not_added_.erase(kind);
    } else {
      not_added_.insert(kind);
    }
  }

  bool persistent() const override { return true; }

  std::vector<std::string> take_notes() override {
    const std::lock_guard lock(mutex_);
    return std::exchange(notes_, {});
  }

 private:
  /// What is damaged there is somebody else's to mend: it is made again here.
  std::unique_ptr<PackReader> find_second(PackKind kind, const Hash128& key) {
    if (options_.second_root.empty()) return nullptr;
    {
      const std::lock_guard lock(mutex_);
      if (second_left_out_.contains(name_of(kind, key))) return nullptr;
    }
    std::string damage;
    auto pack = open_sound(CacheLayout(options_.second_root), kind, key, &damage);
    const std::lock_guard lock(mutex_);
    if (pack != nullptr) from_second_.insert(name_of(kind, key));
    if (!damage.empty()) notes_.push_back(damage + "; --cache-readonly has it, this run makes it");
    return pack;
  }

  /// The pack under this key if there is one whose head and directory are sound; `damage` says why
  /// not.
  std::unique_ptr<PackReader> open_sound(const CacheLayout& layout, PackKind kind,
                                         const Hash128& key, std::string* damage) {
    const std::string path = layout.pack(kind, key);
    auto file = files_.open_held(path);
    if (file == nullptr) return nullptr;
    try {
      auto reader = std::make_unique<PackReader>(std::move(file), path, kind, key);
      // The directory now, while a damaged pack is only one to build again; blocks when they are
      // read, which restarts the job.
      reader->read(reader->directory(), ChunkKind::directory);
      if (options_.verify) reader->verify();
      if (&layout == &layout_) note_use(path);
      return reader;
    } catch (const Error& e) {
      if (e.kind() != ErrorKind::damaged_store) throw;
      *damage = e.what();
      return nullptr;
    }
  }

  bool adds(PackKind kind) {
    const std::lock_guard lock(mutex_);
    return !not_added_.contains(kind);
  }

  bool is_left_out(PackKind kind, const Hash128& key) {
    const std::lock_guard lock(mutex_);
    return left_out_.contains(name_of(kind, key));
  }

  /// Remembers when a pack was used last. Somebody else's pack, or a folder that is read only, may
  /// not let us: then it counts as unused.
  void note_use(const std::string& path) {
    if (read_only_) return;
    try {
      files_.touch(path);
    } catch (const Error&) {
    }
  }

  /// Waits until the key is ours; null if it may not be waited for.
  std::unique_ptr<FileLock> claim_key(PackKind kind, const Hash128& key) {
    const std::string path = layout_.key_lock(kind, key);
    for (int look = 0;; ++look) {
      if (auto lock = files_.try_lock(path)) {
        return std::make_unique<Claim>(files_, path, std::move(lock), claim_count_);
      }
      if (look == 0) {  // it may just be tidied away, which is soon over
        std::this_thread::sleep_for(kTidiedAway);
        continue;
      }
      // Two processes that each hold a key and wait for the other's would wait for ever.
      if (*claim_count_ > 0) return nullptr;
      if (options_.waiting) options_.waiting(lock_holder(files_, path), layout_.pack(kind, key));
      std::this_thread::sleep_for(kLookAgain);
    }
  }

  void note_unkept(std::uint64_t size_bytes) {
    const std::lock_guard lock(mutex_);
    if (std::exchange(unkept_told_, true)) return;
    notes_.push_back(
        fmt::format("{}: no space for a pack of {:.1f} MiB within --cache-limit ({:.1f} MiB) and "
                    "the free disk space; this run does not store what does not fit",
                    layout_.folder(), mebibytes(size_bytes), mebibytes(space_.limit_bytes())));
  }

  /// For people: that it cannot be written does not matter.
  void write_label(PackKind kind, const Hash128& key) {
    std::string label;
    {
      const std::lock_guard lock(mutex_);
      const auto found = labels_.find(name_of(kind, key));
      if (found == labels_.end()) return;
      label = std::move(found->second) + "\n";
      labels_.erase(found);
    }
    try {
      const std::string path = layout_.label(kind, key);
      files_.remove(path);
      const auto file = files_.create(path);
      file->append(std::as_bytes(std::span(label)));
      (void)file->reader();  // empties its buffer; no need to have it on the disk
    } catch (const Error&) {
    }
  }

  FileSystem& files_;
  const CacheLayout layout_;
  const CacheOptions options_;
  const bool read_only_;
  CacheSpace space_;
  const std::unique_ptr<StoreFolder> unkept_;  ///< what the limit had no room for
  const std::shared_ptr<std::atomic<int>> claim_count_ = std::make_shared<std::atomic<int>>(0);
  std::atomic<std::uint64_t> next_part_{0};
  std::mutex mutex_;                                  // guards all below
  std::map<Name, std::unique_ptr<FileLock>> claims_;  ///< keys that find() claimed, until create()
  std::map<Name, std::string> labels_;
  std::set<PackKind> not_added_;
  std::set<Name> left_out_;                       ///< damaged packs that may not be removed
  std::set<Name> from_second_, second_left_out_;  ///< given of the second cache; damaged there
  std::vector<std::string> notes_;
  bool unkept_told_ = false;
};

}  // namespace

std::unique_ptr<StoreFolder> StoreFolder::open_cache(FileSystem& files, const std::string& root,
                                                     CacheOptions options) {
  CacheLayout layout(root);
  if (options.scratch_folder.empty()) options.scratch_folder = layout.folder();
  // A farm's shared cache may be read only for this user: then it saves time all the same.
  if (files.exists(layout.folder()) && !files.is_writable(layout.folder())) {
    return std::make_unique<CacheFolder>(files, std::move(layout), std::move(options), true);
  }
  files.make_folders(layout.parts_folder());
  files.make_folders(layout.locks_folder());
  for (const PackKind kind : kCachedKinds) files.make_folders(layout.kind_folder(kind));
  remove_leftovers(files, layout);
  // Asked once: a file system without locks is better known before the first pack than at it.
  const std::string probe = fmt::format("{}/{}{}", layout.locks_folder(), kProbe, ::getpid());
  (void)files.try_lock(probe);
  files.remove(probe);
  return std::make_unique<CacheFolder>(files, std::move(layout), std::move(options), false);
}

}  // namespace pounce::store
