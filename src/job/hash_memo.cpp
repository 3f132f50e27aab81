// SPDX-License-Identifier: Apache-2.0
//
// Hashes of input files that are remembered from job to job, as long as a file's size, times and
// inode stay what they were: a large image is not read again to find that its column is cached.
//
// A wrong hash would make a job use another image's column, so doubt means "not remembered". A file
// is asked for its identity before and after it is hashed: one that changes meanwhile is not
// remembered, and neither is one that changed so recently that a later change might have the same
// times. Whatever is wrong with the memo itself counts as an empty memo.
#include "job/hash_memo.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <utility>

#include "pounce/error.h"
#include "store/pack/pack_layout.h"

namespace pounce::job {
namespace {

using store::get_u64;
using store::put_u64;

constexpr std::uint64_t kMagic = 0x3130485345434e50;  // "PNCESH01" as bytes in the file
constexpr std::size_t kEntryBytes = 9 * 8;
constexpr std::size_t kFrameBytes = 2 * 8;  // magic, and the checksum at the end
constexpr std::size_t kMostEntries = 4096;  // the newest; 288 KiB
/// Times of the coarsest file systems come in steps of 2 s.
constexpr std::int64_t kSettledNs = 3'000'000'000;

std::int64_t now_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

std::array<std::uint64_t, 7> identify(const FileStatus& file, std::uint64_t offset,
                                      std::uint64_t size_bytes) {
  return {file.device,
          file.inode,
          file.size_bytes,
          static_cast<std::uint64_t>(file.modified_ns),
          static_cast<std::uint64_t>(file.changed_ns),
          offset,
          size_bytes};
}

}  // namespace

HashMemo::HashMemo(FileSystem& files, std::string path, std::string parts_folder)
    : files_(files), path_(std::move(path)), parts_folder_(std::move(parts_folder)) {}

Hash128 HashMemo::get(const std::string& path, std::uint64_t offset, std::uint64_t size_bytes,
                      const std::function<Hash128()>& compute) {
  const std::int64_t begin_ns = now_ns();
  const auto before = files_.status(path);
  if (!before || (size_bytes != 0 ? size_bytes : before->size_bytes) < kLeastBytes) {
    return compute();
  }
  const Identity identity = identify(*before, offset, size_bytes);
  // Read anew each time, and searched in sequence: the file is small beside what a hit saves.
  for (const Entry& entry : load()) {
    if (entry.identity == identity) return entry.hash;
  }
  const Hash128 hash = compute();
  const auto after = files_.status(path);
  const bool settled = begin_ns - std::max(before->modified_ns, before->changed_ns) > kSettledNs;
  if (settled && after && identify(*after, offset, size_bytes) == identity) {
    const std::lock_guard lock(mutex_);
    auto entries = load();  // with what others remembered meanwhile
    entries.push_back({identity, hash});
    save(std::move(entries));
  }
  return hash;
}

std::vector<HashMemo::Entry> HashMemo::load() const {
  std::vector<Entry> entries;
  std::vector<std::byte> bytes;
  try {
    const auto file = files_.open_private(path_);
    if (file == nullptr) return entries;
    const std::uint64_t size = file->size_bytes();
    if (size < kFrameBytes || size > kFrameBytes + kMostEntries * kEntryBytes ||
        (size - kFrameBytes) % kEntryBytes != 0) {
      return entries;
    }
    bytes.resize(static_cast<std::size_t>(size));
    file->read(0, bytes);
  } catch (const Error&) {
    return entries;  // what cannot be read is not remembered
  }
  const std::size_t end = bytes.size() - 8;
  if (get_u64(bytes.data()) != kMagic ||
      get_u64(bytes.data() + end) != checksum(std::span(bytes).first(end))) {
    return entries;
  }
  for (std::size_t at = 8; at < end; at += kEntryBytes) {
    Entry& entry = entries.emplace_back();
    for (std::size_t i = 0; i < entry.identity.size(); ++i) {
      entry.identity[i] = get_u64(bytes.data() + at + 8 * i);
    }
    entry.hash = {get_u64(bytes.data() + at + 56), get_u64(bytes.data() + at + 64)};
  }
  return entries;
}

void HashMemo::save(std::vector<Entry> entries) {
  // The oldest go. What is asked for again is hashed and becomes the newest.
  if (entries.size() > kMostEntries) {
    entries.erase(entries.begin(), entries.end() - static_cast<std::ptrdiff_t>(kMostEntries));
  }
  std::vector<std::byte> bytes(kFrameBytes + entries.size() * kEntryBytes);
  put_u64(bytes.data(), kMagic);
  std::size_t at = 8;
  for (const Entry& entry : entries) {
    for (const std::uint64_t value : entry.identity) {
      put_u64(bytes.data() + at, value);
      at += 8;
    }
    put_u64(bytes.data() + at, entry.hash.hi);
    put_u64(bytes.data() + at + 8, entry.hash.lo);
    at += 16;
  }
  put_u64(bytes.data() + at, checksum(std::span(bytes).first(at)));
  // Written elsewhere and renamed, so that readers see the old file or the new one. Of two
  // processes that save at once one loses its entry, and hashes again.
  const std::string part = fmt::format("{}/{}-{}.hashes", parts_folder_, ::getpid(), now_ns());
  try {
    const auto file = files_.create_private(part);
    if (file == nullptr) return;
    file->append(bytes);
    file->sync();
    files_.rename(part, path_);
  } catch (const Error&) {
    // Then it is hashed again next time; a leftover in tmp goes with the next run.
  }
}

}  // namespace pounce::job
