// SPDX-License-Identifier: Apache-2.0
//
// Point clouds in PLY. There is no standard beyond the names of columns, which the reader of PLY
// meshes knows already (io/ply/rows.h). Files of scanners are large, so rows of the usual kind,
// binary and of one length, are read where they lie; everything else goes through that reader once,
// into a scratch file of such rows.
#include "io/splats/point_ply.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "core/input_file.h"
#include "io/ply/rows.h"
#include "io/problems.h"
#include "io/splats/batch.h"
#include "io/ply/ply_header.h"
#include "pounce/error.h"

namespace pounce::io {
namespace {

/// What is read of a row, in the order of a converted one.
constexpr std::array<PlyValue, 10> kValues{
    PlyValue::x,    PlyValue::y,     PlyValue::z,  PlyValue::red, PlyValue::green,
    PlyValue::blue, PlyValue::alpha, PlyValue::nx, PlyValue::ny,  PlyValue::nz};
constexpr std::size_t kColour = 3, kAlpha = 6, kNormal = 7;
constexpr std::uint64_t kConvertedBytes = kValues.size() * sizeof(float);

struct PointColumn {
  PlyType type = PlyType::f32;
  std::uint32_t offset = 0;
  float scale = 1;
};
using PointColumns = std::array<std::optional<PointColumn>, kValues.size()>;

/// What makes a colour of that type a fraction.
float fraction_of(PlyType type) {
  switch (type) {
    case PlyType::i8:
      return 1.0F / 127;
    case PlyType::u8:
      return 1.0F / 255;
    case PlyType::i16:
      return 1.0F / 32767;
    case PlyType::u16:
      return 1.0F / 65535;
    case PlyType::i32:
      return 1.0F / 2147483648.0F;
    case PlyType::u32:
      return 1.0F / 4294967296.0F;
    case PlyType::f32:
    case PlyType::f64:
      break;
  }
  return 1;
}

template <class T>
void load_as(const std::byte* from, std::size_t stride, std::size_t rows, float scale,
             SplatBatch::Column& to) {
  for (std::size_t i = 0; i < rows; ++i) {
    T value;
    std::memcpy(&value, from + i * stride, sizeof value);
    to[i] = static_cast<float>(value) * scale;
  }
}
using Loader = void (*)(const std::byte*, std::size_t, std::size_t, float, SplatBatch::Column&);
/// By PlyType.
constexpr std::array<Loader, 8> kLoaders{
    load_as<std::int8_t>,  load_as<std::uint8_t>,  load_as<std::int16_t>, load_as<std::uint16_t>,
    load_as<std::int32_t>, load_as<std::uint32_t>, load_as<float>,        load_as<double>};

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

class PointPly : public BatchScene {
 public:
  PointPly(const std::string& path, const Axes& axes)
      : BatchScene(axes), path_(path), file_(open_input(path)) {
    const PlyHeader header = read_ply_header(*file_, path);
    const PlyElement& vertex = *header.find("vertex");
    if (vertex.count == 0) refuse(path, "the point cloud holds no points (element vertex 0)");
    const PlyRows rows(path, PlyContent::points);
    has_alpha_ = rows.has(PlyValue::alpha);
    has_normals_ =
        rows.has(PlyValue::nx) && rows.has(PlyValue::ny) && rows.has(PlyValue::nz);
    is_direct_ = header.format == "binary_little_endian" && !vertex.has_list &&
                 &vertex == header.elements.data();
    if (is_direct_) find_columns(rows, vertex, ply_rows_at(header, file_->size_bytes(), path));
    info_.format = "point cloud PLY";
    info_.splats = vertex.count;
    info_.are_points = true;
    info_.model = store::SplatModel::flat;
    info_.files = {path};
    if (is_direct_) note_rounding();
  }

  std::uint64_t unpacked_bytes() const override {
    return is_direct_ ? 0 : info_.splats * kConvertedBytes;
  }
  // The file's own buffer and a piece of rows; then a sample and its coordinates.
  std::uint64_t prepare_bytes() const override {
    constexpr std::uint64_t kStream = 256 << 10;
    const std::uint64_t most = std::min(info_.splats, kSampleSplats);
    return std::max(is_direct_ ? 0 : kStream + kPieceBytes,
                    round_to_pages(most * sizeof(store::Splat)) +
                        round_to_pages(most * sizeof(float)) + read_bytes());
  }
  void prepare(const ScratchFolder& folder, const std::function<void()>& poll) override {
    if (!is_direct_) convert(folder, poll);
    size_ = usual_size();
  }

  void decode(std::uint64_t first, std::uint64_t count, std::uint32_t, SplatBatch& batch,
              const Take& take) const override {
    batch.sigma[0].fill(size_);
    batch.sigma[1].fill(size_);
    batch.rotation[0].fill(1);
    batch.alpha.fill(1);
    PageVector<std::byte> raw(std::min(count, piece_rows()) * stride_);
    for (const std::uint64_t end = first + count; first < end;) {
      const std::uint64_t rows = std::min(end - first, piece_rows());
      file_->read(rows_at_ + first * stride_, std::span(raw).first(rows * stride_));
      for_batches(rows, [&](std::uint64_t begin, std::size_t n) {
        for (std::size_t v = 0; v < kValues.size(); ++v) {
          if (!columns_[v]) continue;
          const PointColumn& from = *columns_[v];
          kLoaders[static_cast<std::size_t>(from.type)](&raw[begin * stride_ + from.offset],
                                                        stride_, n, from.scale,
                                                        column_of(batch, v));
        }
        take(n);
      });
      first += rows;
    }
  }
  std::uint64_t decode_bytes() const override {
    const std::uint64_t stride = is_direct_ ? stride_ : kConvertedBytes;
    return round_to_pages(std::max(kPieceBytes, stride));
  }

 private:
  static constexpr std::uint64_t kPieceBytes = 256 << 10;

  std::uint64_t piece_rows() const {
    return std::max<std::uint64_t>(kPieceBytes / stride_, 1);
  }
  bool wants(std::size_t v) const {
    return v < kAlpha || (v < kNormal ? has_alpha_ : has_normals_);
  }

  void find_columns(const PlyRows& rows, const PlyElement& vertex, std::uint64_t rows_at) {
    rows_at_ = rows_at;
    stride_ = vertex.row_bytes;
    for (std::size_t v = 0; v < kValues.size(); ++v) {
      if (!wants(v)) continue;
      const PlyColumn& column = vertex.columns[rows.column(kValues[v])];
      const bool is_fraction = v >= kColour && v < kNormal;
      columns_[v] = {column.type, column.offset, is_fraction ? fraction_of(column.type) : 1.0F};
    }
  }

  /// Surveys have coordinates of their country.
  void note_rounding() {
    constexpr float kFar = 1e5F;
    std::vector<std::byte> row(stride_);
    file_->read(rows_at_, row);
    float most = 0;
    for (std::size_t v = 0; v < kColour; ++v) {
      SplatBatch::Column value;
      const PointColumn& from = *columns_[v];
      kLoaders[static_cast<std::size_t>(from.type)](&row[from.offset], stride_, 1, 1, value);
      if (std::abs(value[0]) > most) most = std::abs(value[0]);
    }
    if (!(most > kFar)) return;
    info_.assumptions.push_back(fmt::format(
        "the points of {} lie about {:.0f} units from the origin, where places are rounded to {:.2g} "
        "units; move cloud and target to the origin together if that is too coarse",
        path_, most, most * std::numeric_limits<float>::epsilon()));
  }

  void convert(const ScratchFolder& folder, const std::function<void()>& poll) {
    const PlyRows rows(path_, PlyContent::points);
    auto scratch = folder.create();
    std::array<double, kValues.size()> scale;
    for (std::size_t v = 0; v < kValues.size(); ++v)
      scale[v] = v >= kColour && v < kNormal ? double{fraction_of(rows.type(kValues[v]))} : 1.0;
    PageVector<float> piece;
    piece.reserve(kPieceBytes / sizeof(float));
    const auto write = [&] {
      scratch->append(std::as_bytes(std::span(piece)));
      piece.clear();
      poll();
    };
    rows.read(
        [&](const PlyVertex& vertex) {
          for (std::size_t v = 0; v < kValues.size(); ++v)
            piece.push_back(static_cast<float>(vertex[static_cast<std::size_t>(kValues[v])] *
                                               scale[v]));
          if (piece.capacity() - piece.size() < kValues.size()) write();
        },
        [](const PlyFace&) {});
    write();
    file_ = scratch->reader();
    scratch_ = std::move(scratch);
    rows_at_ = 0;
    stride_ = kConvertedBytes;
    for (std::size_t v = 0; v < kValues.size(); ++v) {
      if (wants(v)) columns_[v] = {PlyType::f32, static_cast<std::uint32_t>(v * sizeof(float)), 1};
    }
  }

  /// About the spacing, were the points spread evenly over the box in which most of them are. It
  /// orders them; what is seen of them is their discs.
  float usual_size() {
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
    }
    const auto [a, b, c] = extents;
    const double area = 2 * (a * b + b * c + c * a);
    const double longest = std::max({a, b, c});  // of points on a line
    const auto count = static_cast<double>(info_.splats);
    const double size = std::max(std::sqrt(area / count), longest / count) / 2;
    return size > 0 ? static_cast<float>(size) : 1;
  }

  const std::string path_;
  std::unique_ptr<ReadFile> file_;
  std::unique_ptr<WriteFile> scratch_;
  bool is_direct_ = true, has_alpha_ = false, has_normals_ = false;
  std::uint64_t rows_at_ = 0, stride_ = kConvertedBytes;
  PointColumns columns_;
  float size_ = 1;
};

}  // namespace

bool is_point_ply(const ReadFile& file, const std::string& path) {
  if (!is_ply(file)) return false;
  try {
    const PlyHeader header = read_ply_header(file, path);
    const PlyElement* const vertex = header.find("vertex");
    if (vertex == nullptr) return false;
    for (const PlyElement& element : header.elements) {
      if (&element != vertex && element.count > 0 &&
          (element.name == "face" || element.name == "tristrips"))
        return false;
    }
    std::array<bool, kPlyValues> has{};
    for (const PlyColumn& column : vertex->columns) {
      if (column.name == "f_dc_0" || column.name == "scale_0" || column.name == "packed_position")
        return false;
      if (const auto value = ply_value(column.name)) has[static_cast<std::size_t>(*value)] = true;
    }
    return std::all_of(kValues.begin(), kValues.begin() + kAlpha,
                       [&](PlyValue value) { return has[static_cast<std::size_t>(value)]; });
  } catch (const Error& e) {
    if (e.kind() != ErrorKind::input) throw;
    return false;
  }
}

std::unique_ptr<SplatScene> open_point_ply(const std::string& path, const Axes& axes) {
  return std::make_unique<PointPly>(path, axes);
}

}  // namespace pounce::io
