// SPDX-License-Identifier: Apache-2.0
//
// What all formats have in common; each format's own library is behind RowDecoder.
#include "io/image/read.h"

#include <fmt/format.h>

#include <span>
#include <vector>

#include "io/codec/row_decoder.h"
#include "io/codec/sample.h"
#include "io/files/asset_file.h"
#include "io/image/header.h"
#include "io/sandbox/sandboxed_decoder.h"
#include "pounce/error.h"

namespace pounce::io {
namespace {

mesh::ImageRef at_path(const std::string& path) {
  return {path, 0, 0, nullptr, path, "", "", false, ""};
}

[[noreturn]] void refuse_names(const ByteSource& bytes) {
  throw Error(
      ErrorKind::input,
      bytes.label() + ": not an EXR file; remove the channel names, which apply only to EXR files");
}

}  // namespace

struct ImageReader::Impl {
  Impl(const mesh::ImageRef& image, const ImageTrust& trust, std::vector<std::string> data);

  ByteSource bytes;
  ImageInfo info;
  std::unique_ptr<RowDecoder> decoder;
  bool straighten = true;
  std::uint32_t next_row = 0;
};

ImageReader::Impl::Impl(const mesh::ImageRef& image, const ImageTrust& trust,
                        std::vector<std::string> data)
    : bytes(image) {
  info.format = image_format(bytes, image.path, trust.formats);
  const WantedChannels wanted{image.channels, std::move(data)};
  if ((!wanted.named.empty() || !wanted.data.empty()) && info.format != "openexr")
    refuse_names(bytes);
  if (is_sandboxed(info.format, trust.sandbox))
    decoder = open_sandboxed(bytes, wanted, trust.sandbox, info);
  if (!decoder) decoder = open_here(bytes, wanted, info);
}

ImageReader::ImageReader(const mesh::ImageRef& image, const ImageTrust& trust)
    : impl_(std::make_unique<Impl>(image, trust, std::vector<std::string>{})) {}

ImageReader::ImageReader(const std::string& path, const ImageTrust& trust)
    : ImageReader(at_path(path), trust) {}

ImageReader::ImageReader(const std::string& path, const std::vector<std::string>& channels,
                         const ImageTrust& trust)
    : impl_(std::make_unique<Impl>(at_path(path), trust, channels)) {}

ImageReader::~ImageReader() = default;
ImageReader::ImageReader(ImageReader&&) noexcept = default;
ImageReader& ImageReader::operator=(ImageReader&&) noexcept = default;

std::vector<std::string> ImageReader::exr_channels(const std::string& path,
                                                   const ImageTrust& trust) {
  ByteSource bytes(at_path(path));
  if (image_format(bytes, path, trust.formats) != "openexr") return {};
  if (is_sandboxed("openexr", trust.sandbox)) {
    if (auto names = list_sandboxed(bytes, trust.sandbox)) return std::move(*names);
  }
  return exr_channel_names(bytes);
}

const ImageInfo& ImageReader::info() const { return impl_->info; }

std::size_t ImageReader::row_bytes() const {
  return impl_->info.width * impl_->info.channels * sample_bytes(impl_->info.depth);
}

void ImageReader::read_rows(std::uint32_t row_count, std::byte* rows) {
  Impl& self = *impl_;
  if (row_count > self.info.height - self.next_row) {
    throw Error(ErrorKind::internal,
                fmt::format("{}: rows {} to {} of {} requested", self.bytes.label(), self.next_row,
                            self.next_row + row_count, self.info.height));
  }
  if (row_count == 0) return;
  self.decoder->read_rows(self.next_row, row_count, rows);
  self.bytes.check();
  if (self.info.premultiplied && self.straighten) {
    divide_by_alpha(self.info.depth, self.info.channels, std::size_t{self.info.width} * row_count,
                    rows);
  }
  self.next_row += row_count;
}

void ImageReader::keep_premultiplied() { impl_->straighten = false; }

}  // namespace pounce::io
