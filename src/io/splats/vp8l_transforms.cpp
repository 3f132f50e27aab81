// SPDX-License-Identifier: Apache-2.0
//
// Bytes are added modulo 256, four at a time. Predictors that need the pixel to the left go pixel
// by pixel, with the SSE2 that every x86-64 has; the others become vector code by themselves.
#include "io/splats/vp8l_transforms.h"

#include <emmintrin.h>
#include <fmt/format.h>

#include <algorithm>

namespace pounce::io {
namespace {

using Pixel = std::uint32_t;
constexpr Pixel kBlack = 0xFF000000;

Pixel add(Pixel a, Pixel b) {
  const Pixel even = (a & 0x00FF00FF) + (b & 0x00FF00FF);
  const Pixel odd = (a & 0xFF00FF00) + (b & 0xFF00FF00);
  return (even & 0x00FF00FF) | (odd & 0xFF00FF00);
}

/// Of each channel, rounded down.
Pixel average(Pixel a, Pixel b) { return (((a ^ b) & 0xFEFEFEFE) >> 1) + (a & b); }

__m128i vector_of(Pixel pixel) { return _mm_cvtsi32_si128(static_cast<int>(pixel)); }
Pixel pixel_of(__m128i vector) { return static_cast<Pixel>(_mm_cvtsi128_si32(vector)); }
/// Four channels of 16 bits.
__m128i widened(Pixel pixel) { return _mm_unpacklo_epi8(vector_of(pixel), _mm_setzero_si128()); }

/// Sum of the differences of the channels.
int difference(Pixel a, Pixel b) {
  return _mm_cvtsi128_si32(_mm_sad_epu8(vector_of(a), vector_of(b)));
}

/// Whichever of left and above is nearer to left + above - corner.
Pixel nearer(Pixel left, Pixel above, Pixel corner) {
  return difference(above, corner) < difference(left, corner) ? left : above;
}

/// left + above - corner, clamped.
Pixel gradient(Pixel left, Pixel above, Pixel corner) {
  const __m128i change = _mm_sub_epi16(widened(above), widened(corner));
  const __m128i sum = _mm_add_epi16(widened(left), change);
  return pixel_of(_mm_packus_epi16(sum, sum));
}

/// a + (a - corner) / 2, the half rounded towards zero, clamped.
Pixel half_gradient(Pixel a, Pixel corner) {
  const __m128i wide = widened(a);
  const __m128i change = _mm_sub_epi16(wide, widened(corner));
  const __m128i half = _mm_srai_epi16(_mm_sub_epi16(change, _mm_srai_epi16(change, 15)), 1);
  const __m128i sum = _mm_add_epi16(wide, half);
  return pixel_of(_mm_packus_epi16(sum, sum));
}

/// Adds what is predicted from (left, above, to the left of that, to the right of that).
template <class Predict>
void add_predicted(Pixel* row, const Pixel* above, std::uint32_t begin, std::uint32_t end,
                   const Predict& predict) {
  Pixel left = row[begin - 1];
  for (std::uint32_t x = begin; x < end; ++x) {
    left = add(row[x], predict(left, above[x], above[x - 1], above[x + 1]));
    row[x] = left;
  }
}

constexpr std::uint8_t kPredictors = 14;

/// Pixels [begin, end) of a row, 0 < begin, by one predictor.
void add_predicted(std::uint8_t predictor, Pixel* row, const Pixel* above, std::uint32_t begin,
                   std::uint32_t end) {
  const auto by = [&](const auto& predict) { add_predicted(row, above, begin, end, predict); };
  using P = const Pixel;
  switch (predictor) {
    case 0:
      return by([](P, P, P, P) { return kBlack; });
    case 1:
      return by([](P l, P, P, P) { return l; });
    case 2:
      return by([](P, P t, P, P) { return t; });
    case 3:
      return by([](P, P, P, P tr) { return tr; });
    case 4:
      return by([](P, P, P tl, P) { return tl; });
    case 5:
      return by([](P l, P t, P, P tr) { return average(average(l, tr), t); });
    case 6:
      return by([](P l, P, P tl, P) { return average(l, tl); });
    case 7:
      return by([](P l, P t, P, P) { return average(l, t); });
    case 8:
      return by([](P, P t, P tl, P) { return average(tl, t); });
    case 9:
      return by([](P, P t, P, P tr) { return average(t, tr); });
    case 10:
      return by([](P l, P t, P tl, P tr) { return average(average(l, tl), average(t, tr)); });
    case 11:
      return by([](P l, P t, P tl, P) { return nearer(l, t, tl); });
    case 12:
      return by([](P l, P t, P tl, P) { return gradient(l, t, tl); });
    default:
      return by([](P l, P t, P tl, P) { return half_gradient(average(l, t), tl); });
  }
}

/// Reads an image of one pixel per block and keeps of it what `value_of` makes of a pixel.
template <class Value, class ValueOf>
Vp8lBlocks<Value> read_blocks(const Vp8lTransformInput& input, const ValueOf& value_of) {
  Vp8lBlocks<Value> blocks(input.width, input.source.read(3) + 2, input.scratch);
  const std::uint32_t columns = blocks.size(input.width), rows = blocks.size(input.height);
  Vp8lPixels image(input.source, columns, rows, input.ring, nullptr);
  PixelRow pixels(columns);
  std::vector<Value> values(columns);
  for (std::uint32_t y = 0; y < rows; ++y) {
    image.read_row(pixels);
    std::transform(pixels.begin(), pixels.end(), values.begin(), value_of);
    blocks.append(values);
  }
  return blocks;
}

class Predictor final : public Vp8lTransform {
 public:
  explicit Predictor(const Vp8lTransformInput& input)
      : predictors_(read_blocks<std::uint8_t>(input,
                                              [&](Pixel pixel) {
                                                const std::uint32_t predictor = pixel >> 8 & 0xFF;
                                                if (predictor >= kPredictors)
                                                  input.source.fail(fmt::format(
                                                      "a predictor of number {}", predictor));
                                                return static_cast<std::uint8_t>(predictor);
                                              })),
        above_(input.width + std::size_t{1}) {}

  void undo(std::uint32_t y, PixelRow& row) override {
    const std::uint32_t width = static_cast<std::uint32_t>(row.size());
    row[0] = add(row[0], y == 0 ? kBlack : above_[0]);
    // The last pixel has nothing above to its right: the next in memory takes that place.
    above_[width] = row[0];
    if (y == 0) {
      add_predicted(1, row.data(), above_.data(), 1, width);
    } else {
      const auto predictors = predictors_.row(y);
      std::uint32_t begin = 1;
      for (std::uint32_t block = 0; begin < width; ++block) {
        const std::uint32_t end = std::min(width, (block + 1) << predictors_.bits());
        add_predicted(predictors[block], row.data(), above_.data(), begin, end);
        begin = end;
      }
    }
    std::copy(row.begin(), row.end(), above_.begin());
  }

 private:
  Vp8lBlocks<std::uint8_t> predictors_;
  PixelRow above_;  ///< the row before, and one pixel more
};

/// What of one channel is added to another, in 32nds.
struct CrossColour {
  std::int8_t green_to_red, green_to_blue, red_to_blue;
};

class CrossColours final : public Vp8lTransform {
 public:
  explicit CrossColours(const Vp8lTransformInput& input)
      : factors_(read_blocks<CrossColour>(input, [](Pixel pixel) {
          return CrossColour{static_cast<std::int8_t>(pixel), static_cast<std::int8_t>(pixel >> 8),
                             static_cast<std::int8_t>(pixel >> 16)};
        })) {}

  void undo(std::uint32_t y, PixelRow& row) override {
    const auto factors = factors_.row(y);
    for (std::size_t begin = 0, block = 0; begin < row.size(); ++block) {
      const std::size_t end = std::min(row.size(), (block + 1) << factors_.bits());
      undo(factors[block], std::span(row).subspan(begin, end - begin));
      begin = end;
    }
  }

 private:
  static void undo(const CrossColour& factors, std::span<Pixel> pixels) {
    const auto share = [](std::int8_t factor, std::uint32_t channel) {
      return static_cast<std::uint32_t>((factor * static_cast<std::int8_t>(channel)) >> 5);
    };
    for (Pixel& pixel : pixels) {
      const std::uint32_t green = pixel >> 8;
      const std::uint32_t red = (pixel >> 16) + share(factors.green_to_red, green);
      const std::uint32_t blue =
          pixel + share(factors.green_to_blue, green) + share(factors.red_to_blue, red);
      pixel = (pixel & 0xFF00FF00) | (red & 0xFF) << 16 | (blue & 0xFF);
    }
  }

  Vp8lBlocks<CrossColour> factors_;
};

class SubtractGreen final : public Vp8lTransform {
 public:
  void undo(std::uint32_t, PixelRow& row) override {
    for (Pixel& pixel : row) {
      const Pixel green = pixel >> 8 & 0xFF;
      pixel = (pixel & 0xFF00FF00) | (((pixel & 0x00FF00FF) + (green << 16 | green)) & 0x00FF00FF);
    }
  }
};

class Palette final : public Vp8lTransform {
 public:
  explicit Palette(const Vp8lTransformInput& input) : width_(input.width) {
    const std::uint32_t count = input.source.read(8) + 1;
    Vp8lPixels image(input.source, count, 1, input.ring, nullptr);
    PixelRow colours(count);
    image.read_row(colours);
    for (std::uint32_t i = 1; i < count; ++i) colours[i] = add(colours[i], colours[i - 1]);
    std::copy(colours.begin(), colours.end(), colours_.begin());
    // log2 of the pixels that are stored as one.
    bundle_ = count <= 2 ? 3 : count <= 4 ? 2 : count <= 16 ? 1 : 0;
  }

  std::uint32_t stored_width(std::uint32_t width) const override {
    return (width + (1U << bundle_) - 1) >> bundle_;
  }

  void undo(std::uint32_t, PixelRow& row) override {
    const std::uint32_t bits = 8U >> bundle_;
    row.resize(width_);
    // From the end: a bundle lies before the pixels that come out of it.
    for (std::uint32_t x = width_; x-- > 0;) {
      const std::uint32_t place = x & ((1U << bundle_) - 1);
      const std::uint32_t bundle = row[x >> bundle_] >> 8 & 0xFF;
      row[x] = colours_[bundle >> (place * bits) & ((1U << bits) - 1)];
    }
  }

 private:
  std::uint32_t width_;
  std::uint32_t bundle_ = 0;
  std::array<Pixel, 256> colours_{};  ///< clear black where there is none
};

}  // namespace

std::unique_ptr<Vp8lTransform> read_vp8l_transform(Vp8lTransformKind kind,
                                                   const Vp8lTransformInput& input) {
  switch (kind) {
    case Vp8lTransformKind::predictor:
      return std::make_unique<Predictor>(input);
    case Vp8lTransformKind::cross_colour:
      return std::make_unique<CrossColours>(input);
    case Vp8lTransformKind::subtract_green:
      return std::make_unique<SubtractGreen>();
    case Vp8lTransformKind::palette:
      return std::make_unique<Palette>(input);
  }
  return nullptr;
}

}  // namespace pounce::io
