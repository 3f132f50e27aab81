// SPDX-License-Identifier: Apache-2.0
//
// A library that is preloaded into pounce and kills it at one of its calls that change a file:
// every write, sync, link, rename, removal, change of size, mode or time, and every file or folder
// that is created. Whoever goes through all numbers has killed a job everywhere that a kill can
// matter: between two such calls nothing changes on disk. Or it lets a call fail, as a disk would:
// then every opening, reading and mapping of a file counts too.
//
// A kill is one of
//   before  dies before the call
//   half    lets half of a write through, then dies (other calls: as before)
//   zeros   dies as if the power failed: what was written and not synced reads as zeros
//   short   the same, and files end where something was not synced
//
// A fault is one of these, once, or with a + behind it from this call on
//   eio      it fails, whatever it is
//   enospc   there is no room: it fails if it writes, makes something, or syncs
//   emfile   it fails if it opens a file
//   eintr    a signal came before it began: it fails if it opens, reads, writes or syncs
//   partial  a read or a write does half of what it was asked for
//
// What a kernel does to unsynced data is anything between the last two: they are the two that it
// does in practice. What it does to names that were not synced is the same as an earlier kill.
//
// Jobs here take less than a second, and what takes less is not kept for a later run. So the clock
// can be made to run ahead at every look at it.
//
// Decoders have processes of their own: only the process that was started first counts and dies.
#include <dlfcn.h>
#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <map>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

namespace {

enum class How { before, half, zeros, cut_short, fault };

/// What kinds of calls there are; a fault concerns some.
enum Kind : unsigned {
  kOpens = 1,
  kReads = 2,
  kWrites = 4,  // data
  kMakes = 8,   // a name, or room
  kSyncs = 16,
  kOther = 32,  // renames, removals, modes, times
  kMaps = 64,
  kAny = 127,
};

struct Fault {
  const char* name;
  int number;  // of the error; 0: half is done
  unsigned kinds;
};

constexpr Fault kFaults[] = {
    {"eio", EIO, kAny},
    {"enospc", ENOSPC, kWrites | kMakes | kSyncs},
    {"emfile", EMFILE, kOpens},
    {"eintr", EINTR, kOpens | kReads | kWrites | kSyncs},
    {"partial", 0, kReads | kWrites},
};

/// What was written to a file since it was last synced.
struct Unsynced {
  int fd = -1;  ///< of our own: the job may have closed its own
  std::vector<std::pair<off_t, off_t>> ranges;
};

struct State {
  pid_t owner = 0;
  long at = 0;  ///< the call to die at; 0: none
  How how = How::before;
  Fault fault{"", 0, kWrites | kMakes | kSyncs | kOther};  ///< a kill's kinds
  bool goes_on = false;                                    ///< the fault, from its call on
  long clock_step_ns = 0;
  std::string report;
  std::atomic<long> calls{0}, looks{0};
  std::mutex mutex;   // guards what follows
  std::string trace;  ///< the calls, a line for each, where it does not die
  std::map<std::pair<dev_t, ino_t>, Unsynced> unsynced;
};

constexpr const char* kMemory = "/memfd:";  ///< files that are no files

State* state = nullptr;  // null before main(), and after it

template <class Function>
Function next(const char* name) {
  return reinterpret_cast<Function>(dlsym(RTLD_NEXT, name));
}

std::string setting(const char* name) {
  const char* const text = std::getenv(name);
  return text == nullptr ? "" : text;
}

/// By the kernel itself: our own calls do not count.
void write_report(const std::string& text) {
  if (state->report.empty()) return;
  const long fd = syscall(SYS_openat, AT_FDCWD, state->report.c_str(),
                          O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  if (fd < 0) return;
  (void)!syscall(SYS_write, fd, text.data(), text.size());
  syscall(SYS_close, fd);
}

__attribute__((constructor)) void begin() {
  auto* const made = new State;
  made->owner = getpid();
  made->at = std::atol(setting("KILL_POINT_AT").c_str());
  std::string how = setting("KILL_POINT_HOW");
  made->goes_on = !how.empty() && how.back() == '+';
  if (made->goes_on) how.pop_back();
  made->how = how == "half"    ? How::half
              : how == "zeros" ? How::zeros
              : how == "short" ? How::cut_short
                               : How::before;
  for (const Fault& fault : kFaults) {
    if (how != fault.name) continue;
    made->how = How::fault;
    made->fault = fault;
  }
  made->clock_step_ns = 1'000'000 * std::atol(setting("KILL_POINT_CLOCK_MS").c_str());
  made->report = setting("KILL_POINT_REPORT");
  unsetenv("LD_PRELOAD");  // for the processes that this one starts
  state = made;
}

__attribute__((destructor)) void end() {
  if (state == nullptr || getpid() != state->owner) return;
  if (state->at == 0 || state->trace.empty()) write_report("ended\n" + state->trace);
  state = nullptr;
}

bool counts() { return state != nullptr && getpid() == state->owner; }

bool loses_unsynced() { return state->how == How::zeros || state->how == How::cut_short; }

void note_written(int fd, off_t from, ssize_t bytes) {
  if (bytes <= 0 || !loses_unsynced()) return;
  struct stat file {};
  if (fstat(fd, &file) != 0) return;
  const std::lock_guard lock(state->mutex);
  Unsynced& entry = state->unsynced[{file.st_dev, file.st_ino}];
  if (entry.fd < 0) {
    // Not a duplicate: that would hold the job's locks.
    const std::string self = "/proc/self/fd/" + std::to_string(fd);
    entry.fd = static_cast<int>(syscall(SYS_openat, AT_FDCWD, self.c_str(), O_RDWR | O_CLOEXEC));
  }
  entry.ranges.emplace_back(from, from + bytes);
}

void note_synced(int fd) {
  struct stat file {};
  if (fstat(fd, &file) != 0) return;
  const std::lock_guard lock(state->mutex);
  const auto found = state->unsynced.find({file.st_dev, file.st_ino});
  if (found != state->unsynced.end()) found->second.ranges.clear();
}

void lose_unsynced() {
  for (const auto& [id, file] : state->unsynced) {
    struct stat now {};
    if (file.fd < 0 || fstat(file.fd, &now) != 0) continue;
    for (const auto& [from, to] : file.ranges) {
      if (state->how == How::cut_short) {
        if (from < now.st_size) now.st_size = from;
      } else {
        const std::vector<char> zeros(static_cast<std::size_t>(to - from));
        (void)!syscall(SYS_pwrite64, file.fd, zeros.data(), zeros.size(), from);
      }
    }
    if (state->how == How::cut_short) syscall(SYS_ftruncate, file.fd, now.st_size);
  }
}

[[noreturn]] void die(const char* call, const std::string& what) {
  write_report("killed at " + std::to_string(state->at) + ": " + call + " " + what + "\n");
  // Held to the end: another thread's file that was synced meanwhile gets no name any more.
  state->mutex.lock();
  if (loses_unsynced()) lose_unsynced();
  kill(state->owner, SIGKILL);
  for (;;) pause();
}

/// Is this the call to die at, or to let fail?
bool is_chosen(Kind kind, const char* call) {
  if ((kind & state->fault.kinds) == 0) return false;
  const long number = ++state->calls;
  if (state->at == 0) {
    const std::lock_guard lock(state->mutex);
    state->trace += call;
    state->trace += '\n';
    return false;
  }
  return state->goes_on ? number >= state->at : number == state->at;
}

void note_fault(const char* call, const std::string& what) {
  const std::lock_guard lock(state->mutex);
  if (!state->trace.empty()) return;
  state->trace = "failed at " + std::to_string(state->at) + ": " + call + " " + what + "\n";
  write_report(state->trace);
}

/// Dies at the call it is to die at. Returns true at one that is to fail, with errno.
bool point(Kind kind, const char* call, const std::string& what) {
  if (what.starts_with(kMemory) || !counts() || !is_chosen(kind, call)) return false;
  if (state->how != How::fault) die(call, what);
  note_fault(call, what);
  errno = state->fault.number;
  return true;
}

std::string name_of(int fd) {
  char name[512];
  const std::string self = "/proc/self/fd/" + std::to_string(fd);
  const ssize_t size = readlink(self.c_str(), name, sizeof name);
  return size < 0 ? "?" : std::string(name, static_cast<std::size_t>(size));
}

bool is_file(int fd) {
  struct stat file {};
  return fstat(fd, &file) == 0 && S_ISREG(file.st_mode) && !name_of(fd).starts_with(kMemory);
}

/// A read or write of so many bytes. `pass` does the first so many of them.
template <class Pass>
ssize_t pass_bytes(Kind kind, const char* call, int fd, off_t at, std::size_t bytes,
                   const Pass& pass) {
  if (!counts() || !is_file(fd)) return pass(bytes);
  if (is_chosen(kind, call)) {
    const std::string what =
        name_of(fd) + " " + std::to_string(bytes) + " bytes at " + std::to_string(at);
    if (state->how == How::half) pass(bytes / 2);
    if (state->how != How::fault) die(call, what);
    note_fault(call, what);
    errno = state->fault.number;
    return errno != 0 ? -1 : pass((bytes + 1) / 2);
  }
  const ssize_t done = pass(bytes);
  if (kind == kWrites) note_written(fd, at, done);
  return done;
}

int pass_sync(const char* call, int fd, int (*sync)(int)) {
  if (point(kSyncs, call, name_of(fd))) return -1;
  const int failed = sync(fd);
  if (counts() && failed == 0) note_synced(fd);
  return failed;
}

bool makes(int flags) { return (flags & O_CREAT) != 0 || (flags & O_TMPFILE) == O_TMPFILE; }

/// An opening that makes a file is both.
Kind opening(int flags) { return makes(flags) ? Kind(kOpens | kMakes) : kOpens; }

}  // namespace

#define PASS(kind, name, parameters, arguments, what)        \
  extern "C" int name parameters {                           \
    static const auto real = next<int(*) parameters>(#name); \
    if (point(kind, #name, what)) return -1;                 \
    return real arguments;                                   \
  }

PASS(kMakes, linkat, (int a, const char* from, int b, const char* to, int flags),
     (a, from, b, to, flags), to)
PASS(kMakes, link, (const char* from, const char* to), (from, to), to)
PASS(kOther, rename, (const char* from, const char* to), (from, to), to)
PASS(kOther, renameat, (int a, const char* from, int b, const char* to), (a, from, b, to), to)
PASS(kOther, renameat2, (int a, const char* from, int b, const char* to, unsigned flags),
     (a, from, b, to, flags), to)
PASS(kOther, unlink, (const char* path), (path), path)
PASS(kOther, unlinkat, (int folder, const char* path, int flags), (folder, path, flags), path)
PASS(kMakes, ftruncate, (int fd, off_t size), (fd, size), name_of(fd))
PASS(kMakes, ftruncate64, (int fd, off64_t size), (fd, size), name_of(fd))
PASS(kMakes, fallocate, (int fd, int mode, off_t at, off_t size), (fd, mode, at, size), name_of(fd))
PASS(kMakes, mkdir, (const char* path, mode_t mode), (path, mode), path)
PASS(kOther, rmdir, (const char* path), (path), path)
PASS(kOther, fchmod, (int fd, mode_t mode), (fd, mode), name_of(fd))
PASS(kOther, fchown, (int fd, uid_t user, gid_t group), (fd, user, group), name_of(fd))
PASS(kOther, utimensat, (int folder, const char* path, const timespec* times, int flags),
     (folder, path, times, flags), path)

extern "C" {

int posix_fallocate(int fd, off_t at, off_t size) {
  static const auto real = next<int (*)(int, off_t, off_t)>("posix_fallocate");
  return point(kMakes, "posix_fallocate", name_of(fd)) ? errno : real(fd, at, size);
}

int fsync(int fd) {
  static const auto real = next<int (*)(int)>("fsync");
  return pass_sync("fsync", fd, real);
}

int fdatasync(int fd) {
  static const auto real = next<int (*)(int)>("fdatasync");
  return pass_sync("fdatasync", fd, real);
}

ssize_t write(int fd, const void* from, std::size_t bytes) {
  static const auto real = next<ssize_t (*)(int, const void*, std::size_t)>("write");
  return pass_bytes(kWrites, "write", fd, lseek(fd, 0, SEEK_CUR), bytes,
                    [&](std::size_t first) { return real(fd, from, first); });
}

ssize_t pwrite(int fd, const void* from, std::size_t bytes, off_t at) {
  static const auto real = next<ssize_t (*)(int, const void*, std::size_t, off_t)>("pwrite");
  return pass_bytes(kWrites, "pwrite", fd, at, bytes,
                    [&](std::size_t first) { return real(fd, from, first, at); });
}

ssize_t pwrite64(int fd, const void* from, std::size_t bytes, off64_t at) {
  return pwrite(fd, from, bytes, at);
}

ssize_t writev(int fd, const iovec* parts, int count) {
  static const auto real = next<ssize_t (*)(int, const iovec*, int)>("writev");
  return pass_bytes(kWrites, "writev", fd, lseek(fd, 0, SEEK_CUR), 2, [&](std::size_t first) {
    return real(fd, parts, first < 2 ? count / 2 : count);
  });
}

ssize_t pwritev(int fd, const iovec* parts, int count, off_t at) {
  static const auto real = next<ssize_t (*)(int, const iovec*, int, off_t)>("pwritev");
  return pass_bytes(kWrites, "pwritev", fd, at, 2, [&](std::size_t first) {
    return real(fd, parts, first < 2 ? count / 2 : count, at);
  });
}

ssize_t read(int fd, void* to, std::size_t bytes) {
  static const auto real = next<ssize_t (*)(int, void*, std::size_t)>("read");
  return pass_bytes(kReads, "read", fd, 0, bytes,
                    [&](std::size_t first) { return real(fd, to, first); });
}

ssize_t pread(int fd, void* to, std::size_t bytes, off_t at) {
  static const auto real = next<ssize_t (*)(int, void*, std::size_t, off_t)>("pread");
  return pass_bytes(kReads, "pread", fd, at, bytes,
                    [&](std::size_t first) { return real(fd, to, first, at); });
}

ssize_t pread64(int fd, void* to, std::size_t bytes, off64_t at) {
  return pread(fd, to, bytes, at);
}

void* mmap(void* where, std::size_t bytes, int access, int flags, int fd, off_t at) noexcept {
  const auto real = [&] {
    return reinterpret_cast<void*>(syscall(SYS_mmap, where, bytes, access, flags, fd, at));
  };
  if (fd >= 0 && counts() && is_file(fd) && point(kMaps, "mmap", name_of(fd))) return MAP_FAILED;
  return real();
}

void* mmap64(void* where, std::size_t bytes, int access, int flags, int fd, off64_t at) noexcept {
  return mmap(where, bytes, access, flags, fd, at);
}

int open(const char* path, int flags, ...) {
  static const auto real = next<int (*)(const char*, int, ...)>("open");
  va_list more;
  va_start(more, flags);
  const mode_t mode = makes(flags) ? va_arg(more, mode_t) : 0;
  va_end(more);
  if (point(opening(flags), "open", path)) return -1;
  return real(path, flags, mode);
}

int open64(const char* path, int flags, ...) {
  va_list more;
  va_start(more, flags);
  const mode_t mode = makes(flags) ? va_arg(more, mode_t) : 0;
  va_end(more);
  return open(path, flags, mode);
}

int openat(int folder, const char* path, int flags, ...) {
  static const auto real = next<int (*)(int, const char*, int, ...)>("openat");
  va_list more;
  va_start(more, flags);
  const mode_t mode = makes(flags) ? va_arg(more, mode_t) : 0;
  va_end(more);
  if (point(opening(flags), "openat", path)) return -1;
  return real(folder, path, flags, mode);
}

int clock_gettime(clockid_t clock, timespec* now) noexcept {
  static const auto real = next<int (*)(clockid_t, timespec*)>("clock_gettime");
  const int failed = real(clock, now);
  if (failed != 0 || clock != CLOCK_MONOTONIC || !counts() || state->clock_step_ns == 0)
    return failed;
  const long ns = now->tv_nsec + state->clock_step_ns * ++state->looks;
  now->tv_sec += ns / 1'000'000'000;
  now->tv_nsec = ns % 1'000'000'000;
  return 0;
}

}  // extern "C"
