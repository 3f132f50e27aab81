// SPDX-License-Identifier: Apache-2.0
#include "io/splats/batch.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "core/directions.h"
#include "core/portable_math.h"

namespace pounce::io {
namespace {

using store::Splat;
using store::SplatFilter;

constexpr float kLeastAlpha = 1.0F / 255.0F;
constexpr float kMostHalf = 65504.0F;

/// Unit vector, or zeros where there is no direction.
template <std::size_t N>
std::array<float, N> unit(const std::array<float, N>& v) {
  double sum = 0;
  for (const float c : v) sum += static_cast<double>(c) * static_cast<double>(c);
  std::array<float, N> result{};
  if (!(sum > 0) || !std::isfinite(sum)) return result;
  const double scale = 1 / std::sqrt(sum);
  for (std::size_t k = 0; k < N; ++k) result[k] = static_cast<float>(v[k] * scale);
  return result;
}

/// Row `i` of neighbouring columns.
template <std::size_t N>
std::array<float, N> row(const std::array<SplatBatch::Column, N>& columns, std::size_t i) {
  std::array<float, N> result;
  for (std::size_t k = 0; k < N; ++k) result[k] = columns[k][i];
  return result;
}

/// Why row i is of no use, if so.
std::optional<SplatFilter> reason_against(const SplatBatch& batch, std::size_t i,
                                          std::uint32_t lobes) {
  // A sum is finite or NaN if and only if every term is: 0 times infinity is NaN.
  float zero = 0;
  for (const float v : row(batch.mean, i)) zero += v * 0;
  for (const float v : row(batch.colour, i)) zero += v * 0;
  for (const float v : row(batch.rotation, i)) zero += v * 0;
  for (std::size_t k = 0; k < 3 * lobes; ++k) zero += batch.sh[k][i] * 0;
  float largest = 0, sum = batch.alpha[i];
  for (const float v : row(batch.sigma, i)) {
    largest = std::max(largest, std::abs(v));
    sum += std::abs(v);  // infinity is meant: only NaN spoils it
  }
  if (zero != 0 || std::isnan(sum)) return SplatFilter::not_finite;
  const auto rotation = row(batch.rotation, i);
  if (std::all_of(rotation.begin(), rotation.end(), [](float v) { return v == 0; }))
    return SplatFilter::zero_quaternion;
  if (batch.alpha[i] < kLeastAlpha) return SplatFilter::transparent;
  if (largest == 0) return SplatFilter::sizeless;
  if (!std::isfinite(largest)) return SplatFilter::exploded;
  return std::nullopt;
}

Splat splat(const SplatBatch& batch, std::size_t i) {
  const auto vector = [](const std::array<float, 3>& v) { return Vec3f{v[0], v[1], v[2]}; };
  Splat s;
  s.mean = vector(row(batch.mean, i));
  const Vec3f sigma = vector(row(batch.sigma, i));
  s.sigma = {std::abs(sigma.x), std::abs(sigma.y), std::abs(sigma.z)};
  s.rotation = unit(row(batch.rotation, i));
  s.alpha = std::min(batch.alpha[i], 1.0F);
  s.colour = vector(row(batch.colour, i));
  s.normal = vector(unit(row(batch.normal, i)));
  return s;
}

}  // namespace

void exponential(SplatBatch::Column& column, std::size_t rows) {
  for (std::size_t i = 0; i < rows; ++i)
    column[i] = static_cast<float>(exp_same(static_cast<double>(column[i])));
}

void logistic(SplatBatch::Column& column, std::size_t rows) {
  for (std::size_t i = 0; i < rows; ++i)
    column[i] = static_cast<float>(1.0 / (1.0 + exp_same(-static_cast<double>(column[i]))));
}

void colour_of_dc(SplatBatch::Column& column, std::size_t rows) {
  for (std::size_t i = 0; i < rows; ++i)
    column[i] = static_cast<float>(0.5 + kShDegree0 * static_cast<double>(column[i]));
}

SplatIntake::SplatIntake(const Axes& axes) : axes_(axes), harmonics_(axes) {}

void SplatIntake::append_harmonics(const SplatBatch& batch, std::size_t i,
                                   store::SplatRows& out) const {
  std::array<float, 3 * store::kMostLobes> values;
  const std::size_t count = 3 * out.lobes;
  for (std::size_t k = 0; k < count; ++k) values[k] = batch.sh[k][i];
  if (axes_ != Axes{}) {
    for (std::size_t c = 0; c < 3; ++c) harmonics_.apply(&values[c], 3, out.lobes);
  }
  const std::size_t at = out.sh.size();
  out.sh.resize(at + count);
  for (std::size_t k = 0; k < count; ++k)
    out.sh[at + k] = float_to_half(std::clamp(values[k], -kMostHalf, kMostHalf));
}

void SplatIntake::take(const SplatBatch& batch, std::size_t rows, store::SplatRows& out,
                       store::SplatCounts& filtered) const {
  const bool turned = axes_ != Axes{};
  for (std::size_t i = 0; i < rows; ++i) {
    if (const auto reason = reason_against(batch, i, out.lobes)) {
      ++filtered[static_cast<std::size_t>(*reason)];
      continue;
    }
    Splat s = splat(batch, i);
    if (turned) {
      s.mean = axes_.apply(s.mean);
      s.normal = axes_.apply(s.normal);
      axes_.apply(s.sigma, s.rotation);
    }
    out.splats.push_back(s);
    if (out.lobes > 0) append_harmonics(batch, i, out);
  }
}

void BatchScene::read(std::uint64_t first, std::uint64_t count, store::SplatRows& out,
                      store::SplatCounts& filtered) const {
  PageVector<SplatBatch> storage(1);
  SplatBatch& batch = storage.front();
  decode(first, count, out.lobes, batch,
         [&](std::size_t rows) { intake_.take(batch, rows, out, filtered); });
}

std::uint64_t BatchScene::read_bytes() const {
  return round_to_pages(sizeof(SplatBatch)) + decode_bytes();
}

}  // namespace pounce::io
