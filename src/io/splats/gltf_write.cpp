// SPDX-License-Identifier: Apache-2.0
//
// The JSON comes first and has the number of Gaussians and the bounds of their places, and each
// attribute lies by itself, so attributes wait in nameless files until all Gaussians are known.
#include "io/splats/gltf_write.h"

#include <fmt/format.h>

#include <cstring>

#include "core/portable_math.h"

namespace pounce::io {
namespace {

enum Column : std::size_t { kPlaces, kRotations, kSizes, kAlphas, kColours, kHarmonics };

constexpr const char* kPrefix = "KHR_gaussian_splatting:";

/// What the accessor of a column is called in its primitive.
std::string attribute(std::size_t column) {
  constexpr std::array<const char*, kHarmonics> kNames{"POSITION", "ROTATION", "SCALE", "OPACITY",
                                                       "SH_DEGREE_0_COEF_0"};
  if (column == kPlaces) return kNames[0];
  if (column < kHarmonics) return std::string(kPrefix) + kNames[column];
  std::size_t degree = 1, first = kHarmonics;
  while (column >= first + 2 * degree + 1) first += 2 * degree++ + 1;
  return fmt::format("{}SH_DEGREE_{}_COEF_{}", kPrefix, degree, column - first);
}

const char* type_of(std::size_t column) {
  return column == kRotations ? "VEC4" : column == kAlphas ? "SCALAR" : "VEC3";
}

}  // namespace

GltfSplatWriter::GltfSplatWriter(const std::string& path, const SplatFileFacts& facts,
                                 const ScratchFolder& folder)
    : SplatWriter(path, facts, SplatOutput::glb, &folder) {
  if (facts.model == store::SplatModel::antialiased) {
    notes_.push_back(
        "these Gaussians were trained with antialiasing, which glTF cannot say: viewers show them "
        "a little too opaque");
  }
  if (facts.model == store::SplatModel::flat)
    notes_.push_back(
        "glTF cannot say that these Gaussians are discs (2DGS): they are written flat");
}

void GltfSplatWriter::encode_columns(const store::SplatRows& rows,
                                     std::span<std::byte* const> columns, SplatTally&) const {
  const auto put_floats = [](std::byte* at, std::size_t row, const auto& values) {
    std::memcpy(at + row * sizeof values, values.data(), sizeof values);
  };
  const std::size_t lobes = rows.lobes;
  for (std::size_t i = 0; i < rows.splats.size(); ++i) {
    const store::Splat& s = rows.splats[i];
    const auto& [w, x, y, z] = s.rotation;
    put_floats(columns[kPlaces], i, std::array{s.mean.x, s.mean.y, s.mean.z});
    put_floats(columns[kRotations], i, std::array{x, y, z, w});
    put_floats(columns[kSizes], i, std::array{s.sigma.x, s.sigma.y, s.sigma.z});
    put_floats(columns[kAlphas], i, std::array{s.alpha});
    put_floats(columns[kColours], i,
               std::array{dc_of(s.colour.x), dc_of(s.colour.y), dc_of(s.colour.z)});
    for (std::size_t k = 0; k < lobes; ++k) {
      const std::uint16_t* const sh = &rows.sh[3 * (i * lobes + k)];
      put_floats(columns[kHarmonics + k], i,
                 std::array{half_to_float(sh[0]), half_to_float(sh[1]), half_to_float(sh[2])});
    }
  }
}

std::string GltfSplatWriter::document() const {
  const std::vector<std::uint32_t>& bytes = column_bytes();
  std::string attributes, accessors, views;
  std::uint64_t at = 0;
  for (std::size_t k = 0; k < bytes.size(); ++k) {
    const char* const comma = k == 0 ? "" : ",";
    attributes += fmt::format("{}\"{}\":{}", comma, attribute(k), k);
    const Vec3f &lo = tally_.box.lo, &hi = tally_.box.hi;
    const std::string bounds =  // {} of a float is the shortest text that reads back as the same
        k != kPlaces ? ""
                     : fmt::format(",\"min\":[{},{},{}],\"max\":[{},{},{}]", lo.x, lo.y, lo.z, hi.x,
                                   hi.y, hi.z);
    accessors +=
        fmt::format("{}{{\"bufferView\":{},\"componentType\":5126,\"count\":{},\"type\":\"{}\"{}}}",
                    comma, k, rows_, type_of(k), bounds);
    views += fmt::format("{}{{\"buffer\":0,\"byteOffset\":{},\"byteLength\":{},\"target\":34962}}",
                         comma, at, rows_ * bytes[k]);
    at += rows_ * bytes[k];
  }
  const Vec3d& o = facts_.origin;
  const std::string translation =
      o == Vec3d{} ? "" : fmt::format(",\"translation\":[{},{},{}]", o.x, o.y, o.z);
  std::string text = fmt::format(
      "{{\"asset\":{{\"version\":\"2.0\",\"generator\":\"pounce\"}},"
      "\"extensionsUsed\":[\"KHR_gaussian_splatting\"],\"scene\":0,\"scenes\":[{{\"nodes\":[0]}}],"
      "\"nodes\":[{{\"mesh\":0{}}}],\"meshes\":[{{\"primitives\":[{{\"mode\":0,\"attributes\":{{{}}"
      "},"
      "\"extensions\":{{\"KHR_gaussian_splatting\":{{\"kernel\":\"ellipse\",\"colorSpace\":\"{}\"}}"
      "}}}}]}}],\"accessors\":[{}],\"bufferViews\":[{}],\"buffers\":[{{\"byteLength\":{}}}]}}",
      translation, attributes, facts_.is_linear ? "lin_rec709_display" : "srgb_rec709_display",
      accessors, views, at);
  text.resize((text.size() + 3) / 4 * 4, ' ');
  return text;
}

void GltfSplatWriter::commit(const std::function<void()>& poll) {
  if (tally_.normals > 0)
    notes_.push_back("the normals of the source are not written: splats in glTF have none");
  const std::string json = document();
  const std::uint64_t binary = rows_ * row_bytes();  // a multiple of four
  const auto put_numbers = [this](std::initializer_list<std::uint64_t> numbers) {
    for (const std::uint64_t number : numbers) {
      const auto value = static_cast<std::uint32_t>(number);
      put(std::as_bytes(std::span(&value, 1)));
    }
  };
  put_numbers({0x46546C67, 2, 12 + 8 + json.size() + 8 + binary});  // "glTF"
  put_numbers({json.size(), 0x4E4F534A});                           // "JSON"
  put(std::as_bytes(std::span(json)));
  put_numbers({binary, 0x004E4942});  // "BIN"
  for (std::size_t k = 0; k < kHarmonics + facts_.lobes; ++k)
    for_column(k, poll, [&](std::span<const std::byte> bytes) { put(bytes); });
  file_.commit();
}

}  // namespace pounce::io
