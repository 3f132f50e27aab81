// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <exception>
#include <memory>
#include <mutex>
#include <unordered_map>
#include <utility>

#include "runtime/memory_budget.h"

namespace pounce::runtime {

/// An open store and what was decoded of it: kept in what the leases leave of the budget, else
/// read, checked and decoded again. Whoever asks shares the ownership of what it gets; what it
/// holds is under its own lease. Thread-safe.
///
/// `Reader` owns the store and knows how to read it:
///   Index, Entry, Block                what a part of the index, an entry of it and a block are
///   Index read_index(part) const, uint64_t index_bytes(const Index&) const
///   Block read_block(entry) const, uint64_t block_bytes(entry) const      (decoded)
///   uint64_t index_place(part) const, uint64_t place(entry) const         (offsets: multiples of
///   8)
///   bool kReadsAlone                   reading a block waits for no other thread
///   Reuse reuse                        who asks for a block again
///
/// Where reading waits for nobody, threads that ask for one block at once wait for the first of
/// them; else each of them decodes it.
template <class Reader>
class BlockCache {
 public:
  using Index = typename Reader::Index;
  using Entry = typename Reader::Entry;
  using Block = typename Reader::Block;
  using BlockPtr = std::shared_ptr<const Block>;

  BlockCache(MemoryBudget& budget, Reader reader) : budget_(budget), reader_(std::move(reader)) {}
  ~BlockCache() { budget_.forget(id_); }
  BlockCache(const BlockCache&) = delete;
  BlockCache& operator=(const BlockCache&) = delete;

  const Reader& reader() const { return reader_; }
  const auto& store() const { return *reader_.store; }
  std::uint64_t indices_read() const { return indices_read_; }  ///< parts of the index, so far

  std::shared_ptr<const Index> index(std::uint32_t part) const {
    // A low bit of the offset tells parts of the index from blocks.
    const CacheKey key{id_, reader_.index_place(part) | 1};
    if (auto kept = budget_.find(key)) return std::static_pointer_cast<const Index>(kept);
    auto made = std::make_shared<const Index>(reader_.read_index(part));
    ++indices_read_;
    budget_.keep(key, made, reader_.index_bytes(*made));
    return made;
  }

  BlockPtr block(const Entry& entry) const {
    if (auto kept = kept_block(entry)) return kept;
    if constexpr (!Reader::kReadsAlone) return read(entry);
    const std::uint64_t place = reader_.place(entry);
    std::unique_lock lock(mutex_);
    if (const auto others = under_way_.find(place); others != under_way_.end()) {
      const std::shared_ptr<Making> making = others->second;
      made_.wait(lock, [&] { return making->block != nullptr || making->failure != nullptr; });
      if (making->failure != nullptr) std::rethrow_exception(making->failure);
      return making->block;
    }
    if (auto kept = kept_block(entry)) return kept;  // meanwhile
    const auto making = std::make_shared<Making>();
    under_way_.emplace(place, making);
    lock.unlock();
    BlockPtr block;
    std::exception_ptr failure;
    try {
      block = read(entry);
    } catch (...) {
      failure = std::current_exception();
    }
    lock.lock();
    making->block = block;
    making->failure = failure;
    under_way_.erase(place);
    lock.unlock();
    made_.notify_all();
    if (failure != nullptr) std::rethrow_exception(failure);
    return block;
  }
  /// The same where it need not be decoded; else null.
  BlockPtr kept_block(const Entry& entry) const {
    return std::static_pointer_cast<const Block>(budget_.find({id_, reader_.place(entry)}));
  }

 private:
  BlockPtr read(const Entry& entry) const {
    auto made = std::make_shared<const Block>(reader_.read_block(entry));
    budget_.keep({id_, reader_.place(entry)}, made, reader_.block_bytes(entry), reader_.reuse);
    return made;
  }

  /// What one thread makes for all that ask meanwhile: a block or a failure, once it is over. (A
  /// promise would cost each block a call of the kernel, whether anybody waits or not.)
  struct Making {
    BlockPtr block;
    std::exception_ptr failure;
  };

  MemoryBudget& budget_;
  const Reader reader_;
  const std::uint64_t id_ = budget_.new_store();
  mutable std::mutex mutex_;  ///< guards what follows
  mutable std::unordered_map<std::uint64_t, std::shared_ptr<Making>> under_way_;
  mutable std::condition_variable made_;
  mutable std::atomic<std::uint64_t> indices_read_{0};
};

}  // namespace pounce::runtime
