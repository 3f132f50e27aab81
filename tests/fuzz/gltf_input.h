// SPDX-License-Identifier: Apache-2.0
//
// What the glTF targets take as input: a GLB as it stands; or JSON, as a .gltf has it; or JSON, a
// line "%%" and the bytes of a BIN chunk, of which a GLB with right lengths is made. Most
// mutations know that JSON is a tree, or leave it as it is and change the bytes behind it. To be
// included by one file of a program.
#pragma once

#include <array>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <vector>

#include "fuzz/fuzz_support.h"

namespace pounce::fuzz {

using Json = nlohmann::json;
using Random = std::minstd_rand;

inline void append_u32(std::string& out, std::size_t value) {
  for (int i = 0; i < 4; ++i) out.push_back(static_cast<char>(value >> 8 * i));
}

inline std::string file_bytes(std::string_view input) {
  const Parts parts = split(input);
  if (!parts.has_second || input.starts_with("glTF")) return std::string(input);
  std::string text(parts.first), bin(parts.second), out = "glTF";
  text.resize((text.size() + 3) / 4 * 4, ' ');
  bin.resize((bin.size() + 3) / 4 * 4, '\0');
  append_u32(out, 2);
  append_u32(out, 12 + 8 + text.size() + 8 + bin.size());
  append_u32(out, text.size());
  out += "JSON" + text;
  append_u32(out, bin.size());
  return out + std::string("BIN\0", 4) + bin;
}

// clang-format off
inline constexpr const char* kWords[] = {
    "POSITION", "NORMAL", "TANGENT", "TEXCOORD_0", "TEXCOORD_1", "COLOR_0", "JOINTS_0",
    "WEIGHTS_0", "indices", "attributes", "targets", "weights", "mode", "material", "mesh",
    "skin", "children", "matrix", "translation", "rotation", "scale", "scene", "nodes",
    "joints", "skeleton", "sparse", "count", "values", "normalized", "byteOffset", "byteLength",
    "byteStride", "buffer", "bufferView", "inverseBindMatrices", "uri", "mimeType", "source",
    "sampler", "wrapS", "texCoord", "extensions", "extras", "name", "index", "componentType",
    "type", "SCALAR", "VEC2", "VEC3", "VEC4", "MAT4", "m.bin", "KHR_texture_transform",
    "KHR_mesh_quantization", "KHR_materials_unlit", "KHR_draco_mesh_compression",
    "EXT_texture_webp", "extensionsRequired", "extensionsUsed", "offset", "data:,",
    "data:a/b;base64,AAAA"};
// clang-format on
inline constexpr std::array<double, 26> kNumbers{
    -1,    0,     1,     2,          3,          4,          5,    6,     16,
    255,   256,   5120,  5121,       5123,       5125,       5126, 0.5,   1e-9,
    1e300, -1e39, 65535, 2147483647, 4294967295, 4294967296, 1e18, 1e-320};

template <class List>
auto pick(const List& list, Random& random) {
  return list[random() % std::size(list)];
}

/// Every value of a document.
inline std::vector<Json*> all_of(Json& document) {
  std::vector<Json*> all{&document};
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (!all[i]->is_structured()) continue;
    for (Json& child : *all[i]) all.push_back(&child);
  }
  return all;
}

inline Json number(Random& random) {
  const double value = pick(kNumbers, random);
  if (std::abs(value) > 1e18 || value != std::floor(value)) return value;
  return static_cast<std::int64_t>(value);
}

inline void mutate(Json& document, Random& random) {
  const std::vector<Json*> all = all_of(document);
  Json& value = *pick(all, random);
  const Json other = *pick(all, random);  // a copy: it may be inside the value
  switch (random() % 8) {
    case 0:
      value = number(random);
      break;
    case 1:
      value = other;
      break;
    case 2:
      if (!value.empty() && value.is_structured())
        value.erase(std::next(value.begin(), static_cast<std::ptrdiff_t>(random() % value.size())));
      break;
    case 3:
      if (value.is_array()) value.push_back(value.empty() ? other : pick(value, random));
      break;
    case 4:
      if (value.is_object()) value[pick(kWords, random)] = other;
      break;
    case 5:  // an off-by-one, mostly
      if (value.is_number_integer())
        value = value.get<std::int64_t>() / (random() % 4 == 0 ? 2 : 1) +
                static_cast<std::int64_t>(random() % 5) - 2;
      break;
    case 6:
      if (value.is_object()) value[pick(kWords, random)] = number(random);
      break;
    default:
      if (value.is_string()) value = pick(kWords, random);
  }
}

}  // namespace pounce::fuzz

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t max_size);

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size,
                                               std::size_t max_size, unsigned seed) {
  using namespace pounce::fuzz;
  Random random(seed);
  const Parts parts = split(text_of(data, size));
  const unsigned how = static_cast<unsigned>(random() % 4);
  if (how == 0 || parts.first.starts_with("glTF")) return LLVMFuzzerMutate(data, size, max_size);
  if (how == 1 && !parts.second.empty()) {
    const std::size_t before = size - parts.second.size();
    if (random() % 2 == 0) {  // a small number, as indices are
      data[before + random() % parts.second.size()] = static_cast<std::uint8_t>(random() % 9);
      return size;
    }
    return before + LLVMFuzzerMutate(data + before, parts.second.size(), max_size - before);
  }
  Json document = Json::parse(parts.first, nullptr, false);
  if (document.is_discarded()) return LLVMFuzzerMutate(data, size, max_size);
  for (unsigned n = 1 + random() % 3; n > 0; --n) mutate(document, random);
  std::string out = document.dump(-1, ' ', false, Json::error_handler_t::replace);
  if (parts.has_second) out.append("\n%%\n").append(parts.second);
  if (out.size() > max_size) return LLVMFuzzerMutate(data, size, max_size);
  std::memcpy(data, out.data(), out.size());
  return out.size();
}
