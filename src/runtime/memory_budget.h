// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <list>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include "pounce/error.h"

namespace pounce::runtime {

/// Names a decoded thing in the cache: which store, what kind of thing in it, which one.
struct CacheKey {
  std::uint64_t store = 0;
  std::uint64_t item = 0;
  bool operator==(const CacheKey&) const = default;
};

/// Who asks again for a thing that was decoded.
enum class Reuse {
  near,      ///< pieces of work close by: what they have passed is seldom asked for again
  anywhere,  ///< any piece
};

/// The bytes of one job. Leases are for what a piece of work needs while it lives; what they leave
/// over keeps decoded blocks, least recently used ones going first when a lease asks for room.
/// Of those that only pieces close by ask for (Reuse::near) it keeps no more than turns out to be
/// asked for again: memory that is touched for the first time costs more than what it would save.
/// leased + cached never exceeds the limit. Thread-safe.
class MemoryBudget {
 public:
  explicit MemoryBudget(std::uint64_t limit_bytes) : limit_(limit_bytes) {}

  /// First come, first served is the caller's affair (see Pump). Never blocks.
  bool try_lease(std::uint64_t bytes);
  void release(std::uint64_t bytes);

  /// A number for the keys of a store that none had before: what is known of a store that was
  /// closed must not be taken for another's.
  std::uint64_t new_store();
  /// A decoded thing that is still there, or nothing.
  std::shared_ptr<const void> find(const CacheKey& key);
  /// Keeps it if there is room; the caller's own reference is under the caller's lease.
  void keep(const CacheKey& key, std::shared_ptr<const void> thing, std::uint64_t bytes,
            Reuse reuse = Reuse::anywhere);
  /// Forgets everything of one store (before it is closed).
  void forget(std::uint64_t store);
  /// The same of all stores, which is much faster than one by one: their blocks lie in between each
  /// other.
  void forget_all();

  std::uint64_t limit() const { return limit_; }
  /// Before anything is leased.
  void set_limit(std::uint64_t limit_bytes) { limit_ = limit_bytes; }
  std::uint64_t leased() const;
  std::uint64_t leased_peak() const;  ///< largest leased + cached so far

  /// Of Reuse::near so much is kept before any of it was asked for again.
  static constexpr std::uint64_t kNearBytes = 4ULL << 20;

 private:
  struct Kept {
    CacheKey key;
    std::shared_ptr<const void> thing;
    std::uint64_t bytes;
    Reuse reuse;
    /// When it was last put to the front, on the clock of uses_: no more than uses_ - used_at
    /// things lie ahead of it.
    std::uint64_t used_at;
  };
  using Recent = std::list<Kept>;  ///< most recently used first, but for the first eighth
  struct KeyHash {
    std::size_t operator()(const CacheKey& k) const {
      return k.store * 0x9E3779B97F4A7C15ULL ^ k.item;
    }
  };
  // All with mutex_ held.
  Recent& recent(Reuse reuse) { return recent_[static_cast<std::size_t>(reuse)]; }
  void drop_last(Recent& recent);
  void make_room(std::uint64_t bytes);
  void make_room_near(const CacheKey& key, std::uint64_t bytes);

  std::uint64_t limit_;
  mutable std::mutex mutex_;  ///< guards everything below
  std::uint64_t leased_ = 0, cached_ = 0, peak_ = 0;
  std::array<Recent, 2> recent_;  ///< by Reuse
  std::uint64_t uses_ = 0;        ///< things that were put to the front of a list
  std::uint64_t stores_ = 0;
  std::uint64_t near_ = 0, near_most_ = kNearBytes;  ///< bytes of Reuse::near
  std::vector<bool> passed_;  ///< by hash of the key: was it dropped although there was room?
  std::unordered_map<CacheKey, Recent::iterator, KeyHash> kept_;
  /// Of kept_, by store: a job of many images closes thousands of stores.
  std::unordered_map<std::uint64_t, std::unordered_set<std::uint64_t>> items_;
};

/// A lease that ends with its object. Throws Error(budget) if there is no room: only for what must
/// be there.
class Lease {
 public:
  Lease() = default;
  Lease(MemoryBudget& budget, std::uint64_t bytes, const std::string& what);
  Lease(Lease&& other) noexcept;
  Lease& operator=(Lease&& other) noexcept;
  ~Lease();
  std::uint64_t bytes() const { return bytes_; }

 private:
  MemoryBudget* budget_ = nullptr;
  std::uint64_t bytes_ = 0;
};

/// What to throw where `bytes` more are needed for `what` and cannot come: it names the least that
/// works. "The memory budget of 8.0 MiB is too small: sorting needs 9.0 MiB beside ..."
Error too_small(const MemoryBudget& budget, std::uint64_t bytes, const std::string& what);

/// "12.5 MiB"
std::string format_bytes(std::uint64_t bytes);

}  // namespace pounce::runtime
