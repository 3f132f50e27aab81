// SPDX-License-Identifier: Apache-2.0
//
// The outer half of lossless WebP (RFC 9649): the container, the transforms and rows of colours.
//
// A decoder of our own, because libwebp's needs the whole image in memory (a 16384² one takes 1
// GiB) and the images of a scene have a pixel for each of millions of Gaussians. Here a row is
// decoded and its transforms are undone while only the row above is kept.
//
// The file is a RIFF of chunks; lossy and animated ones are refused by name, for they would be read
// without complaint and change every value. Then come up to four transforms, each at most once, in
// the order in which the encoder applied them, so they are undone from the last to the first.
//
// A chunk VP8L begins with the byte 0x2F, then, from the lowest bit of the next word, 14 bits of
// width - 1, 14 of height - 1, one that says whether alpha is used (it is decoded anyway) and three
// of version. The bits behind it are one stream: transforms, then pixels.
//
// Bytes are added modulo 256, four at a time. Predictors that need the pixel to the left go pixel
// by pixel, with the SSE2 that every x86-64 has; the others become vector code by themselves.
//
// Steering images (predictors, colour shares, code groups) have a pixel per block, and the rows of
// the image need them block row by block row. They wait in the scratch file, so that memory grows
// with the width of an image at most.
#include "io/splats/vp8l.h"

#include <emmintrin.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <string_view>

#include "io/problems.h"

namespace pounce::io {
namespace {

/// What a transform of an image, `width` x `height` pixels when it is undone, is read with.
struct Vp8lTransformInput {
  BitSource& source;
  std::uint32_t width, height;
  PixelRing& ring;
  WriteFile& scratch;
};

/// The kinds of transforms, by their number in the file.
enum class Vp8lTransformKind : std::uint32_t { predictor, cross_colour, subtract_green, palette };

using Pixel = std::uint32_t;
constexpr Pixel kBlack = 0xFF000000;

// Two channels at a time: what one carries falls into the gap above it, or out of the word, and
// the masks drop it.
Pixel add(Pixel a, Pixel b) {
  const Pixel even = (a & 0x00FF00FF) + (b & 0x00FF00FF);
  const Pixel odd = (a & 0xFF00FF00) + (b & 0xFF00FF00);
  return (even & 0x00FF00FF) | (odd & 0xFF00FF00);
}

/// Of each channel, rounded down.
// Half of what differs plus what both have: no sum exceeds a channel, so nothing is carried.
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
  // In 16 bits with sign per channel. Packing clamps to a byte.
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
  // The pixel to the left stays in a register: each prediction waits for the one before.
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

/// Every pixel less what its neighbours foretell, by one of 14 rules for each block.
class Predictor final : public Vp8lTransform {
 public:
  explicit Predictor(const Vp8lTransformInput& input)
      : predictors_(read_blocks<std::uint8_t>(input,
                                              [&](Pixel pixel) {
                                                const std::uint32_t predictor = pixel >> 8 & 0xFF;
                                                if (predictor >= kPredictors)
                                                  input.source.fail(fmt::format(
                                                      "unknown predictor {}", predictor));
                                                return static_cast<std::uint8_t>(predictor);
                                              })),
        above_(input.width + std::size_t{1}) {}

  void undo(std::uint32_t y, PixelRow& row) override {
    const std::uint32_t width = static_cast<std::uint32_t>(row.size());
    row[0] = add(row[0], y == 0 ? kBlack : above_[0]);
    // The last pixel has nothing above to its right: the next in memory takes that place.
    above_[width] = row[0];
    if (y == 0) {
      // In the first row nothing is above: the format predicts from the left there, whatever the
      // block says.
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

/// Red and blue less what a linear share of green (and red) foretells, by blocks.
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
    // Signed bytes, and a shift that keeps the sign, as the format has it.
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

/// Green is added to red and blue again.
class SubtractGreen final : public Vp8lTransform {
 public:
  void undo(std::uint32_t, PixelRow& row) override {
    for (Pixel& pixel : row) {
      const Pixel green = pixel >> 8 & 0xFF;
      pixel = (pixel & 0xFF00FF00) | (((pixel & 0x00FF00FF) + (green << 16 | green)) & 0x00FF00FF);
    }
  }
};

/// Few colours: pixels are indices, of which up to eight share the green of one stored pixel.
class Palette final : public Vp8lTransform {
 public:
  explicit Palette(const Vp8lTransformInput& input) : width_(input.width) {
    // Colours are stored as differences to the one before. Indices beyond the last mean clear
    // black, as the format has it, so no index needs a check.
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
    // With more than 16 colours a pixel is one index and nothing is bundled: the loop is then a
    // look-up.
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

/// Reads what a transform of this kind needs. Its blocks go into the scratch file. Throws
/// Error(input), Error(storage).
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

constexpr std::uint32_t kMostChunks = 64;  // before the image: metadata, each at most once
constexpr std::uint64_t kMostPalette = 256;

[[noreturn]] void refuse_lossy(const std::string& name) {
  refuse(name,
         "is a lossy WebP image (VP8), which changes the Gaussians' values; export the scene again "
         "with lossless WebP images");
}

[[noreturn]] void refuse_animation(const std::string& name) {
  refuse(name, "is an animated WebP image; export the scene again with plain lossless ones");
}

[[noreturn]] void refuse_cut(const std::string& name, std::uint64_t needed, std::uint64_t bytes) {
  refuse(name, "ends after {} of at least {} bytes; download it or export it again", bytes, needed);
}

/// The first bytes of a range of a file, checked against its end.
struct Range {
  const ReadFile& file;
  std::uint64_t at, bytes;
  const std::string& name;

  template <std::size_t N>
  std::array<std::uint8_t, N> read(std::uint64_t offset) const {
    if (offset > bytes || bytes - offset < N) refuse_cut(name, offset + N, bytes);
    std::array<std::uint8_t, N> result;
    file.read(at + offset, std::as_writable_bytes(std::span(result)));
    return result;
  }
};

template <std::size_t N>
std::string_view text_of(const std::array<std::uint8_t, N>& bytes, std::size_t at) {
  return {reinterpret_cast<const char*>(bytes.data()) + at, 4};
}

template <std::size_t N>
std::uint32_t number_of(const std::array<std::uint8_t, N>& bytes, std::size_t at,
                        std::size_t count = 4) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < count; ++i) value |= std::uint32_t{bytes[at + i]} << (8 * i);
  return value;
}

/// The size and place of the bits of the VP8L chunk whose data begin at `offset`.
Vp8lHeader read_stream_header(const Range& range, std::uint64_t offset, std::uint32_t size) {
  std::array<std::uint8_t, 5> start{};
  if (size >= start.size()) start = range.read<5>(offset);
  if (start[0] != 0x2F)
    refuse(range.name, "does not begin like a lossless WebP image; download it or export it again");
  const std::uint32_t bits = number_of(start, 1);
  if (bits >> 29 != 0) {
    refuse(range.name,
           "is lossless WebP of version {}, but only 0 is supported; export the scene again with a "
           "plain encoder",
           bits >> 29);
  }
  Vp8lHeader header;
  header.width = (bits & 0x3FFF) + 1;
  header.height = (bits >> 14 & 0x3FFF) + 1;
  header.origin = range.at;
  header.stream_at = range.at + offset + start.size();
  header.stream_bytes = size - start.size();
  return header;
}

}  // namespace

Vp8lHeader read_vp8l_header(const ReadFile& file, std::uint64_t at, std::uint64_t bytes,
                            const std::string& name) {
  const Range range{file, at, bytes, name};
  const auto riff = range.read<12>(0);
  if (text_of(riff, 0) != "RIFF" || text_of(riff, 8) != "WEBP")
    refuse(name, "is not a WebP image; export the scene again with lossless WebP images");
  const std::uint64_t end = std::uint64_t{8} + number_of(riff, 4);
  if (end > bytes) refuse_cut(name, end, bytes);
  std::uint32_t canvas_width = 0, canvas_height = 0;
  // The length in the RIFF counts, not the file's: an archive may have more behind it.
  std::uint64_t offset = riff.size();
  for (std::uint32_t chunk = 0; chunk < kMostChunks && offset + 8 <= end; ++chunk) {
    const auto start = range.read<8>(offset);
    const std::string_view type = text_of(start, 0);
    const std::uint32_t size = number_of(start, 4);
    offset += start.size();
    // A chunk may not reach beyond what the RIFF says it has.
    if (size > end - offset) refuse_cut(name, offset + size, end);
    // ALPH is the alpha of a lossy image: VP8 follows.
    if (type == "VP8 " || type == "ALPH") refuse_lossy(name);
    if (type == "ANIM" || type == "ANMF") refuse_animation(name);
    if (type == "VP8X") {
      const auto extended = range.read<10>(offset);
      if ((extended[0] & 2) != 0) refuse_animation(name);
      canvas_width = number_of(extended, 4, 3) + 1;
      canvas_height = number_of(extended, 7, 3) + 1;
    } else if (type == "VP8L") {
      const Vp8lHeader header = read_stream_header(range, offset, size);
      if (canvas_width != 0 && (header.width != canvas_width || header.height != canvas_height)) {
        refuse(name, "states {} x {} pixels, but has {} x {}; download it or export it again",
               canvas_width, canvas_height, header.width, header.height);
      }
      return header;
    }
    // Chunks begin at even places.
    offset += size + (size & 1);
  }
  refuse(name, "is a WebP file without an image (no VP8L chunk); download it or export it again");
}

// The ring serves every image in turn: those that steer the main one (predictors, colours, groups,
// palette) are decoded to their end before it begins. A palette may have more entries than pixels.
Vp8lDecoder::Vp8lDecoder(const ReadFile& file, const Vp8lHeader& header, const std::string& name,
                         WriteFile& scratch)
    : header_(header),
      name_(name),
      source_(file, header.stream_at, header.stream_bytes, name, header.origin),
      ring_(std::max(std::uint64_t{header.width} * header.height, kMostPalette)),
      stored_width_(header.width) {
  row_.reserve(header.width);
  read_transforms(scratch);
  pixels_ = std::make_unique<Vp8lPixels>(source_, stored_width_, header.height, ring_, &scratch);
}

void Vp8lDecoder::read_transforms(WriteFile& scratch) {
  // The format allows each kind once. Without that, a file could stack transforms without end, each
  // with blocks of its own in the scratch file.
  std::array<bool, 4> seen{};
  while (source_.read(1) == 1) {
    const std::uint32_t kind = source_.read(2);
    if (seen[kind]) source_.fail("a repeated transform");
    seen[kind] = true;
    transforms_.push_back(
        read_vp8l_transform(static_cast<Vp8lTransformKind>(kind),
                            {source_, stored_width_, header_.height, ring_, scratch}));
    stored_width_ = transforms_.back()->stored_width(stored_width_);
  }
}

// Transforms are undone from the last to the first; the palette is the one that changes the width.
void Vp8lDecoder::read_row(std::span<std::uint8_t> rgba) {
  if (next_row_ == header_.height || rgba.size() != std::size_t{4} * header_.width)
    throw Error(ErrorKind::internal, name_ + ": asked for a row that does not exist");
  row_.resize(stored_width_);
  pixels_->read_row(row_);
  for (auto transform = transforms_.rbegin(); transform != transforms_.rend(); ++transform)
    (*transform)->undo(next_row_, row_);
  for (std::size_t x = 0; x < row_.size(); ++x) {
    // From one word to bytes red, green, blue, alpha: two of them change places.
    const std::uint32_t argb = row_[x];
    const std::uint32_t abgr = (argb & 0xFF00FF00) | (argb >> 16 & 0xFF) | (argb & 0xFF) << 16;
    std::memcpy(&rgba[4 * x], &abgr, sizeof abgr);
  }
  ++next_row_;
}

std::uint64_t Vp8lDecoder::memory_bytes() const {
  return (ring_.mask() + 1) * 4 + pixels_->memory_bytes() + kRowBytes;
}

}  // namespace pounce::io
