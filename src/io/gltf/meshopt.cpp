// SPDX-License-Identifier: Apache-2.0
//
// EXT_meshopt_compression: buffer views that are packed one by one.
//
//   ATTRIBUTES   numbers of one vertex after the other, 4 to 256 bytes each; maybe with a filter
//   TRIANGLES    three indices for each triangle
//   INDICES      any other list of indices
//
// The view itself lies in a buffer that may have no bytes at all (a fallback for readers without
// the extension); its accessors are checked against it as if it had them.
//
// The library is made for untrusted input, but writes as many elements as it is told, and memory
// for them is there before the first one is decoded. So a count has to be possible for so many
// packed bytes: the codecs need a bit for each four bytes of vertices, and a byte for each triangle
// and for each index.
#include "io/gltf/meshopt.h"

#include <fmt/format.h>
#include <meshoptimizer.h>

#include <algorithm>
#include <array>
#include <stdexcept>
#include <string_view>
#include <utility>
#include <vector>

#include "io/gltf/gltf_file.h"
#include "io/problems.h"

namespace pounce::io {
namespace {

using Json = nlohmann::json;
using Mode = MeshoptView::Mode;
using Filter = MeshoptView::Filter;

constexpr std::array<std::string_view, 3> kModes{"ATTRIBUTES", "TRIANGLES", "INDICES"};
constexpr std::array<std::string_view, 4> kFilters{"NONE", "OCTAHEDRAL", "QUATERNION",
                                                   "EXPONENTIAL"};
constexpr std::uint64_t kMostBytes = std::uint64_t{1} << 53;
constexpr std::uint64_t kMostStride = 256;
/// Of vertices: two bits stand for 16 bytes, at least.
constexpr std::uint64_t kMostRatio = 64;

/// The place of a name in a list; its size where the name is another.
template <class Names>
std::size_t place_of(const Names& names, std::string_view name) {
  std::size_t at = 0;
  while (at < names.size() && names[at] != name) ++at;
  return at;
}

const Json* extension_of(const Json& view) {
  const auto extensions = view.find("extensions");
  if (extensions == view.end() || !extensions->is_object()) return nullptr;
  const auto found = extensions->find(kMeshopt);
  return found == extensions->end() ? nullptr : &*found;
}

/// The extension as it stands: its numbers fit what holds them, nothing else is known of them.
MeshoptView read(const Json& extension) {
  MeshoptView out;
  out.buffer = extension.at("buffer").get<std::size_t>();
  out.offset_bytes = extension.value("byteOffset", std::uint64_t{0});
  out.packed_bytes = extension.at("byteLength").get<std::uint64_t>();
  out.stride = extension.at("byteStride").get<std::uint64_t>();
  out.count = extension.at("count").get<std::uint64_t>();
  const auto& mode = extension.at("mode").get_ref<const std::string&>();
  out.mode = static_cast<Mode>(place_of(kModes, mode));
  const std::string filter = extension.value("filter", std::string("NONE"));
  out.filter = static_cast<Filter>(place_of(kFilters, filter));
  return out;
}

/// What is wrong with strides and filters; "" if nothing.
std::string shape_problem(const MeshoptView& view) {
  const bool is_whole_words = view.stride % 4 == 0;
  if (view.mode == Mode::attributes && !is_whole_words)
    return fmt::format("has byteStride {}, but ATTRIBUTES need a multiple of 4", view.stride);
  if (view.mode != Mode::attributes && view.stride != 2 && view.stride != 4)
    return fmt::format("has byteStride {}, but indices have 2 or 4 bytes", view.stride);
  if (view.mode == Mode::triangles && view.count % 3 != 0)
    return fmt::format("has {} indices, which are no whole triangles", view.count);
  if (view.filter == Filter::none) return "";
  if (view.mode != Mode::attributes) return "has a filter, which only ATTRIBUTES may have";
  const bool fits = view.filter == Filter::octahedral   ? view.stride == 4 || view.stride == 8
                    : view.filter == Filter::quaternion ? view.stride == 8
                                                        : is_whole_words;
  if (fits) return "";
  return fmt::format("has byteStride {}, which its filter does not allow", view.stride);
}

/// As many elements as so many packed bytes can stand for, rounded up.
std::uint64_t most_elements(const MeshoptView& view) {
  if (view.mode == Mode::attributes) return view.packed_bytes * kMostRatio / view.stride;
  return view.mode == Mode::triangles ? view.packed_bytes * 3 : view.packed_bytes;
}

}  // namespace

void check_meshopt(const JsonCheck& check, const Json& root, const Json& view,
                   const std::string& place) {
  const Json* extensions = check.object(view, "extensions", place);
  const std::string here = place + "." + kMeshopt;
  const Json* extension =
      extensions == nullptr ? nullptr : check.object(*extensions, kMeshopt, place);
  if (extension == nullptr) return;
  check.required_index(*extension, "buffer", here, "buffers");
  check.whole(*extension, "byteOffset", here, 0, kMostBytes, 0);
  check.required_whole(*extension, "byteLength", here, 1, kMostBytes);
  check.required_whole(*extension, "byteStride", here, 1, kMostStride);
  check.required_whole(*extension, "count", here, 1, kMostBytes / kMostStride);
  const std::string* mode = check.string(*extension, "mode", here);
  if (mode == nullptr || place_of(kModes, *mode) == kModes.size())
    check.fail(here + ".mode", "is none of ATTRIBUTES, TRIANGLES and INDICES");
  const std::string* filter = check.string(*extension, "filter", here);
  if (filter != nullptr && place_of(kFilters, *filter) == kFilters.size())
    check.fail(here + ".filter", "is none of NONE, OCTAHEDRAL, QUATERNION and EXPONENTIAL");
  const MeshoptView packed = read(*extension);
  if (const std::string problem = shape_problem(packed); !problem.empty())
    check.fail(here, problem);
  const auto size = root.at("buffers").at(packed.buffer).at("byteLength").get<std::uint64_t>();
  if (packed.offset_bytes > size || packed.packed_bytes > size - packed.offset_bytes) {
    check.fail(
        here, fmt::format("reaches beyond the end of buffers[{}] ({} bytes)", packed.buffer, size));
  }
  if (packed.count > most_elements(packed)) {
    check.fail(here, fmt::format("claims {} elements of {} bytes, more than {} packed bytes hold",
                                 packed.count, packed.stride, packed.packed_bytes));
  }
  const auto length = view.at("byteLength").get<std::uint64_t>();
  if (packed.bytes() != length || view.value("byteStride", packed.stride) != packed.stride) {
    check.fail(here, fmt::format("has {} elements of {} bytes, but its view has other sizes",
                                 packed.count, packed.stride));
  }
}

std::optional<MeshoptView> meshopt_view(const Json& view) {
  const Json* extension = extension_of(view);
  if (extension == nullptr) return std::nullopt;
  return read(*extension);
}

void unpack_meshopt(const MeshoptView& view, std::span<const std::byte> packed,
                    std::span<std::byte> out) {
  const auto* bytes = reinterpret_cast<const unsigned char*>(packed.data());
  int result = 0;
  switch (view.mode) {
    case Mode::attributes:
      result =
          meshopt_decodeVertexBuffer(out.data(), view.count, view.stride, bytes, packed.size());
      break;
    case Mode::triangles:
      result = meshopt_decodeIndexBuffer(out.data(), view.count, view.stride, bytes, packed.size());
      break;
    case Mode::indices:
      result =
          meshopt_decodeIndexSequence(out.data(), view.count, view.stride, bytes, packed.size());
      break;
  }
  if (result != 0) throw std::invalid_argument("cannot be unpacked");
  switch (view.filter) {
    case Filter::none:
      break;
    case Filter::octahedral:
      meshopt_decodeFilterOct(out.data(), view.count, view.stride);
      break;
    case Filter::quaternion:
      meshopt_decodeFilterQuat(out.data(), view.count, view.stride);
      break;
    case Filter::exponential:
      meshopt_decodeFilterExp(out.data(), view.count, view.stride);
      break;
  }
}

/// Each view can become no more than 64 times its packed bytes (check_meshopt()), but any number of
/// them may name the same bytes.
void GltfFile::measure_packed() {
  const auto views = document_.find("bufferViews");
  if (views == document_.end()) return;
  std::uint64_t most_packed = 0;
  const std::uint64_t limit = kExpandedBase + kExpandedPerByte * total_buffer_bytes();
  for (const auto& view : *views) {
    const auto packed = meshopt_view(view);
    if (!packed) continue;
    unpacking_bytes_ += packed->bytes();
    most_packed = std::max(most_packed, packed->packed_bytes);
    if (unpacking_bytes_ > limit) {
      refuse(path_,
             "its views packed with {} claim {} bytes or more, too many for a file of this "
             "size; export the model without compression",
             kMeshopt, unpacking_bytes_);
    }
  }
  unpacking_bytes_ += std::min(most_packed, total_buffer_bytes());
}

// Kept, because exporters put the attributes of all meshes into one view. A map's elements stay
// where they are, so what is handed out lives as long as the file.
std::span<const std::byte> GltfFile::unpacked(std::size_t view, const MeshoptView& packed) const {
  const std::lock_guard lock(unpacking_);
  const auto found = unpacked_.find(view);
  if (found != unpacked_.end()) return found->second;
  read_buffer(packed.buffer, packed.offset_bytes, {});  // a buffer without bytes says so here
  // What stays is allocated first: between such, what goes would leave holes.
  std::vector<std::byte> out(packed.bytes());
  std::vector<std::byte> bytes(packed.packed_bytes);
  read_buffer(packed.buffer, packed.offset_bytes, bytes);
  try {
    unpack_meshopt(packed, bytes, out);
  } catch (const std::invalid_argument& e) {
    refuse(path_,
           "bufferViews[{}] {}: its {} data are damaged; export the model again, or without "
           "compression",
           view, e.what(), kMeshopt);
  }
  return unpacked_[view] = std::move(out);
}

}  // namespace pounce::io
