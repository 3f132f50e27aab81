// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include "core/bounds.h"
#include "cube_charts.h"
#include "head_texture.h"
#include "output_file.h"
#include "pounce/error.h"
#include "recipes.h"
#include "splat_scene.h"
#include "write_spz.h"
#include "write_textured_mesh.h"

namespace pounce::fixture {
namespace {

std::string header(const SplatOptions& options, const SplatScene& scene) {
  const SplatCounts& c = scene.counts();
  std::string text = fmt::format(
      "ply\nformat binary_little_endian 1.0\n"
      "comment pounce-fixture splats: {}, seed {}\n"
      "comment surface {} needles {} interior {} floaters {} haze {}\n"
      "comment broken: nan {} zero-rotation {} infinite-scale {} far {} transparent {}\n"
      "comment spacing {:.9g} noise-sigma {:.9g}\n"
      "element vertex {}\n",
      options.shape, options.seed, c.surface, c.needles, c.interior, c.floaters, c.haze, c.broken,
      c.broken, c.broken, c.broken, c.broken, scene.spacing(), scene.noise(), options.count);
  const auto column = [&text](const std::string& name) { text += "property float " + name + "\n"; };
  for (const char* name : {"x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"}) {
    column(name);
  }
  for (std::size_t i = 0; i < scene.rest_columns(); ++i) column(fmt::format("f_rest_{}", i));
  column("opacity");
  for (const char* name : {"scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"}) {
    column(name);
  }
  return text + "end_header\n";
}

void write_scene(const SplatOptions& options, const SplatScene& scene) {
  constexpr std::uint64_t kBatch = 16384;  // rows: 4 MiB at degree 3
  OutputFile file(options.path);
  file.append(header(options, scene));
  const std::size_t columns = scene.columns();
  std::vector<float> rows(columns * std::min(kBatch, options.count));
  for (std::uint64_t first = 0; first < options.count; first += kBatch) {
    const std::uint64_t here = std::min(kBatch, options.count - first);
    tbb::parallel_for(tbb::blocked_range<std::uint64_t>(0, here, 256), [&](const auto& range) {
      for (std::uint64_t i = range.begin(); i < range.end(); ++i) {
        scene.fill(first + i, std::span(rows).subspan(i * columns, columns));
      }
    });
    file.append(rows.data(), here * columns * sizeof(float));
  }
  file.commit();
}

/// Places and colours of all rows.
void write_points(const SplatOptions& options, const SplatScene& scene) {
  constexpr std::uint64_t kBatch = 16384;
  constexpr std::size_t kPlaceBytes = 3 * sizeof(float), kRowBytes = kPlaceBytes + 3;
  constexpr std::size_t kColour = 6;  // of a row's columns
  constexpr float kC0 = 0.28209479177387814F;
  OutputFile file(options.path);
  file.append(
      fmt::format("ply\nformat binary_little_endian 1.0\n"
                  "comment pounce-fixture splats --points: {}, seed {}\n"
                  "comment spacing {:.9g} noise-sigma {:.9g}\nelement vertex {}\n"
                  "property float x\nproperty float y\nproperty float z\n"
                  "property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n",
                  options.shape, options.seed, scene.spacing(), scene.noise(), options.count));
  const std::size_t columns = scene.columns();
  std::vector<std::byte> rows(kRowBytes * std::min(kBatch, options.count));
  for (std::uint64_t first = 0; first < options.count; first += kBatch) {
    const std::uint64_t here = std::min(kBatch, options.count - first);
    tbb::parallel_for(tbb::blocked_range<std::uint64_t>(0, here, 256), [&](const auto& range) {
      std::vector<float> row(columns);
      for (std::uint64_t i = range.begin(); i < range.end(); ++i) {
        scene.fill(first + i, row);
        std::byte* const to = &rows[i * kRowBytes];
        std::memcpy(to, row.data(), kPlaceBytes);
        for (std::size_t c = 0; c < 3; ++c) {
          const float share = std::clamp(0.5F + kC0 * row[kColour + c], 0.0F, 1.0F);
          to[kPlaceBytes + c] = static_cast<std::byte>(share * 255 + 0.5F);
        }
      }
    });
    file.append(rows.data(), here * kRowBytes);
  }
  file.commit();
}

/// The scene's picture at the texels' centres of `mesh`, alpha 1 where a chart holds them.
void sphere_truth_row(const GridMesh& mesh, const ChartPositions& positions,
                      const SplatScene& scene, std::uint32_t size, std::uint32_t y,
                      std::span<float> row) {
  ChartFinder finder(mesh);
  for (std::uint32_t x = 0; x < size; ++x) {
    const auto found = finder.find({(x + 0.5) / size, (y + 0.5) / size});
    const Rgb colour =
        found.inside ? scene.colour(normalized(positions.at(found.chart, found.grid))) : Rgb{};
    for (std::size_t c = 0; c < 3; ++c) row[std::size_t{x} * 4 + c] = colour[c];
    row[std::size_t{x} * 4 + 3] = found.inside ? 1.0F : 0.0F;
  }
}

/// The charts, moved along their normals by a part of their box's diagonal.
GridMesh moved_outward(const GridMesh& mesh, double part) {
  Box3f box;
  for (const GridChart& chart : mesh) {
    for (std::uint32_t row = 0; row <= chart.rows; ++row) {
      for (std::uint32_t column = 0; column <= chart.columns; ++column)
        box.extend(Vec3f(chart.point(column, row).position));
    }
  }
  const double distance = part * length(Vec3d(box.hi) - Vec3d(box.lo));
  GridMesh moved = mesh;
  for (GridChart& chart : moved) {
    chart.point = [point = chart.point, distance](std::uint32_t column, std::uint32_t row) {
      const SurfacePoint p = point(column, row);
      return SurfacePoint{p.position + p.normal * distance, p.normal};
    };
  }
  return moved;
}

void write_target(const SplatOptions& options, const SplatScene& scene, const std::string& stem,
                  Paths& written) {
  const std::uint32_t size = options.target_size;
  const bool is_sphere = options.shape == "sphere";
  const GridMesh mesh =
      is_sphere ? sphere_charts(20000, 1) : head_target_charts(source_head(), 13000, Turn(27, 19));
  write_plain_mesh({stem + "_target", true, false, {}},
                   moved_outward(mesh, options.target_offset / 100), written);
  written.push_back(stem + "_target.truth.png");
  const RenderSpec spec{.width = size, .height = size, .channels = 4, .depth = Depth::u16};
  if (is_sphere) {
    const ChartPositions positions(mesh);
    render_image(written.back(), spec, [&](std::uint32_t y, std::span<float> row) {
      sphere_truth_row(mesh, positions, scene, size, y, row);
    });
  } else {
    const HeadTexture truth(mesh, size, size);
    render_image(written.back(), spec,
                 [&](std::uint32_t y, std::span<float> row) { truth.truth_row(y, row); });
  }
}

}  // namespace

Paths make_splats(const SplatOptions& asked) {
  SplatOptions options = asked;
  if (options.points) options.needles = options.interior = options.floaters = options.haze = 0;
  const std::filesystem::path path(options.path);
  const bool is_spz = path.extension() == ".spz";
  if (path.extension() != ".ply" && !is_spz) {
    throw Error(
        ErrorKind::usage,
        fmt::format("{}: splat scenes are written as .ply and .spz; name it so", options.path));
  }
  if (is_spz && options.broken > 0) {
    throw Error(ErrorKind::usage, "SPZ has no place for broken rows; write a .ply");
  }
  if (options.points && (is_spz || options.broken > 0 || options.sh_degree > 0)) {
    throw Error(ErrorKind::usage,
                "--points has no harmonics and no broken rows, and is written as .ply");
  }
  const SplatScene scene(options);
  Paths written;
  if (path.has_parent_path()) make_folder(path.parent_path().string());
  if (options.points) {
    write_points(options, scene);
  } else {
    is_spz ? write_spz(options, scene) : write_scene(options, scene);
  }
  written.push_back(options.path);
  if (options.target_size != 0) {
    write_target(options, scene, (path.parent_path() / path.stem()).string(), written);
  }
  return written;
}

}  // namespace pounce::fixture
