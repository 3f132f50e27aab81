// SPDX-License-Identifier: Apache-2.0
#include "output_file.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <memory>
#include <vector>

#include "pounce/error.h"

namespace pounce::fixture {

OutputFile::OutputFile(const std::string& path)
    : path_(path), temporary_(fmt::format("{}.{}.partial", path, ::getpid())) {
  file_ = std::fopen(temporary_.c_str(), "wb");
  if (file_ == nullptr) fail("cannot be created");
}

OutputFile::~OutputFile() {
  if (file_ == nullptr) return;
  std::fclose(file_);
  std::remove(temporary_.c_str());
}

void OutputFile::fail(const char* what) const {
  throw Error(ErrorKind::storage,
              fmt::format("{}: {} ({}); choose a folder that exists and has room", path_, what,
                          std::strerror(errno)));
}

void OutputFile::append(const void* bytes, std::size_t size_bytes) {
  if (std::fwrite(bytes, 1, size_bytes, file_) != size_bytes) fail("cannot be written");
  size_bytes_ += size_bytes;
}

void OutputFile::commit() {
  std::FILE* const file = file_;
  bool good = std::fflush(file) == 0 && ::fdatasync(::fileno(file)) == 0;
  file_ = nullptr;  // from here on the destructor has nothing to do
  good = (std::fclose(file) == 0) && good;
  if (good && std::rename(temporary_.c_str(), path_.c_str()) == 0) return;
  const int reason = errno;
  std::remove(temporary_.c_str());
  errno = reason;
  fail("cannot be finished");
}

void make_folder(const std::string& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (!std::filesystem::is_directory(folder)) {
    throw Error(ErrorKind::storage,
                fmt::format("{}: cannot be created as a folder ({}); choose another one", folder,
                            error ? error.message() : "something else has this name"));
  }
}

void append_file(const std::string& path, OutputFile& out) {
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "rb"),
                                                             &std::fclose);
  std::vector<char> piece(256 << 10);
  std::size_t got = 0;
  while (file && (got = std::fread(piece.data(), 1, piece.size(), file.get())) > 0) {
    out.append(piece.data(), got);
  }
  if (!file || std::ferror(file.get()) != 0) {
    throw Error(ErrorKind::storage,
                fmt::format("{}: cannot be read back ({})", path, std::strerror(errno)));
  }
}

std::uint64_t file_size_bytes(const std::string& path) {
  std::error_code error;
  const std::uint64_t size = std::filesystem::file_size(path, error);
  if (error) {
    throw Error(ErrorKind::storage, fmt::format("{}: has no size ({})", path, error.message()));
  }
  return size;
}

}  // namespace pounce::fixture
