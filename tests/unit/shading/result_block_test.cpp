// SPDX-License-Identifier: Apache-2.0
#include "shading/result_block.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>

#include "core/colour_space.h"
#include "core/portable_math.h"
#include "support/bytes.h"
#include "support/random.h"

using namespace pounce;
using namespace pounce::shading;
using pounce::test::Random;

namespace {

store::StoredChunk as_chunk(std::span<const std::byte> stored) {
  UnsetBytes chunk(stored.size());
  std::copy(stored.begin(), stored.end(), chunk.data());
  const std::span<const std::byte> payload = chunk;
  return {std::move(chunk), payload};
}

/// What a value becomes in an output, read back as doubles: 0..1 or the float itself.
std::vector<double> stored(const TexelFormat& format, const TexelValue& value) {
  std::vector<std::byte> bytes(format.texel_bytes() + 1, std::byte{0xCD});
  store_texel(format, value, bytes.data());
  CHECK(bytes.back() == std::byte{0xCD});
  std::vector<double> out;
  for (std::uint32_t c = 0; c < format.channels; ++c) {
    const std::byte* const at = bytes.data() + c * (format.texel_bytes() / format.channels);
    if (format.depth == Depth::u8) {
      out.push_back(std::to_integer<int>(*at) / 255.0);
    } else if (format.depth == Depth::float32) {
      float v;
      std::memcpy(&v, at, 4);
      out.push_back(double{v});
    } else {
      std::uint16_t v;
      std::memcpy(&v, at, 2);
      out.push_back(format.depth == Depth::u16 ? v / 65535.0 : double{half_to_float(v)});
    }
  }
  return out;
}

using Values = std::vector<double>;

TexelValue gray(double v) { return {{v, 0, 0, 0}, 1, false}; }

/// No power of its argument, so that it shows what it was given: (r, g, b) -> (b + 1, r + 2, g +
/// 3).
class Shifted : public ColourTransform {
 public:
  void apply(std::array<double, 3>& c) const noexcept override {
    c = {c[2] + 1, c[0] + 2, c[1] + 3};
  }
  Hash128 identity() const override { return {}; }
};

}  // namespace

TEST_CASE("the sRGB functions agree with std::pow to twelve digits and undo each other") {
  const auto decoded = [](double c) {
    return c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4);
  };
  const auto coded = [](double l) {
    return l <= 0.0031308 ? l * 12.92 : 1.055 * std::pow(l, 1 / 2.4) - 0.055;
  };
  double worst = 0;
  for (int i = 0; i <= 65535; ++i) {
    const double x = i / 65535.0;
    worst = std::max(worst, std::abs(srgb_to_linear(x) - decoded(x)));
    worst = std::max(worst, std::abs(linear_to_srgb(x) - coded(x)));
    worst = std::max(worst, std::abs(linear_to_srgb(srgb_to_linear(x)) - x) - 1e-7 * (x < 0.05));
  }
  CHECK(worst < 1e-12);
  CHECK(srgb_to_linear(0) == 0);
  CHECK(srgb_to_linear(1) == Approx(1).epsilon(1e-15));
  CHECK(linear_to_srgb(-0.5) == -6.46);
  for (const double x : {1.5, 20.0, 1000.0, 65504.0, 1e9}) {  // beyond white: float images have it
    CHECK(srgb_to_linear(x) == Approx(decoded(x)).epsilon(1e-12));
    CHECK(linear_to_srgb(x) == Approx(coded(x)).epsilon(1e-12));
  }
}

TEST_CASE("channels are expanded and dropped by rule") {
  const TexelValue gray_alpha{{0.2, 0.6, 0, 0}, 2, false, true, false};
  const TexelValue rgb{{0.2, 0.4, 0.6, 0}, 3, false};
  const TexelValue rgba{{0.2, 0.4, 0.6, 0.8}, 4, false, true, false};
  const auto out = [](std::uint32_t channels, bool has_alpha, const TexelValue& value) {
    return stored({channels, Depth::u8, false, true, has_alpha}, value);
  };
  CHECK(out(1, false, gray(0.2)) == Values{0.2});
  CHECK(out(3, false, gray(0.2)) == Values{0.2, 0.2, 0.2});
  CHECK(out(4, true, gray(0.2)) == Values{0.2, 0.2, 0.2, 1});
  CHECK(out(2, true, gray(0.2)) == Values{0.2, 1});
  CHECK(out(1, false, gray_alpha) == Values{0.2});
  CHECK(out(2, true, gray_alpha) == Values{0.2, 0.6});
  CHECK(out(3, false, gray_alpha) == Values{0.2, 0.2, 0.2});
  CHECK(out(4, true, gray_alpha) == Values{0.2, 0.2, 0.2, 0.6});
  CHECK(out(3, false, rgb) == Values{0.2, 0.4, 0.6});
  CHECK(out(4, true, rgb) == Values{0.2, 0.4, 0.6, 1});
  CHECK(out(3, false, rgba) == Values{0.2, 0.4, 0.6});
  CHECK(out(4, true, rgba) == Values{0.2, 0.4, 0.6, 0.8});
}

TEST_CASE("integers are clamped and rounded to nearest, floats are kept") {
  const auto byte_of = [](double v) {
    return std::lround(stored({1, Depth::u8, false, true, false}, gray(v))[0] * 255);
  };
  CHECK(byte_of(-3) == 0);
  CHECK(byte_of(7) == 255);
  CHECK(byte_of(100.49 / 255) == 100);
  CHECK(byte_of(100.51 / 255) == 101);
  for (int i = 0; i < 256; ++i) CHECK(byte_of(i / 255.0) == i);
  const auto word = stored({1, Depth::u16, false, true, false}, gray(30000.51 / 65535))[0];
  CHECK(std::lround(word * 65535) == 30001);
  CHECK(stored({1, Depth::float32, true, true, false}, {{-2.5, 0, 0, 0}, 1, true})[0] == -2.5);
  CHECK(stored({1, Depth::half, true, true, false}, {{1e9, 0, 0, 0}, 1, true})[0] == 65504);
  CHECK(stored({1, Depth::half, true, true, false}, {{-1e9, 0, 0, 0}, 1, true})[0] == -65504);
}

TEST_CASE("colour is converted where source and output differ, data and alpha never") {
  TexelValue value{{0.5, 0.5, 0.5, 0.5}, 4, false, true, false};
  const TexelFormat linear{4, Depth::float32, true, true, true};
  Values out = stored(linear, value);
  CHECK(out[0] == Approx(0.21404114048223255).epsilon(1e-6));
  CHECK(out[3] == 0.5);
  value.linear = true;
  CHECK(stored(linear, value) == Values{0.5, 0.5, 0.5, 0.5});
  out = stored({4, Depth::float32, false, true, true}, value);
  CHECK(out[2] == Approx(0.7353569830524495).epsilon(1e-6));
  CHECK(out[3] == 0.5);
  CHECK(stored({4, Depth::float32, false, false, true}, value) == Values{0.5, 0.5, 0.5, 0.5});
  // Gray without alpha as a linear colour: the added alpha stays 1.
  out = stored(linear, gray(0.5));
  CHECK(out[1] == out[0]);
  CHECK(out[3] == 1);
}

TEST_CASE("what a depth cannot hold is cut and counted, what rounding absorbs is not") {
  const auto clipped = [](Depth depth, double a, double b) {
    std::array<std::byte, 16> out{};
    return store_texel({3, depth, true, true, false}, {{a, b, 0.5, 0}, 3, true}, out.data());
  };
  CHECK(clipped(Depth::u8, -0.01, 1.01) == 2);
  CHECK(clipped(Depth::u8, -0.0019, 1.0019) == 0);  // half a step is 0.00196
  CHECK(clipped(Depth::u16, -0.0019, 1.0019) == 2);
  CHECK(clipped(Depth::u16, 0, 1) == 0);
  CHECK(clipped(Depth::half, -65519, 65519) == 0);
  CHECK(clipped(Depth::half, -65520, 1e30) == 2);
  CHECK(clipped(Depth::float32, -1e30, 1e30) == 0);
  CHECK(clipped(Depth::u8, std::nan(""), 0.5) == 1);
}

TEST_CASE("a fourth channel without alpha is data") {
  const TexelValue data{{0.5, 0.5, 0.5, 0.5}, 4, true};
  const Values out = stored({4, Depth::float32, false, true, false}, data);
  CHECK(out[2] == Approx(0.7353569830524495).epsilon(1e-6));
  CHECK(out[3] == 0.5);                                                // not converted
  CHECK(stored({4, Depth::float32, true, true, true}, data)[3] == 1);  // and no alpha
  CHECK(stored({4, Depth::float32, true, true, false}, {{0.5, 0.5, 0.5, 0}, 3, true})[3] == 0);
}

TEST_CASE("colours are multiplied for a format that holds them so, once") {
  const TexelFormat format{4, Depth::float32, true, true, true, true};
  CHECK(stored(format, {{0.5, 1, 2, 0.25}, 4, true, true, false}) ==
        Values{0.125, 0.25, 0.5, 0.25});
  CHECK(stored(format, {{0.5, 1, 2, 0.25}, 4, true, true, true}) == Values{0.5, 1, 2, 0.25});
}

TEST_CASE("every 8-bit sRGB value survives a trip through a linear half or float image") {
  for (const Depth depth : {Depth::half, Depth::float32}) {
    for (int i = 0; i < 256; ++i) {
      const double there = stored({1, depth, true, true, false}, gray(i / 255.0))[0];
      const TexelValue back{{there, 0, 0, 0}, 1, true};
      CHECK(std::lround(stored({1, Depth::u8, false, true, false}, back)[0] * 255) == i);
    }
  }
}

TEST_CASE("a result block comes back, filtered or as it is, and another size is refused") {
  Random random(91);
  store::Compressor compressor;
  for (const Depth depth : {Depth::u8, Depth::u16, Depth::half, Depth::float32}) {
    for (std::uint32_t channels = 1; channels <= 4; ++channels) {
      const TexelFormat format{channels, depth, false, true, false};
      ResultBlock block, read;
      block.texels.resize(4096 * format.texel_bytes());
      for (std::byte& b : block.texels) b = static_cast<std::byte>(random.bits());
      for (std::uint32_t texel = 0; texel < 4096; ++texel) {
        if (random.one_in(3)) {
          block.cover(texel);
          CHECK(block.covered(texel));
        }
      }
      const auto size = static_cast<std::uint32_t>(kMaskBytes + block.texels.size());
      for (const bool has_room : {false, true}) {
        store::PlainRoom room = has_room ? size : size - 1;
        std::vector<std::byte> stored;
        CHECK(encode(block, format, compressor, &room, stored) == size);
        CHECK(store::is_as_is(stored) == has_room);
        CHECK(room == (has_room ? 0 : size - 1));
        if (has_room) {
          // Nothing but the texels themselves behind the coverage.
          CHECK(std::memcmp(stored.data() + (stored.size() - block.texels.size()),
                            block.texels.data(), block.texels.size()) == 0);
        }
        decode(as_chunk(stored), size, format, compressor, "r", read);
        CHECK(read.mask == block.mask);
        CHECK(read.texels == block.texels);

        for (const std::uint32_t other : {0U, 511U, size - 1, size + 1}) {
          std::string message;
          CHECK(test::error_kind(
                    [&] { decode(as_chunk(stored), other, format, compressor, "r.pack", read); },
                    &message) == test::kDamaged);
          CHECK(message.find("r.pack") == 0);
        }
        stored.pop_back();
        CHECK(test::error_kind([&] {
                decode(as_chunk(stored), size, format, compressor, "r", read);
              }) == test::kDamaged);
      }
    }
  }
}

TEST_CASE("a colour goes through a format's transform last, without its alpha and as light") {
  const Shifted shifted;
  TexelFormat format{4, Depth::float32, true, true, true};
  format.transform = &shifted;
  TexelValue light{{0.25, 0.5, 0.75, 0.5}, 4, true, true};
  CHECK(stored(format, light) == Values{1.75, 2.25, 3.5, 0.5});
  SECTION("coded colours are made light first") {
    light.linear = false;
    const float expected = static_cast<float>(srgb_to_linear(0.75) + 1);
    CHECK(stored(format, light)[0] == double{expected});
  }
  SECTION("colours times alpha stay so") {
    format.premultiplied = true;
    light.premultiplied = true;
    CHECK(stored(format, light) == Values{(1.5 + 1) / 2, (0.5 + 2) / 2, (1 + 3) / 2.0, 0.5});
    light.v[3] = 0;  // light that covers nothing
    CHECK(stored(format, light) == Values{1.75, 2.25, 3.5, 0});
  }
  SECTION("grey becomes colour, its alpha stays alpha") {
    CHECK(stored(format, {{0.5, 0.25}, 2, true, true}) == Values{1.5, 2.5, 3.5, 0.25});
    CHECK(stored(format, {{0.5}, 1, true}) == Values{1.5, 2.5, 3.5, 1});
    const double grey = srgb_to_linear(0.5);
    const auto as_float = [](double v) { return double{static_cast<float>(v)}; };
    CHECK(stored(format, {{0.5, 0.25}, 2, false, true}) ==
          Values{as_float(grey + 1), as_float(grey + 2), as_float(grey + 3), 0.25});
  }
  SECTION("two channels are none") {
    CHECK(stored(format, {{0.5, 0.25}, 2, true}) == Values{0.5, 0.25, 0, 1});
  }
  SECTION("what is final is not touched, whatever it is called") {
    light.is_final = true;
    CHECK(stored(format, light) == Values{0.25, 0.5, 0.75, 0.5});
  }
  SECTION("what eight bits cannot hold is counted") {
    format.depth = Depth::u8;
    std::array<std::byte, 4> out;
    CHECK(store_texel(format, light, out.data()) == 3);
    CHECK(out[0] == std::byte{255});
  }
  SECTION("eight bits are not taken over as they are") {
    store::ColourDirectory image;
    image.depth = Depth::u8;
    image.channels = 4;
    image.has_alpha = true;
    TexelFormat plain{4, Depth::u8, false, true, true};
    CHECK(plain.keeps(image));
    plain.transform = &shifted;
    CHECK_FALSE(plain.keeps(image));
  }
}

TEST_CASE("sixteen values are stored as each alone", "[shading]") {
  Random random(3);
  std::size_t plain = 0, clipped = 0;
  for (int round = 0; round < 4000; ++round) {
    TexelFormat format;
    format.channels = static_cast<std::uint32_t>(random.whole(1, 4));
    format.depth =
        random.one_in(2) ? Depth::u8 : Depth{static_cast<std::uint8_t>(random.whole(0, 3))};
    format.linear = random.one_in(3);
    format.is_colour = !random.one_in(3);
    format.has_alpha = (format.channels == 2 || format.channels == 4) && random.one_in(2);
    format.premultiplied = format.has_alpha && format.depth == Depth::half;
    std::array<std::array<double, kValues>, 4> numbers;
    for (auto& row : numbers) {
      for (double& v : row) {
        constexpr double kOdd[] = {-0.0, 1.0, 0.5 / 255, 254.5 / 255, 255.5 / 255, -0.5 / 255};
        v = random.between(-0.1, 1.2);
        if (random.one_in(4)) v = kOdd[random.below(std::size(kOdd))];
        if (random.one_in(40)) v = std::nan("");
        if (random.one_in(40)) v = random.one_in(2) ? 1e300 : -HUGE_VAL;
        if (random.one_in(4)) v = (static_cast<double>(random.whole(0, 255)) + 0.5) / 255;
      }
    }
    TexelValues values;
    for (std::size_t c = 0; c < 4; ++c) values.v[c] = numbers[c].data();
    values.channels =
        random.one_in(2) ? format.channels : static_cast<std::uint32_t>(random.whole(1, 4));
    values.linear = random.one_in(3);
    values.has_alpha = (values.channels == 2 || values.channels == 4) && random.one_in(2);
    values.is_final = random.one_in(2);
    const auto lanes = static_cast<std::uint32_t>(random.below(1U << kValues));
    std::uint16_t texel[kValues];
    for (std::size_t i = 0; i < kValues; ++i) texel[i] = static_cast<std::uint16_t>(i * 7 % 31);
    const std::size_t size = format.texel_bytes();
    std::vector<std::byte> expected(31 * size, std::byte{0xCD}), found = expected;
    std::uint32_t count = 0;
    for (std::size_t i = 0; i < kValues; ++i) {
      if ((lanes >> i & 1) == 0) continue;
      TexelValue value{{},    values.channels, values.linear, values.has_alpha,
                       false, values.is_final};
      for (std::size_t c = 0; c < values.channels; ++c) value.v[c] = numbers[c][i];
      count += store_texel(format, value, &expected[texel[i] * size]);
    }
    CHECK(store_texels(format, values, lanes, texel, found.data()) == count);
    CHECK(found == expected);
    clipped += count;
    const bool alike = format.channels == values.channels && format.linear == values.linear;
    plain += format.depth == Depth::u8 && alike && format.has_alpha == values.has_alpha ? 1 : 0;
  }
  CHECK(plain > 300);
  CHECK(clipped > 1000);
}
