// SPDX-License-Identifier: Apache-2.0
//
// The N-th largest of any number of keys in constant memory: keys go to a nameless file; four times
// it is read, and a histogram of the next 16 bits, of those keys that begin as the one that is
// looked for, says how it goes on. A fifth time finds how far its equals are taken.
//
// Sorting would need memory or disk for all keys with their places, and the source is wanted in its
// own order anyway: a threshold is enough. It is exact, so the number of Gaussians is what was
// asked for. Reading the keys several times is cheap beside reading the source once more.
#include "sorting/importance.h"

#include <algorithm>
#include <array>
#include <bit>

#include "gaussian/gaussian_source.h"
#include "runtime/pump.h"

namespace pounce::sorting {
namespace {

constexpr int kDigitBits = 16;
constexpr std::uint64_t kPieceKeys = 32 << 10;

std::uint64_t parts_of(std::uint64_t rows, std::uint64_t part_rows) {
  return (rows + part_rows - 1) / part_rows;
}

/// Stops here if the caller asked to: a reading of all keys of a huge scene takes seconds.
template <class Take>
void for_keys(runtime::Meter& meter, const ReadFile& file, std::uint64_t total, const Take& take) {
  PageVector<std::uint64_t> piece(std::min(total, kPieceKeys));
  for (std::uint64_t at = 0; at < total; at += piece.size()) {
    const auto part = std::span(piece).first(std::min<std::uint64_t>(piece.size(), total - at));
    file.read(at * sizeof(std::uint64_t), std::as_writable_bytes(part));
    for (std::size_t i = 0; i < part.size(); ++i) take(at + i, part[i]);
    meter.advance(0);
  }
}

}  // namespace

std::uint64_t importance(const store::Splat& splat) {
  std::array<double, 3> sigma{splat.sigma.x, splat.sigma.y, splat.sigma.z};
  std::sort(sigma.begin(), sigma.end());
  // Bits of doubles that are not negative are in the order of the numbers, so that a key can be
  // compared, and searched digit by digit, as an integer.
  return std::bit_cast<std::uint64_t>(static_cast<double>(splat.alpha) * (sigma[1] * sigma[2]));
}

std::uint64_t ImportanceCut::bytes(std::uint64_t rows, std::uint64_t part_rows) {
  const std::uint64_t parts = parts_of(rows, part_rows);
  constexpr std::uint64_t kHistogram = sizeof(std::uint64_t) << kDigitBits, kBuffer = 256 << 10;
  return 2 * round_to_pages((parts + 1) * sizeof(std::uint64_t)) + kHistogram + kBuffer +
         round_to_pages(kPieceKeys * sizeof(std::uint64_t));
}

ImportanceCut::ImportanceCut(job::JobContext& job, const gaussian::GaussianSource& source,
                             const gaussian::SplatKeep& keep, std::uint64_t count,
                             std::uint64_t part_rows) {
  const std::uint64_t rows = source.count(), parts = parts_of(rows, part_rows);
  const std::uint64_t part_bytes = gaussian::rows_bytes(std::min(rows, part_rows), source.lobes()) +
                                   source.read_bytes() +
                                   round_to_pages(part_rows * sizeof(std::uint64_t));
  const PageVector<std::uint64_t> costs(parts, part_bytes);
  const auto keys = job.scratch_place().create();
  first_.reserve(parts + 1);
  first_.push_back(0);
  using Keys = PageVector<std::uint64_t>;
  runtime::run_ordered<Keys>(
      job.budget, costs, "selecting the most important Gaussians",
      [&](std::size_t i) {
        store::SplatCounts ignored{};
        const std::uint64_t begin = i * part_rows;
        const store::SplatRows read =
            gaussian::read_kept(source, keep, begin, std::min(part_rows, rows - begin), ignored);
        Keys found;
        found.reserve(read.splats.size());
        for (const store::Splat& splat : read.splats) found.push_back(importance(splat));
        return found;
      },
      [&](std::size_t i, const Keys& found) {
        // Parts come in order, so a key's place in the file is the ordinal of its Gaussian among
        // those that are wanted. takes() relies on that where importances are equal.
        keys->append(std::as_bytes(std::span(found)));
        first_.push_back(first_.back() + found.size());
        job.meter.advance(std::min(part_rows, rows - i * part_rows));
      });
  const std::uint64_t total = first_.back();
  if (count >= total) return;
  left_out_ = total - count;
  find(job.meter, *keys->reader(), total, count);
}

void ImportanceCut::find(runtime::Meter& meter, const ReadFile& keys, std::uint64_t total,
                         std::uint64_t count) {
  std::uint64_t wanted = count;  // of those that begin as the one that is looked for
  PageVector<std::uint64_t> histogram(std::size_t{1} << kDigitBits);
  for (int shift = 64 - kDigitBits; shift >= 0; shift -= kDigitBits) {
    std::fill(histogram.begin(), histogram.end(), 0);
    const std::uint64_t known = shift + kDigitBits == 64 ? 0 : ~0ULL << (shift + kDigitBits);
    for_keys(meter, keys, total, [&](std::uint64_t, std::uint64_t key) {
      if ((key & known) == least_) ++histogram[key >> shift & 0xFFFF];
    });
    // From the largest digit down: whole digits are taken while they are fewer than what is still
    // wanted. The digit that is too many holds the threshold.
    std::uint64_t digit = histogram.size() - 1;
    for (; histogram[digit] < wanted; --digit) wanted -= histogram[digit];
    least_ |= digit << shift;
  }
  for_keys(meter, keys, total, [&](std::uint64_t ordinal, std::uint64_t key) {
    if (key == least_ && wanted > 0 && --wanted == 0) ties_end_ = ordinal + 1;
  });
}

}  // namespace pounce::sorting
