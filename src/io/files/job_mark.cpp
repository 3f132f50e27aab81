// SPDX-License-Identifier: Apache-2.0
//
// The job's hash inside an output, found again without a decoder: it is plain text near the start
// of a PNG, JPEG and EXR, in the first directory of a TIFF, and in the JSON of a model.
#include "io/files/job_mark.h"

#include <fmt/format.h>

#include <algorithm>
#include <exception>
#include <memory>
#include <string_view>

#include "core/file.h"
#include "io/files/file_ending.h"
#include "pounce/version.h"

namespace pounce::io {
namespace {

using namespace std::string_view_literals;

constexpr std::string_view kInImage = "pounce:job=";
constexpr std::string_view kInModel = "\"pounce\":{\"job\":\"";
constexpr std::size_t kDigits = 32;
/// The texts of an image stand before its pixels; a preview or profile may come before them.
constexpr std::uint64_t kImageHeadBytes = 64 << 10;
constexpr std::size_t kWindow = 64 << 10;
constexpr std::uint16_t kTiffDescription = 270;
constexpr std::uint64_t kMostTiffFields = 4096;  // as libtiff

std::string read_text(const ReadFile& file, std::uint64_t at, std::uint64_t most) {
  if (at >= file.size_bytes()) return {};
  std::string text(static_cast<std::size_t>(std::min(most, file.size_bytes() - at)), '\0');
  file.read(at, std::as_writable_bytes(std::span(text)));
  return text;
}

std::optional<std::string> digits_after(std::string_view text, std::string_view prefix) {
  for (std::size_t at = text.find(prefix); at != std::string_view::npos;
       at = text.find(prefix, at + 1)) {
    const std::string_view digits = text.substr(at + prefix.size(), kDigits);
    const bool whole = digits.size() == kDigits &&
                       digits.find_first_not_of("0123456789abcdef") == std::string_view::npos;
    if (whole) return std::string(digits);
  }
  return std::nullopt;
}

/// A text of any length, window by window.
std::optional<std::string> search(const ReadFile& file, std::uint64_t begin, std::uint64_t end,
                                  std::string_view prefix) {
  end = std::min(end, file.size_bytes());
  const std::size_t overlap = prefix.size() + kDigits;
  for (std::uint64_t at = begin; at < end; at += kWindow) {
    const std::string window =
        read_text(file, at, std::min<std::uint64_t>(kWindow + overlap, end - at));
    if (auto found = digits_after(window, prefix)) return found;
  }
  return std::nullopt;
}

/// Little-endian, as pounce writes them.
std::uint64_t number(std::string_view bytes, std::size_t at, std::size_t size) {
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < size && at + i < bytes.size(); ++i)
    value |= std::uint64_t{static_cast<unsigned char>(bytes[at + i])} << 8 * i;
  return value;
}

/// The description in a TIFF's first directory.
std::optional<std::string> search_tiff(const ReadFile& file, bool big) {
  const std::string head = read_text(file, 0, 16);
  const std::uint64_t place = big ? number(head, 8, 8) : number(head, 4, 4);
  const std::size_t count_bytes = big ? 8 : 2, field_bytes = big ? 20 : 12, word = big ? 8 : 4;
  const std::uint64_t fields = number(read_text(file, place, count_bytes), 0, count_bytes);
  if (fields > kMostTiffFields) return std::nullopt;
  const std::string directory = read_text(file, place + count_bytes, fields * field_bytes);
  for (std::size_t at = 0; at + field_bytes <= directory.size(); at += field_bytes) {
    if (number(directory, at, 2) != kTiffDescription) continue;
    const std::uint64_t length = number(directory, at + 4, word);
    const std::uint64_t text = number(directory, at + 4 + word, word);
    if (text >= file.size_bytes()) return std::nullopt;
    return search(file, text, text + std::min(length, kImageHeadBytes), kInImage);
  }
  return std::nullopt;
}

std::optional<std::string> search_file(const std::string& path) {
  const std::unique_ptr<ReadFile> file = posix_file_system().open(path);
  const std::string head = read_text(*file, 0, 20);
  if (head.starts_with("glTF")) return search(*file, 20, 20 + number(head, 12, 4), kInModel);
  if (lower_ending(path) == ".gltf") return search(*file, 0, file->size_bytes(), kInModel);
  if (head.starts_with("II*\0"sv)) return search_tiff(*file, false);
  if (head.starts_with("II+\0"sv)) return search_tiff(*file, true);
  return search(*file, 0, kImageHeadBytes, kInImage);
}

}  // namespace

std::string software_name() { return "pounce " POUNCE_VERSION; }

std::string job_description(const std::string& job) { return fmt::format("{}{}", kInImage, job); }

std::string job_extras(const std::string& job) {
  return fmt::format("{{\"job\":\"{}\",\"software\":\"{}\"}}", job, software_name());
}

std::optional<std::string> read_job(const std::string& path) noexcept {
  try {
    return search_file(path);
  } catch (const std::exception&) {
    return std::nullopt;  // whoever makes or reads the file says what is wrong with it
  }
}

}  // namespace pounce::io
