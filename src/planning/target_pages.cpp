// SPDX-License-Identifier: Apache-2.0
//
// A target's pages: which texture sets and UDIM tiles get images, and which triangles are on each.
//
// A triangle is on the page of its texture set, or, with tiles, on those of all tiles of UV space
// that it shares an area with. Each page keeps a list of its triangles, so that it can be made by
// itself.
//
// Pages are numbered in the order in which they are written. Texture sets are numbered as triangles
// meet them, so a material without triangles has no page, and triangles without UVs are on none.
#include "planning/target_pages.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <set>

#include "planning/name_patterns.h"
#include "pounce/error.h"

namespace pounce::planning {
namespace {

using mesh::kNoPage;
using mesh::UvTile;

/// Where a texture set's triangles lie in UV space.
struct UvExtent {
  Vec2d lo{kNowhere, kNowhere}, hi{-kNowhere, -kNowhere};
  std::uint64_t outside = 0;  ///< triangles that leave the image

  void add(const std::array<Vec2d, 3>& uvs) {
    bool is_outside = false;
    for (const Vec2d uv : uvs) {
      lo = {std::min(lo.x, uv.x), std::min(lo.y, uv.y)};
      hi = {std::max(hi.x, uv.x), std::max(hi.y, uv.y)};
      is_outside = is_outside || !(uv.x >= 0 && uv.x <= 1 && uv.y >= 0 && uv.y <= 1);
    }
    outside += is_outside ? 1 : 0;
  }
  /// As where each UDIM tile has a material of its own: nothing comes to lie on something else.
  bool is_one_tile() const { return hi.x <= std::floor(lo.x) + 1 && hi.y <= std::floor(lo.y) + 1; }

 private:
  static constexpr double kNowhere = std::numeric_limits<double>::infinity();
};

class PageFinder {
 public:
  PageFinder(const mesh::Mesh& target, const PageRequest& request,
             std::vector<std::string>& warnings)
      : target_(target), request_(request), warnings_(warnings) {}

  TargetPages find() {
    if (target_.triangles.empty())
      throw Error(ErrorKind::input, target_.path + ": has no triangles");
    for (std::uint32_t t = 0; t < target_.triangles.size(); ++t) {
      triangle_set_.push_back(has_uvs(t) ? texture_set(t) : kNoPage);
      if (triangle_set_.back() == kNoPage) {
        ++without_;
      } else {
        look_at_tiles(t, triangle_set_.back());
      }
    }
    if (without_ == target_.triangles.size()) {
      throw Error(ErrorKind::input,
                  fmt::format("{}: has no UVs (no TEXCOORD_{} or vt); unwrap the target first",
                              target_.path, request_.uv_set));
    }
    request_.by_tile ? make_tile_pages() : make_set_pages();
    warn();
    return std::move(out_);
  }

 private:
  bool has_uvs(std::uint32_t t) const {
    const auto& corners = target_.triangles[t];
    return std::all_of(corners.begin(), corners.end(),
                       [&](std::uint32_t v) { return target_.has_uv(request_.uv_set, v); });
  }

  std::uint32_t texture_set(std::uint32_t t) {
    if (!request_.by_material) {
      if (sets_.empty()) sets_.push_back({"default", std::nullopt, mesh::kFirstUdim});
      return 0;
    }
    const std::uint32_t material = target_.triangle_material[t];
    const auto [at, fresh] =
        set_of_.try_emplace(material, static_cast<std::uint32_t>(sets_.size()));
    if (fresh) sets_.push_back({target_.materials[material].name, material, mesh::kFirstUdim});
    return at->second;
  }

  std::array<Vec2d, 3> uvs_of(std::uint32_t t) const {
    std::array<Vec2d, 3> uvs;
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec2f uv = target_.uv_sets[request_.uv_set][target_.triangles[t][k]];
      uvs[k] = {uv.x, uv.y};
    }
    return uvs;
  }

  void look_at_tiles(std::uint32_t t, std::uint32_t set) {
    const std::array<Vec2d, 3> uvs = uvs_of(t);
    extents_.resize(sets_.size());
    extents_[set].add(uvs);
    if (!request_.by_tile) return;
    bool beyond = false;
    const std::uint64_t count = mesh::visit_uv_tiles(uvs, [&](UvTile tile) {
      const auto udim = mesh::udim_number(tile);
      beyond = beyond || !udim;
      if (udim) tiles_.insert({*udim, set});
    });
    // visit_uv_tiles() has visited none then. One stray coordinate must not cost a list of millions
    // of tiles.
    if (count > 65536) {
      throw Error(
          ErrorKind::input,
          fmt::format(
              "{}: triangle {} spans more than 65536 UV tiles; repair its UVs or remove <UDIM>",
              target_.path, t));
    }
    beyond_ += beyond ? 1 : 0;
  }

  void make_set_pages() {
    out_.pages = sets_;
    out_.triangles =
        std::make_shared<const mesh::PageTriangles>(std::span(triangle_set_), sets_.size());
  }

  /// Tiles in rising order, and in each the texture sets in file order: what is finished first has
  /// the smallest number.
  void make_tile_pages() {
    std::map<std::pair<std::uint32_t, UvTile>, std::uint32_t> page_of;  // by texture set and tile
    std::set<std::uint32_t> present;
    for (const auto& [udim, set] : tiles_) {
      present.insert(udim);
      if (!request_.selected.empty() &&
          !std::binary_search(request_.selected.begin(), request_.selected.end(), udim)) {
        continue;
      }
      page_of[{set, mesh::udim_tile(udim)}] = static_cast<std::uint32_t>(out_.pages.size());
      out_.pages.push_back(sets_[set]);
      out_.pages.back().udim = udim;
    }
    const std::vector<std::uint32_t> there(present.begin(), present.end());
    if (out_.pages.empty()) {
      throw Error(ErrorKind::input,
                  there.empty() ? target_.path +
                                      ": its UVs are outside of all UDIM tiles (0 <= u < 10, 0 <= "
                                      "v); move them, or remove <UDIM>"
                                : fmt::format("{}: has no UVs in UDIM {}; it has {}", target_.path,
                                              udim_list(request_.selected), udim_list(there)));
    }
    list_triangles(page_of);
    std::vector<std::uint32_t> absent;
    std::set_difference(request_.selected.begin(), request_.selected.end(), there.begin(),
                        there.end(), std::back_inserter(absent));
    if (!absent.empty()) {
      warnings_.push_back(
          fmt::format("{}: has no UVs in UDIM {} of --tiles", target_.path, udim_list(absent)));
    }
  }

  void list_triangles(const std::map<std::pair<std::uint32_t, UvTile>, std::uint32_t>& page_of) {
    out_.triangles =
        // Tiles are found twice, here and in look_at_tiles(): a list of (triangle, tile) in between
        // could be larger than the mesh.
        std::make_shared<const mesh::PageTriangles>(out_.pages.size(), [&](auto&& put) {
          for (std::uint32_t t = 0; t < triangle_set_.size(); ++t) {
            if (triangle_set_[t] == kNoPage) continue;
            mesh::visit_uv_tiles(uvs_of(t), [&](UvTile tile) {
              const auto at = page_of.find({triangle_set_[t], tile});
              if (at != page_of.end()) put(at->second, t);
            });
          }
        });
  }

  void warn() {
    if (without_ > 0) {
      warnings_.push_back(fmt::format("{}: {} of {} triangles have no UVs and get no texels",
                                      target_.path, without_, target_.triangles.size()));
    }
    // Where they wrap it may come as a surprise.
    std::uint64_t outside = 0;
    for (const UvExtent& extent : extents_) outside += extent.is_one_tile() ? 0 : extent.outside;
    if (outside > 0 && !request_.by_tile) {
      warnings_.push_back(
          fmt::format("{}: the UVs of {} triangles leave the image and wrap around; with <UDIM> in "
                      "the output each tile gets its own image",
                      target_.path, outside));
    }
    if (beyond_ > 0) {
      warnings_.push_back(
          fmt::format("{}: the UVs of {} triangles leave the UDIM tiles 1001 to 9999 (0 <= u < 10, "
                      "0 <= v); those parts are not written",
                      target_.path, beyond_));
    }
  }

  const mesh::Mesh& target_;
  const PageRequest& request_;
  std::vector<std::string>& warnings_;
  std::vector<TargetPage> sets_;
  std::vector<std::uint32_t> triangle_set_;                  ///< kNoPage: without UVs
  std::map<std::uint32_t, std::uint32_t> set_of_;            ///< material -> texture set
  std::set<std::pair<std::uint32_t, std::uint32_t>> tiles_;  ///< (UDIM, texture set)
  std::vector<UvExtent> extents_;                            ///< by texture set
  std::uint64_t without_ = 0, beyond_ = 0;
  TargetPages out_;
};

}  // namespace

std::map<std::string, std::string> TargetPage::tokens() const {
  return {{"MATERIAL", file_name_part(set)},
          {"UDIM", std::to_string(udim)},
          {"UVTILE", mesh::uvtile_name(mesh::udim_tile(udim))}};
}

TargetPages target_pages(const mesh::Mesh& target, const PageRequest& request,
                         std::vector<std::string>& warnings) {
  return PageFinder(target, request, warnings).find();
}

}  // namespace pounce::planning
