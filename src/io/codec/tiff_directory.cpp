// SPDX-License-Identifier: Apache-2.0
//
// A TIFF is a chain of directories, one for each of its images: the header says where the first one
// is, and behind the fields of each is the place of the next, or 0. A field is a tag, the type and
// the number of its values, and the values themselves if they fit into four bytes (eight in a
// BigTIFF, whose counts and places are wider, too), else where they are. Everything that reads a
// TIFF beside its decoder goes through this walker, so that the attacks on it are stopped once:
// a directory or values beyond the end of the file, more fields than libtiff takes, the same field
// twice. What the fields mean together is for guard_tiff().
#include "io/codec/tiff_directory.h"

#include <fmt/format.h>

#include <algorithm>

#include "pounce/error.h"

namespace pounce::io {
namespace {

constexpr std::uint64_t kMostFields = 4096;  // as libtiff

bool is_big_endian(ByteSource& bytes) {
  char first = 0;
  return bytes.read_at(0, &first, 1) == 1 && first == 'M';
}

}  // namespace

TiffDirectory::TiffDirectory(ByteSource& bytes, std::optional<std::uint64_t> place)
    : at_(bytes, "TIFF", is_big_endian(bytes)) {
  big_ = at_.u16(2) == 43;
  place_ = place ? *place : big_ ? at_.number(8, 8) : at_.u32(4);
  if (place_ >= at_.size())
    refuse(
        fmt::format("the TIFF's directory is at offset {}, past the end of the file ({} bytes); "
                    "the file is damaged or truncated",
                    place_, at_.size()));
  const std::uint64_t fields = at_.number(place_, count_bytes());
  if (fields == 0 || fields > kMostFields)
    refuse(fmt::format("the TIFF's directory claims {} fields; the file is damaged", fields));
  end_ = place_ + count_bytes();
  for (std::uint64_t i = 0; i < fields; ++i) {
    TiffField field;
    field.place = end_;
    field.size_bytes = big_ ? 20 : 12;
    field.tag = at_.u16(end_);
    field.type = at_.u16(end_ + 2);
    field.count = at_.number(end_ + 4, word_bytes());
    const std::uint64_t value = end_ + 4 + word_bytes();
    field.data = field.data_bytes() <= word_bytes() ? value : at_.number(value, word_bytes());
    end_ += field.size_bytes;
    fields_.push_back(field);
  }
  end_ += word_bytes();
}

std::uint64_t TiffDirectory::next() { return at_.number(end_ - word_bytes(), word_bytes()); }

const TiffField* TiffDirectory::find(std::uint16_t tag) const {
  const TiffField* found = nullptr;
  for (const TiffField& field : fields_) {
    if (field.tag != tag) continue;
    if (found != nullptr)
      refuse(fmt::format("the TIFF has field {} twice; the file is damaged", tag));
    found = &field;
  }
  return found;
}

const TiffField* TiffDirectory::use(std::uint16_t tag) {
  const TiffField* const field = find(tag);
  if (field != nullptr) used_.push_back(tag);
  return field;
}

std::vector<std::uint64_t> TiffDirectory::numbers(const TiffField& field, std::uint64_t count) {
  const bool whole = field.type == kShort || field.type == kLong || (field.type == kLong8 && big_);
  if (!whole || field.count != count) {
    refuse(fmt::format(
        "field {} of the TIFF has {} values of type {} instead of {} integers; the file is damaged",
        field.tag, field.count, field.type, count));
  }
  if (field.data > at_.size() || field.data_bytes() > at_.size() - field.data) {
    refuse(fmt::format(
        "the values of field {} of the TIFF extend past the end of the file ({} bytes); the file "
        "is damaged or truncated",
        field.tag, at_.size()));
  }
  std::vector<std::uint64_t> values(static_cast<std::size_t>(count));
  for (std::size_t i = 0; i < values.size(); ++i) {
    values[i] = at_.number(field.data + i * field.value_bytes(),
                           static_cast<std::size_t>(field.value_bytes()));
  }
  return values;
}

std::uint64_t TiffDirectory::number(std::uint16_t tag, std::uint64_t fallback) {
  const TiffField* const field = use(tag);
  return field == nullptr ? fallback : numbers(*field, 1).front();
}

std::uint64_t TiffDirectory::needed(std::uint16_t tag, std::string_view what) {
  if (find(tag) == nullptr)
    refuse(
        fmt::format("the TIFF does not state its {} (field {}); the file is damaged", what, tag));
  return number(tag, 0);
}

std::uint64_t TiffDirectory::of_all_samples(std::uint16_t tag, std::uint64_t samples,
                                            std::uint64_t fallback) {
  const TiffField* const field = use(tag);
  if (field == nullptr) return fallback;
  const std::vector<std::uint64_t> each = numbers(*field, field->count == 1 ? 1 : samples);
  if (std::any_of(each.begin(), each.end(), [&](std::uint64_t n) { return n != each.front(); }))
    refuse(
        "the TIFF's samples differ in bit depth or type; save it with one type for all channels");
  return each.front();
}

void TiffDirectory::show_used() {
  std::vector<std::byte> shown(static_cast<std::size_t>(end_ - place_));
  std::size_t end = count_bytes();
  std::uint64_t kept = 0;
  for (const TiffField& field : fields_) {
    if (std::find(used_.begin(), used_.end(), field.tag) == used_.end()) continue;
    for (std::uint64_t i = 0; i < field.size_bytes; ++i)
      shown[end++] = static_cast<std::byte>(at_.u8(field.place + i));
    ++kept;
  }
  ByteSource& bytes = at_.bytes();
  const bool big_endian = is_big_endian(bytes);
  for (std::size_t i = 0; i < count_bytes(); ++i)
    shown[big_endian ? count_bytes() - 1 - i : i] = static_cast<std::byte>(kept >> 8 * i);
  std::vector<ByteSource::Piece> pieces;
  if (place_ > 0) pieces.push_back({0, place_, {}});
  const std::uint64_t size = shown.size();
  pieces.push_back({place_, size, std::move(shown)});
  if (end_ < bytes.size_bytes()) pieces.push_back({end_, bytes.size_bytes() - end_, {}});
  bytes.show_only(std::move(pieces));
}

namespace {

struct Level {
  std::uint64_t width = 0, height = 0, next = 0;
};

/// Of the directory at `place` or of the first one; nothing where it is damaged. A failure to read
/// is not lost: `bytes` keeps it.
std::optional<Level> level_at(ByteSource& bytes, std::optional<std::uint64_t> place) {
  if (place == 0U) return std::nullopt;
  try {
    TiffDirectory directory(bytes, place);
    return Level{directory.number(kWidth, 0), directory.number(kHeight, 0), directory.next()};
  } catch (const Error&) {
    return std::nullopt;
  }
}

/// Rounded down or up, but at least 1.
bool is_half(std::uint64_t half, std::uint64_t whole) {
  return half > 0 && (half == whole / 2 || half == (whole + 1) / 2);
}

}  // namespace

std::uint32_t tiff_levels(ByteSource& bytes) {
  std::optional<Level> last = level_at(bytes, std::nullopt);
  std::uint32_t levels = 1;
  // Sizes fall, so this ends whatever the chain is.
  while (last && (last->width > 1 || last->height > 1)) {
    const std::optional<Level> next = level_at(bytes, last->next);
    if (!next || !is_half(next->width, last->width) || !is_half(next->height, last->height)) break;
    ++levels;
    last = next;
  }
  return levels;
}

}  // namespace pounce::io
