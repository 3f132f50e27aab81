// SPDX-License-Identifier: Apache-2.0
#include "io/gltf/accessor.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <type_traits>

#include "pounce/error.h"

namespace pounce::io {
namespace {

constexpr std::uint64_t kPieceBytes = 1 << 20;

std::uint64_t component_count(int type) {
  return static_cast<std::uint64_t>(
      tinygltf::GetNumComponentsInType(static_cast<std::uint32_t>(type)));
}

std::uint64_t component_bytes(int component_type) {
  return static_cast<std::uint64_t>(
      tinygltf::GetComponentSizeInBytes(static_cast<std::uint32_t>(component_type)));
}

/// One stored component as a number. Integers become real by glTF's rule: c / max, and never below
/// -1.
template <class Stored, class Out>
Out convert(const std::byte* from, [[maybe_unused]] bool normalized) {
  Stored value;
  std::memcpy(&value, from, sizeof(Stored));
  if constexpr (std::is_floating_point_v<Out> && std::is_integral_v<Stored>) {
    if (normalized) {
      const double real =
          static_cast<double>(value) / static_cast<double>(std::numeric_limits<Stored>::max());
      return static_cast<Out>(std::max(real, -1.0));
    }
  }
  return static_cast<Out>(value);
}

template <class Stored, class Out>
void convert_elements(const std::byte* from, std::uint64_t stride, std::uint64_t count,
                      std::uint64_t components, bool normalized, Out* out) {
  for (std::uint64_t i = 0; i < count; ++i) {
    for (std::uint64_t c = 0; c < components; ++c) {
      *out++ = convert<Stored, Out>(from + i * stride + c * sizeof(Stored), normalized);
    }
  }
}

template <class Out>
void convert_any(int component_type, const std::byte* from, std::uint64_t stride,
                 std::uint64_t count, std::uint64_t components, bool normalized, Out* out) {
  const auto run = [&](auto stored) {
    convert_elements<decltype(stored)>(from, stride, count, components, normalized, out);
  };
  switch (component_type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
      return run(std::int8_t{});
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return run(std::uint8_t{});
    case TINYGLTF_COMPONENT_TYPE_SHORT:
      return run(std::int16_t{});
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return run(std::uint16_t{});
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
      return run(std::uint32_t{});
    default:
      return run(float{});
  }
}

}  // namespace

void AccessorReader::fail(int index, const std::string& place, const std::string& what) const {
  throw Error(ErrorKind::input, fmt::format("{}: {} (accessor {}) {}; export the model again",
                                            file_.path(), place, index, what));
}

void AccessorReader::check_unbacked(int index, std::uint64_t most, const std::string& place) const {
  const tinygltf::Accessor& a = accessor(index);
  if (a.bufferView < 0 && a.count > most) {
    fail(index, place, fmt::format("claims {} elements but has no bytes", a.count));
  }
}

template <class Out>
void AccessorReader::read(int index, Out* out, const std::string& place) const {
  const tinygltf::Accessor& a = accessor(index);
  if (a.bufferView < 0) {
    std::fill_n(out, a.count * component_count(a.type), Out{});
  } else {
    read_elements(a, 0, a.count, out);
  }
  if (a.sparse.isSparse) read_sparse(a, index, out, place);
}

template <class Out>
void AccessorReader::read_elements(const tinygltf::Accessor& a, std::uint64_t first,
                                   std::uint64_t count, Out* out) const {
  const std::uint64_t components = component_count(a.type);
  const std::uint64_t element = components * component_bytes(a.componentType);
  const std::uint64_t view_stride = model_.bufferViews.at(idx(a.bufferView)).byteStride;
  const std::uint64_t stride = view_stride == 0 ? element : view_stride;
  const std::uint64_t most = std::max<std::uint64_t>(1, kPieceBytes / stride);
  std::vector<std::byte> raw;
  for (std::uint64_t done = 0; done < count;) {
    const std::uint64_t piece = std::min(most, count - done);
    raw.resize((piece - 1) * stride + element);
    file_.read_view(idx(a.bufferView), a.byteOffset + (first + done) * stride, raw);
    convert_any(a.componentType, raw.data(), stride, piece, components, a.normalized,
                out + done * components);
    done += piece;
  }
}

void AccessorReader::read_range(int index, std::uint64_t first, std::uint64_t count,
                                float* out) const {
  read_elements(accessor(index), first, count, out);
}

template <class Out>
void AccessorReader::read_sparse(const tinygltf::Accessor& a, int index, Out* out,
                                 const std::string& place) const {
  const std::uint64_t components = component_count(a.type);
  const std::uint64_t element = components * component_bytes(a.componentType);
  const std::uint64_t index_bytes = component_bytes(a.sparse.indices.componentType);
  const auto total = static_cast<std::uint64_t>(a.sparse.count);
  const std::uint64_t piece = kPieceBytes / element;
  std::vector<std::byte> raw;
  std::vector<std::uint32_t> where;
  for (std::uint64_t first = 0; first < total; first += piece) {
    const std::uint64_t count = std::min(piece, total - first);
    raw.resize(count * index_bytes);
    where.resize(count);
    file_.read_view(idx(a.sparse.indices.bufferView),
                    static_cast<std::uint64_t>(a.sparse.indices.byteOffset) + first * index_bytes,
                    raw);
    convert_any(a.sparse.indices.componentType, raw.data(), index_bytes, count, 1, false,
                where.data());
    raw.resize(count * element);
    file_.read_view(idx(a.sparse.values.bufferView),
                    static_cast<std::uint64_t>(a.sparse.values.byteOffset) + first * element, raw);
    for (std::uint64_t i = 0; i < count; ++i) {
      if (where[i] >= a.count) {
        fail(index, place,
             fmt::format("has the sparse index {}, but only {} elements", where[i], a.count));
      }
      convert_any(a.componentType, raw.data() + i * element, element, 1, components, a.normalized,
                  out + where[i] * components);
    }
  }
}

void AccessorReader::read_floats(int index, float* out, const std::string& place,
                                 bool any_value) const {
  read(index, out, place);
  if (any_value) return;
  const std::uint64_t components = component_count(accessor(index).type);
  const std::uint64_t total = count(index) * components;
  for (std::uint64_t i = 0; i < total; ++i) {
    if (!std::isfinite(out[i])) {
      fail(index, place, fmt::format("element {} is not a finite number", i / components));
    }
  }
}

void AccessorReader::read_whole(int index, std::uint32_t* out, const std::string& place) const {
  read(index, out, place);
}

}  // namespace pounce::io
