// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/stat.h>
#include <sys/types.h>

#include <cstdint>
#include <cstdio>
#include <optional>
#include <string>
#include <vector>

namespace pounce::io {

/// Makes a folder and those above it that are missing. What it made and what is empty in the end
/// goes again, so that a job that fails leaves nothing.
class NewFolders {
 public:
  /// Throws Error(storage) naming the folder and the reason.
  explicit NewFolders(const std::string& folder) { make(folder); }
  ~NewFolders();
  NewFolders(const NewFolders&) = delete;
  NewFolders& operator=(const NewFolders&) = delete;
  /// Once more, where another job removed it.
  void make(const std::string& folder);

 private:
  bool make_missing(const std::string& folder, bool last);

  std::vector<std::string> made_;  ///< outermost first
};

/// The folder if it is there, else the nearest above it that is.
std::string existing_folder(const std::string& folder);

/// What `path` stands for once its links are followed; the last one may lead to nothing yet. Empty:
/// they lead in a circle, or into /proc, where a name is no name of a file. OutputFile makes its
/// file in that folder.
std::string output_place(const std::string& path);

/// A file that appears under its name whole or not at all, for libraries that write and seek
/// through a C stream. Folders that are missing are made. A symbolic link stays and what it leads
/// to is replaced; a file that is replaced hands on its permissions. Throws Error(storage) with
/// path and reason. Not thread-safe.
class OutputFile {
 public:
  explicit OutputFile(const std::string& path);
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  FILE* stream() { return stream_; }
  const std::string& path() const { return path_; }  ///< as given
  /// Bytes written so far, those in the stream's buffer included.
  std::uint64_t size_bytes();
  /// Up to `count` of the bytes written so far, from `offset`.
  std::size_t read_back(std::int64_t offset, void* out, std::size_t count) noexcept;
  /// Throws if any write so far did not reach the file.
  void check() const;
  /// Everything is written: hands it to the system. Nobody may use the stream afterwards.
  void close();
  /// Closes what is not closed, fsyncs, gives the file its name, fsyncs the folder.
  void commit();
  /// Throws Error(storage): "cannot write <path>: <what>".
  [[noreturn]] void fail(const std::string& what, int code = 0) const;

 private:
  static long write_piece(void* self, const char* bytes, std::size_t count);
  static int seek(void* self, std::int64_t* offset, int whence);

  /// fail() with the reason that an errno has, and its cure.
  [[noreturn]] void fail_by(int code) const;
  void check_folder();
  bool folder_is_back(int& tries);
  void next_temporary();
  void open_named(mode_t mode);
  void give_temporary_name();
  void begin_storing();
  void keep_mode() const;

  std::string path_, target_;  ///< as given; what it stands for once links are followed
  std::string folder_, name_;  ///< of target_
  NewFolders folders_;
  std::optional<struct stat> replaced_;  ///< the file of that name, if there is one
  std::string temporary_;
  bool nameless_ = false;
  bool has_temporary_ = false;
  int descriptor_ = -1;
  FILE* stream_ = nullptr;
  std::int64_t position_ = 0;
  std::int64_t storing_to_ = 0;  ///< the disk has begun with what is before it
  int failure_ = 0;              ///< errno of the first call that failed
};

/// Removes the hidden files ".NAME.<digits>-<digits>.tmp" that processes which died left beside the
/// output `name` in `folder`: those that nobody has locked and that belong to this user or to
/// `owner`. Failures do not matter. A folder is listed anew only once its last listing was a
/// fiftieth of the time since: a job may have thousands of outputs in a folder of a million files.
/// Thread-safe.
void remove_leftovers(const std::string& folder, const std::string& name, uid_t owner);
/// The same of an output that is there and stays: nobody will write it and look.
void remove_leftovers_of(const std::string& output);

/// The hidden file beside an output `name` whose lock says that a job is making it: one of those
/// above, so that it goes where its process could not remove it.
std::string claim_name(const std::string& name);

}  // namespace pounce::io
