// SPDX-License-Identifier: Apache-2.0
//
// A TIFF of several images is a chain: the header says where the directory of the first one is, and
// behind the entries of each directory is where the next one is, or 0. OpenImageIO appends an image
// only to a file that it opened by name, and an output has none yet (OutputFile). Through a stream
// it starts a new file each time: a header, then data and directory, always at the end of what is
// there, at offsets from its beginning. That is what a further image looks like, but for the
// header. So the header of a further image stays unwritten, and the place of its directory goes to
// the end of the chain instead.
#include "io/image/output_proxy.h"

namespace pounce::io {
namespace {

// Numbers are in this machine's byte order, as libtiff writes them.
constexpr std::uint64_t kClassicVersion = 42, kBigVersion = 43;

}  // namespace

template <class Number>
std::uint64_t OutputProxy::number_at(std::int64_t offset) {
  Number number = 0;
  if (file_.read_back(offset, &number, sizeof number) != sizeof number)
    file_.fail("it cannot be read back");
  return number;
}

/// Behind the last of its directories.
template <class Link, class Count>
std::int64_t OutputProxy::open_link(std::int64_t first_link, std::size_t entry_bytes) {
  std::int64_t link = first_link;
  while (const std::uint64_t directory = number_at<Link>(link)) {
    const auto at = static_cast<std::int64_t>(directory);
    // Each is behind the one before, so this ends.
    if (at < link) file_.fail("its TIFF directories are not in order");
    link = at + static_cast<std::int64_t>(sizeof(Count) + number_at<Count>(at) * entry_bytes);
  }
  return link;
}

void OutputProxy::append_tiff_image() {
  const std::uint64_t version = number_at<std::uint16_t>(2);
  if (version == kClassicVersion) {
    header_bytes_ = 8;
    last_link_ = open_link<std::uint32_t, std::uint16_t>(4, 12);
  } else if (version == kBigVersion) {
    header_bytes_ = 16;
    last_link_ = open_link<std::uint64_t, std::uint64_t>(8, 20);
  } else {
    file_.fail("it is not a TIFF");
  }
}

std::size_t OutputProxy::write(const void* bytes, std::size_t count) {
  const std::int64_t at = tell();
  if (at >= header_bytes_) return IOFile::write(bytes, count);
  const std::int64_t end = at + static_cast<std::int64_t>(count);
  if (at > 0) {  // not all of the header: the place of the directory
    seek(last_link_);
    IOFile::write(bytes, count);
  }
  seek(end);
  return count;
}

std::size_t OutputProxy::read(void* out, std::size_t count) {
  const std::size_t got = file_.read_back(tell(), out, count);
  seek(tell() + static_cast<std::int64_t>(got));
  return got;
}

std::size_t SinkProxy::write(const void* bytes, std::size_t count) {
  if (!failure_) {
    try {
      sink_.append({static_cast<const std::byte*>(bytes), count});
    } catch (...) {
      failure_ = std::current_exception();
    }
  }
  m_pos += static_cast<std::int64_t>(count);
  return count;
}

}  // namespace pounce::io
