// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <OpenImageIO/filesystem.h>

#include <cstddef>
#include <cstdint>
#include <exception>

#include "core/file.h"
#include "io/files/output_file.h"

namespace pounce::io {

/// The stream for an encoder that writes into an output file. IOFile knows the size of files it
/// opened itself only, and libtiff appends at the end.
class OutputProxy : public OIIO::Filesystem::IOFile {
 public:
  explicit OutputProxy(OutputFile& file) : IOFile(file.stream(), Write), file_(file) {}

  /// What is in the file is a whole TIFF, classic or big; the encoder opened next writes another
  /// image of the same kind, which becomes the last one of this file. Throws Error(storage) if it
  /// is no such TIFF.
  void append_tiff_image();

  std::size_t write(const void* bytes, std::size_t count) override;
  std::size_t pread(void* out, std::size_t count, std::int64_t offset) override {
    return file_.read_back(offset, out, count);
  }
  std::size_t read(void* out, std::size_t count) override;
  std::size_t size() const override { return static_cast<std::size_t>(file_.size_bytes()); }

 private:
  template <class Number>
  std::uint64_t number_at(std::int64_t offset);
  template <class Link, class Count>
  std::int64_t open_link(std::int64_t first_link, std::size_t entry_bytes);

  OutputFile& file_;
  /// Of a TIFF that already holds images: its header, and where the next image's place belongs.
  std::int64_t header_bytes_ = 0, last_link_ = 0;
};

/// The same for an encoder that writes from start to end (PNG), at the end of a file of ours. What
/// that file throws waits for the encoder to return: it is C.
class SinkProxy : public OIIO::Filesystem::IOProxy {
 public:
  explicit SinkProxy(WriteFile& sink) : IOProxy("", Write), sink_(sink) {}
  const char* proxytype() const override { return "sink"; }
  std::size_t write(const void* bytes, std::size_t count) override;
  std::size_t size() const override { return static_cast<std::size_t>(m_pos); }
  void check() const {
    if (failure_) std::rethrow_exception(failure_);
  }

 private:
  WriteFile& sink_;
  std::exception_ptr failure_;
};

}  // namespace pounce::io
