// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/page_pool.h"

namespace pounce::mesh {

/// A triangle that is on no page.
inline constexpr std::uint32_t kNoPage = 0xFFFFFFFF;

/// Which triangles each page of a mesh has, in file order; one may be on several. Four bytes for
/// each time a triangle is on a page. Immutable.
class PageTriangles {
 public:
  PageTriangles() = default;
  /// From the page of each triangle, or kNoPage.
  PageTriangles(std::span<const std::uint32_t> triangle_page, std::size_t pages)
      : PageTriangles(pages, [&](auto&& put) {
          for (std::uint32_t t = 0; t < triangle_page.size(); ++t) {
            if (triangle_page[t] != kNoPage) put(triangle_page[t], t);
          }
        }) {}
  /// each(put) calls put(page, triangle), triangles rising, twice over: to count and to fill.
  template <class Each>
  PageTriangles(std::size_t pages, const Each& each) : first_(pages + 1, 0) {
    each([&](std::uint32_t page, std::uint32_t) { ++first_[page + 1]; });
    for (std::size_t p = 0; p < pages; ++p) first_[p + 1] += first_[p];
    triangles_.resize(first_.back());
    std::vector<std::uint64_t> next(first_.begin(), first_.end() - 1);
    each([&](std::uint32_t page, std::uint32_t triangle) { triangles_[next[page]++] = triangle; });
  }

  std::span<const std::uint32_t> of(std::size_t page) const {
    return {triangles_.data() + first_[page], triangles_.data() + first_[page + 1]};
  }
  std::size_t pages() const { return first_.empty() ? 0 : first_.size() - 1; }
  std::uint64_t size_bytes() const {
    return triangles_.size() * sizeof(std::uint32_t) + first_.size() * sizeof(std::uint64_t);
  }

 private:
  std::vector<std::uint64_t> first_;  ///< of each page, into triangles_; one more at the end
  PageVector<std::uint32_t> triangles_;
};

}  // namespace pounce::mesh
