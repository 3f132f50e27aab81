// SPDX-License-Identifier: Apache-2.0
#include "io/image/read.h"

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <optional>
#include <span>
#include <vector>

#include "io/files/asset_file.h"
#include "io/image/decoder.h"
#include "io/image/guard.h"
#include "io/image/header.h"
#include "io/image/sample.h"
#include "io/image/tiff_directory.h"
#include "pounce/error.h"
#include "store/blocks/colour_store.h"

// OpenImageIO decodes; this file gives it the bytes (a C stream over a range of a file or over
// memory, which every format it reads here accepts, so nothing is copied whole), asks for samples
// as stored, and does not trust its word on damaged files: its JPEG reader returns grey rows and
// success for a file that was cut off (libjpeg's warning is only kept as an error text, which is
// asked for after every strip), and its PNG reader never looks at the last checksum (PngCheck
// does).
namespace pounce::io {
namespace {

constexpr std::uint32_t kLargestSide = store::kLargestImageSide;

[[noreturn]] void refuse(const std::string& label, const std::string& what) {
  throw Error(ErrorKind::input, label + ": " + what);
}

void check_size(const std::string& label, std::int64_t width, std::int64_t height) {
  if (width < 1 || height < 1 || width > kLargestSide || height > kLargestSide) {
    refuse(label, fmt::format("the image is {} x {} texels, but each side must be 1 to {}", width,
                              height, kLargestSide));
  }
}

/// The channels of the file that make the image. `tiff`: null for other formats.
ChosenChannels channels_of(const ByteSource& bytes, const TiffPicture* tiff,
                           const OIIO::ImageSpec& spec) {
  // OpenImageIO takes a fourth sample for alpha even if the TIFF says nothing of it.
  const bool guessed = tiff != nullptr && !tiff->says_extra_samples;
  std::vector<std::string> names = spec.channelnames;
  if (guessed && spec.alpha_channel >= 0)
    names[static_cast<std::size_t>(spec.alpha_channel)] =
        fmt::format("channel{}", spec.alpha_channel);
  ChosenChannels chosen = choose_channels(names, guessed ? -1 : spec.alpha_channel);
  if (!chosen.places.empty()) return chosen;
  refuse(
      bytes.label(),
      fmt::format(
          "it has {} channels ({}), but no single set of R, G, B or Y; save up to {} of them as "
          "a separate file, or name those of an EXR after its path, such as FILE.exr:diffuse.R,G,B",
          spec.nchannels, joined(spec.channelnames), kMostChannels));
}

/// The decoder makes room by its own reading of the header and is handed buffers by it: it must be
/// ours.
void check_promise(const std::string& label, const TiffPicture& tiff, const OIIO::ImageSpec& spec) {
  const auto type = tiff.floats ? tiff.bits == 16 ? OIIO::TypeDesc::HALF : OIIO::TypeDesc::FLOAT
                    : tiff.bits == 16 ? OIIO::TypeDesc::UINT16
                                      : OIIO::TypeDesc::UINT8;
  const auto is = [](int decoder, std::uint32_t ours) {
    return decoder >= 0 && static_cast<std::uint32_t>(decoder) == ours;
  };
  const bool same = is(spec.width, tiff.width) && is(spec.height, tiff.height) &&
                    is(spec.nchannels, tiff.channels()) && spec.channelformats.empty() &&
                    spec.format == type && is(spec.tile_width, tiff.tiled ? tiff.part_width : 0) &&
                    is(spec.tile_height, tiff.tiled ? tiff.part_height : 0);
  if (!same)
    refuse(label, "the decoder reads the TIFF's header differently; convert it to PNG or EXR");
}

/// The stream for libjpeg, which asks for a FILE, and for everybody else. IOFile's own pread() and
/// size() want a file descriptor, which a stream over a part of a file has not.
class SourceProxy : public OIIO::Filesystem::IOFile {
 public:
  SourceProxy(ByteSource& bytes, FILE* stream) : IOFile(stream, Read), bytes_(bytes) {}
  std::size_t pread(void* out, std::size_t count, std::int64_t offset) override {
    return offset < 0 ? 0 : bytes_.read_at(static_cast<std::uint64_t>(offset), out, count);
  }
  std::size_t size() const override { return static_cast<std::size_t>(bytes_.size_bytes()); }

 private:
  ByteSource& bytes_;
};

}  // namespace

struct ImageReader::Impl {
  /// `only_lists`: only to list its channels, whatever they are.
  Impl(const mesh::ImageRef& image, std::span<const ImageFormat> allowed, bool only_lists = false,
       std::vector<std::string> data = {});
  void open();
  void take_spec();
  ChosenChannels choose();
  ChosenChannels choose_data() const;
  void take_channels(const ChosenChannels& chosen);
  void refuse_webp_alpha(bool has_alpha) const;
  void describe_unopened_jpeg(const JpegHeader& header);
  void describe_unopened(const WholeHeader& header);
  void describe_pnm();
  std::size_t decoded_row_bytes() const;
  void read_tile_row(std::uint32_t row);
  void pick(std::uint32_t row_count, std::byte* out) const;
  void read_decoded(std::uint32_t row_count, std::byte* rows);
  void check_bytes_after_last_row();
  [[noreturn]] void fail(const std::string& what) const;

  ByteSource bytes;
  std::string wanted;  // channels, by name
  bool lists = false;
  std::vector<std::string> data_names;  // of the channels, where these alone are wanted
  std::optional<TiffPicture> tiff;
  std::uint64_t parts_bytes = 0;                                       ///< of an EXR: guard_exr()
  std::unique_ptr<FILE, int (*)(FILE*)> stream{nullptr, std::fclose};  // outlives proxy and input
  std::unique_ptr<SourceProxy> proxy;
  std::unique_ptr<OIIO::ImageInput> input;  // null until open()
  std::optional<PnmPicture> pnm;            // which needs no input
  ImageInfo info;
  int part = 0;                            // of the file's images
  int first_channel = 0, end_channel = 0;  // asked of the decoder
  std::vector<std::size_t> picked;  // of these, the image's; empty: all of them, in their order
  OIIO::TypeDesc sample_type;
  // What is asked of OpenImageIO: UNKNOWN = "as it is". Named types make it convert through a
  // scratch buffer of 64 MB, which is mapped anew for every call, even if nothing is to be
  // converted.
  OIIO::TypeDesc asked_type;
  bool straighten = true;
  int first_row = 0, first_column = 0;  // of the data window
  std::uint32_t next_row = 0;
  bool tiled = false;
  std::uint32_t rows_together = 1;  // a tile's height, or the rows compressed together
  std::vector<std::byte> tile_row;
  std::vector<std::byte> unpicked;  // rows with channels that the image has not
  PngCheck png_check;
};

ImageReader::Impl::Impl(const mesh::ImageRef& image, std::span<const ImageFormat> allowed,
                        bool only_lists, std::vector<std::string> data)
    : bytes(image), wanted(image.channels), lists(only_lists), data_names(std::move(data)) {
  info.format = image_format(bytes, image.path, allowed);
  if ((!wanted.empty() || !data_names.empty()) && info.format != "openexr")
    refuse(bytes.label(),
           "not an EXR file; remove the channel names, which apply only to EXR files");
  if (info.format == "tiff") {
    info.levels = tiff_levels(bytes);  // before they are hidden
    std::vector<ColourPiece> colours;
    tiff = guard_tiff(bytes, colours);
    info.colours = read_colour_tags(colours);
  } else if (info.format == "openexr") {
    parts_bytes = guard_exr(bytes);
  } else {
    info.colours = read_colour_tags(hide_metadata(bytes, info.format));
  }
  JpegHeader jpeg;
  if (info.format == "jpeg") jpeg = read_jpeg_header(bytes);
  if (info.format == "pnm") {
    pnm.emplace(bytes);
    describe_pnm();
  } else if (jpeg.several_scans) {
    // Opening these decodes everything, so it waits for the first read: by then the caller has
    // leased decoder_bytes.
    describe_unopened_jpeg(jpeg);
  } else if (opens_whole(bytes, info.format)) {  // the same
    describe_unopened(read_whole_header(bytes, info.format));
  } else {
    open();
  }
}

void ImageReader::Impl::open() {
  set_up_oiio();
  stream.reset(bytes.stream());
  if (info.format == "png") {
    bytes.watcher = [this](std::uint64_t offset, const std::byte* data, std::size_t count) {
      png_check.see(offset, data, count);
    };
  }
  proxy = std::make_unique<SourceProxy>(bytes, stream.get());
  auto created = OIIO::ImageInput::create(info.format);
  if (!created)
    refuse(bytes.label(), fmt::format("OpenImageIO was built without support for {}", info.format));
  created->threads(1);
  OIIO::ImageSpec config, spec;
  config.attribute("oiio:UnassociatedAlpha", 1);
  // A BMP with run lengths and a grey palette is said to have one channel, and three are written.
  if (info.format == "bmp" && opens_whole(bytes, info.format))
    config.attribute("bmp:monochrome_detect", 0);
  OIIO::Filesystem::IOProxy* io = proxy.get();
  config.attribute("oiio:ioproxy", OIIO::TypeDesc::PTR, &io);
  const bool opened = created->open(bytes.label(), spec, config);
  input = std::move(created);
  if (!opened || input->has_error()) fail("the image header cannot be read");
  if (!lists) take_spec();
}

/// All channels that are wanted as data, exact.
ChosenChannels ImageReader::Impl::choose_data() const {
  const std::vector<std::string>& names = input->spec().channelnames;
  ChosenChannels chosen;
  chosen.names = data_names;
  for (const std::string& name : data_names) {
    const auto at = std::find(names.begin(), names.end(), name);
    if (at == names.end())
      refuse(bytes.label(), fmt::format("the image has no channel \"{}\"", name));
    chosen.places.push_back(static_cast<int>(at - names.begin()));
    if (input->spec().channelformat(chosen.places.back()) != OIIO::TypeDesc::FLOAT)
      refuse(
          bytes.label(),
          fmt::format("channel \"{}\" is not float, so it is not exact; write it as float", name));
  }
  const std::string compression = input->spec().get_string_attribute("compression");
  for (const char* lossy : {"pxr24", "b44", "dwa"}) {
    if (compression.starts_with(lossy))
      refuse(bytes.label(),
             fmt::format("{} compression loses precision; write it as zip", compression));
  }
  return chosen;
}

/// Which channels of which part make the image. The decoder stands there then.
ChosenChannels ImageReader::Impl::choose() {
  const TiffPicture* const said = tiff ? &*tiff : nullptr;
  if (!data_names.empty()) return choose_data();
  if (info.format != "openexr") return channels_of(bytes, said, input->spec());
  const std::vector<Part> parts = parts_of(*input);
  if (wanted.empty()) {
    ChosenChannels chosen = channels_of(bytes, said, input->spec());
    const std::vector<std::string> others = names_of(std::span(parts).subspan(1));
    chosen.left_out.insert(chosen.left_out.end(), others.begin(), others.end());
    return chosen;
  }
  ChosenPart chosen = wanted_part(bytes.label(), parts, wanted);
  part = static_cast<int>(chosen.part);
  if (!input->seek_subimage(part, 0)) fail("the header of one of its parts cannot be read");
  return std::move(chosen.channels);
}

void ImageReader::Impl::take_spec() {
  if (tiff) check_promise(bytes.label(), *tiff, input->spec());
  const ChosenChannels chosen = choose();
  const OIIO::ImageSpec& spec = input->spec();
  const std::string& label = bytes.label();
  check_size(label, spec.width, spec.height);
  if (spec.deep || spec.depth > 1)
    refuse(label, "deep and volume images are not supported; convert it to a flat image");
  if (info.format == "openexr" &&
      (spec.x != spec.full_x || spec.y != spec.full_y || spec.width != spec.full_width ||
       spec.height != spec.full_height)) {
    refuse(label,
           fmt::format(
               "its data window ({} x {} at {}, {}) differs from its display window ({} x {} at "
               "{}, {}); save it with equal windows",
               spec.width, spec.height, spec.x, spec.y, spec.full_width, spec.full_height,
               spec.full_x, spec.full_y));
  }
  take_channels(chosen);
  first_row = spec.y;
  first_column = spec.x;
  info.width = static_cast<std::uint32_t>(spec.width);
  info.height = static_cast<std::uint32_t>(spec.height);
  info.linear = info.depth == Depth::half || info.depth == Depth::float32;
  if (info.format == "openexr") {
    take_chromaticities(spec, info.colours);
    info.hits_note = spec.get_string_attribute(kHitsAttribute);
  }
  info.premultiplied = info.has_alpha && spec.get_int_attribute("oiio:UnassociatedAlpha") == 0;
  refuse_webp_alpha(info.has_alpha);
  const bool all_alike =
      spec.channelformats.empty() && end_channel - first_channel == spec.nchannels;
  asked_type = all_alike ? OIIO::TypeDesc(OIIO::TypeDesc::UNKNOWN) : sample_type;
  rows_together = block_rows(spec, info.format);
  tiled = spec.tile_width > 0;
  info.tile_width = static_cast<std::uint32_t>(spec.tile_width);
  info.tile_height = static_cast<std::uint32_t>(spec.tile_height);
  info.decoder_bytes = decoder_cost(spec, info.format, bytes) + parts_bytes;
  if (!picked.empty()) info.decoder_bytes += kMostRowsAtOnce * decoded_row_bytes();
  if (tiled && info.format == "openexr") info.levels = levels_of(*input, part);
}

void ImageReader::Impl::take_channels(const ChosenChannels& chosen) {
  const OIIO::ImageSpec& spec = input->spec();
  const auto [first, last] = std::minmax_element(chosen.places.begin(), chosen.places.end());
  first_channel = *first;
  end_channel = *last + 1;
  picked.clear();
  for (const int place : chosen.places) picked.push_back(static_cast<std::size_t>(place - *first));
  const bool as_they_come =
      static_cast<std::size_t>(end_channel - first_channel) == picked.size() &&
      std::is_sorted(picked.begin(), picked.end());
  if (as_they_come) picked.clear();
  info.channels = static_cast<std::uint32_t>(chosen.places.size());
  info.has_alpha = chosen.has_alpha;
  info.left_out = chosen.left_out;
  info.names = chosen.names;
  sample_type = sample_type_of(spec, chosen.places);
  info.depth = depth_of(bytes.label(), sample_type);
}

void ImageReader::Impl::describe_unopened_jpeg(const JpegHeader& header) {
  check_size(bytes.label(), header.width, header.height);
  info.width = header.width;
  info.height = header.height;
  info.channels = header.components == 1 ? 1 : 3;  // CMYK is converted
  info.names = usual_names(info.channels, false);
  // libjpeg keeps what there is between the scans beside them.
  info.decoder_bytes = header.coefficient_bytes + jpeg_row_cost(header.width) + bytes.size_bytes();
}

void ImageReader::Impl::describe_unopened(const WholeHeader& header) {
  check_size(bytes.label(), header.width, header.height);
  refuse_webp_alpha(header.has_alpha);
  info.width = header.width;
  info.height = header.height;
  info.channels = header.channels;
  info.depth = header.depth;
  info.names = usual_names(header.channels, header.has_alpha);
  info.decoder_bytes =
      header.working_bytes + whole_cost(std::uint64_t{header.width} * header.height *
                                            header.channels * sample_bytes(header.depth),
                                        bytes);
}

void ImageReader::Impl::describe_pnm() {
  check_size(bytes.label(), pnm->width(), pnm->height());
  info.width = pnm->width();
  info.height = pnm->height();
  info.channels = pnm->channels();
  info.depth = pnm->depth();
  info.names = usual_names(info.channels, false);
}

void ImageReader::Impl::refuse_webp_alpha(bool has_alpha) const {
  if (info.format == "webp" && has_alpha)
    refuse(bytes.label(), "WebP images with alpha cannot be read exactly; convert it to PNG");
}

void ImageReader::Impl::fail(const std::string& what) const {
  bytes.check();
  if (!png_check.problem().empty()) refuse_damaged(bytes.label(), what, png_check.problem());
  const std::string why = input ? one_line(input->geterror()) : "";
  decoder_failed(bytes.label(), what, why, info.decoder_bytes);
}

/// Bytes of a row as the decoder gives it.
std::size_t ImageReader::Impl::decoded_row_bytes() const {
  return std::size_t{info.width} * static_cast<std::size_t>(end_channel - first_channel) *
         sample_type.size();
}

void ImageReader::Impl::read_tile_row(std::uint32_t row) {
  const auto& spec = input->spec();
  const std::size_t row_bytes = decoded_row_bytes();
  tile_row.assign(row_bytes * rows_together, std::byte{});
  const int begin = first_row + static_cast<int>(row);
  const int end = std::min(begin + static_cast<int>(rows_together), first_row + spec.height);
  if (!input->read_tiles(part, 0, first_column, first_column + spec.width, begin, end, 0, 1,
                         first_channel, end_channel, asked_type, tile_row.data())) {
    fail(fmt::format("decoding failed in rows {} to {} of {}", row, end - first_row - 1,
                     info.height));
  }
}

void ImageReader::Impl::read_decoded(std::uint32_t row_count, std::byte* rows) {
  const std::size_t row_bytes = decoded_row_bytes();
  const std::size_t image_row_bytes = std::size_t{info.width} * info.channels * sample_type.size();
  for (std::uint32_t done = 0; done < row_count;) {
    const std::uint32_t row = next_row + done;
    const std::uint32_t in_block = row % rows_together;
    // Never across the end of a block: what the decoder holds must not depend on what the caller
    // asks for.
    std::uint32_t piece = std::min({row_count - done, rows_together - in_block, kMostRowsAtOnce});
    // Strips that are asked for whole OpenImageIO 2.4 inflates itself, and takes damage for
    // success; damaged PackBits end otherwise whole than row by row.
    if (tiff && tiff->compressed && in_block == 0) piece = 1;
    std::byte* out = rows + done * image_row_bytes;
    if (!picked.empty()) {
      unpicked.resize(piece * row_bytes);
      out = unpicked.data();
    }
    // Whatever a decoder leaves out is the same in every run.
    std::memset(out, 0, piece * row_bytes);
    if (tiled) {
      if (in_block == 0) read_tile_row(row);
      std::memcpy(out, tile_row.data() + in_block * row_bytes, piece * row_bytes);
    } else {
      const int begin = first_row + static_cast<int>(row);
      if (!input->read_scanlines(part, 0, begin, begin + static_cast<int>(piece), 0, first_channel,
                                 end_channel, asked_type, out)) {
        fail(fmt::format("decoding failed in row {} of {}", row, info.height));
      }
    }
    if (!picked.empty()) pick(piece, rows + done * image_row_bytes);
    done += piece;
  }
}

/// Of rows in `unpicked`, the image's channels.
void ImageReader::Impl::pick(std::uint32_t row_count, std::byte* out) const {
  const std::size_t sample = sample_type.size();
  const std::size_t stride = static_cast<std::size_t>(end_channel - first_channel) * sample;
  const std::byte* texel = unpicked.data();
  for (std::size_t i = 0; i < std::size_t{info.width} * row_count; ++i, texel += stride) {
    for (const std::size_t channel : picked) {
      std::memcpy(out, texel + channel * sample, sample);
      out += sample;
    }
  }
}

void ImageReader::Impl::check_bytes_after_last_row() {
  if (info.format != "png") return;
  std::array<std::byte, 16384> piece;
  while (!png_check.finished() && png_check.problem().empty()) {
    const std::uint64_t at = png_check.position();
    const std::size_t got = bytes.read_at(at, piece.data(), piece.size());
    if (got == 0) fail("the PNG has all rows, but no IEND chunk");
    png_check.see(at, piece.data(), got);
  }
  if (!png_check.problem().empty()) fail("the PNG failed its checks");
}

ImageReader::ImageReader(const mesh::ImageRef& image, std::span<const ImageFormat> allowed)
    : impl_(std::make_unique<Impl>(image, allowed)) {}

ImageReader::ImageReader(const std::string& path, std::span<const ImageFormat> allowed)
    : ImageReader(mesh::ImageRef{path, 0, 0, nullptr, path, "", "", false, ""}, allowed) {}

ImageReader::ImageReader(const std::string& path, const std::vector<std::string>& channels)
    : impl_(std::make_unique<Impl>(mesh::ImageRef{path, 0, 0, nullptr, path, "", "", false, ""},
                                   std::span<const ImageFormat>(), false, channels)) {}

ImageReader::~ImageReader() = default;
ImageReader::ImageReader(ImageReader&&) noexcept = default;
ImageReader& ImageReader::operator=(ImageReader&&) noexcept = default;

std::vector<std::string> ImageReader::exr_channels(const std::string& path,
                                                   std::span<const ImageFormat> allowed) {
  Impl impl({path, 0, 0, nullptr, path, "", "", false, ""}, allowed, true);
  return impl.info.format == "openexr" ? names_of(parts_of(*impl.input))
                                       : std::vector<std::string>{};
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
  if (self.pnm) {
    self.pnm->read_rows(self.next_row, row_count, rows);
    self.bytes.check();
    self.next_row += row_count;
    return;
  }
  if (!self.input) {
    const ImageInfo promised = self.info;
    self.open();
    if (self.info.width != promised.width || self.info.height != promised.height ||
        self.info.channels != promised.channels || self.info.depth != promised.depth) {
      self.fail("the decoded size or format differs from the image header");
    }
    self.info.decoder_bytes = promised.decoder_bytes;
  }
  self.read_decoded(row_count, rows);
  // Decoders that go on after damage leave a text behind.
  if (self.input->has_error() || self.bytes.failure() != 0 || !self.png_check.problem().empty()) {
    self.fail(fmt::format("the image is damaged in rows {} to {} of {}", self.next_row,
                          self.next_row + row_count - 1, self.info.height));
  }
  if (self.info.premultiplied && self.straighten) {
    divide_by_alpha(self.info.depth, self.info.channels, std::size_t{self.info.width} * row_count,
                    rows);
  }
  self.next_row += row_count;
  if (self.next_row == self.info.height) self.check_bytes_after_last_row();
}

void ImageReader::keep_premultiplied() { impl_->straighten = false; }

}  // namespace pounce::io
