// SPDX-License-Identifier: Apache-2.0
//
// Gaussians are kept column by column, since that is how they are blended (one field of sixteen of
// them in a register) and how they compress. Only means are stored as differences: blocks are cut
// from an order in space, so neighbours are near, while sizes and rotations of neighbours have
// little in common. Everything but the means was rounded to 16 bits beforehand, which makes one of
// four byte planes zero.
//
// A decoder lets nothing through that a reader of scenes would not: no NaN, no size below 0, no
// quaternion that is not one. Kernels rely on that and check nothing.
//
// Boxes are made of the rounded numbers, after round_for_store(): they must hold what a reader
// gets, not what the file had.
#include "store/blocks/splat_block.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "core/bytes.h"
#include "core/directions.h"
#include "store/pack/codec.h"

namespace pounce::store {
namespace {

constexpr std::uint32_t kHasNormals = 1;
constexpr std::uint32_t kDegreeShift = 1, kMostDegree = 3;  // of the harmonics: two bits
constexpr std::uint32_t kIsPlain = 8;                       // columns passed no filter
constexpr std::size_t kColumns = 14, kNormalColumns = 3, kHeaderBytes = 8;

/// Visits every column in the payload's order: (column, its values are near their neighbours').
template <class Block, class Visitor>
void for_columns(Block& block, bool normals, const Visitor& visit) {
  for (auto& column : block.mean) visit(column, true);
  for (auto& column : block.sigma) visit(column, false);
  for (auto& column : block.rotation) visit(column, false);
  visit(block.alpha, false);
  for (auto& column : block.colour) visit(column, false);
  if (!normals) return;
  for (auto& column : block.normal) visit(column, false);
}

/// How far from 1 the squared length of what was rounded to 16 significant bits may be.
constexpr float kLengthSlack = 0x1p-12F;

/// How many there are; in a form that becomes vector code.
template <class IsBroken>
std::uint32_t count_broken(std::size_t count, const IsBroken& is_broken) {
  std::uint32_t broken = 0;
  for (std::size_t i = 0; i < count; ++i) broken += is_broken(i) ? 1U : 0U;
  return broken;
}

/// Is all of it what a reader of scenes lets through? Everything that follows relies on it. Column
/// by column: small budgets read a block again for each part of a view.
bool are_legal(const SplatBlock& block) {
  const std::size_t count = block.size();
  constexpr std::uint32_t kInfinity = 0x7F800000, kMagnitude = 0x7FFFFFFF;
  std::uint32_t broken = 0;
  const auto check = [&](const auto& is_broken) { broken += count_broken(count, is_broken); };
  const auto check_finite = [&](const PageVector<float>& column) {
    check([v = column.data()](std::size_t i) {
      return (std::bit_cast<std::uint32_t>(v[i]) & kInfinity) == kInfinity;
    });
  };
  for (const auto& column : block.mean) check_finite(column);
  for (const auto& column : block.sigma) check_finite(column);
  check([x = block.sigma[0].data(), y = block.sigma[1].data(),
         z = block.sigma[2].data()](std::size_t i) {
    const float least = std::min(std::min(x[i], y[i]), z[i]),
                most = std::max(std::max(x[i], y[i]), z[i]);
    return !(least >= 0 && most > 0);
  });
  check([w = block.rotation[0].data(), x = block.rotation[1].data(), y = block.rotation[2].data(),
         z = block.rotation[3].data()](std::size_t i) {
    const float length = w[i] * w[i] + x[i] * x[i] + y[i] * y[i] + z[i] * z[i];
    return !(std::abs(length - 1) <= kLengthSlack);
  });
  check([a = block.alpha.data()](std::size_t i) { return !(a[i] > 0 && a[i] <= 1); });
  for (const auto& column : block.colour) {
    check([v = column.data()](std::size_t i) {
      return (std::bit_cast<std::uint32_t>(v[i]) & kMagnitude) > kInfinity;
    });
  }
  if (!block.normal[0].empty()) {
    check([x = block.normal[0].data(), y = block.normal[1].data(),
           z = block.normal[2].data()](std::size_t i) {
      const float length = x[i] * x[i] + y[i] * y[i] + z[i] * z[i];
      return !(length == 0 || std::abs(length - 1) <= kLengthSlack);
    });
  }
  return broken == 0;
}

/// Larger than the rounding of the few operations that make a box.
constexpr float kOutwards = 0x1p-20F;

/// To 16 significant bits, halves away from zero.
void round_bits(float& value) {
  value = std::bit_cast<float>((std::bit_cast<std::uint32_t>(value) + 0x80U) & 0xFFFFFF00U);
}

/// The same of what must not become 0: it would be no Gaussian any more.
void round_above_zero(float& value) {
  const bool is_above = value > 0;
  round_bits(value);
  if (is_above && value == 0) value = std::bit_cast<float>(0x100U);
}

std::uint32_t degree_of(std::uint32_t lobes) {
  return static_cast<std::uint32_t>(std::find(kLobesOfDegree.begin(), kLobesOfDegree.end(), lobes) -
                                    kLobesOfDegree.begin());
}

}  // namespace

bool all_finite(std::span<const std::uint16_t> halves) {
  constexpr std::uint16_t kExponent = 0x7C00;
  std::uint32_t broken = 0;
  for (const std::uint16_t half : halves) broken += (half & kExponent) == kExponent ? 1U : 0U;
  return broken == 0;
}

void round_for_store(Splat& splat) {
  for (float* v : {&splat.sigma.x, &splat.sigma.y, &splat.sigma.z, &splat.alpha})
    round_above_zero(*v);
  for (float* v : {&splat.colour.x, &splat.colour.y, &splat.colour.z, &splat.normal.x,
                   &splat.normal.y, &splat.normal.z}) {
    round_bits(*v);
  }
  for (float& v : splat.rotation) round_bits(v);
}

Box3f splat_box(const Splat& splat) {
  // Per axis of space, not per axis of the Gaussian: the tightest box there is, in three square
  // roots.
  const auto [w, x, y, z] = splat.rotation;
  const auto r = rotation_columns(w, x, y, z);
  // Sigma = R S S R^T, so Sigma_xx is the squared length of R's first row times S, and so on.
  const auto half = [&](float mean, float r0, float r1, float r2) {
    const float a = r0 * splat.sigma.x, b = r1 * splat.sigma.y, c = r2 * splat.sigma.z;
    const float h = 3 * std::sqrt(a * a + b * b + c * c);
    return h + (h + std::abs(mean)) * kOutwards;
  };
  const Vec3f& m = splat.mean;
  const Vec3f h{half(m.x, r[0].x, r[1].x, r[2].x), half(m.y, r[0].y, r[1].y, r[2].y),
                half(m.z, r[0].z, r[1].z, r[2].z)};
  return {{m.x - h.x, m.y - h.y, m.z - h.z}, {m.x + h.x, m.y + h.y, m.z + h.z}};
}

Splat SplatBlock::splat(std::size_t i) const {
  Splat out;
  out.mean = {mean[0][i], mean[1][i], mean[2][i]};
  out.sigma = {sigma[0][i], sigma[1][i], sigma[2][i]};
  out.rotation = {rotation[0][i], rotation[1][i], rotation[2][i], rotation[3][i]};
  out.alpha = alpha[i];
  out.colour = {colour[0][i], colour[1][i], colour[2][i]};
  if (!normal[0].empty()) out.normal = {normal[0][i], normal[1][i], normal[2][i]};
  return out;
}

void SplatBlock::assign(std::span<const Splat> splats, std::uint32_t lobes_each,
                        std::span<const std::uint16_t> coefficients) {
  const std::size_t count = splats.size();
  bool normals = false;
  // One that has a normal makes columns for all: the others' are zero, which compresses to nothing.
  for (const Splat& s : splats) normals |= s.normal != Vec3f{};
  for (auto& column : normal) column.clear();
  for_columns(*this, normals, [&](PageVector<float>& column, bool) { column.resize(count); });
  for (std::size_t i = 0; i < count; ++i) {
    const Splat& s = splats[i];
    mean[0][i] = s.mean.x, mean[1][i] = s.mean.y, mean[2][i] = s.mean.z;
    sigma[0][i] = s.sigma.x, sigma[1][i] = s.sigma.y, sigma[2][i] = s.sigma.z;
    for (std::size_t k = 0; k < 4; ++k) rotation[k][i] = s.rotation[k];
    alpha[i] = s.alpha;
    colour[0][i] = s.colour.x, colour[1][i] = s.colour.y, colour[2][i] = s.colour.z;
  }
  // Not in the loop above: most scenes have no normals, and then their columns stay empty.
  for (std::size_t i = 0; normals && i < count; ++i) {
    const Vec3f& n = splats[i].normal;
    normal[0][i] = n.x, normal[1][i] = n.y, normal[2][i] = n.z;
  }
  // Coefficients come one Gaussian after the other and are read coefficient by coefficient.
  lobes = lobes_each;
  const std::size_t columns = std::size_t{3} * lobes;
  sh.resize(columns * count);
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t c = 0; c < columns; ++c) sh[c * count + i] = coefficients[i * columns + c];
  }
}

std::uint64_t SplatBlock::decoded_bytes(std::size_t splats, bool normals, std::uint32_t lobes) {
  return (kColumns + (normals ? kNormalColumns : 0)) * round_to_pages(splats * sizeof(float)) +
         round_to_pages(splats * lobe_bytes(lobes));
}

void encode(const SplatBlock& block, std::vector<std::byte>& raw, SplatBytes form) {
  const bool normals = !block.normal[0].empty(), is_plain = form == SplatBytes::plain;
  const auto count = static_cast<std::uint32_t>(block.size());
  const std::uint32_t flags = (normals ? kHasNormals : 0U) |
                              (degree_of(block.lobes) << kDegreeShift) | (is_plain ? kIsPlain : 0U);
  const std::size_t bytes = block.size() * sizeof(float);
  const auto sh = std::as_bytes(std::span(block.sh));
  raw.resize(kHeaderBytes + bytes * (kColumns + (normals ? kNormalColumns : 0)) + sh.size());
  std::memcpy(raw.data(), &count, 4);
  std::memcpy(raw.data() + 4, &flags, 4);
  std::vector<std::byte> values(is_plain ? 0 : bytes);
  std::size_t at = kHeaderBytes;
  for_columns(block, normals, [&](const PageVector<float>& column, bool near) {
    if (bytes == 0) return;
    if (is_plain) {
      std::memcpy(raw.data() + at, column.data(), bytes);
    } else {
      std::memcpy(values.data(), column.data(), bytes);
      if (near) delta(values, sizeof(float), 1);
      shuffle(values, sizeof(float), std::span(raw).subspan(at, bytes));
    }
    at += bytes;
  });
  if (sh.empty()) return;
  if (is_plain) {
    std::memcpy(raw.data() + at, sh.data(), sh.size());
  } else {
    shuffle(sh, sizeof(std::uint16_t), std::span(raw).subspan(at, sh.size()));
  }
}

SplatBlock decode_splats(std::span<const std::byte> raw, const std::string& name) {
  ByteReader in(raw, name);
  const auto count = in.get<std::uint32_t>();
  const auto flags = in.get<std::uint32_t>();
  const bool normals = (flags & kHasNormals) != 0, is_plain = (flags & kIsPlain) != 0;
  const std::uint32_t degree = (flags & ~kIsPlain) >> kDegreeShift;
  const std::size_t columns = kColumns + (normals ? kNormalColumns : 0);
  if (count > kMostSplatsPerBlock || degree > kMostDegree ||
      in.left() != (columns * sizeof(float) + lobe_bytes(kLobesOfDegree[degree])) * count) {
    in.fail("has an impossible block header");
  }
  SplatBlock block;
  block.lobes = kLobesOfDegree[degree];
  const auto read = [&](std::span<std::byte> values, std::size_t element_bytes) {
    const auto stored = in.take(values.size());
    if (!is_plain) return unshuffle(stored, element_bytes, values);
    if (!values.empty()) std::memcpy(values.data(), stored.data(), values.size());
  };
  constexpr std::size_t kLanes = 16;  // whoever wants whole registers can have them in place
  for_columns(block, normals, [&](PageVector<float>& column, bool near) {
    column.reserve((std::size_t{count} + kLanes - 1) / kLanes * kLanes);
    column.resize(count);
    const auto bytes = std::as_writable_bytes(std::span(column));
    read(bytes, sizeof(float));
    if (near && !is_plain) undelta(bytes, sizeof(float), 1);
  });
  block.sh.resize(std::size_t{3} * block.lobes * count);
  read(std::as_writable_bytes(std::span(block.sh)), sizeof(std::uint16_t));
  if (!all_finite(block.sh)) in.fail("has non-finite spherical harmonics");
  if (!are_legal(block)) in.fail("has an invalid Gaussian");
  return block;
}

}  // namespace pounce::store
