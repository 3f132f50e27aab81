// SPDX-License-Identifier: Apache-2.0
#include "sorting/block_encoder.h"

#include <bit>
#include <type_traits>

#include "gaussian/point_discs.h"
#include "gaussian/splat_statistics.h"

namespace pounce::sorting {
namespace {

using store::kMostSplatsPerBlock;
using store::SplatBlock;

/// So many blocks are asked for their noise, or up to twice as many.
constexpr std::uint32_t kNoiseBlocksLog2 = 5;

std::uint32_t noise_step_log2(std::uint64_t ordinal) {
  const auto bits = static_cast<std::uint32_t>(std::bit_width(ordinal));
  return bits > kNoiseBlocksLog2 + 1 ? bits - kNoiseBlocksLog2 - 1 : 0;
}
bool asked_for_noise(std::uint64_t ordinal, std::uint32_t step_log2) {
  return (ordinal & ((1ULL << step_log2) - 1)) == 0;
}

// A vector of them that grows moves them: a copy would lose the room that they have.
static_assert(std::is_nothrow_move_constructible_v<EncodedBlock>);

}  // namespace

EncodedBlock::EncodedBlock(std::uint32_t lobes) : lobes_(lobes) {
  // Vectors that grow hold what they had beside what they get.
  raw.reserve(SplatBlock::decoded_bytes(kMostSplatsPerBlock, true, lobes));
  stored.reserve(raw.capacity() + raw.capacity() / 64);
}

std::uint64_t EncodedBlock::most_bytes(std::uint32_t lobes) {
  constexpr std::uint64_t kScratch = 128 << 10;  // a column, what is asked about noise, rounding
  return round_to_pages(kMostSplatsPerBlock * sizeof(store::Splat)) +
         round_to_pages(kMostSplatsPerBlock * store::lobe_bytes(lobes)) +
         3 * SplatBlock::decoded_bytes(kMostSplatsPerBlock, true, lobes) + kScratch;
}

void EncodedBlock::encode(job::JobContext& job, const Shaping& shaping) {
  if (shaping.are_points) gaussian::make_discs(cut.splats);
  if (shaping.fades) gaussian::fade_isolated(cut.splats);
  entry = {};
  entry.splats = static_cast<std::uint32_t>(cut.splats.size());
  entry.size_class = static_cast<std::uint32_t>(store::SplatLattice::key_size_class(cut.first_key));
  for (const store::Splat& s : cut.splats) entry.box.extend(store::splat_box(s));
  block.assign(cut.splats, lobes_, cut.sh);
  store(job);
  noise.clear();
  sizes.clear();
  if (!asked_for_noise(cut.ordinal, noise_step_log2(cut.ordinal))) return;
  gaussian::append_surface_noise(block, noise);
  if (shaping.are_points) sizes.push_back(gaussian::median_size(cut.splats));
}

void EncodedBlock::store(job::JobContext& job) {
  store::PlainRoom* const room = job.stores_room();
  // Most blocks of a large scene come when there is none left.
  if (room != nullptr && *room >= SplatBlock::decoded_bytes(block.size(), true, lobes_)) {
    store::encode(block, raw, store::SplatBytes::plain);
    if (store::Compressor::keep_as_is(raw, stored, room)) return;
  }
  store::encode(block, raw);
  job.compressor().compress(raw, stored,
                            job.stores->persistent() ? store::kZstdLevel : store::kFastLevel);
}

void BlockEstimate::add(std::uint64_t ordinal, const std::vector<float>& figures) {
  if (!figures.empty()) asked_.emplace_back(ordinal, figures);
}

float BlockEstimate::median(std::uint64_t blocks) const {
  std::vector<float> figures;
  for (const auto& [ordinal, of_block] : asked_) {
    if (asked_for_noise(ordinal, noise_step_log2(blocks - 1)))
      figures.insert(figures.end(), of_block.begin(), of_block.end());
  }
  return gaussian::median(figures);
}

}  // namespace pounce::sorting
