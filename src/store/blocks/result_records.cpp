// SPDX-License-Identifier: Apache-2.0
//
// A record says what a run that died had made, and is believed as little as a file from elsewhere:
// all that it states is held against what can be, before memory is taken for it.
#include "store/blocks/result_records.h"

#include <algorithm>
#include <utility>

#include "core/bytes.h"
#include "pounce/error.h"
#include "store/blocks/geometry_block.h"

namespace pounce::store {
namespace {

std::uint32_t blocks_across(std::uint32_t texels) {
  return (texels + mesh::kBlockEdge - 1) / mesh::kBlockEdge;
}

void add_to(std::vector<std::uint64_t>& sums, const std::vector<std::uint64_t>& more) {
  sums.resize(std::max(sums.size(), more.size()));
  for (std::size_t i = 0; i < more.size(); ++i) sums[i] += more[i];
}

bool names_twice(const ResultRecord& record) {
  std::vector<std::pair<std::int32_t, std::int32_t>> places;
  for (const ResultRecord::Block& block : record.blocks) places.emplace_back(block.x, block.y);
  std::sort(places.begin(), places.end());
  return std::adjacent_find(places.begin(), places.end()) != places.end();
}

}  // namespace

void ResultCounts::add(const ResultCounts& more) {
  add_to(covered, more.covered);
  add_to(clipped, more.clipped);
  for (std::size_t i = 0; i < kDistanceBins; ++i) distances[i] += more.distances[i];
  distance_steps += more.distance_steps;
}

ResultGrid::ResultGrid(const mesh::Lattice& page, std::size_t of_channels)
    : across(blocks_across(page.width)), down(blocks_across(page.height)), channels(of_channels) {}

std::uint64_t ResultRecord::texels() const {
  std::uint64_t sum = 0;
  for (const Block& block : blocks) sum += block.texels;
  return sum;
}

std::size_t ResultRecord::chunks() const {
  std::size_t sum = 0;
  for (const Block& block : blocks)
    sum +=
        static_cast<std::size_t>(std::count(block.has_chunk.begin(), block.has_chunk.end(), true));
  return sum;
}

void encode(const ResultRecord& record, std::vector<std::byte>& bytes) {
  bytes.clear();
  ByteWriter out(bytes);
  out.put(static_cast<std::uint32_t>(record.blocks.size()));
  for (const ResultRecord::Block& block : record.blocks) {
    out.put_all(static_cast<std::uint32_t>(block.x), static_cast<std::uint32_t>(block.y),
                block.texels);
    for (const bool has : block.has_chunk) out.put(static_cast<std::uint8_t>(has ? 1 : 0));
  }
  const ResultCounts& counts = record.counts;
  out.put_span(std::span(counts.covered));
  out.put_span(std::span(counts.clipped));
  out.put_span(std::span<const std::uint64_t>(counts.distances));
  out.put_all(counts.distance_steps, record.page_texels, record.worked_ms);
}

std::optional<ResultRecord> decode_record(std::span<const std::byte> bytes,
                                          const ResultGrid& grid) {
  try {
    ByteReader in(bytes, "a record of results");
    ResultRecord record;
    const auto count = in.get<std::uint32_t>();
    if (count > grid.blocks()) return std::nullopt;
    for (std::uint32_t b = 0; b < count; ++b) {
      ResultRecord::Block& block = record.blocks.emplace_back();
      const auto x = in.get<std::uint32_t>(), y = in.get<std::uint32_t>();
      block.texels = in.get<std::uint32_t>();
      if (x >= grid.across || y >= grid.down || block.texels > kTexelsPerBlock) return std::nullopt;
      block.x = static_cast<std::int32_t>(x);
      block.y = static_cast<std::int32_t>(y);
      for (std::size_t c = 0; c < grid.channels; ++c)
        block.has_chunk.push_back(in.get<std::uint8_t>() != 0);
    }
    ResultCounts& counts = record.counts;
    counts.covered.resize(grid.channels);
    counts.clipped.resize(grid.channels);
    in.get_span(std::span(counts.covered));
    in.get_span(std::span(counts.clipped));
    in.get_span(std::span<std::uint64_t>(counts.distances));
    in.get_all(counts.distance_steps, record.page_texels, record.worked_ms);
    if (in.left() != 0 || names_twice(record)) return std::nullopt;
    return record;
  } catch (const Error& e) {
    if (e.kind() != ErrorKind::damaged_store) throw;
    return std::nullopt;
  }
}

void encode(const EncodedRows& rows, std::vector<std::byte>& bytes) {
  bytes.clear();
  ByteWriter(bytes).put_all(rows.image, rows.block, rows.rows.hi, rows.rows.lo);
}

std::optional<EncodedRows> decode_encoded_rows(std::span<const std::byte> bytes) {
  if (bytes.size() < kEncodedRowsBytes) return std::nullopt;
  ByteReader in(bytes, "encoded rows");
  EncodedRows rows;
  in.get_all(rows.image, rows.block, rows.rows.hi, rows.rows.lo);
  return rows;
}

std::optional<HalfDone> half_done(const ReadFile& pack, const Hash128& key,
                                  const ResultGrid& grid) {
  HalfDone done;
  scan_pack(
      pack, PackKind::results, key,
      [&](ChunkKind kind, const ChunkRef&, std::span<const std::byte> stored, const PackScan&) {
        if (kind != ChunkKind::record) return true;
        const auto record = decode_record(stored, grid);
        if (!record) return false;
        done.blocks += record->blocks.size();
        done.texels += record->texels();
        done.of_texels = record->page_texels;
        done.worked_s = static_cast<double>(record->worked_ms) / 1000;
        return true;
      });
  if (done.blocks == 0) return std::nullopt;
  return done;
}

}  // namespace pounce::store
