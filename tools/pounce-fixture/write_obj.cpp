// SPDX-License-Identifier: Apache-2.0
#include "write_obj.h"

#include <fmt/format.h>

#include <cstdint>
#include <filesystem>
#include <iterator>

#include "output_file.h"

namespace pounce::fixture {
namespace {

void write_mtl(const std::string& path, const std::string& texture) {
  OutputFile out(path);
  out.append(fmt::format("newmtl skin\nKd 1 1 1\nmap_Kd {}\n", texture));
  out.commit();
}

void write_vertex(fmt::memory_buffer& text, const GridChart& chart, std::uint32_t column,
                  std::uint32_t row) {
  const SurfacePoint point = chart.point(column, row);
  const Vec3f p(point.position), n(point.normal);
  const Vec2d uv = chart.uv_sets.front().to_uv({column * 1.0, row * 1.0});
  fmt::format_to(std::back_inserter(text), "v {} {} {}\nvt {} {}\nvn {} {} {}\n", p.x, p.y, p.z,
                 static_cast<float>(uv.x), static_cast<float>(1 - uv.y), n.x, n.y, n.z);
}

void write_face(fmt::memory_buffer& text, std::uint64_t a, std::uint64_t b, std::uint64_t c) {
  fmt::format_to(std::back_inserter(text), "f {0}/{0}/{0} {1}/{1}/{1} {2}/{2}/{2}\n", a, b, c);
}

}  // namespace

void write_obj(const std::string& path, const GridMesh& mesh, const std::string& texture) {
  OutputFile out(path);
  if (!texture.empty()) {
    const std::filesystem::path mtl = std::filesystem::path(path).replace_extension(".mtl");
    write_mtl(mtl.string(), texture);
    out.append(fmt::format("mtllib {}\nusemtl skin\n", mtl.filename().string()));
  }
  fmt::memory_buffer text;
  const auto flush = [&] {
    out.append(text.data(), text.size());
    text.clear();
  };
  std::uint64_t base = 1;
  for (const GridChart& chart : mesh) {
    for (std::uint32_t row = 0; row <= chart.rows; ++row) {
      for (std::uint32_t column = 0; column <= chart.columns; ++column) {
        write_vertex(text, chart, column, row);
      }
      flush();
    }
    const std::uint64_t stride = std::uint64_t{chart.columns} + 1;
    for (std::uint32_t row = 0; row < chart.rows; ++row) {
      for (std::uint32_t column = 0; column < chart.columns; ++column) {
        const std::uint64_t upper = base + row * stride + column, lower = upper + stride;
        write_face(text, upper, lower, lower + 1);
        write_face(text, upper, lower + 1, upper + 1);
      }
      flush();
    }
    base += chart.vertex_count();
  }
  out.commit();
}

}  // namespace pounce::fixture
