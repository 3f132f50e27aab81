// SPDX-License-Identifier: Apache-2.0
//
// Files that a model or a user names: may they be read, and their bytes.
//
// A model from elsewhere is hostile input that names files of this machine. Whether one of them may
// be read is asked of where its name really leads, with all links followed; the comparison is by
// components of paths, so that "/art/head2" does not lie in "/art/head".
//
// Images go through ByteSource. It hides where the bytes are (a file, a range of one, memory),
// gives decoders no more than is asked for, and shows them other bytes than are stored where a
// guard wants it (show_only()). Decoders are C libraries that call back: nothing may throw through
// them, so a read that fails is remembered, looks like the end of the file, and becomes an error in
// check().
//
// AssetFolder judges a name, and the file is opened later, so what is exchanged in between is not
// noticed. It guards against names in a model, not against other users of the machine.
//
// Links are followed before the comparison, since a name within the folder may lead anywhere. 0.1.0
// read what a model asked for, and a model output carried it away (docs/decisions/017).
#include "io/files/asset_file.h"

#include <fmt/format.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <system_error>

#include "core/posix_io.h"

namespace pounce::io {
namespace {

namespace fs = std::filesystem;

/// Where a path leads, as far as it exists.
fs::path resolved(const fs::path& path) {
  std::error_code error;
  fs::path out = fs::weakly_canonical(path, error);
  // What cannot be looked at cannot be opened, either.
  return error ? fs::absolute(path, error).lexically_normal() : out;
}

/// What a C stream over a ByteSource remembers.
struct Cookie {
  ByteSource* source = nullptr;
  std::uint64_t position = 0;
};

/// -1 only where nothing was read: what came before the error is good.
ssize_t cookie_read(void* opaque, char* out, std::size_t count) {
  auto& cookie = *static_cast<Cookie*>(opaque);
  const std::size_t got = cookie.source->read_at(cookie.position, out, count);
  if (got == 0 && cookie.source->failure() != 0) {
    errno = cookie.source->failure();
    return -1;
  }
  if (cookie.source->watcher) {
    cookie.source->watcher(cookie.position, reinterpret_cast<const std::byte*>(out), got);
  }
  cookie.position += got;
  return static_cast<ssize_t>(got);
}

int cookie_seek(void* opaque, off64_t* offset, int whence) {
  auto& cookie = *static_cast<Cookie*>(opaque);
  std::int64_t base = 0;
  if (whence == SEEK_CUR) base = static_cast<std::int64_t>(cookie.position);
  if (whence == SEEK_END) base = static_cast<std::int64_t>(cookie.source->size_bytes());
  if (base + *offset < 0) {
    errno = EINVAL;
    return -1;
  }
  cookie.position = static_cast<std::uint64_t>(base + *offset);
  *offset = static_cast<off64_t>(cookie.position);
  return 0;
}

int cookie_close(void* opaque) {
  delete static_cast<Cookie*>(opaque);
  return 0;
}

}  // namespace

// A mesh that is a link has two folders: its textures lie beside the one or the other.
AssetFolder::AssetFolder(const std::string& mesh_path, bool allow_external) {
  if (allow_external) return;
  const fs::path named = fs::path(mesh_path).parent_path();
  folders_ = {resolved(named.empty() ? "." : named), resolved(mesh_path).parent_path()};
}

bool AssetFolder::holds(const std::string& path) const {
  if (folders_.empty()) return true;
  const fs::path file = resolved(path);
  return std::any_of(folders_.begin(), folders_.end(), [&](const fs::path& folder) {
    // A folder holds a file if all of its own components come first in the file's path.
    const auto rest = std::mismatch(folder.begin(), folder.end(), file.begin(), file.end());
    return rest.first == folder.end();
  });
}

ByteSource::ByteSource(const mesh::ImageRef& image)
    : label_(image.label.empty() ? image.path : image.label), path_(image.path) {
  // Found while the model was read, and no error then: only now does somebody want this image.
  if (!image.problem.empty()) {
    const std::string what = fmt::format("{}: {}", label_, image.problem);
    if (image.missing) throw MissingFile(what);
    throw Error(ErrorKind::input, what);
  }
  if (image.bytes) {
    memory_ = image.bytes;
    offset_bytes_ = image.offset_bytes;
    size_bytes_ = image.size_bytes != 0 ? image.size_bytes : memory_->size();
  } else {
    open(image);
  }
  if (size_bytes_ == 0) {
    throw Error(ErrorKind::input, fmt::format("{}: the image is empty (0 bytes)", label_));
  }
}

ByteSource::ByteSource(std::string label, std::string path, int descriptor,
                       std::uint64_t offset_bytes, std::uint64_t size_bytes)
    : label_(std::move(label)),
      path_(std::move(path)),
      offset_bytes_(offset_bytes),
      size_bytes_(size_bytes) {
  descriptor_.reset(descriptor);
}

int ByteSource::share() {
  if (!memory_ || descriptor_.get() >= 0) return descriptor_.get();
  descriptor_.reset(memfd_create("pounce image", MFD_CLOEXEC));
  const std::byte* const bytes = memory_->data() + offset_bytes_;
  for (std::uint64_t done = 0; done < size_bytes_;) {
    const ssize_t put =
        ::pwrite(descriptor_.get(), bytes + done, static_cast<std::size_t>(size_bytes_ - done),
                 static_cast<off_t>(done));
    if (put < 0 && errno == EINTR) continue;
    if (put <= 0)
      throw Error(ErrorKind::budget, label_ + ": not enough memory to hand it to its decoder");
    done += static_cast<std::uint64_t>(put);
  }
  return descriptor_.get();
}

// Opened without waiting and without becoming a terminal (open_for_reading()), then judged: a name
// may be a pipe or a device.
void ByteSource::open(const mesh::ImageRef& image) {
  descriptor_.reset(open_for_reading(path_));
  struct stat status {};
  if (descriptor_.get() < 0 || ::fstat(descriptor_.get(), &status) != 0) fail("open", errno);
  if (!S_ISREG(status.st_mode)) {
    throw Error(ErrorKind::storage,
                fmt::format("{}: cannot read{}: it is {}, not a file", label_,
                            label_ == path_ ? "" : " " + path_, kind_of_file(status.st_mode)));
  }
  const auto file_bytes = static_cast<std::uint64_t>(status.st_size);
  offset_bytes_ = image.offset_bytes;
  size_bytes_ = image.size_bytes;
  // 0 in a reference stands for all of the file.
  if (size_bytes_ == 0 && file_bytes > offset_bytes_) size_bytes_ = file_bytes - offset_bytes_;
  if (offset_bytes_ > file_bytes || size_bytes_ > file_bytes - offset_bytes_) {
    throw Error(ErrorKind::input,
                fmt::format("{}: the image should be bytes {} to {} of {}, which has only {}; the "
                            "file is truncated",
                            label_, offset_bytes_, offset_bytes_ + size_bytes_, path_, file_bytes));
  }
}

// What a decoder is shown need not be what is stored: a guard leaves out blocks that it would
// inflate, or puts others in their place. Sizes are those of what is shown from then on.
void ByteSource::show_only(std::vector<Piece> pieces) {
  starts_.clear();
  pieces_ = std::move(pieces);
  size_bytes_ = 0;
  for (const Piece& piece : pieces_) {
    starts_.push_back(size_bytes_);
    size_bytes_ += piece.size_bytes;
  }
}

std::size_t ByteSource::read_at(std::uint64_t offset, void* out, std::size_t count) noexcept {
  if (offset >= size_bytes_ || count == 0) return 0;  // `out` may be null then
  count = static_cast<std::size_t>(std::min<std::uint64_t>(count, size_bytes_ - offset));
  if (pieces_.empty()) return read_stored(offset, static_cast<char*>(out), count);
  std::size_t done = 0;
  while (done < count) {
    // The last piece that begins at or before the place; none is empty, so there is one.
    const auto after = std::upper_bound(starts_.begin(), starts_.end(), offset + done);
    const auto at = static_cast<std::size_t>(after - starts_.begin()) - 1;
    const Piece& piece = pieces_[at];
    const std::uint64_t inside = offset + done - starts_[at];
    const auto wanted =
        static_cast<std::size_t>(std::min<std::uint64_t>(count - done, piece.size_bytes - inside));
    char* const to = static_cast<char*>(out) + done;
    std::size_t got = wanted;
    if (piece.instead.empty())
      got = read_stored(piece.offset_bytes + inside, to, wanted);
    else
      std::memcpy(to, piece.instead.data() + inside, wanted);
    done += got;
    if (got < wanted) break;
  }
  return done;
}

ByteSource::Descriptor::~Descriptor() {
  if (number_ >= 0) ::close(number_);
}

std::size_t ByteSource::read_stored(std::uint64_t offset, char* out, std::size_t count) noexcept {
  if (memory_) {
    std::memcpy(out, memory_->data() + offset_bytes_ + offset, count);
    return count;
  }
  std::size_t done = 0;
  while (done < count) {
    const ssize_t got = ::pread(descriptor_.get(), out + done, count - done,
                                static_cast<off_t>(offset_bytes_ + offset + done));
    if (got < 0 && errno == EINTR) continue;
    // The first reason is kept: later ones are mostly its consequences.
    if (got < 0 && failure_ == 0) failure_ = errno;
    if (got <= 0) break;
    done += static_cast<std::size_t>(got);
  }
  return done;
}

void ByteSource::check() const {
  if (failure_ != 0) fail("read", failure_);
}

// The label says which image of which model it is; the path is added where it is another.
void ByteSource::fail(const char* what, int reason) const {
  const std::string said =
      label_ == path_
          ? fmt::format("{}: cannot {}: {}", path_, what, std::strerror(reason))
          : fmt::format("{}: cannot {} {}: {}", label_, what, path_, std::strerror(reason));
  if (reason == ENOENT || reason == ENOTDIR) throw MissingFile(said);
  throw Error(ErrorKind::storage, said, is_passing(reason));
}

FILE* ByteSource::stream() {
  // Released once the stream owns it: cookie_close() deletes it.
  auto cookie = std::make_unique<Cookie>(Cookie{this, 0});
  FILE* file = ::fopencookie(cookie.get(), "r", {cookie_read, nullptr, cookie_seek, cookie_close});
  if (file == nullptr)
    throw Error(ErrorKind::budget, label_ + ": not enough memory to read it; give it more");
  cookie.release();
  // Decoders ask for 4 KB at a time; 64 KB halves the system time of a 100 MB PNG.
  std::setvbuf(file, nullptr, _IOFBF, 64 << 10);
  return file;
}

Hash128 hash_image(const mesh::ImageRef& image) {
  // By content and not by name or time: a copied file finds its column again, an edited one does
  // not.
  ByteSource bytes(image);
  std::vector<std::byte> piece(std::min<std::uint64_t>(bytes.size_bytes(), 1 << 17));
  Hasher hasher;
  for (std::uint64_t at = 0; at < bytes.size_bytes();) {
    const std::size_t got = bytes.read_at(at, piece.data(), piece.size());
    bytes.check();
    if (got == 0) {
      throw Error(ErrorKind::input,
                  fmt::format("{}: reading stopped after {} of {} bytes: the file shrank",
                              bytes.label(), at, bytes.size_bytes()));
    }
    hasher.add(std::span<const std::byte>(piece.data(), got));
    at += got;
  }
  return hasher.digest();
}

}  // namespace pounce::io
