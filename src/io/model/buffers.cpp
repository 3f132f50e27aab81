// SPDX-License-Identifier: Apache-2.0
#include "io/model/buffers.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "pounce/error.h"

namespace pounce::io {
namespace {

// No component of an accessor is larger than 4 bytes; extensions may want more.
constexpr std::uint64_t kAlignment = 16;

/// The byte ranges of the views of one buffer, to ask whether one meets any.
class Ranges {
 public:
  void add(std::uint64_t begin, std::uint64_t size) {
    if (size > 0) ranges_.emplace_back(begin, begin + size);
  }
  void close() {
    std::sort(ranges_.begin(), ranges_.end());
    std::uint64_t end = 0;
    for (auto& range : ranges_) range.second = end = std::max(end, range.second);
  }
  bool meets(std::uint64_t begin, std::uint64_t end) const {
    const auto after =
        std::lower_bound(ranges_.begin(), ranges_.end(), std::pair(end, std::uint64_t{0}));
    return after != ranges_.begin() && (after - 1)->second > begin;
  }

 private:
  std::vector<std::pair<std::uint64_t, std::uint64_t>> ranges_;
};

}  // namespace

void ModelBuffer::append(const ModelPiece& piece) {
  if (piece.size_bytes == 0) return;
  pieces.push_back(piece);
  size_bytes += piece.size_bytes;
}

void ModelBuffer::align(std::uint64_t alignment) {
  append({nullptr, nullptr, 0, (alignment - size_bytes % alignment) % alignment});
}

ModelBuffers::ModelBuffers(const GltfFile& target, const ModelSlots& slots,
                           const std::string& output)
    : target_(target), origins_(target.buffers().size()) {
  const bool is_glb = is_glb_path(output);
  const auto is_data_uri = [&](std::size_t b) { return target.buffers()[b].bytes != nullptr; };
  const auto has_data = [&](std::size_t b) {
    const GltfBuffer& buffer = target.buffers()[b];
    if (buffer.problem.empty()) return true;
    const nlohmann::json& entry = target.document().at("buffers").at(b);
    if (!entry.contains("uri") && buffer.bytes == nullptr && buffer.file == nullptr) return false;
    throw Error(ErrorKind::input,
                fmt::format("{}: buffer {} {}; a copy would not be whole: put the missing data "
                            "back or export the model again",
                            target.path(), b, buffer.problem));
  };
  find_holes(slots);
  if (is_glb) buffers_.emplace_back().is_new = true;
  for (std::size_t b = 0; b < origins_.size(); ++b) {
    if (!has_data(b) || (!is_glb && is_data_uri(b))) {
      add_kept(b);
      continue;
    }
    if (!is_glb) {
      const std::filesystem::path stem = std::filesystem::path(output).replace_extension();
      buffers_.emplace_back().origin = b;
      buffers_.back().path = stem.string() + (b == 0 ? ".bin" : fmt::format(".{}.bin", b));
    } else if (buffers_.front().is_new) {
      buffers_.front().is_new = false;
      buffers_.front().origin = b;
    }
    add_pieces(b, is_glb ? buffers_.front() : buffers_.back());
  }
}

/// Which bytes of the freed views are nobody's.
void ModelBuffers::find_holes(const ModelSlots& slots) {
  const auto views = target_.document().find("bufferViews");
  if (views == target_.document().end()) return;
  std::vector<Ranges> live(origins_.size());
  for (std::size_t v = 0; v < views->size(); ++v) {
    const nlohmann::json& view = (*views)[v];
    if (view.contains("extensions")) return;  // who knows what else it reads
    if (std::binary_search(slots.free_views.begin(), slots.free_views.end(), v)) continue;
    live[view.at("buffer").get<std::size_t>()].add(view.value("byteOffset", std::uint64_t{0}),
                                                   view.at("byteLength").get<std::uint64_t>());
  }
  for (Ranges& ranges : live) ranges.close();
  for (const std::size_t v : slots.free_views) {
    const nlohmann::json& view = views->at(v);
    const auto buffer = view.at("buffer").get<std::size_t>();
    const std::uint64_t begin = view.value("byteOffset", std::uint64_t{0});
    const auto size = view.at("byteLength").get<std::uint64_t>();
    const std::uint64_t gone = size / kAlignment * kAlignment;
    if (gone == 0 || live[buffer].meets(begin, begin + size)) continue;
    emptied_[v] = true;
    origins_[buffer].holes.push_back({begin, gone});
  }
  for (Origin& origin : origins_) {
    auto& holes = origin.holes;
    std::sort(holes.begin(), holes.end(),
              [](const Hole& a, const Hole& b) { return a.begin < b.begin; });
    // Freed views may overlap: each leaves out what those before it have not.
    std::uint64_t end = 0;
    for (Hole& hole : holes) {
      const std::uint64_t skip = hole.begin < end ? end - hole.begin : 0;
      const std::uint64_t stepped = (skip + kAlignment - 1) / kAlignment * kAlignment;
      const std::uint64_t used = std::min(stepped, hole.size);
      hole = {hole.begin + used, hole.size - used};
      end = std::max(end, hole.begin + hole.size);
    }
  }
}

void ModelBuffers::add_kept(std::size_t index) {
  origins_[index].holes.clear();
  origins_[index].buffer = buffers_.size();
  ModelBuffer& kept = buffers_.emplace_back();
  kept.origin = index;
  kept.is_kept = true;
  kept.size_bytes = target_.buffers()[index].size_bytes;
}

void ModelBuffers::add_pieces(std::size_t index, ModelBuffer& to) {
  const GltfBuffer& from = target_.buffers()[index];
  Origin& origin = origins_[index];
  if (!from.path.empty()) inputs_.push_back(from.path);
  to.align(kAlignment);
  origin.buffer = static_cast<std::size_t>(&to - buffers_.data());
  origin.base = to.size_bytes;
  std::uint64_t copied = 0;
  const auto copy_to = [&](std::uint64_t end) {
    to.append({from.file, from.bytes, from.offset_bytes + copied, end - copied});
  };
  for (const Hole& hole : origin.holes) {
    copy_to(hole.begin);
    copied = hole.begin + hole.size;
  }
  copy_to(from.size_bytes);
  // A buffer of no bytes is not allowed.
  if (to.size_bytes == 0) to.append({nullptr, nullptr, 0, kAlignment});
}

ViewPlace ModelBuffers::moved(std::size_t buffer, std::uint64_t offset, std::uint64_t size) const {
  const Origin& origin = origins_.at(buffer);
  std::uint64_t gone = 0;
  for (const Hole& hole : origin.holes) {
    if (hole.begin >= offset) break;
    gone += std::min(hole.size, offset - hole.begin);
  }
  return {origin.buffer, origin.base + offset - gone, size};
}

ViewPlace ModelBuffers::view(std::size_t index) const {
  const nlohmann::json& view = target_.document().at("bufferViews").at(index);
  const auto buffer = view.at("buffer").get<std::size_t>();
  const std::uint64_t offset = view.value("byteOffset", std::uint64_t{0});
  const auto size = view.at("byteLength").get<std::uint64_t>();
  const bool kept = buffers_[origins_[buffer].buffer].is_kept;
  if (!kept && emptied_.contains(index)) return {origins_[buffer].buffer, 0, 1};
  return moved(buffer, offset, size);
}

ViewPlace ModelBuffers::append(const ModelPiece& piece) {
  ModelBuffer& bin = buffers_.front();
  bin.align(4);
  const ViewPlace place{0, bin.size_bytes, piece.size_bytes};
  bin.append(piece);
  return place;
}

}  // namespace pounce::io
