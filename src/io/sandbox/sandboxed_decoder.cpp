// SPDX-License-Identifier: Apache-2.0
//
// The file goes to the decoder as a descriptor, and rows come back through memory that both share.
// Nothing that comes back is believed: sizes are checked again, and samples are only copied.
#include "io/sandbox/sandboxed_decoder.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <utility>

#include "io/codec/sample.h"
#include "io/sandbox/decoder_process.h"
#include "pounce/error.h"

namespace pounce::io {
namespace {

/// Rows that come in one go: this much, or one.
constexpr std::uint64_t kBufferBytes = 1 << 20;
/// What opening a file may take: headers and tables; of an EXR a block of each part as well, of
/// which its guard lets through 1 GiB.
constexpr std::uint64_t kOpeningBytes = 128 << 20, kOpeningExrBytes = 1280ULL << 20;
/// Channels that are handed out: four, or as many as were named as data.
constexpr std::size_t kMostDataChannels = 64;
/// What the program takes beside what a decoder says.
constexpr std::uint64_t kSlackBytes = 64 << 20;

/// Memory that both processes see, of a size that neither can change.
class SharedRows {
 public:
  explicit SharedRows(std::size_t bytes) : bytes_(bytes) {
    descriptor_ = memfd_create("pounce rows", MFD_CLOEXEC | MFD_ALLOW_SEALING);
    if (descriptor_ >= 0 && ftruncate(descriptor_, static_cast<off_t>(bytes)) == 0) {
      fcntl(descriptor_, F_ADD_SEALS, F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL);
      at_ = mmap(nullptr, bytes, PROT_READ, MAP_SHARED, descriptor_, 0);
    }
    if (at_ == MAP_FAILED)
      throw Error(ErrorKind::budget,
                  "not enough memory to decode an image in a process of its own");
  }
  ~SharedRows() {
    if (at_ != MAP_FAILED) munmap(at_, bytes_);
    if (descriptor_ >= 0) close(descriptor_);
  }
  SharedRows(const SharedRows&) = delete;
  SharedRows& operator=(const SharedRows&) = delete;

  int descriptor() const { return descriptor_; }
  const std::byte* data() const { return static_cast<const std::byte*>(at_); }

 private:
  std::size_t bytes_;
  int descriptor_ = -1;
  void* at_ = MAP_FAILED;
};

bool needs_module(const std::string& format) {
  return format == "hdr" || format == "bmp" || format == "targa";
}

std::uint64_t opening_bytes(const std::string& format) {
  return format == "openexr" ? kOpeningExrBytes : kOpeningBytes;
}

Message request_of(const char* what, const ByteSource& bytes, const std::string& format) {
  const ByteSource::Range range = bytes.range();
  return {{"what", what},     {"label", bytes.label()},       {"path", bytes.path()},
          {"format", format}, {"offset", range.offset_bytes}, {"size", range.size_bytes}};
}

std::unique_ptr<DecoderProcess> take(const std::string& label, const std::string& format,
                                     Sandbox mode) {
  std::unique_ptr<DecoderProcess> process = DecoderProcess::take(needs_module(format));
  if (process || mode != Sandbox::on) return process;
  throw Error(ErrorKind::storage,
              fmt::format("{}: --sandbox on: the decoder's process cannot be started or confined; "
                          "install pounce-decoder, or use --sandbox auto",
                          label));
}

class SandboxedDecoder : public RowDecoder {
 public:
  SandboxedDecoder(ByteSource& bytes, const WantedChannels& wanted, ImageInfo& info,
                   std::unique_ptr<DecoderProcess> process)
      : process_(std::move(process)), label_(bytes.label()) {
    Message request = request_of("open", bytes, info.format);
    request["wanted"] = to_message(wanted);
    const int file = bytes.share();
    try {
      const std::string format = info.format;
      info = info_from(
          process_->ask(label_, request, {file}, opening_bytes(format), bytes.size_bytes()));
      info.format = format;
      check_size(label_, info.width, info.height);
      if (info.channels > kMostDataChannels || info.names.size() != info.channels)
        throw std::runtime_error("no image has so many channels");
    } catch (const Error&) {
      throw;
    } catch (const std::exception&) {
      throw Error(ErrorKind::input, label_ + ": its decoder says what cannot be");
    }
    row_bytes_ = std::size_t{info.width} * info.channels * sample_bytes(info.depth);
    height_ = info.height;
    decoder_bytes_ = info.decoder_bytes;
    rows_at_once_ = static_cast<std::uint32_t>(
        std::clamp<std::uint64_t>(kBufferBytes / row_bytes_, 1, height_));
    info.decoder_bytes += rows_at_once_ * row_bytes_;
  }
  ~SandboxedDecoder() override {
    try {
      if (process_->is_alive()) process_->ask(label_, {{"what", "close"}}, {}, kSlackBytes, 0);
      DecoderProcess::give_back(std::move(process_));
    } catch (const std::exception&) {
    }
  }

  void read_rows(std::uint32_t first, std::uint32_t count, std::byte* rows) override {
    if (!process_->is_alive())
      throw Error(ErrorKind::input, label_ + ": its decoder is gone; the file is damaged");
    for (std::uint32_t done = 0; done < count;) {
      const std::uint32_t piece = std::min(count - done, rows_at_once_);
      Message request = {{"what", "read"}, {"first", first + done}, {"count", piece}};
      std::vector<int> descriptors;
      if (!shared_) {
        const std::size_t bytes = row_bytes_ * rows_at_once_;
        shared_.emplace(bytes);
        request["buffer_bytes"] = bytes;
        descriptors = {shared_->descriptor()};
      }
      // What decodes whole does so at its first row.
      const std::uint64_t work = first + done == 0 ? row_bytes_ * height_ : row_bytes_ * piece;
      process_->ask(label_, request, descriptors,
                    decoder_bytes_ + row_bytes_ * rows_at_once_ + kSlackBytes, work);
      std::memcpy(rows + done * row_bytes_, shared_->data(), piece * row_bytes_);
      done += piece;
    }
  }

 private:
  std::unique_ptr<DecoderProcess> process_;
  std::string label_;
  std::size_t row_bytes_ = 0;
  std::uint32_t height_ = 0, rows_at_once_ = 1;
  std::uint64_t decoder_bytes_ = 0;
  std::optional<SharedRows> shared_;
};

}  // namespace

bool is_sandboxed(const std::string& format, Sandbox mode) {
  if (mode == Sandbox::off || format == "pnm") return false;
  return mode == Sandbox::on || format == "openexr" || format == "tiff" || needs_module(format);
}

std::unique_ptr<RowDecoder> open_sandboxed(ByteSource& bytes, const WantedChannels& wanted,
                                           Sandbox mode, ImageInfo& info) {
  auto process = take(bytes.label(), info.format, mode);
  if (!process) return nullptr;
  return std::make_unique<SandboxedDecoder>(bytes, wanted, info, std::move(process));
}

std::optional<std::vector<std::string>> list_sandboxed(ByteSource& bytes, Sandbox mode) {
  auto process = take(bytes.label(), "openexr", mode);
  if (!process) return std::nullopt;
  const Message answer = process->ask(bytes.label(), request_of("list", bytes, "openexr"),
                                      {bytes.share()}, kOpeningExrBytes, bytes.size_bytes());
  DecoderProcess::give_back(std::move(process));
  try {
    return answer.at("names").get<std::vector<std::string>>();
  } catch (const Message::exception&) {
    throw Error(ErrorKind::input, bytes.label() + ": its decoder says what cannot be");
  }
}

}  // namespace pounce::io
