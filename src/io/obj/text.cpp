// SPDX-License-Identifier: Apache-2.0
#include "io/obj/text.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <span>
#include <utility>

#include "core/input_file.h"
#include "pounce/error.h"

namespace pounce::io {
namespace {

constexpr std::size_t kPieceBytes = 256 << 10;
constexpr std::size_t kMaxObjLineBytes = 16 << 20, kMaxMtlLineBytes = 1 << 20;

bool is_blank(char c) { return c == ' ' || c == '\t'; }
bool is_digit(char c) { return c >= '0' && c <= '9'; }

/// Of a decimal number without sign that no such number can hold: is it too large, not too small?
bool is_large(std::string_view number) {
  const std::size_t mantissa = std::min(number.find_first_of("eE"), number.size());
  const std::size_t point = std::min(number.find('.'), mantissa);
  const std::size_t first = number.find_first_not_of("0.");
  std::string_view exponent = number.substr(std::min(mantissa + 1, number.size()));
  if (exponent.starts_with('+')) exponent.remove_prefix(1);
  std::int64_t moved = 0;
  const auto result = std::from_chars(exponent.data(), exponent.data() + exponent.size(), moved);
  if (result.ec == std::errc::result_out_of_range) return exponent[0] != '-';
  return moved > static_cast<std::int64_t>(first) - static_cast<std::int64_t>(point);
}

/// Reads the number at the front of `word`; returns how many characters it has, 0 for none.
template <class T>
std::size_t read_number(std::string_view word, T& value) {
  const std::size_t sign = word.starts_with('+') || word.starts_with('-') ? 1 : 0;
  // from_chars() knows "inf" and "nan", and no "+".
  if (sign == word.size() || (word[sign] != '.' && !is_digit(word[sign]))) return 0;
  const auto [end, error] = std::from_chars(word.data() + sign, word.data() + word.size(), value);
  if (error == std::errc::invalid_argument) return 0;
  const auto length = static_cast<std::size_t>(end - word.data());
  if (error == std::errc::result_out_of_range) {
    value = is_large(word.substr(sign, length - sign)) ? std::numeric_limits<T>::infinity() : 0;
  }
  if (word[0] == '-') value = -value;
  return length;
}

template <class T>
std::optional<T> whole_number(std::string_view word) {
  T value = 0;
  const std::size_t length = read_number(word, value);
  return length > 0 && length == word.size() ? std::optional(value) : std::nullopt;
}

}  // namespace

ObjText::ObjText(const std::string& path, Kind kind)
    : path_(path), kind_(kind), file_(open_input(path)) {}

void ObjText::fail(const std::string& what) const {
  throw Error(ErrorKind::input,
              fmt::format("{}: line {}: {}; repair the line or export the model again", path_,
                          line_, what));
}

bool ObjText::next_piece() {
  const std::uint64_t left = file_->size_bytes() - offset_;
  if (left == 0) return false;
  piece_.resize(std::min<std::uint64_t>(left, kPieceBytes));
  file_->read(offset_, std::as_writable_bytes(std::span(piece_)));
  constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
  const std::string_view piece(piece_.data(), piece_.size());
  at_ = offset_ == 0 && piece.starts_with(kByteOrderMark) ? kByteOrderMark.size() : 0;
  next_lf_ = std::min(piece.find('\n', at_), piece.size());
  offset_ += piece_.size();
  return true;
}

bool ObjText::append_line(std::string& out) {
  const std::size_t most_bytes = kind_ == Kind::obj ? kMaxObjLineBytes : kMaxMtlLineBytes;
  bool any = false;
  for (bool ended = false; !ended && (at_ < piece_.size() || next_piece());) {
    if (std::exchange(after_cr_, false) && piece_[at_] == '\n') {
      ++at_;
      continue;
    }
    any = true;
    const std::string_view piece(piece_.data(), piece_.size());
    // Searched for once: where lines end with CR alone, the next LF may be far.
    if (next_lf_ < at_) next_lf_ = std::min(piece.find('\n', at_), piece.size());
    const std::string_view line = piece.substr(at_, next_lf_ - at_);
    const std::size_t size = std::min(line.find('\r'), line.size());
    if (out.size() + size > most_bytes) {
      line_ = lines_ended_ + 1;
      fail(fmt::format("longer than {} MiB, which no line of such a file is", most_bytes >> 20));
    }
    out.append(line, 0, size);
    at_ += size;
    ended = at_ < piece.size();
    if (ended) {
      ++lines_ended_;
      after_cr_ = piece[at_++] == '\r';
    }
  }
  longest_bytes_ = std::max<std::uint64_t>(longest_bytes_, out.size());
  while (!out.empty() && is_blank(out.back())) out.pop_back();
  return any;
}

bool ObjText::next(std::string& out) {
  out.clear();
  line_ = lines_ended_ + 1;
  if (!append_line(out)) return false;
  const bool may_go_on =
      kind_ == Kind::obj && out[std::min(out.find_first_not_of(" \t"), out.size())] != '#';
  while (may_go_on && !out.empty() && out.back() == '\\') {
    out.back() = ' ';
    if (!append_line(out)) break;
  }
  return true;
}

std::string_view next_word(std::string_view& rest) {
  std::size_t first = 0;
  while (first < rest.size() && is_blank(rest[first])) ++first;
  std::size_t last = first;
  while (last < rest.size() && !is_blank(rest[last])) ++last;
  const std::string_view word = rest.substr(first, last - first);
  rest.remove_prefix(last);
  return word;
}

std::size_t word_count(std::string_view rest) {
  std::size_t words = 0;
  while (!next_word(rest).empty()) ++words;
  return words;
}

std::string name_in(std::string_view rest) {
  rest = rest.substr(0, rest.find('\0'));
  return std::string(rest.substr(std::min<std::size_t>(1, rest.size())));
}

std::optional<float> to_float(std::string_view word) { return whole_number<float>(word); }

std::optional<double> to_double(std::string_view word) { return whole_number<double>(word); }

float to_float_or(std::string_view word, float otherwise) {
  float value = 0;
  return read_number(word, value) > 0 && std::isfinite(value) ? value : otherwise;
}

}  // namespace pounce::io
