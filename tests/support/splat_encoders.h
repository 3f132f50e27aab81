// SPDX-License-Identifier: Apache-2.0
//
// One small scene in every format that is read, written here from the formats' descriptions, so
// that readers are not tested against themselves. Harmonics of degree 1; everything within the
// range of each format.
#pragma once

#include <zlib.h>
#include <zstd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/portable_math.h"

namespace pounce::test {

struct SceneSplat {
  std::array<float, 3> mean, log_sigma, dc;
  std::array<float, 4> q;  ///< unit, w >= 0
  float alpha;
  std::array<float, 9> rest;  ///< 3 k + channel
};
using Scene = std::vector<SceneSplat>;

inline constexpr double kC0 = 0.28209479177387814;

inline Scene random_scene(std::size_t count, unsigned seed) {
  std::mt19937 random(seed);
  const auto between = [&](double low, double high) {
    return static_cast<float>(low + (high - low) * static_cast<double>(random()) / 4294967295.0);
  };
  Scene scene(count);
  for (SceneSplat& s : scene) {
    for (float& v : s.mean) v = between(-3, 3);
    for (float& v : s.log_sigma) v = between(-6, -2);
    for (float& v : s.dc) v = between(-1.5, 1.5);
    for (float& v : s.rest) v = between(-0.9, 0.9);
    s.alpha = between(0.1, 0.95);
    s.q = {between(0.5, 1), between(-1, 1), between(-1, 1), between(-1, 1)};
    float square = 0;
    for (const float v : s.q) square += v * v;
    for (float& v : s.q) v /= std::sqrt(square);
  }
  return scene;
}

template <class T>
void put(std::string& out, T value) {
  out.append(reinterpret_cast<const char*>(&value), sizeof value);
}
inline void put_byte(std::string& out, double value) {
  out.push_back(static_cast<char>(static_cast<int>(std::clamp(std::round(value), 0.0, 255.0))));
}
inline std::uint32_t bits_of(double unit, int bits) {
  const double most = (1U << bits) - 1;
  return static_cast<std::uint32_t>(std::clamp(std::round(unit * most), 0.0, most));
}
/// Index of the largest component and the others, made so that the largest is positive.
struct SmallestThree {
  std::size_t largest = 0;
  std::array<float, 3> rest{};
};
inline SmallestThree smallest_three(const std::array<float, 4>& q) {
  SmallestThree out;
  for (std::size_t k = 1; k < 4; ++k)
    if (std::abs(q[k]) > std::abs(q[out.largest])) out.largest = k;
  for (std::size_t k = 0, next = 0; k < 4; ++k)
    if (k != out.largest) out.rest[next++] = q[out.largest] < 0 ? -q[k] : q[k];
  return out;
}

/// `type` is that of all columns: float, double, or ushort for half floats.
inline std::string ply_bytes_of(const Scene& scene, const std::string& type) {
  std::string out =
      "ply\nformat binary_little_endian 1.0\nelement vertex " + std::to_string(scene.size()) + "\n";
  const auto column = [&](const std::string& name) {
    out += "property " + type + " " + name + "\n";
  };
  for (const char* name : {"x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2"}) column(name);
  for (int k = 0; k < 9; ++k) column("f_rest_" + std::to_string(k));
  for (const char* name :
       {"opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"})
    column(name);
  out += "end_header\n";
  const auto value = [&](float v) {
    type == "ushort"   ? put(out, float_to_half(v))
    : type == "double" ? put(out, static_cast<double>(v))
                       : put(out, v);
  };
  for (const SceneSplat& s : scene) {
    for (const float v : s.mean) value(v);
    for (const float v : s.dc) value(v);
    for (std::size_t c = 0; c < 3; ++c)
      for (std::size_t k = 0; k < 3; ++k) value(s.rest[3 * k + c]);
    value(std::log(s.alpha / (1 - s.alpha)));
    for (const float v : s.log_sigma) value(v);
    for (const float v : s.q) value(v);
  }
  return out;
}

inline std::string ply_bytes(const Scene& scene, bool halves) {
  return ply_bytes_of(scene, halves ? "ushort" : "float");
}

inline std::string compressed_ply_bytes(const Scene& scene) {
  const std::size_t chunks = (scene.size() + 255) / 256;
  const std::string count = std::to_string(scene.size());
  std::string out =
      "ply\nformat binary_little_endian 1.0\nelement chunk " + std::to_string(chunks) + "\n";
  for (const char* of : {"", "scale_"})
    for (const char* end : {"min_", "max_"})
      for (const char* axis : {"x", "y", "z"}) {
        out += std::string("property float ") + end + of + axis + "\n";
      }
  for (const char* end : {"min_", "max_"})
    for (const char* channel : {"r", "g", "b"})
      out += std::string("property float ") + end + channel + "\n";
  out += "element vertex " + count + "\n";
  for (const char* name : {"position", "rotation", "scale", "color"})
    out += std::string("property uint packed_") + name + "\n";
  out += "element sh " + count + "\n";
  for (int k = 0; k < 9; ++k) out += "property uchar f_rest_" + std::to_string(k) + "\n";
  out += "end_header\n";
  const auto values_of = [](const SceneSplat& s) {  // position, scale, colour
    std::array<float, 9> v;
    for (std::size_t k = 0; k < 3; ++k) {
      v[k] = s.mean[k];
      v[3 + k] = s.log_sigma[k];
      v[6 + k] = static_cast<float>(0.5 + kC0 * s.dc[k]);
    }
    return v;
  };
  std::string rows, harmonics;
  for (std::size_t first = 0; first < scene.size(); first += 256) {
    std::array<float, 9> low, high;
    low.fill(1e9F), high.fill(-1e9F);
    const std::size_t end = std::min(scene.size(), first + 256);
    for (std::size_t i = first; i < end; ++i) {
      const auto v = values_of(scene[i]);
      for (std::size_t k = 0; k < 9; ++k)
        low[k] = std::min(low[k], v[k]), high[k] = std::max(high[k], v[k]);
    }
    for (std::size_t k = 0; k < 9; k += 3) {
      for (std::size_t c = 0; c < 3; ++c) put(out, low[k + c]);
      for (std::size_t c = 0; c < 3; ++c) put(out, high[k + c]);
    }
    for (std::size_t i = first; i < end; ++i) {
      const SceneSplat& s = scene[i];
      const auto v = values_of(s);
      const auto unit = [&](std::size_t k) {
        return static_cast<double>(v[k] - low[k]) / static_cast<double>(high[k] - low[k]);
      };
      const auto three = [&](std::size_t k) {
        return bits_of(unit(k), 11) << 21 | bits_of(unit(k + 1), 10) << 11 |
               bits_of(unit(k + 2), 11);
      };
      const SmallestThree small = smallest_three(s.q);
      std::uint32_t rotation = static_cast<std::uint32_t>(small.largest) << 30;
      for (std::size_t k = 0; k < 3; ++k)
        rotation |= bits_of(small.rest[k] / std::sqrt(2.0) + 0.5, 10) << (20 - 10 * k);
      put(rows, three(0));
      put(rows, rotation);
      put(rows, three(3));
      put(rows, bits_of(unit(6), 8) << 24 | bits_of(unit(7), 8) << 16 | bits_of(unit(8), 8) << 8 |
                    bits_of(s.alpha, 8));
      for (std::size_t c = 0; c < 3; ++c)
        for (std::size_t k = 0; k < 3; ++k)
          put_byte(harmonics, std::floor((s.rest[3 * k + c] / 8 + 0.5) * 256));
    }
  }
  return out + rows + harmonics;
}

inline std::string dot_splat_bytes(const Scene& scene) {
  std::string out;
  for (const SceneSplat& s : scene) {
    for (const float v : s.mean) put(out, v);
    for (const float v : s.log_sigma) put(out, std::exp(v));
    for (const float v : s.dc) put_byte(out, (0.5 + kC0 * v) * 255);
    put_byte(out, s.alpha * 255);
    for (const float v : s.q) put_byte(out, v * 128 + 128);
  }
  return out;
}

inline std::string gzipped(const std::string& bytes) {
  z_stream stream{};
  if (deflateInit2(&stream, 6, Z_DEFLATED, MAX_WBITS + 16, 8, Z_DEFAULT_STRATEGY) != Z_OK)
    throw std::runtime_error("zlib");
  std::string out(deflateBound(&stream, bytes.size()), '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  deflate(&stream, Z_FINISH);
  out.resize(stream.total_out);
  deflateEnd(&stream);
  return out;
}

/// Versions 1 to 3 uncompressed, or 4; `extensions` are whole records.
inline std::string spz_bytes(const Scene& scene, std::uint32_t version,
                             const std::string& extensions = {}, unsigned flags = 0) {
  std::array<std::string, 6> blocks;
  for (const SceneSplat& s : scene) {
    for (const float v : s.mean) {
      if (version == 1) {
        put(blocks[0], float_to_half(v));
      } else {
        const auto fixed = static_cast<std::int32_t>(std::lround(v * 4096));
        for (int k = 0; k < 3; ++k) blocks[0].push_back(static_cast<char>(fixed >> 8 * k));
      }
    }
    put_byte(blocks[1], s.alpha * 255);
    for (const float v : s.dc) put_byte(blocks[2], (v * 0.15 + 0.5) * 255);
    for (const float v : s.log_sigma) put_byte(blocks[3], (v + 10) * 16);
    if (version < 3) {
      for (std::size_t k = 1; k < 4; ++k) put_byte(blocks[4], (s.q[k] + 1) * 127.5);
    } else {
      const std::array<float, 4> xyzw{s.q[1], s.q[2], s.q[3], s.q[0]};
      const SmallestThree small = smallest_three(xyzw);
      std::uint32_t rotation = static_cast<std::uint32_t>(small.largest) << 30;
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t magnitude = bits_of(std::abs(small.rest[k]) * std::sqrt(2.0), 9);
        rotation |= (magnitude | (small.rest[k] < 0 ? 512U : 0U)) << (20 - 10 * k);
      }
      put(blocks[4], rotation);
    }
    for (const float v : s.rest) put_byte(blocks[5], v * 128 + 128);
  }
  std::string out;
  put(out, std::uint32_t{0x5053474E});
  put(out, version);
  put(out, static_cast<std::uint32_t>(scene.size()));
  out.push_back(1);
  out.push_back(12);
  out.push_back(static_cast<char>(flags | (extensions.empty() ? 0U : 2U)));
  out.push_back(version == 4 ? 6 : 0);
  if (version < 4) {
    for (const std::string& block : blocks) out += block;
    return out + extensions;
  }
  put(out, static_cast<std::uint32_t>(32 + extensions.size()));
  out += std::string(12, '\0') + extensions;
  std::string frames;
  for (const std::string& block : blocks) {
    std::string frame(ZSTD_compressBound(block.size()), '\0');
    frame.resize(ZSTD_compress(frame.data(), frame.size(), block.data(), block.size(), 3));
    put(out, std::uint64_t{frame.size()});
    put(out, std::uint64_t{block.size()});
    frames += frame;
  }
  return out + frames;
}

/// One section; at levels 1 and 2 with full buckets of 256 and one that is not full.
inline std::string ksplat_bytes(const Scene& scene, unsigned level) {
  const std::uint32_t count = static_cast<std::uint32_t>(scene.size());
  const std::uint32_t full = level == 0 ? 0 : count / 256, rest = level == 0 ? 0 : count % 256;
  const std::uint32_t buckets = full + (rest > 0 ? 1 : 0);
  std::string out(4096 + 1024, '\0');
  const auto at = [&](std::size_t offset, auto value) {
    std::memcpy(&out[offset], &value, sizeof value);
  };
  out[1] = 1;
  at(4, std::uint32_t{1}), at(16, count), at(20, static_cast<std::uint16_t>(level));
  at(4096, count), at(4100, count), at(4104, std::uint32_t{256}), at(4108, buckets);
  at(4112, 8.0F), at(4116, std::uint16_t{12}), at(4128, full);
  at(4132, std::uint32_t{rest > 0 ? 1U : 0U}), at(4136, std::uint16_t{1});
  if (rest > 0) put(out, rest);
  for (std::uint32_t b = 0; b < buckets; ++b)
    for (int k = 0; k < 3; ++k) put(out, 0.25F * static_cast<float>(b));
  for (std::uint32_t i = 0; i < count; ++i) {
    const SceneSplat& s = scene[i];
    const float centre = 0.25F * static_cast<float>(i / 256);
    const auto number = [&](float v) { level == 0 ? put(out, v) : put(out, float_to_half(v)); };
    for (const float v : s.mean) {
      level == 0
          ? put(out, v)
          : put(out, static_cast<std::uint16_t>(std::lround((v - centre) / 4 * 32767 + 32767)));
    }
    for (const float v : s.log_sigma) number(std::exp(v));
    for (const float v : s.q) number(v);
    for (const float v : s.dc) put_byte(out, (0.5 + kC0 * v) * 255);
    put_byte(out, s.alpha * 255);
    for (std::size_t c = 0; c < 3; ++c) {
      for (std::size_t k = 0; k < 3; ++k) {
        const float v = s.rest[3 * k + c];
        level == 2 ? put_byte(out, (v + 1.5) / 3 * 255) : number(v);
      }
    }
  }
  return out;
}

inline std::string glb_bytes(const nlohmann::json& document, std::string bin) {
  std::string text = document.dump(), out = "glTF";
  text.resize((text.size() + 3) / 4 * 4, ' ');
  bin.resize((bin.size() + 3) / 4 * 4, '\0');
  put(out, std::uint32_t{2});
  put(out, static_cast<std::uint32_t>(28 + text.size() + bin.size()));
  put(out, static_cast<std::uint32_t>(text.size()));
  out += "JSON" + text;
  put(out, static_cast<std::uint32_t>(bin.size()));
  return out + std::string("BIN\0", 4) + bin;
}

/// A document of one node and one primitive of floats, and its buffer.
struct GltfScene {
  nlohmann::json document;
  std::string bin;
  std::string bytes() const { return glb_bytes(document, bin); }
  nlohmann::json& primitive() { return document["meshes"][0]["primitives"][0]; }

  void attribute(const std::string& name, const char* type, const std::vector<float>& values) {
    const std::size_t components = std::string(type) == "SCALAR" ? 1 : type[3] - '0';
    add_accessor(name, type, 5126, false, values.size() / components,
                 {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(float)});
  }
  void add_accessor(const std::string& name, const char* type, int component_type, bool normalized,
                    std::size_t count, const std::string& values) {
    document["bufferViews"].push_back(
        {{"buffer", 0}, {"byteOffset", bin.size()}, {"byteLength", values.size()}});
    document["accessors"].push_back({{"bufferView", document["bufferViews"].size() - 1},
                                     {"componentType", component_type},
                                     {"normalized", normalized},
                                     {"count", count},
                                     {"type", type}});
    primitive()["attributes"][name] = document["accessors"].size() - 1;
    bin += values;
    bin.resize((bin.size() + 3) / 4 * 4, '\0');
    document["buffers"][0]["byteLength"] = bin.size();
  }
};

inline GltfScene gltf_scene(const Scene& scene) {
  GltfScene out;
  out.document = {{"asset", {{"version", "2.0"}}},
                  {"scenes", {{{"nodes", {0}}}}},
                  {"nodes", {{{"mesh", 0}}}},
                  {"extensionsUsed", {"KHR_gaussian_splatting"}}};
  out.primitive() = {{"mode", 0},
                     {"extensions",
                      {{"KHR_gaussian_splatting",
                        {{"kernel", "ellipse"}, {"colorSpace", "srgb_rec709_display"}}}}}};
  std::vector<float> mean, rotation, scale, opacity, dc;
  std::array<std::vector<float>, 3> rest;
  for (const SceneSplat& s : scene) {
    mean.insert(mean.end(), s.mean.begin(), s.mean.end());
    rotation.insert(rotation.end(), {s.q[1], s.q[2], s.q[3], s.q[0]});
    for (const float v : s.log_sigma) scale.push_back(std::exp(v));
    opacity.push_back(s.alpha);
    dc.insert(dc.end(), s.dc.begin(), s.dc.end());
    for (std::size_t k = 0; k < 3; ++k)
      rest[k].insert(rest[k].end(), s.rest.begin() + 3 * static_cast<std::ptrdiff_t>(k),
                     s.rest.begin() + 3 * static_cast<std::ptrdiff_t>(k) + 3);
  }
  const std::string prefix = "KHR_gaussian_splatting:";
  out.attribute("POSITION", "VEC3", mean);
  out.attribute(prefix + "ROTATION", "VEC4", rotation);
  out.attribute(prefix + "SCALE", "VEC3", scale);
  out.attribute(prefix + "OPACITY", "SCALAR", opacity);
  out.attribute(prefix + "SH_DEGREE_0_COEF_0", "VEC3", dc);
  for (std::size_t k = 0; k < 3; ++k)
    out.attribute(prefix + "SH_DEGREE_1_COEF_" + std::to_string(k), "VEC3", rest[k]);
  return out;
}

/// Lossless WebP without any transform: 8 bits for each byte of each pixel.
inline std::string webp_bytes(std::uint32_t width, std::uint32_t height,
                              const std::vector<std::uint8_t>& rgba) {
  std::string bits;
  std::size_t used = 0;
  const auto write = [&](std::uint32_t value, int count) {
    for (int k = 0; k < count; ++k, ++used) {
      if (used % 8 == 0) bits.push_back('\0');
      if ((value >> k & 1) != 0) bits.back() = static_cast<char>(bits.back() | 1 << used % 8);
    }
  };
  write(0x2F, 8), write(width - 1, 14), write(height - 1, 14), write(1, 1), write(0, 3);
  write(0, 3);  // no transform, no cache of colours, one group of codes
  for (int code = 0; code < 4; ++code) {
    write(0, 1), write(8, 4);                              // 12 lengths of length codes, of which
    for (int k = 0; k < 11; ++k) write(0, 3);              // only the length 8 occurs
    write(1, 3), write(1, 1), write(3, 3), write(254, 8);  // 256 times
  }
  write(1, 1), write(0, 3);  // distances: a single one
  const auto symbol = [&](std::uint8_t value) {
    for (int k = 7; k >= 0; --k) write(value >> k & 1, 1);
  };
  for (std::size_t i = 0; i < rgba.size(); i += 4)
    for (const std::size_t channel : {1U, 0U, 2U, 3U}) symbol(rgba[i + channel]);
  if (bits.size() % 2 != 0) bits.push_back('\0');
  std::string out = "RIFF";
  put(out, static_cast<std::uint32_t>(bits.size() + 12));
  out += "WEBPVP8L";
  put(out, static_cast<std::uint32_t>(bits.size()));
  return out + bits;
}

/// A folder of SOG, version 1 or 2.
inline void write_sog(const Scene& scene, const std::filesystem::path& folder,
                      unsigned version = 2) {
  const std::size_t width = (static_cast<std::size_t>(std::sqrt(scene.size())) / 4 + 1) * 4;
  const std::size_t height = (scene.size() + width - 1) / width;
  using Pixels = std::vector<std::uint8_t>;
  const Pixels empty(4 * width * height, 0);
  Pixels low = empty, high = empty, scales = empty, quats = empty, sh0 = empty, labels = empty;
  const std::size_t palette_rows = (scene.size() + 63) / 64;
  Pixels centroids(4 * 64 * 3 * palette_rows, 0);
  const auto byte = [](double v) {
    return static_cast<std::uint8_t>(std::clamp(std::lround(v), 0L, 255L));
  };
  nlohmann::json scale_book, colour_book, harmonic_book;
  for (int b = 0; b < 256; ++b) {
    scale_book.push_back(-6.0 + 4.0 * b / 255);
    colour_book.push_back(-1.5 + 3.0 * b / 255);
    harmonic_book.push_back(-1.0 + 2.0 * b / 255);
  }
  const double reach = std::log(4.0);  // means within 3
  for (std::size_t i = 0; i < scene.size(); ++i) {
    const SceneSplat& s = scene[i];
    for (std::size_t k = 0; k < 3; ++k) {
      const double t = std::copysign(std::log(std::abs(double{s.mean[k]}) + 1), s.mean[k]);
      const auto v = static_cast<std::uint32_t>(std::lround((t + reach) / (2 * reach) * 65535));
      low[4 * i + k] = static_cast<std::uint8_t>(v);
      high[4 * i + k] = static_cast<std::uint8_t>(v >> 8);
      scales[4 * i + k] = byte((s.log_sigma[k] + 6) / 4 * 255);
      sh0[4 * i + k] = byte((s.dc[k] + 1.5) / 3 * 255);
    }
    low[4 * i + 3] = high[4 * i + 3] = scales[4 * i + 3] = 255;
    const double logit = std::log(s.alpha / (1 - s.alpha));
    sh0[4 * i + 3] = byte(version == 1 ? (logit + 4) / 8 * 255 : s.alpha * 255);
    const SmallestThree small = smallest_three(s.q);
    for (std::size_t k = 0; k < 3; ++k)
      quats[4 * i + k] = byte((small.rest[k] * std::sqrt(2.0) + 1) / 2 * 255);
    quats[4 * i + 3] = static_cast<std::uint8_t>(252 + small.largest);
    labels[4 * i] = static_cast<std::uint8_t>(i);
    labels[4 * i + 1] = static_cast<std::uint8_t>(i >> 8);
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t pixel = i / 64 * 64 * 3 + i % 64 * 3 + k;
      for (std::size_t c = 0; c < 3; ++c)
        centroids[4 * pixel + c] = byte((s.rest[3 * k + c] + 1) / 2 * 255);
    }
  }
  const auto image = [&](const char* name, std::size_t w, std::size_t h, const Pixels& pixels) {
    std::ofstream(folder / name, std::ios::binary)
        << webp_bytes(static_cast<std::uint32_t>(w), static_cast<std::uint32_t>(h), pixels);
  };
  std::filesystem::create_directories(folder);
  image("low.webp", width, height, low);
  image("high.webp", width, height, high);
  image("scales.webp", width, height, scales);
  image("quats.webp", width, height, quats);
  image("sh0.webp", width, height, sh0);
  image("labels.webp", width, height, labels);
  image("centroids.webp", 64 * 3, palette_rows, centroids);
  nlohmann::json meta{{"version", 2},
                      {"count", scene.size()},
                      {"means",
                       {{"mins", {-reach, -reach, -reach}},
                        {"maxs", {reach, reach, reach}},
                        {"files", {"low.webp", "high.webp"}}}},
                      {"scales", {{"codebook", scale_book}, {"files", {"scales.webp"}}}},
                      {"quats", {{"files", {"quats.webp"}}}},
                      {"sh0", {{"codebook", colour_book}, {"files", {"sh0.webp"}}}},
                      {"shN",
                       {{"count", scene.size()},
                        {"bands", 1},
                        {"codebook", harmonic_book},
                        {"files", {"centroids.webp", "labels.webp"}}}}};
  if (version == 1) {  // equal steps between two ends in place of codebooks
    meta.erase("version"), meta.erase("count");
    meta["means"]["shape"] = {scene.size(), 3};
    const auto ends = [&](const char* part, const nlohmann::json& least,
                          const nlohmann::json& most) {
      meta[part].erase("codebook");
      meta[part]["mins"] = least, meta[part]["maxs"] = most;
    };
    ends("scales", {-6, -6, -6}, {-2, -2, -2});
    ends("sh0", {-1.5, -1.5, -1.5, -4}, {1.5, 1.5, 1.5, 4});
    ends("shN", -1, 1);
    meta["shN"].erase("count"), meta["shN"].erase("bands");
  }
  std::ofstream(folder / "meta.json") << meta;
}

}  // namespace pounce::test
