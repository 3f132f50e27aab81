// SPDX-License-Identifier: Apache-2.0
#include <draco/compression/encode.h>

#include "support/packed_grid.h"

namespace pounce::test {

__attribute__((visibility("default"))) std::string draco_bytes_of(const Grid& grid,
                                                                  const DracoChoice& choice) {
  using Attribute = draco::GeometryAttribute;
  draco::Mesh mesh;
  const auto points = static_cast<std::uint32_t>(grid.positions.size());
  mesh.set_num_points(points);
  const auto add = [&](Attribute::Type type, std::int8_t width, const float* values) {
    Attribute attribute;
    attribute.Init(type, nullptr, width, draco::DT_FLOAT32, false, 4 * width, 0);
    const int id = mesh.AddAttribute(attribute, true, points);
    for (std::uint32_t i = 0; i < points; ++i) {
      mesh.attribute(id)->SetAttributeValue(draco::AttributeValueIndex(i), values + i * width);
    }
  };
  add(Attribute::POSITION, 3, &grid.positions[0].x);
  add(Attribute::NORMAL, 3, &grid.normals[0].x);
  add(Attribute::TEX_COORD, 2, &grid.uvs[0].x);
  for (std::size_t i = 0; i < grid.indices.size(); i += 3) {
    mesh.AddFace({{draco::PointIndex(grid.indices[i]), draco::PointIndex(grid.indices[i + 1]),
                   draco::PointIndex(grid.indices[i + 2])}});
  }
  draco::Encoder encoder;
  encoder.SetSpeedOptions(choice.speed, choice.speed);
  encoder.SetEncodingMethod(choice.sequential ? draco::MESH_SEQUENTIAL_ENCODING
                                              : draco::MESH_EDGEBREAKER_ENCODING);
  encoder.SetAttributeQuantization(Attribute::POSITION, choice.position_bits);
  encoder.SetAttributeQuantization(Attribute::NORMAL, 8);
  encoder.SetAttributeQuantization(Attribute::TEX_COORD, 12);
  draco::EncoderBuffer buffer;
  if (!encoder.EncodeMeshToBuffer(mesh, &buffer).ok()) return "";
  return {buffer.data(), buffer.size()};
}

}  // namespace pounce::test
