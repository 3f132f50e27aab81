// SPDX-License-Identifier: Apache-2.0
//
// What point clouds of all formats have in common once it is known where their rows are: columns
// that become batches, an origin, and a size until their neighbours are known.
//
// Surveys have coordinates of their country, where a float has steps of centimetres. So places are
// counted from an origin near the cloud, in double precision, as those of meshes are
// (docs/decisions/042-origin.md).
#include "io/splats/point_scene.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <vector>

namespace pounce::io {
namespace {

constexpr std::size_t kColour = 3, kAlpha = 6, kNormal = 7;

template <class T>
double stored_as(const std::byte* from) {
  return static_cast<double>(value_at<T>(from));
}
template <class T>
void load_as(const std::byte* from, std::size_t stride, std::size_t rows, double scale,
             double shift, SplatBatch::Column& to) {
  for (std::size_t i = 0; i < rows; ++i) {
    to[i] = static_cast<float>(stored_as<T>(from + i * stride) * scale + shift);
  }
}
using Loader = void (*)(const std::byte*, std::size_t, std::size_t, double, double,
                        SplatBatch::Column&);
/// By PlyType.
constexpr std::array<Loader, 8> kLoaders{
    load_as<std::int8_t>,  load_as<std::uint8_t>,  load_as<std::int16_t>, load_as<std::uint16_t>,
    load_as<std::int32_t>, load_as<std::uint32_t>, load_as<float>,        load_as<double>};

using Stored = double (*)(const std::byte*);
constexpr std::array<Stored, 8> kStored{stored_as<std::int8_t>,  stored_as<std::uint8_t>,
                                        stored_as<std::int16_t>, stored_as<std::uint16_t>,
                                        stored_as<std::int32_t>, stored_as<std::uint32_t>,
                                        stored_as<float>,        stored_as<double>};

SplatBatch::Column& column_of(SplatBatch& batch, std::size_t v) {
  if (v < kColour) return batch.mean[v];
  if (v < kAlpha) return batch.colour[v - kColour];
  return v < kNormal ? batch.alpha : batch.normal[v - kNormal];
}

/// The extent of what lies between the tenths at both ends.
float middle_extent(PageVector<float>& values) {
  const auto tenth = static_cast<std::ptrdiff_t>(values.size() / 10);
  std::nth_element(values.begin(), values.begin() + tenth, values.end());
  const float low = values[static_cast<std::size_t>(tenth)];
  std::nth_element(values.begin(), values.end() - 1 - tenth, values.end());
  return *(values.end() - 1 - tenth) - low;
}

}  // namespace

double fraction_of(PlyType type) {
  switch (type) {
    case PlyType::i8:
      return 1.0 / 127;
    case PlyType::u8:
      return 1.0 / 255;
    case PlyType::i16:
      return 1.0 / 32767;
    case PlyType::u16:
      return 1.0 / 65535;
    case PlyType::i32:
      return 1.0 / 2147483647;
    case PlyType::u32:
      return 1.0 / 4294967295;
    case PlyType::f32:
    case PlyType::f64:
      break;
  }
  return 1;
}

void PointScene::set_rows(std::unique_ptr<ReadFile> file, const PointRows& rows) {
  file_ = std::move(file);
  rows_ = rows;
}

void PointScene::set_origin(const Box3f& box) {
  Box3f turned;
  if (!box.empty()) {
    turned.extend(axes_.apply(box.lo));
    turned.extend(axes_.apply(box.hi));
  }
  info_.origin = origin_for(turned);
  const Vec3d own = axes_.undo(info_.origin);
  const std::array<double, 3> from{own.x, own.y, own.z};
  for (std::size_t v = 0; v < kColour; ++v) {
    if (rows_.columns[v]) rows_.columns[v]->shift -= from[v];
  }
}

double PointScene::value(const PointColumn& column, const std::byte* row) {
  return kStored[static_cast<std::size_t>(column.type)](row + column.offset) * column.scale +
         column.shift;
}

void PointScene::for_sample(const std::function<void(const std::byte* row)>& f) const {
  constexpr std::uint64_t kRowsPerSpot = 64, kSpots = kSampleSplats / kRowsPerSpot;
  const std::uint64_t spots = std::min<std::uint64_t>(kSpots, rows_.count / kRowsPerSpot + 1);
  std::vector<std::byte> raw;
  for (std::uint64_t i = 0; i < spots; ++i) {
    const std::uint64_t first = rows_.count / spots * i + rows_.count % spots * i / spots;
    const std::uint64_t count = std::min(kRowsPerSpot, rows_.count - first);
    raw.resize(count * rows_.stride);
    file_->read(rows_.at + first * rows_.stride, raw);
    for (std::uint64_t r = 0; r < count; ++r) f(&raw[r * rows_.stride]);
  }
}

Box3f PointScene::middle_of(std::array<std::vector<double>, 3>& places) {
  Box3f box;
  if (places[0].empty()) return box;
  std::array<double, 3> low, high;
  for (std::size_t k = 0; k < 3; ++k) {
    std::vector<double>& own = places[k];
    const auto hundredth = static_cast<std::ptrdiff_t>(own.size() / 100);
    std::nth_element(own.begin(), own.begin() + hundredth, own.end());
    low[k] = own[static_cast<std::size_t>(hundredth)];
    std::nth_element(own.begin(), own.end() - 1 - hundredth, own.end());
    high[k] = *(own.end() - 1 - hundredth);
  }
  box.extend(Vec3f(Vec3d{low[0], low[1], low[2]}));
  box.extend(Vec3f(Vec3d{high[0], high[1], high[2]}));
  return box;
}

Box3f PointScene::middle_box() const {
  constexpr std::uint64_t kMost = 8192;  // of a sample, while the file is opened
  const std::uint64_t step =
      std::max<std::uint64_t>(std::min(rows_.count, kSampleSplats) / kMost, 1);
  std::array<std::vector<double>, 3> places;
  std::uint64_t number = 0;
  for_sample([&](const std::byte* row) {
    if (number++ % step != 0) return;
    if (rows_.is_withheld != nullptr && rows_.is_withheld(row)) return;
    std::array<double, 3> at;
    for (std::size_t k = 0; k < 3; ++k) at[k] = value(*rows_.columns[k], row);
    if (!std::isfinite(at[0]) || !std::isfinite(at[1]) || !std::isfinite(at[2])) return;
    for (std::size_t k = 0; k < 3; ++k) places[k].push_back(at[k]);
  });
  return middle_of(places);
}

std::uint64_t PointScene::prepare_bytes() const {
  constexpr std::uint64_t kStream = 256 << 10;
  const std::uint64_t most = std::min(info_.splats, kSampleSplats);
  return std::max(kStream + kPieceBytes, round_to_pages(most * sizeof(store::Splat)) +
                                             round_to_pages(most * sizeof(float)) + read_bytes());
}

void PointScene::prepare(const ScratchFolder& folder, const std::function<void()>& poll) {
  convert(folder, poll);
  size_ = usual_size();
}

void PointScene::decode(std::uint64_t first, std::uint64_t count, std::uint32_t, SplatBatch& batch,
                        const Take& take) const {
  batch.sigma[0].fill(size_);
  batch.sigma[1].fill(size_);
  batch.rotation[0].fill(1);
  batch.alpha.fill(1);
  const std::uint64_t stride = rows_.stride;
  PageVector<std::byte> raw(std::min(count, piece_rows()) * stride);
  for (const std::uint64_t end = first + count; first < end;) {
    const std::uint64_t rows = std::min(end - first, piece_rows());
    file_->read(rows_.at + first * stride, std::span(raw).first(rows * stride));
    for_batches(rows, [&](std::uint64_t begin, std::size_t n) {
      const std::byte* const from = &raw[begin * stride];
      for (std::size_t v = 0; v < kPointValues; ++v) {
        if (!rows_.columns[v]) continue;
        const PointColumn& column = *rows_.columns[v];
        kLoaders[static_cast<std::size_t>(column.type)](
            from + column.offset, stride, n, column.scale, column.shift, column_of(batch, v));
      }
      // Beyond this squares of distances are no numbers; no cloud is there.
      constexpr float kFarthest = 1e18F;
      for (SplatBatch::Column& axis : batch.mean) {
        for (std::size_t i = 0; i < n; ++i) {
          if (!(std::abs(axis[i]) <= kFarthest)) axis[i] = std::numeric_limits<float>::quiet_NaN();
        }
      }
      for (std::size_t i = 0; i < n; ++i) batch.alpha[i] = std::min(batch.alpha[i], 1.0F);
      for (std::size_t i = 0; rows_.is_withheld != nullptr && i < n; ++i)
        batch.alpha[i] = rows_.is_withheld(from + i * stride) ? 0.0F : 1.0F;
      take(n);
    });
    first += rows;
  }
}

std::uint64_t PointScene::decode_bytes() const {
  return round_to_pages(std::max(kPieceBytes, rows_.stride));
}

/// About the spacing, were the points spread evenly over the box in which most of them are. It
/// orders them; what is seen of them is their discs.
float PointScene::usual_size() {
  size_ = 1;
  const PageVector<store::Splat> points = sample(*this);
  if (points.empty()) return 1;
  PageVector<float> values(points.size());
  std::array<double, 3> extents;
  for (std::size_t k = 0; k < 3; ++k) {
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Vec3f at = points[i].mean;
      values[i] = k == 0 ? at.x : k == 1 ? at.y : at.z;
    }
    extents[k] = static_cast<double>(middle_extent(values)) * 1.25;
    if (extents[k] > 0) continue;  // most of them in one place, or on a plane
    const auto [low, high] = std::minmax_element(values.begin(), values.end());
    extents[k] = static_cast<double>(*high) - static_cast<double>(*low);
  }
  const auto [a, b, c] = extents;
  const double area = 2 * (a * b + b * c + c * a);
  const double longest = std::max({a, b, c});  // of points on a line
  const auto count = static_cast<double>(info_.splats);
  const double size = std::max(std::sqrt(area / count), longest / count) / 2;
  const auto single = static_cast<float>(size);
  return single > 0 && std::isfinite(single) ? single : 1;
}

}  // namespace pounce::io
