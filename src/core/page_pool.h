// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <new>
#include <type_traits>
#include <utility>
#include <vector>

namespace pounce {

inline constexpr std::size_t kPageBytes = 4096;
constexpr std::uint64_t round_to_pages(std::uint64_t bytes) {
  return (bytes + kPageBytes - 1) / kPageBytes * kPageBytes;
}

/// Where everything that the budget counts is allocated: whole pages from anonymous mappings. What
/// is freed is reused, and beyond a few MiB of it goes back to the system at once, so that the
/// resident size follows what is in use. A general-purpose allocator keeps 30-130 % more
/// (docs/decisions/003-page-pool.md). Thread-safe; one per process.
class PagePool {
 public:
  static PagePool& instance();
  /// Page-aligned. Throws std::bad_alloc. Contents are undefined.
  void* allocate(std::size_t bytes);
  void release(void* at, std::size_t bytes) noexcept;

 private:
  PagePool() = default;
};

/// While one lives, what its thread releases stays in the pool, all but empty regions and mappings
/// of their own. Then what is more than may be idle goes back to the system at once, neighbours
/// together: for who releases very many buffers, one by one. Nobody may count these as free memory
/// before that.
class ReleaseTogether {
 public:
  ReleaseTogether();
  ReleaseTogether(const ReleaseTogether&) = delete;
  ReleaseTogether& operator=(const ReleaseTogether&) = delete;
  ~ReleaseTogether();
};

/// While one lives, so much of the pool is going to be in use: huge pages, each a fault for 512
/// pages, are taken as if it were already. What is idle stays bounded as ever. Thread-safe.
class ExpectedUse {
 public:
  explicit ExpectedUse(std::uint64_t bytes);
  ExpectedUse(const ExpectedUse&) = delete;
  ExpectedUse& operator=(const ExpectedUse&) = delete;
  ~ExpectedUse();

 private:
  std::uint64_t pages_;
};

/// How far behind the start of its first page something begins: where its last page has bytes to
/// spare, another cache line than the one before. Columns that are gone through side by side would
/// otherwise lie in the same few sets of the processor's cache and drive each other out.
inline std::size_t next_shift(std::size_t bytes) {
  constexpr std::size_t kLineBytes = 64;
  static thread_local std::size_t next = 0;
  return next++ % ((round_to_pages(bytes) - bytes) / kLineBytes + 1) * kLineBytes;
}

/// std::allocator's interface over the pool.
template <class T>
struct PageAllocator {
  using value_type = T;
  PageAllocator() = default;
  template <class U>
  explicit PageAllocator(const PageAllocator<U>&) {}
  T* allocate(std::size_t count) {
    const std::size_t bytes = count * sizeof(T);
    auto* const pages = static_cast<std::byte*>(PagePool::instance().allocate(bytes));
    return reinterpret_cast<T*>(pages + next_shift(bytes));
  }
  void deallocate(T* at, std::size_t count) noexcept {
    auto* const pages = reinterpret_cast<std::byte*>(reinterpret_cast<std::uintptr_t>(at) /
                                                     kPageBytes * kPageBytes);
    PagePool::instance().release(pages, count * sizeof(T));
  }
  template <class U>
  bool operator==(const PageAllocator<U>&) const {
    return true;
  }
};

/// A vector whose memory is whole pages of the pool: for what is large or lives long.
template <class T>
using PageVector = std::vector<T, PageAllocator<T>>;

/// The same, of elements that resize() leaves as their memory is: for what is filled in full next.
template <class T>
struct UnsetPageAllocator : PageAllocator<T> {
  using value_type = T;
  template <class U>
  struct rebind {
    using other = UnsetPageAllocator<U>;
  };
  UnsetPageAllocator() = default;
  template <class U>
  explicit UnsetPageAllocator(const UnsetPageAllocator<U>&) {}
  template <class U>
  void construct(U* at) noexcept {
    static_assert(std::is_trivially_default_constructible_v<U>);
    ::new (static_cast<void*>(at)) U;
  }
  template <class U, class First, class... Rest>
  void construct(U* at, First&& first, Rest&&... rest) {
    ::new (static_cast<void*>(at)) U(std::forward<First>(first), std::forward<Rest>(rest)...);
  }
};
template <class T>
using UnsetPageVector = std::vector<T, UnsetPageAllocator<T>>;

}  // namespace pounce
