// SPDX-License-Identifier: Apache-2.0
//
// Writing SPZ, version 2: a byte for each value but places, which have 24 bits in fixed point.
//
// Attributes lie one behind the other, so each waits in a nameless file until all Gaussians are
// known: then their number is, and how large a step their places need. A scene so wide that the
// step would be larger than half of its Gaussians is refused with the cure, not written as dust;
// the same where sizes lie beyond what a byte of logarithm holds. Fewer are a warning.
//
// Rotations have no component w: readers take it as the positive root of what the others leave. It
// is found well where it is large, so the axes are named anew until it is (turn_least()): the
// ellipsoid stays the same.
//
// zlib is told no time and no name, and its level is fixed: the same Gaussians are the same bytes.
//
// Version 2 and not a later one, since every reader supports it. What its three-byte rotations lose
// is given back by the naming of axes: w is then 0.85 at least, and the error below a degree
// (docs/decisions/025).
#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <new>

#include "core/portable_math.h"
#include "io/splats/splat_writer.h"

namespace pounce::io {
namespace {

using Quaternion = std::array<float, 4>;  // w, x, y, z

constexpr float kHalf = 0.5F, kRoot = 0.70710678F;

/// A rotation of the cube: column k of its matrix is plus or minus the axis from[k].
// One of the 24 rotations that take axes to axes. Mirrors would leave the ellipsoid as well, but no
// quaternion stands for one.
struct Renaming {
  Quaternion turn;
  std::array<std::size_t, 3> from;
};
constexpr std::array<Renaming, 24> kRenamings{{
    {{1, 0, 0, 0}, {0, 1, 2}},
    {{0, 1, 0, 0}, {0, 1, 2}},
    {{0, 0, 1, 0}, {0, 1, 2}},
    {{0, 0, 0, 1}, {0, 1, 2}},
    {{kRoot, kRoot, 0, 0}, {0, 2, 1}},
    {{kRoot, -kRoot, 0, 0}, {0, 2, 1}},
    {{0, 0, kRoot, kRoot}, {0, 2, 1}},
    {{0, 0, kRoot, -kRoot}, {0, 2, 1}},
    {{kRoot, 0, kRoot, 0}, {2, 1, 0}},
    {{kRoot, 0, -kRoot, 0}, {2, 1, 0}},
    {{0, kRoot, 0, kRoot}, {2, 1, 0}},
    {{0, kRoot, 0, -kRoot}, {2, 1, 0}},
    {{kRoot, 0, 0, kRoot}, {1, 0, 2}},
    {{kRoot, 0, 0, -kRoot}, {1, 0, 2}},
    {{0, kRoot, kRoot, 0}, {1, 0, 2}},
    {{0, kRoot, -kRoot, 0}, {1, 0, 2}},
    {{kHalf, kHalf, kHalf, kHalf}, {1, 2, 0}},
    {{kHalf, kHalf, -kHalf, -kHalf}, {1, 2, 0}},
    {{kHalf, -kHalf, kHalf, -kHalf}, {1, 2, 0}},
    {{kHalf, -kHalf, -kHalf, kHalf}, {1, 2, 0}},
    {{kHalf, -kHalf, -kHalf, -kHalf}, {2, 0, 1}},
    {{kHalf, -kHalf, kHalf, kHalf}, {2, 0, 1}},
    {{kHalf, kHalf, -kHalf, kHalf}, {2, 0, 1}},
    {{kHalf, kHalf, kHalf, -kHalf}, {2, 0, 1}},
}};

Quaternion product(const Quaternion& a, const Quaternion& b) {
  return {a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
          a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
          a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
          a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
}

enum Column : std::size_t { kPlaces, kAlphas, kColours, kScales, kRotations, kHarmonics };

constexpr std::uint64_t kPieceBytes = 64 << 10;
constexpr double kLargestFixed = 0x7FFFFF;
/// A 48th of the smallest size that the format holds: more would be of no use.
constexpr int kMostFractionBits = 20;
constexpr unsigned kAntialiased = 1;
// Logarithms of sizes, in sixteenths from -10.
constexpr float kLeastLog = -10, kLogsPerUnit = 16;

/// The byte next to a value; `clipped` where it lies beyond what bytes hold.
std::byte byte_of(float value, bool& clipped) {
  const float whole = std::floor(value + 0.5F);
  clipped |= !(whole >= 0 && whole <= 255);
  return static_cast<std::byte>(static_cast<unsigned>(std::clamp(whole, 0.0F, 255.0F)));
}

/// A gzip member, written piece by piece.
class GzipWriter {
 public:
  using Put = std::function<void(std::span<const std::byte>)>;
  explicit GzipWriter(Put put) : put_(std::move(put)), out_(kPieceBytes) {
    constexpr int kGzipWrapper = 16, kUsualMemory = 8;  // its header has no time
    if (deflateInit2(&stream_, Z_DEFAULT_COMPRESSION, Z_DEFLATED, MAX_WBITS + kGzipWrapper,
                     kUsualMemory, Z_DEFAULT_STRATEGY) != Z_OK)
      throw std::bad_alloc();
  }
  ~GzipWriter() { deflateEnd(&stream_); }
  GzipWriter(const GzipWriter&) = delete;
  GzipWriter& operator=(const GzipWriter&) = delete;

  void write(std::span<const std::byte> bytes) { run(bytes, Z_NO_FLUSH); }
  void finish() { run({}, Z_FINISH); }

 private:
  // zlib is asked until it leaves some of its output empty: then it has taken all of its input.
  void run(std::span<const std::byte> bytes, int flush) {
    // zlib's interface is older than const.
    stream_.next_in = const_cast<Bytef*>(reinterpret_cast<const Bytef*>(bytes.data()));
    stream_.avail_in = static_cast<uInt>(bytes.size());
    do {
      stream_.next_out = reinterpret_cast<Bytef*>(out_.data());
      stream_.avail_out = static_cast<uInt>(out_.size());
      deflate(&stream_, flush);
      put_(std::span(out_).first(out_.size() - stream_.avail_out));
    } while (stream_.avail_out == 0);
  }

  Put put_;
  PageVector<std::byte> out_;
  z_stream stream_{};
};

class SpzWriter : public SplatWriter {
 public:
  SpzWriter(const std::string& path, const SplatFileFacts& facts, const ScratchFolder& folder);
  void commit(const std::function<void()>& poll) override;

 private:
  void encode_columns(const store::SplatRows& rows, std::span<std::byte* const> columns,
                      SplatTally& tally) const override;
  int fraction_bits() const;
  void check_places(int bits);
  void check_sizes();
  std::array<std::byte, 16> header(int bits) const;
};

SpzWriter::SpzWriter(const std::string& path, const SplatFileFacts& facts,
                     const ScratchFolder& folder)
    : SplatWriter(path, facts, SplatOutput::spz, &folder) {
  if (facts.is_linear) {
    refuse("these colours are linear, which SPZ cannot state; write a .glb");
  }
  if (facts.model == store::SplatModel::flat)
    notes_.emplace_back(
        "SPZ cannot state that these Gaussians are discs (2DGS): they are written flat");
}

// Every value as the byte whose meaning is nearest. What a byte cannot hold is clamped and counted
// where it shows: colours, harmonics, sizes. Opacity and rotation always fit.
void SpzWriter::encode_columns(const store::SplatRows& rows, std::span<std::byte* const> columns,
                               SplatTally& tally) const {
  const std::size_t harmonics = std::size_t{3} * rows.lobes;
  for (std::size_t i = 0; i < rows.splats.size(); ++i) {
    store::Splat s = rows.splats[i];
    bool clipped = false, ignored = false;
    std::memcpy(columns[kPlaces] + i * sizeof s.mean, &s.mean, sizeof s.mean);
    const float farthest = std::max({std::abs(s.mean.x), std::abs(s.mean.y), std::abs(s.mean.z)});
    // Counted while the bounds are still unknown: what even the largest step cannot hold.
    tally.too_far += static_cast<double>(farthest) + 0.5 >= kLargestFixed + 1 ? 1 : 0;
    columns[kAlphas][i] = byte_of(s.alpha * 255, ignored);
    // The constants of the format: its colours are degree-0 coefficients times 0.15, around a half.
    const std::array<float, 3> colour{s.colour.x, s.colour.y, s.colour.z};
    for (std::size_t k = 0; k < 3; ++k)
      columns[kColours][3 * i + k] = byte_of((dc_of(colour[k]) * 0.15F + 0.5F) * 255, clipped);
    turn_least(s);
    std::array<float, 3> sizes{s.sigma.x, s.sigma.y, s.sigma.z};
    for (std::size_t k = 0; k < 3; ++k) {
      columns[kScales][3 * i + k] =
          byte_of((log_sigma(sizes[k]) - kLeastLog) * kLogsPerUnit, ignored);
      columns[kRotations][3 * i + k] = byte_of((s.rotation[1 + k] + 1) * 127.5F, ignored);
    }
    for (std::size_t k = 0; k < harmonics; ++k) {
      const float value = half_to_float(rows.sh[harmonics * i + k]);
      columns[kHarmonics][harmonics * i + k] = byte_of(value * 128 + 128, clipped);
    }
    tally.clipped += clipped ? 1 : 0;
    // A disc thinner than the format's least is no thicker than wide: its width is what counts.
    std::sort(sizes.begin(), sizes.end());
    bool middle = false, largest = false;
    byte_of((log_sigma(sizes[1]) - kLeastLog) * kLogsPerUnit, middle);
    byte_of((log_sigma(sizes[2]) - kLeastLog) * kLogsPerUnit, largest);
    tally.too_small += middle && log_sigma(sizes[1]) < 0 ? 1 : 0;
    tally.too_large += largest && log_sigma(sizes[2]) > 0 ? 1 : 0;
  }
}

int SpzWriter::fraction_bits() const {
  const Box3f& box = tally_.box;
  double farthest = 0;
  for (const float v : {box.lo.x, box.lo.y, box.lo.z, box.hi.x, box.hi.y, box.hi.z})
    farthest = std::max(farthest, std::abs(static_cast<double>(v)));
  // As many bits behind the point as the farthest place leaves, after rounding.
  for (int bits = kMostFractionBits; bits >= 0; --bits) {
    if (std::floor(std::ldexp(farthest, bits) + 0.5) <= kLargestFixed) return bits;
  }
  refuse(
      fmt::format("{} of {} Gaussians are farther than {:.0f} units from the origin, up to {:.3g}, "
                  "which exceeds the range of SPZ; leave them out with --box (\"box 98 %\" in "
                  "pounce inspect contains nearly all of a scene), or write a .ply or .glb",
                  tally_.too_far, rows_, kLargestFixed, farthest));
}

/// A place is rounded to the step: no matter to Gaussians that are larger. Their number comes from
/// the tally by exponents, so "smaller" means by whole powers of two, as the step is one.
void SpzWriter::check_places(int bits) {
  std::uint64_t smaller = 0;  // than 2^-bits
  // A float with the exponent field e is below 2^(e - 126).
  for (int e = 0; e <= 126 - bits; ++e) smaller += tally_.sizes[static_cast<std::size_t>(e)];
  if (smaller == 0) return;
  const std::string what = fmt::format(
      "{} of {} Gaussians are smaller than the step of {:g} units with which SPZ stores positions "
      "in a scene of this extent",
      smaller, rows_, std::ldexp(1.0, -bits));
  if (2 * smaller > rows_)
    refuse(what +
           "; leave out distant ones with --box (\"box 98 %\" in pounce inspect contains nearly "
           "all of a scene), or write a .ply or .glb");
  warnings_.push_back(what);
}

// Half of the Gaussians changed is another scene: refused. Fewer are told as a warning.
void SpzWriter::check_sizes() {
  const std::uint64_t clamped = tally_.too_small + tally_.too_large;
  if (clamped > 0) {
    const std::string what = fmt::format(
        "{} of {} Gaussians are outside of the range of SPZ (standard deviations of 4.5e-05 to 379 "
        "units)",
        clamped, rows_);
    if (2 * clamped > rows_) refuse(what + "; scale the scene, or write a .ply or .glb");
    warnings_.push_back(what + ": clamped to it");
  }
  if (tally_.clipped > 0) {
    warnings_.push_back(
        fmt::format("{} of {} Gaussians have colours or spherical harmonics outside of the range "
                    "of SPZ (-1 to 1): clamped",
                    tally_.clipped, rows_));
  }
  if (tally_.normals > 0)
    notes_.emplace_back("SPZ does not store normals: those of the source are not written");
}

// Known once all Gaussians are: their number and the bits of a position.
std::array<std::byte, 16> SpzWriter::header(int bits) const {
  std::array<std::byte, 16> out{};
  const auto put32 = [&](std::size_t at, std::uint32_t value) {
    std::memcpy(&out[at], &value, sizeof value);
  };
  const auto degree =
      std::find(store::kLobesOfDegree.begin(), store::kLobesOfDegree.end(), facts_.lobes) -
      store::kLobesOfDegree.begin();
  put32(0, 0x5053474E);  // "NGSP"
  put32(4, 2);
  put32(8, static_cast<std::uint32_t>(rows_));
  out[12] = static_cast<std::byte>(degree);
  out[13] = static_cast<std::byte>(bits);
  if (facts_.model == store::SplatModel::antialiased) out[14] = std::byte{kAntialiased};
  return out;
}

void SpzWriter::commit(const std::function<void()>& poll) {
  const int bits = fraction_bits();
  check_places(bits);
  check_sizes();
  GzipWriter gzip([this](std::span<const std::byte> bytes) { put(bytes); });
  gzip.write(header(bits));
  std::array<std::byte, 9> fixed;
  PageVector<std::byte> places;
  // Converted only now: the step follows from the farthest place of all.
  for_column(kPlaces, poll, [&](std::span<const std::byte> floats) {
    places.clear();
    places.reserve(floats.size() / sizeof(Vec3f) * fixed.size());  // growing would hold it twice
    for (std::size_t at = 0; at < floats.size(); at += sizeof(Vec3f)) {
      std::array<float, 3> mean;
      std::memcpy(mean.data(), &floats[at], sizeof mean);
      for (std::size_t k = 0; k < 3; ++k) {
        // Rounded, not cut off: cutting would move all places by half a step towards one corner.
        const double steps = std::ldexp(static_cast<double>(mean[k]), bits);
        const auto whole = static_cast<std::int32_t>(std::floor(steps + 0.5));
        std::memcpy(&fixed[3 * k], &whole, 3);
      }
      places.insert(places.end(), fixed.begin(), fixed.end());
    }
    gzip.write(places);
  });
  // In the order of the format, which is that of the columns.
  for (std::size_t k = kAlphas; k < (facts_.lobes > 0 ? kHarmonics + 1 : kHarmonics); ++k)
    for_column(k, poll, [&](std::span<const std::byte> bytes) { gzip.write(bytes); });
  gzip.finish();
  file_.commit();
}

}  // namespace

// A rotation times any of the cube's 24 leaves the same ellipsoid with its axes in another order.
// All of them are tried; the first of equals counts, so the result does not depend on anything
// else.
void turn_least(store::Splat& splat) {
  const Quaternion q = splat.rotation;
  const Renaming* best = nullptr;
  float largest = -1;
  for (const Renaming& renaming : kRenamings) {
    // q and -q are one rotation, so the sign of w does not matter here; it is made positive below.
    const float w = std::abs(product(q, renaming.turn)[0]);
    if (w > largest) {
      largest = w;
      best = &renaming;
    }
  }
  splat.rotation = product(q, best->turn);
  if (splat.rotation[0] < 0) {
    for (float& v : splat.rotation) v = -v;
  }
  const std::array<float, 3> sigma{splat.sigma.x, splat.sigma.y, splat.sigma.z};
  splat.sigma = {sigma[best->from[0]], sigma[best->from[1]], sigma[best->from[2]]};
}

std::unique_ptr<SplatWriter> open_spz_writer(const std::string& path, const SplatFileFacts& facts,
                                             const ScratchFolder& folder) {
  return std::make_unique<SpzWriter>(path, facts, folder);
}

}  // namespace pounce::io
