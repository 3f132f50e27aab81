// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <map>
#include <random>
#include <string>
#include <vector>

namespace pounce::test {

/// Bits, the lowest of each byte first.
class BitWriter {
 public:
  void put(std::uint64_t value, std::uint32_t bits) {
    for (std::uint32_t i = 0; i < bits; ++i, ++count_) {
      if (count_ % 8 == 0) bytes_ += '\0';
      if ((value >> i & 1) != 0)
        bytes_.back() =
            static_cast<char>(static_cast<unsigned char>(bytes_.back()) | 1U << (count_ % 8));
    }
  }
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
  std::uint64_t count_ = 0;
};

inline std::string little_endian(std::uint64_t value, std::size_t bytes) {
  std::string text;
  for (std::size_t i = 0; i < bytes; ++i) text += static_cast<char>(value >> (8 * i) & 0xFF);
  return text;
}

inline std::string riff_chunk(const std::string& type, const std::string& data) {
  return type + little_endian(data.size(), 4) + data + std::string(data.size() % 2, '\0');
}

inline std::string riff_file(const std::string& chunks) {
  return riff_chunk("RIFF", "WEBP" + chunks);
}

/// A whole file of one image: `stream` follows the size.
inline std::string vp8l_file(std::uint32_t width, std::uint32_t height, const std::string& stream) {
  const std::uint32_t size = (width - 1) | (height - 1) << 14 | 1U << 28;
  return riff_file(riff_chunk("VP8L", "\x2F" + little_endian(size, 4) + stream));
}

/// A canonical prefix code by the lengths of its symbols' codes.
class CodeWriter {
 public:
  explicit CodeWriter(std::vector<std::uint8_t> lengths) : lengths_(std::move(lengths)) {
    std::vector<std::uint32_t> order;
    for (std::uint32_t s = 0; s < lengths_.size(); ++s)
      if (lengths_[s] > 0) order.push_back(s);
    std::stable_sort(order.begin(), order.end(),
                     [&](std::uint32_t a, std::uint32_t b) { return lengths_[a] < lengths_[b]; });
    std::uint32_t code = 0, bits = 0;
    codes_.resize(lengths_.size());
    for (const std::uint32_t s : order) {
      code <<= lengths_[s] - bits;
      bits = lengths_[s];
      for (std::uint32_t i = 0; i < bits; ++i) codes_[s] |= (code >> i & 1) << (bits - 1 - i);
      ++code;
    }
    symbols_ = order;
  }
  /// `used` symbols, each with a code of log2(used) bits, of an alphabet of `symbols`.
  static CodeWriter flat(std::size_t symbols, std::size_t used = 256) {
    std::vector<std::uint8_t> lengths(symbols);
    const std::size_t bits = used == 1 ? 1 : static_cast<std::size_t>(std::bit_width(used - 1));
    std::fill_n(lengths.begin(), used, static_cast<std::uint8_t>(bits));
    return CodeWriter(lengths);
  }
  static CodeWriter single(std::size_t symbols, std::size_t symbol) {
    std::vector<std::uint8_t> lengths(symbols);
    lengths[symbol] = 1;
    return CodeWriter(lengths);
  }

  /// The symbols that have a code.
  const std::vector<std::uint32_t>& symbols() const { return symbols_; }
  std::uint32_t longest() const { return *std::max_element(lengths_.begin(), lengths_.end()); }

  void put(BitWriter& out, std::uint32_t symbol) const {
    if (symbols_.size() > 1) out.put(codes_[symbol], lengths_[symbol]);
  }

  /// The form for one or two symbols below 256 with codes of one bit.
  bool fits_simple() const {
    return symbols_.size() <= 2 && longest() == 1 && symbols_.back() < 256;
  }
  void describe_simple(BitWriter& out) const {
    out.put(1, 1);
    out.put(symbols_.size() - 1, 1);
    const bool is_short = symbols_[0] < 2;
    out.put(is_short ? 0 : 1, 1);
    out.put(symbols_[0], is_short ? 1 : 8);
    if (symbols_.size() == 2) out.put(symbols_[1], 8);
  }
  /// All lengths one by one, or with repetitions, and those behind the last symbol left out.
  void describe(BitWriter& out, bool repeat = false, bool leave_out = false) const {
    // 0 to 13 take four bits, the repetitions five, 14 and 15 six: a complete code.
    std::vector<std::uint8_t> own(19, 4);
    own[14] = own[15] = 6;
    own[16] = own[17] = own[18] = 5;
    const CodeWriter code(own);
    out.put(0, 1);
    out.put(19 - 4, 4);
    for (const int s : {17, 18, 0, 1, 2, 3, 4, 5, 16, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15})
      out.put(own[static_cast<std::size_t>(s)], 3);
    const auto runs = this->runs(repeat, leave_out);
    out.put(leave_out ? 1 : 0, 1);
    if (leave_out) {
      out.put(5, 3);  // the number of lengths takes twelve bits
      out.put(runs.size() - 2, 12);
    }
    for (const Run& run : runs) {
      code.put(out, run.symbol);
      if (run.symbol == 16) out.put(run.count - 3, 2);
      if (run.symbol == 17) out.put(run.count - 3, 3);
      if (run.symbol == 18) out.put(run.count - 11, 7);
    }
  }

 private:
  struct Run {
    std::uint32_t symbol;
    std::size_t count;
  };
  std::vector<Run> runs(bool repeat, bool leave_out) const {
    std::vector<Run> runs;
    std::size_t end = lengths_.size();
    while (leave_out && end > 2 && lengths_[end - 1] == 0) --end;
    std::uint32_t last = 8;
    for (std::size_t i = 0; i < end;) {
      const std::uint8_t length = lengths_[i];
      std::size_t same = 1;
      while (i + same < end && lengths_[i + same] == length) ++same;
      if (!repeat || same < 3 || (length != 0 && length != last)) {
        runs.push_back({length, 1});
        same = 1;
      } else if (length == 0) {
        same = std::min<std::size_t>(same, 138);
        runs.push_back({same < 11 ? 17U : 18U, same});
      } else {
        same = std::min<std::size_t>(same, 6);
        runs.push_back({16, same});
      }
      if (length != 0) last = length;
      i += same;
    }
    while (runs.size() < 2) runs.push_back({0, 1});
    return runs;
  }

  std::vector<std::uint8_t> lengths_;
  std::vector<std::uint32_t> codes_, symbols_;
};

/// The five codes of a group: green, red, blue, alpha, distance.
using CodeGroup = std::vector<CodeWriter>;

/// Codes with which any pixel can be written, 8 bits a channel, and no copies.
inline CodeGroup flat_codes() {
  return {CodeWriter::flat(280), CodeWriter::flat(256), CodeWriter::flat(256),
          CodeWriter::flat(256), CodeWriter::single(40, 0)};
}
inline void describe(BitWriter& out, const CodeGroup& codes) {
  for (const CodeWriter& code : codes) {
    if (code.fits_simple()) {
      code.describe_simple(out);
    } else {
      code.describe(out);
    }
  }
}
/// A pixel alpha << 24 | red << 16 | green << 8 | blue.
inline void put_pixel(BitWriter& out, const CodeGroup& codes, std::uint32_t argb) {
  codes[0].put(out, argb >> 8 & 0xFF);
  codes[1].put(out, argb >> 16 & 0xFF);
  codes[2].put(out, argb & 0xFF);
  codes[3].put(out, argb >> 24);
}
/// An image of blocks or colours: no cache, flat codes, its pixels.
inline void put_image(BitWriter& out, const std::vector<std::uint32_t>& pixels) {
  const CodeGroup codes = flat_codes();
  out.put(0, 1);
  describe(out, codes);
  for (const std::uint32_t pixel : pixels) put_pixel(out, codes, pixel);
}
/// The end of a stream: no more transforms, then the pixels, with one group of codes.
inline void put_main_image(BitWriter& out, const std::vector<std::uint32_t>& pixels) {
  const CodeGroup codes = flat_codes();
  out.put(0, 3);  // no transform, no cache, one group
  describe(out, codes);
  for (const std::uint32_t pixel : pixels) put_pixel(out, codes, pixel);
}

/// A stream that is a valid image of random contents: any codes, any transforms in any order, any
/// copies. Counts what it put in.
class RandomVp8l {
 public:
  struct Shape {
    std::uint32_t width, height;
    bool far_copies = false;  ///< most copies are long and from far
  };
  RandomVp8l(std::uint32_t seed, const Shape& shape) : random_(seed), shape_(shape) {
    std::uint32_t width = shape.width;
    std::vector<std::uint32_t> kinds{0, 1, 2, 3};
    std::shuffle(kinds.begin(), kinds.end(), random_);
    kinds.resize(below(5));
    for (const std::uint32_t kind : kinds) {
      out_.put(1, 1);
      out_.put(kind, 2);
      ++met_["transform " + std::to_string(kind)];
      put_transform(kind, width);
    }
    out_.put(0, 1);
    if (kinds.size() > 1) ++met_["several transforms"];
    put_argb(width);
  }
  std::string file() const { return vp8l_file(shape_.width, shape_.height, out_.bytes()); }
  const std::map<std::string, int>& met() const { return met_; }

 private:
  struct Image {
    std::uint32_t width = 0, height = 0;
    std::uint32_t cache_bits = 0;
    std::vector<CodeGroup> groups;
    std::uint32_t block_bits = 0;
    std::vector<std::uint32_t> group_of_block;
  };
  std::uint32_t below(std::uint32_t end) { return static_cast<std::uint32_t>(random_() % end); }
  static std::uint32_t blocks(std::uint32_t pixels, std::uint32_t bits) {
    return (pixels + (1U << bits) - 1) >> bits;
  }

  /// A complete code of some of the symbols, among them `wanted`.
  CodeWriter random_code(std::uint32_t symbols, const std::vector<std::uint32_t>& wanted,
                         std::uint32_t limit) {
    std::vector<std::uint32_t> order;
    for (std::uint32_t s = 0; s < symbols; ++s)
      if (s < limit || s >= 256) order.push_back(s);
    std::shuffle(order.begin(), order.end(), random_);
    for (const std::uint32_t s : wanted) std::erase(order, s);
    order.insert(order.begin(), wanted.begin(), wanted.end());
    const std::uint32_t most = static_cast<std::uint32_t>(order.size());
    std::uint32_t count = below(3) == 0 ? 1 + below(2) : 1 + below(most);
    count = std::max(count, static_cast<std::uint32_t>(wanted.size()));
    // Splits leaves of a tree; often the one that was split before, which makes long codes.
    std::vector<std::uint8_t> depths{0};
    const bool deep = below(2) == 0;
    std::size_t last = 0;
    while (depths.size() < count) {
      const std::size_t at = deep && depths[last] < 15 && below(4) != 0
                                 ? last
                                 : below(static_cast<std::uint32_t>(depths.size()));
      if (depths[at] == 15) continue;
      depths.push_back(++depths[at]);
      last = at;
    }
    if (count == 1) depths[0] = 1;
    std::vector<std::uint8_t> lengths(symbols);
    for (std::uint32_t i = 0; i < count; ++i) lengths[order[i]] = depths[i];
    return CodeWriter(lengths);
  }

  void describe_code(const CodeWriter& code) {
    if (code.symbols().size() == 1) ++met_["code of one symbol"];
    if (code.longest() > 9) ++met_["long codes"];
    if (code.longest() == 15) ++met_["longest codes"];
    if (code.fits_simple() && below(2) == 0) {
      ++met_["simple code"];
      code.describe_simple(out_);
    } else {
      const bool repeat = below(2) == 0, leave_out = below(2) == 0;
      ++met_[repeat ? "repeated lengths" : "single lengths"];
      if (leave_out) ++met_["lengths left out"];
      code.describe(out_, repeat, leave_out);
    }
  }

  CodeGroup random_group(std::uint32_t cache_bits, std::uint32_t greens_end) {
    const std::uint32_t cached = cache_bits > 0 ? 1U << cache_bits : 0;
    std::vector<std::uint32_t> greens{below(greens_end)};
    if (shape_.far_copies) greens = {greens[0], 256 + 23, 256 + 22};
    std::vector<std::uint32_t> distances{below(40)};
    if (shape_.far_copies) distances = {39, 38, 37};
    return {random_code(280 + cached, greens, greens_end), random_code(256, {}, 256),
            random_code(256, {}, 256), random_code(256, {}, 256), random_code(40, distances, 40)};
  }

  std::uint32_t put_cache() {
    const std::uint32_t bits = below(2) == 0 ? 0 : 1 + below(11);
    out_.put(bits > 0 ? 1 : 0, 1);
    if (bits > 0) out_.put(bits, 4);
    ++met_[bits > 0 ? "colour cache" : "no colour cache"];
    return bits;
  }

  void put_transform(std::uint32_t kind, std::uint32_t& width) {
    if (kind == 2) return;
    if (kind == 3) {
      static constexpr std::uint32_t kCounts[] = {1, 2, 3, 4, 5, 16, 17, 200, 256};
      const std::uint32_t count = kCounts[below(9)];
      const std::uint32_t bundle = count <= 2 ? 3 : count <= 4 ? 2 : count <= 16 ? 1 : 0;
      out_.put(count - 1, 8);
      put_sub_image(count, 1, 256);
      width = blocks(width, bundle);
      ++met_["palette of " + std::to_string(1U << bundle) + " in one"];
      return;
    }
    const std::uint32_t bits = below(4) == 0 ? below(8) : below(2);
    out_.put(bits, 3);
    put_sub_image(blocks(width, bits + 2), blocks(shape_.height, bits + 2), kind == 0 ? 14 : 256);
  }

  /// Its greens are below `greens_end`.
  void put_sub_image(std::uint32_t width, std::uint32_t height, std::uint32_t greens_end) {
    Image image;
    image.width = width;
    image.height = height;
    image.cache_bits = put_cache();
    image.groups = {random_group(image.cache_bits, greens_end)};
    for (const CodeWriter& code : image.groups[0]) describe_code(code);
    const bool holds_predictors = greens_end == 14;
    put_pixels(image, holds_predictors);
  }

  void put_argb(std::uint32_t width) {
    Image image;
    image.width = width;
    image.height = shape_.height;
    image.cache_bits = put_cache();
    const bool has_groups = below(2) == 0;
    out_.put(has_groups ? 1 : 0, 1);
    std::uint32_t groups = 1;
    if (has_groups) {
      const std::uint32_t bits = below(3);
      out_.put(bits, 3);
      image.block_bits = bits + 2;
      groups = 1 + below(8);
      if (below(10) == 0) groups = 300;
      put_group_image(image, groups);
      ++met_[groups > 256 ? "more than 256 groups" : "groups"];
    }
    for (std::uint32_t i = 0; i < groups; ++i) {
      image.groups.push_back(random_group(image.cache_bits, 256));
      for (const CodeWriter& code : image.groups.back()) describe_code(code);
    }
    put_pixels(image, false);
  }

  /// Which group each block has: literals alone, so that it is known here, too. The last group is
  /// always used, others may not be.
  void put_group_image(Image& image, std::uint32_t groups) {
    const std::uint32_t count =
        blocks(image.width, image.block_bits) * blocks(image.height, image.block_bits);
    out_.put(0, 1);
    const CodeGroup codes = flat_codes();
    for (const CodeWriter& code : codes) describe_code(code);
    for (std::uint32_t i = 0; i < count; ++i) {
      image.group_of_block.push_back(i == 0 ? groups - 1 : below(groups));
      put_pixel(out_, codes, image.group_of_block.back() << 8 | 0xAB00'00CDU);
    }
  }

  static std::uint32_t extra_bits(std::uint32_t symbol) {
    return symbol < 4 ? 0 : (symbol - 2) >> 1;
  }
  static std::uint32_t number(std::uint32_t symbol, std::uint32_t extra) {
    return symbol < 4 ? symbol + 1 : ((2 + (symbol & 1)) << extra_bits(symbol)) + extra + 1;
  }

  void put_pixels(const Image& image, bool holds_predictors) {
    const std::uint64_t pixels = std::uint64_t{image.width} * image.height;
    for (std::uint64_t at = 0; at < pixels;) {
      const std::uint32_t x = static_cast<std::uint32_t>(at % image.width);
      const std::uint32_t y = static_cast<std::uint32_t>(at / image.width);
      const CodeGroup& codes =
          image.group_of_block.empty()
              ? image.groups[0]
              : image.groups[image.group_of_block[(y >> image.block_bits) *
                                                      blocks(image.width, image.block_bits) +
                                                  (x >> image.block_bits)]];
      const auto any = [&](std::size_t code) {
        const auto& symbols = codes[code].symbols();
        return symbols[below(static_cast<std::uint32_t>(symbols.size()))];
      };
      std::uint32_t green = any(0);
      if (green >= 256 && green < 280) {
        if (put_copy(codes, green, any(4), image, pixels, at)) continue;
        const auto& symbols = codes[0].symbols();
        green = *std::min_element(symbols.begin(), symbols.end());
      }
      codes[0].put(out_, green);
      if (green < 256) {
        codes[1].put(out_, any(1));
        codes[2].put(out_, any(2));
        codes[3].put(out_, any(3));
        if (holds_predictors) ++met_["predictor " + std::to_string(green)];
      } else {
        ++met_["cached colour"];
      }
      ++at;
    }
  }

  bool put_copy(const CodeGroup& codes, std::uint32_t green, std::uint32_t distance_symbol,
                const Image& image, std::uint64_t pixels, std::uint64_t& at) {
    const std::uint32_t length_extra = below(1U << extra_bits(green - 256));
    const std::uint32_t distance_extra = shape_.far_copies && below(2) == 0
                                             ? (1U << extra_bits(distance_symbol)) - 1 - below(2)
                                             : below(1U << extra_bits(distance_symbol));
    const std::uint32_t length = number(green - 256, length_extra);
    const std::uint32_t code = number(distance_symbol, distance_extra);
    // Near pixels: at most 7 rows up and 8 to the left; whoever is that far in the image may.
    const std::uint64_t reach = code > 120 ? code - 120 : std::uint64_t{7} * image.width + 8;
    if (length > pixels - at || reach > at) return false;
    codes[0].put(out_, green);
    out_.put(length_extra, extra_bits(green - 256));
    codes[4].put(out_, distance_symbol);
    out_.put(distance_extra, extra_bits(distance_symbol));
    ++met_[code > 120 ? "far copy" : "near copy"];
    if (code <= 120 && image.width < 8) ++met_["near copy in a narrow image"];
    if (code > (1U << 20) - 4096) ++met_["copy from almost 2^20 pixels back"];
    if (code > 120 && code - 120 < length) ++met_["copy over itself"];
    at += length;
    return true;
  }

  std::mt19937 random_;
  Shape shape_;
  BitWriter out_;
  std::map<std::string, int> met_;
};

}  // namespace pounce::test
