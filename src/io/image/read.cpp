// SPDX-License-Identifier: Apache-2.0
//
// What all formats have in common; each format's own library is behind RowDecoder.
#include "io/image/read.h"

#include <fmt/format.h>

#include <span>
#include <vector>

#include "io/files/asset_file.h"
#include "io/image/header.h"
#include "io/image/row_decoder.h"
#include "io/image/sample.h"
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
  Impl(const mesh::ImageRef& image, std::span<const ImageFormat> allowed,
       std::vector<std::string> data);
  std::unique_ptr<RowDecoder> open(const WantedChannels& wanted);

  ByteSource bytes;
  ImageInfo info;
  std::unique_ptr<RowDecoder> decoder;
  bool straighten = true;
  std::uint32_t next_row = 0;
};

ImageReader::Impl::Impl(const mesh::ImageRef& image, std::span<const ImageFormat> allowed,
                        std::vector<std::string> data)
    : bytes(image) {
  info.format = image_format(bytes, image.path, allowed);
  const WantedChannels wanted{image.channels, std::move(data)};
  if ((!wanted.named.empty() || !wanted.data.empty()) && info.format != "openexr")
    refuse_names(bytes);
  decoder = open(wanted);
}

std::unique_ptr<RowDecoder> ImageReader::Impl::open(const WantedChannels& wanted) {
  if (info.format == "png") return open_png(bytes, info);
  if (info.format == "jpeg") return open_jpeg(bytes, info);
  if (info.format == "tiff") return open_tiff(bytes, info);
  if (info.format == "openexr") return open_exr(bytes, wanted, info);
  if (info.format == "webp") return open_webp(bytes, info);
  if (info.format == "pnm") return open_pnm(bytes, info);
  return open_foreign(bytes, info);
}

ImageReader::ImageReader(const mesh::ImageRef& image, std::span<const ImageFormat> allowed)
    : impl_(std::make_unique<Impl>(image, allowed, std::vector<std::string>{})) {}

ImageReader::ImageReader(const std::string& path, std::span<const ImageFormat> allowed)
    : ImageReader(at_path(path), allowed) {}

ImageReader::ImageReader(const std::string& path, const std::vector<std::string>& channels)
    : impl_(std::make_unique<Impl>(at_path(path), std::span<const ImageFormat>(), channels)) {}

ImageReader::~ImageReader() = default;
ImageReader::ImageReader(ImageReader&&) noexcept = default;
ImageReader& ImageReader::operator=(ImageReader&&) noexcept = default;

std::vector<std::string> ImageReader::exr_channels(const std::string& path,
                                                   std::span<const ImageFormat> allowed) {
  ByteSource bytes(at_path(path));
  if (image_format(bytes, path, allowed) != "openexr") return {};
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
