// SPDX-License-Identifier: Apache-2.0
//
// Point clouds in PLY. There is no standard beyond the names of columns, which the reader of PLY
// meshes knows already (io/ply/rows.h). Files of scanners are large, so rows of the usual kind,
// binary and of one length, are read where they lie; everything else goes through that reader once,
// into a scratch file of such rows.
#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <utility>

#include "core/bounds.h"
#include "core/input_file.h"
#include "io/ply/ply_header.h"
#include "io/ply/rows.h"
#include "io/problems.h"
#include "io/splats/point_scene.h"
#include "pounce/error.h"

namespace pounce::io {
namespace {

/// By PointValue.
constexpr std::array<PlyValue, kPointValues> kValues{
    PlyValue::x,    PlyValue::y,     PlyValue::z,  PlyValue::red, PlyValue::green,
    PlyValue::blue, PlyValue::alpha, PlyValue::nx, PlyValue::ny,  PlyValue::nz};
constexpr std::size_t kColour = 3, kAlpha = 6, kNormal = 7;
constexpr std::uint64_t kConvertedBytes = kPointValues * sizeof(float);

bool is_fraction(std::size_t v) { return v >= kColour && v < kNormal; }

class PointPly : public PointScene {
 public:
  PointPly(const std::string& path, const Axes& axes) : PointScene(path, axes) {
    auto file = open_input(path);
    const PlyHeader header = read_ply_header(*file, path);
    const PlyElement& vertex = *header.find("vertex");
    if (vertex.count == 0) refuse(path, "the point cloud holds no points (element vertex 0)");
    info_.format = "point cloud PLY";
    info_.splats = vertex.count;
    const PlyRows ply(path, PlyContent::points);
    has_alpha_ = ply.has(PlyValue::alpha);
    has_normals_ = ply.has(PlyValue::nx) && ply.has(PlyValue::ny) && ply.has(PlyValue::nz);
    is_direct_ = header.format == "binary_little_endian" && !vertex.has_list &&
                 &vertex == header.elements.data();
    if (!is_direct_) {
      set_origin(box_of_first(ply));
      return;
    }
    PointRows rows;
    rows.at = ply_rows_at(header, file->size_bytes(), path);
    rows.count = vertex.count;
    rows.stride = vertex.row_bytes;
    for (std::size_t v = 0; v < kPointValues; ++v) {
      if (!wants(v)) continue;
      const PlyColumn& column = vertex.columns[ply.column(kValues[v])];
      rows.columns[v] = {column.type, column.offset,
                         is_fraction(v) ? fraction_of(column.type) : 1.0, 0.0};
    }
    set_rows(std::move(file), rows);
    set_origin(middle_box());
  }

  std::uint64_t unpacked_bytes() const override {
    return is_direct_ ? 0 : info_.splats * kConvertedBytes;
  }

 private:
  bool wants(std::size_t v) const {
    return v < kAlpha || (v < kNormal ? has_alpha_ : has_normals_);
  }

  /// Of a file that can only be read from its front: of its first points, with as much around them
  /// as a cloud may have.
  static Box3f box_of_first(const PlyRows& ply) {
    constexpr std::size_t kFirst = 4096;
    constexpr float kAround = 8;
    struct Enough {};
    std::array<std::vector<double>, 3> places;
    std::size_t count = 0;
    try {
      ply.read(
          [&](const PlyVertex& vertex) {
            if (std::isfinite(vertex[0]) && std::isfinite(vertex[1]) && std::isfinite(vertex[2])) {
              for (std::size_t k = 0; k < 3; ++k) places[k].push_back(vertex[k]);
            }
            if (++count == kFirst) throw Enough();
          },
          [](const PlyFace&) {});
    } catch (const Enough&) {
    }
    const Box3f box = middle_of(places);
    if (box.empty()) return box;
    const Vec3f size = box.hi - box.lo;
    return box.grown(kAround * std::max({size.x, size.y, size.z}));
  }

  void convert(const ScratchFolder& folder, const std::function<void()>& poll) override {
    if (is_direct_) return;
    const PlyRows ply(path_, PlyContent::points);
    scratch_ = folder.create();
    const Vec3d origin = axes_.undo(info_.origin);
    std::array<double, kPointValues> scale{}, shift{-origin.x, -origin.y, -origin.z};
    for (std::size_t v = 0; v < kPointValues; ++v)
      scale[v] = is_fraction(v) ? fraction_of(ply.type(kValues[v])) : 1.0;
    PageVector<float> piece;
    piece.reserve(kPieceBytes / sizeof(float));
    const auto write = [&] {
      scratch_->append(std::as_bytes(std::span(piece)));
      piece.clear();
      poll();
    };
    ply.read(
        [&](const PlyVertex& vertex) {
          for (std::size_t v = 0; v < kPointValues; ++v) {
            const double stored = vertex[static_cast<std::size_t>(kValues[v])];
            piece.push_back(static_cast<float>(stored * scale[v] + shift[v]));
          }
          if (piece.capacity() - piece.size() < kPointValues) write();
        },
        [](const PlyFace&) {});
    write();
    PointRows rows;
    rows.count = info_.splats;
    rows.stride = kConvertedBytes;
    for (std::size_t v = 0; v < kPointValues; ++v) {
      if (wants(v))
        rows.columns[v] = {PlyType::f32, static_cast<std::uint32_t>(v * sizeof(float)), 1.0, 0.0};
    }
    set_rows(scratch_->reader(), rows);
  }

  std::unique_ptr<WriteFile> scratch_;
  bool is_direct_ = true, has_alpha_ = false, has_normals_ = false;
};

}  // namespace

bool is_point_ply(const ReadFile& file, const std::string& path) {
  if (!is_ply(file)) return false;
  try {
    const PlyHeader header = read_ply_header(file, path);
    const PlyElement* const vertex = header.find("vertex");
    if (vertex == nullptr) return false;
    for (const PlyElement& element : header.elements) {
      if (element.count > 0 && (element.name == "face" || element.name == "tristrips"))
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
