// SPDX-License-Identifier: Apache-2.0
//
// A file that appears under its name whole or not at all, and what has to be so around it.
//
// It has no name while it is being written (O_TMPFILE), so that even a killed process leaves
// nothing behind. It gets a hidden name beside its final one only to be renamed over it: linkat()
// cannot replace. Where there are no nameless files it has the hidden name from the start. It is
// locked (flock) as long as it is open: an unlocked one was left by a process that died, and the
// next job with the same output removes it.
//
// Folders that are missing are made with the first file in them, and a job that fails removes those
// that are empty then. Another job may do that at any moment between two of our calls: whatever
// finds its folder gone makes it again, a hundred times at the most.
//
// Leftovers are looked for by listing a folder, which may hold a million files and be on a network:
// the time of a listing decides how soon there is another.
//
// Encoders write through a C stream. Behind it are one descriptor and a position of our own, so a
// failed write is seen here and not by the encoder.
//
// Why not write beside the output and rename: that leaves a file behind wherever a process is
// killed, and on a render farm many are. Without a name there is nothing to remove, and no reader
// can take half a file for an output.
#include "io/files/output_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <map>
#include <mutex>
#include <string_view>
#include <system_error>
#include <utility>

#include "core/own_errors.h"
#include "core/posix_io.h"
#include "pounce/error.h"
#include "pounce/report.h"

namespace pounce::io {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr int kMostLinks = 40;   // as the kernel
constexpr int kMostTries = 100;  // where others remove folders meanwhile
constexpr std::int64_t kStoredTogether = 1 << 20;

std::string folder_of(const fs::path& path) {
  return path.has_parent_path() ? path.parent_path().string() : ".";
}

constexpr int kPause = 50;                    // listings' share of the time: 2 %
constexpr std::size_t kMostFolders = 64;      // remembered
constexpr std::size_t kMostLeftovers = 4096;  // of a folder; the next listing finds others

/// The NAME in ".NAME.<digits>-<digits>.tmp", or nothing.
std::string_view output_of(std::string_view entry) {
  // From the end: a name may have dots, dashes and digits of its own.
  constexpr std::string_view kEnding = ".tmp", kDigits = "0123456789";
  if (!entry.starts_with('.') || !entry.ends_with(kEnding)) return {};
  entry.remove_prefix(1);
  entry.remove_suffix(kEnding.size());
  for (const char before : {'-', '.'}) {
    const std::size_t last = entry.find_last_not_of(kDigits);
    if (last == std::string_view::npos || last + 1 == entry.size() || entry[last] != before)
      return {};
    entry = entry.substr(0, last);
  }
  return entry;
}

void remove_if_left(const std::string& path, uid_t owner) {
  constexpr int kHow = O_NOFOLLOW | O_NONBLOCK;
  int file = open_retrying(path, O_RDWR | kHow);
  // Reading is enough for a lock (but on NFS).
  if (file < 0 && errno == EACCES) file = open_retrying(path, O_RDONLY | kHow);
  if (file < 0) return;
  struct stat opened {
  }, named{};
  // Judged once it is open and locked, since the name may lead to another file by now. Who holds
  // the lock is alive; what belongs to neither this user nor the owner of the output is left alone.
  const bool dead = ::fstat(file, &opened) == 0 && S_ISREG(opened.st_mode) &&
                    (opened.st_uid == ::geteuid() || opened.st_uid == owner) &&
                    ::flock(file, LOCK_EX | LOCK_NB) == 0 && ::lstat(path.c_str(), &named) == 0 &&
                    opened.st_dev == named.st_dev && opened.st_ino == named.st_ino;
  if (dead) ::unlink(path.c_str());
  ::close(file);
}

/// A folder's hidden files, by the outputs they were to become.
struct Listing {
  std::multimap<std::string, std::string, std::less<>> found;
  Clock::time_point end;
  Clock::duration took{};

  explicit Listing(const std::string& folder) {
    const Clock::time_point begin = Clock::now();
    std::error_code ignored;
    for (fs::directory_iterator entry(folder, ignored), end_entry; !ignored && entry != end_entry;
         entry.increment(ignored)) {
      const std::string name = entry->path().filename().string();
      if (const std::string_view output = output_of(name); !output.empty())
        found.emplace(output, name);
      if (found.size() == kMostLeftovers) break;
    }
    end = Clock::now();
    took = end - begin;
  }
};

}  // namespace

void NewFolders::make(const std::string& folder) {
  for (int tries = 1; !make_missing(folder, tries == kMostTries); ++tries) {
  }
}

/// False where another process removed meanwhile what was made or found, if that is not the `last`
/// try.
bool NewFolders::make_missing(const std::string& folder, bool last) {
  std::vector<std::string> missing;
  std::error_code ignored;
  // From the inside out to the first folder that exists, then mkdir() in the other direction.
  for (fs::path path = folder; !path.empty() && !fs::exists(path, ignored);) {
    missing.push_back(path.string());
    const fs::path above = path.parent_path();
    if (above == path) break;  // the root, which nobody may look at
    path = above;
  }
  for (auto path = missing.rbegin(); path != missing.rend(); ++path) {
    if (::mkdir(path->c_str(), 0777) == 0) {
      made_.push_back(*path);
    } else if (errno == ENOENT && !last) {
      return false;
    } else if (errno != EEXIST) {  // another process may be as fast
      throw Error(ErrorKind::storage,
                  fmt::format("{}: cannot create the folder: {}", *path, std::strerror(errno)));
    }
  }
  return true;
}

// rmdir() takes empty folders only: what another job has put there keeps its folder.
NewFolders::~NewFolders() {
  // The innermost first, since the others are empty only then.
  for (auto path = made_.rbegin(); path != made_.rend(); ++path) ::rmdir(path->c_str());
}

std::string existing_folder(const std::string& folder) {
  std::error_code ignored;
  fs::path path = folder.empty() ? "." : folder;
  while (path != "." && !fs::exists(path, ignored)) {
    const fs::path above = path.parent_path();
    path = above.empty() || above == path ? "." : above;
  }
  return path.string();
}

std::string claim_name(const std::string& name) { return "." + name + ".0-0.tmp"; }

void remove_leftovers(const std::string& folder, const std::string& name, uid_t owner) {
  // One set of listings for the process: the jobs of a batch write into the same folders.
  static std::mutex mutex;
  static std::map<std::pair<dev_t, ino_t>, Listing> listings;
  struct stat status {};
  if (::stat(folder.c_str(), &status) != 0) return;
  const std::lock_guard lock(mutex);
  // By identity: a folder may have several names.
  const std::pair key{status.st_dev, status.st_ino};
  auto known = listings.find(key);
  // Not more than a fiftieth of the time goes into listing, however slow the folder is.
  if (known != listings.end() && Clock::now() - known->second.end > kPause * known->second.took)
    known = (listings.erase(known), listings.end());
  if (known == listings.end()) {
    if (listings.size() == kMostFolders) listings.clear();
    known = listings.emplace(key, Listing(folder)).first;
  }
  auto& found = known->second.found;
  const auto [begin, end] = found.equal_range(name);
  for (auto entry = begin; entry != end; ++entry)
    remove_if_left((fs::path(folder) / entry->second).string(), owner);
  found.erase(begin, end);
}

void remove_leftovers_of(const std::string& output) {
  const fs::path place = output_place(output);
  struct stat there {};
  if (place.empty() || ::stat(place.c_str(), &there) != 0) return;
  remove_leftovers(folder_of(place), place.filename().string(), there.st_uid);
}

// Links are followed by hand, since the last one may lead to a file that is not there yet.
std::string output_place(const std::string& given) {
  fs::path path = given;
  for (int link = 0; link < kMostLinks; ++link) {
    std::error_code none;
    const fs::path to = fs::read_symlink(path, none);
    if (none) return path.string();
    path = to.is_absolute() ? to : path.parent_path() / to;
    if (path.string().starts_with("/proc/")) return {};
  }
  return {};
}

// In this order: what is there under the name (a folder or a device is refused, a file hands on its
// mode), leftovers of dead jobs, then the new file, nameless if the file system can do that and
// /proc is there to give it a name later.
OutputFile::OutputFile(const std::string& path)
    : path_(path), target_(output_place(path)), folder_(folder_of(target_)), folders_(folder_) {
  if (target_.empty()) fail("it is a broken link");
  struct stat there {};
  if (::stat(path_.c_str(), &there) == 0) {
    if (!S_ISREG(there.st_mode)) fail("it exists but is not a regular file");
    replaced_ = there;
  }
  check_folder();
  name_ = fs::path(target_).filename().string();
  remove_leftovers(folder_, name_, replaced_ ? there.st_uid : ::geteuid());
  // Until it has the mode of what it replaces nobody else may look into it.
  const mode_t mode = replaced_ ? 0600 : 0666;
  if (::access("/proc/self/fd", X_OK) == 0) {
    descriptor_ = open_retrying(folder_, O_TMPFILE | O_RDWR, mode);
    nameless_ = descriptor_ >= 0;
    if (nameless_) ::flock(descriptor_, LOCK_EX | LOCK_NB);  // it has no name: nobody else can
  }
  if (descriptor_ < 0) open_named(mode);
  stream_ = ::fopencookie(this, "w", {nullptr, write_piece, seek, nullptr});
  if (stream_ == nullptr) {
    ::close(descriptor_);
    if (has_temporary_) ::unlink(temporary_.c_str());
    fail("no stream");
  }
  std::setvbuf(stream_, nullptr, _IOFBF, 256 << 10);
}

/// A job that failed removes the folders that it made and that are empty, as this one's are until
/// its file has a name.
bool OutputFile::folder_is_back(int& tries) {
  if (errno != ENOENT || ++tries > kMostTries) return false;
  folders_.make(folder_);
  return true;
}

void OutputFile::check_folder() {
  struct stat status {};
  for (int tries = 0; ::stat(folder_.c_str(), &status) != 0;) {
    if (!folder_is_back(tries)) fail(fmt::format("{}: {}", folder_, std::strerror(errno)));
  }
  if (!S_ISDIR(status.st_mode)) fail(fmt::format("{} is not a folder", folder_));
}

void OutputFile::next_temporary() {
  static std::atomic<unsigned> counter{0};
  temporary_ =
      (fs::path(folder_) / fmt::format(".{}.{}-{}.tmp", name_, ::getpid(), counter++)).string();
}

// For file systems without nameless files. Between creating and locking a file somebody may take it
// for a leftover and remove it, so whether the name still leads to it is asked afterwards.
void OutputFile::open_named(mode_t mode) {
  for (int tries = 0;;) {
    next_temporary();
    descriptor_ = open_retrying(temporary_, O_CREAT | O_EXCL | O_RDWR, mode);
    if (descriptor_ < 0 && errno == EEXIST) continue;  // a process of our number elsewhere
    if (descriptor_ < 0 && folder_is_back(tries)) continue;
    if (descriptor_ < 0) fail_by(errno);
    // Before it is locked another job may take it for a leftover.
    struct stat named {};
    // Somebody has it locked: a job that is about to remove it. The name is that job's concern
    // then.
    if (::flock(descriptor_, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) {
      ::close(descriptor_);
      continue;
    }
    if (::lstat(temporary_.c_str(), &named) == 0) break;
    ::close(descriptor_);
  }
  has_temporary_ = true;
}

void OutputFile::give_temporary_name() {
  const std::string self = fmt::format("/proc/self/fd/{}", descriptor_);
  for (int tries = 0; !has_temporary_;) {
    next_temporary();
    has_temporary_ =
        ::linkat(AT_FDCWD, self.c_str(), AT_FDCWD, temporary_.c_str(), AT_SYMLINK_FOLLOW) == 0;
    if (!has_temporary_ && errno != EEXIST && !folder_is_back(tries)) fail_by(errno);
  }
}

/// A file that is replaced keeps its permissions, and its owner as far as that is allowed. They are
/// given last: what a killed process leaves is then its user's own, who may remove it.
void OutputFile::keep_mode() const {
  if (!replaced_) return;
  const struct stat& old = *replaced_;
  // Set-ID bits and a group's rights are those of the old owner and group. Where these cannot be
  // given, the rights are not given either.
  mode_t mode = old.st_mode & 07777;
  struct stat own {};
  if (::fstat(descriptor_, &own) != 0) return;
  if ((own.st_uid != old.st_uid || own.st_gid != old.st_gid) &&
      ::fchown(descriptor_, old.st_uid, old.st_gid) != 0) {
    if (::fchown(descriptor_, static_cast<uid_t>(-1), old.st_gid) != 0) mode &= ~02070U;
    mode &= ~04000U;
  }
  (void)!::fchmod(descriptor_, mode);
}

OutputFile::~OutputFile() {
  if (stream_ != nullptr) std::fclose(stream_);
  if (descriptor_ >= 0) ::close(descriptor_);
  if (has_temporary_) ::unlink(temporary_.c_str());
}

// The position is ours, since encoders seek: pwrite() needs no seek of its own.
long OutputFile::write_piece(void* opaque, const char* bytes, std::size_t count) {
  auto& self = *static_cast<OutputFile*>(opaque);
  // A failure is kept for check() and never shown to the encoder: libjpeg ends the process on one.
  for (std::size_t done = 0; done < count && self.failure_ == 0;) {
    const ssize_t put =
        ::pwrite(self.descriptor_, bytes + done, count - done,
                 static_cast<off_t>(self.position_ + static_cast<std::int64_t>(done)));
    if (put > 0) {
      done += static_cast<std::size_t>(put);
    } else if (put == 0 || errno != EINTR) {
      self.failure_ = put == 0 ? EIO : errno;
    }
  }
  // Counted in full after a failure, too: an encoder that seeks must not notice anything.
  self.position_ += static_cast<std::int64_t>(count);
  self.begin_storing();
  return static_cast<long>(count);
}

/// The disk begins with what commit() will wait for. Where it cannot, commit() takes longer; what
/// it says of writing is kept, since it may not be said again.
void OutputFile::begin_storing() {
  if (position_ < storing_to_ + kStoredTogether || failure_ != 0) return;
  const std::int64_t bytes = position_ - storing_to_;
  if (::sync_file_range(descriptor_, storing_to_, bytes, SYNC_FILE_RANGE_WRITE) != 0 &&
      (errno == EIO || errno == ENOSPC || errno == EDQUOT))
    failure_ = errno;
  storing_to_ = position_;
}

int OutputFile::seek(void* opaque, std::int64_t* offset, int whence) {
  auto& self = *static_cast<OutputFile*>(opaque);
  std::int64_t base = 0;
  if (whence == SEEK_CUR) base = self.position_;
  if (whence == SEEK_END) base = ::lseek(self.descriptor_, 0, SEEK_END);
  if (base + *offset < 0) {
    errno = EINVAL;
    return -1;
  }
  self.position_ = *offset = base + *offset;
  return 0;
}

std::uint64_t OutputFile::size_bytes() {
  std::fflush(stream_);
  struct stat status {};
  return ::fstat(descriptor_, &status) == 0 ? static_cast<std::uint64_t>(status.st_size) : 0;
}

std::size_t OutputFile::read_back(std::int64_t offset, void* out, std::size_t count) noexcept {
  std::fflush(stream_);
  std::size_t done = 0;
  while (done < count && failure_ == 0) {
    const ssize_t got = ::pread(descriptor_, static_cast<char*>(out) + done, count - done,
                                static_cast<off_t>(offset) + static_cast<off_t>(done));
    if (got == 0) break;
    if (got > 0) {
      done += static_cast<std::size_t>(got);
    } else if (errno != EINTR) {
      failure_ = errno;
    }
  }
  return done;
}

void OutputFile::check() const {
  if (failure_ != 0) fail_by(failure_);
}

void OutputFile::close() {
  if (stream_ == nullptr) return;
  const bool flushed = std::fclose(std::exchange(stream_, nullptr)) == 0;
  const int reason = errno;
  check();
  if (!flushed) fail_by(reason);
}

// Data first, then the name, then the folder that holds the name: after a power failure there is
// the old file or the new one, whole.
void OutputFile::commit() {
  close();
  if (!sync_retrying(descriptor_)) fail_by(errno);
  if (nameless_) give_temporary_name();
  keep_mode();
  // Opened first: where that fails for want of a descriptor the old file is still there.
  const int folder = open_retrying(folder_, O_RDONLY | O_DIRECTORY);
  if (folder < 0 && errno != EACCES && errno != EINVAL) fail_by(errno);
  if (::rename(temporary_.c_str(), target_.c_str()) != 0) {
    const int reason = errno;
    if (folder >= 0) ::close(folder);
    fail_by(reason);
  }
  has_temporary_ = false;
  const bool synced = folder < 0 || sync_retrying(folder);
  const int reason = errno;
  if (folder >= 0) ::close(folder);
  // Some network file systems cannot sync a folder, and one that cannot be read is not opened; the
  // file itself is safe.
  if (synced || reason == EINVAL || reason == EACCES) return;
  throw Error(
      ErrorKind::storage,
      fmt::format("{}: was written, but its folder could not be synced to the disk ({}), so its "
                  "name may be lost in a power failure; check the disk and run the job again",
                  path_, std::strerror(reason)),
      is_passing(reason));
}

void OutputFile::fail_by(int code) const {
  fail(std::string(std::strerror(code)) + storage_advice(code), code);
}

void OutputFile::fail(const std::string& what, int code) const {
  throw Error(ErrorKind::storage, fmt::format("cannot write {}: {}", path_, what),
              is_passing(code));
}

}  // namespace pounce::io

namespace pounce {

void save_report(const Report& report, const std::string& path) {
  with_own_errors([&] {
    const std::string text = to_json(report);
    io::OutputFile file(path);
    std::fwrite(text.data(), 1, text.size(), file.stream());
    file.commit();
  });
}

}  // namespace pounce
