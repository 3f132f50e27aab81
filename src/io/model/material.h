// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "io/model/write.h"
#include "pounce/options.h"

namespace pounce::io {

/// What a material shows in one channel from now on.
struct MaterialTexture {
  Channel channel = Channel::base_color;
  std::size_t texture = 0;                  ///< index into "textures"
  std::array<float, 4> factor{1, 1, 1, 1};  ///< as ModelTexture::factor
  ModelAlpha alpha = ModelAlpha::as_it_is;
};

/// The JSON of a glTF material with these textures, on this UV set without a texture transform; the
/// rest of it as it was.
///
/// KHR_materials_pbrSpecularGlossiness stands above the metallic-roughness values in viewers that
/// know it. With a new baseColor its diffuse texture becomes the same one, so that every viewer
/// shows it. With a new metallicRoughness, for which it has no place, it is removed; the diffuse
/// texture and factor become those of baseColor where that is not written and there was none.
std::string with_textures(std::string_view material, const std::vector<MaterialTexture>& textures,
                          std::uint32_t uv_set);

}  // namespace pounce::io
