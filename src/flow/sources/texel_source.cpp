// SPDX-License-Identifier: Apache-2.0
//
// A textured mesh as a source of Gaussians.
//
//   geometry store ─▶ list of blocks ─▶ count ─▶ any range: decode a block, raster it, look colours
//   up colour columns ───────────────────────────────────────────▲
//
// What is held is a place and a first number per block, some 50 bytes for up to a few thousand
// Gaussians. A range decodes the blocks that it touches and visits the part it wants, so that even
// a block of millions (an image repeated over one triangle) is read in pieces whose bytes are known
// before they are made.
//
// Nothing is cached between ranges: whoever reads in order decodes a block about once, and a sort
// reads in order. The readers are pounce gaussians, which writes the ranges as they come, and the
// store of --method gaussian, which sorts them. Both may read in several threads.
//
// Densifying needs the mean area of a Gaussian, which is known when all were counted. So it counts
// twice: once to find the mean, once with the texels split by it.
#include "flow/sources/texel_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <optional>
#include <tuple>
#include <utility>

#include "core/portable_math.h"
#include "runtime/pump.h"

namespace pounce::flow {
namespace {

/// A decoded block's vertices and triangles, and what counting them takes.
constexpr std::uint64_t kPerTriangle = 300;
/// Alpha that a store can hold: so that texels which are not seen have a colour, too, where nothing
/// else is in reach. What is blended from them alone comes out as 0.
constexpr float kLeastAlpha = 0x1p-20F;
/// Samples are taken in pieces, each of which decodes a block or two.
constexpr std::uint64_t kSamplePieces = 256;

/// The blend that a transfer makes of a mesh's texels as Gaussians, where the target's texels are
/// as large: its kernel at (dx, dy).
class BlendKernel {
 public:
  explicit BlendKernel(double sigma) {
    constexpr double kFootprint = 0.3;  // of the target's texel: docs/stages/5-splats.md
    const double variance = sigma * sigma + kFootprint;
    for (int dy = -kReach; dy <= kReach; ++dy) {
      for (int dx = -kReach; dx <= kReach; ++dx)
        weights_[index(dx, dy)] = exp_same(-(dx * dx + dy * dy) / (2 * variance));
    }
  }
  double operator()(int dx, int dy) const { return weights_[index(dx, dy)]; }
  static constexpr int kReach = gaussian::TexelNeighbours::kReach;

 private:
  static std::size_t index(int dx, int dy) {
    return static_cast<std::size_t>((dy + kReach) * (2 * kReach + 1) + dx + kReach);
  }
  std::array<double, (2 * kReach + 1) * (2 * kReach + 1)> weights_{};
};

}  // namespace

/// A block in the order of the source.
struct TexelSource::Block {
  std::uint32_t page = 0;
  std::int32_t y = 0, x = 0;
  std::uint32_t triangles = 0;
  store::ChunkRef chunk;
};

TexelSource::TexelSource(job::JobContext& job, Request request, double progress_end)
    : job_(job), request_(std::move(request)) {
  sampling_.sigma = request_.sigma;
  list_blocks();
  job_.meter.begin("count", (request_.densify ? 2 : 1) * blocks_.size(), "blocks", progress_end);
  const double area = count_blocks();
  if (request_.densify && count() > 0) {
    sampling_.spacing = std::sqrt(area / static_cast<double>(count()));
    count_blocks();
  }
  job_.meter.end();
  std::uint64_t tile = 0, triangles = 0, chunk = 0;
  for (const PageColour& page : request_.pages) tile = std::max(tile, tile_bytes(page));
  for (const Block& block : blocks_) {
    triangles = std::max<std::uint64_t>(triangles, block.triangles);
    chunk = std::max<std::uint64_t>(chunk, block.chunk.raw_bytes);
  }
  read_bytes_ = read_bytes(triangles, chunk, tile, request_.sharpen > 0);
}

TexelSource::~TexelSource() = default;

std::uint64_t TexelSource::read_bytes(std::uint64_t triangles, std::uint64_t chunk_bytes,
                                      std::uint64_t colour_tile_bytes, bool sharpens) {
  const std::uint64_t block = triangles * kPerTriangle + 2 * chunk_bytes;
  return block + (ColourWindow::kTiles + 2) * colour_tile_bytes + (64 << 10) +
         (sharpens ? block + gaussian::TexelNeighbours::bytes() : 0);
}

std::uint64_t TexelSource::list_bytes(const surface::GeometryRequest& geometry) {
  // Blocks are windows of the texels that triangles lie in; very full ones are cut.
  // A bound for planning, before the store exists. A page cannot have more blocks than windows that
  // its triangles' box spans, with the partial ones at both ends, and one more for each time that a
  // block is full.
  const std::uint64_t entries = surface::geometry_most(geometry).chunks / 2;
  std::uint64_t windows = 0;
  for (std::size_t p = 0; p < geometry.pages.size(); ++p) {
    const mesh::Lattice& page = geometry.pages[p];
    Box3f texels;
    for (const std::uint32_t t : geometry.triangles->of(geometry.first_page + p)) {
      if (page.width == 0) continue;
      for (const Vec2d& c : mesh::texel_corners(*geometry.mesh, page, {t, 0, 0}))
        texels.extend(Vec3f{static_cast<float>(c.x), static_cast<float>(c.y), 0});
    }
    const auto along = [](float low, float high) {
      const double blocks =
          (static_cast<double>(high) - static_cast<double>(low)) / mesh::kBlockEdge;
      return static_cast<std::uint64_t>(std::clamp(blocks, 0.0, 1e9)) + 3;
    };
    if (texels.empty()) texels.extend(Vec3f{});
    windows += along(texels.lo.x, texels.hi.x) * along(texels.lo.y, texels.hi.y);
  }
  const std::uint64_t blocks =
      std::min(entries, windows + entries / store::kMostTrianglesPerBlock) + 1;
  return round_to_pages(blocks * (sizeof(Block) + sizeof(store::TileEntry))) +
         2 * round_to_pages((blocks + 1) * sizeof(std::uint64_t)) + kPageBytes;
}

void TexelSource::list_blocks() {
  const store::GeometryDirectory& directory = request_.geometry->directory();
  std::uint64_t blocks = 0;
  for (const store::TileEntry& tile : directory.tiles) blocks += tile.blocks;
  // Beside the list and the firsts: what each block costs while they are counted.
  leases_.emplace_back(job_.budget,
                       round_to_pages(blocks * sizeof(Block)) +
                           2 * round_to_pages((blocks + 1) * sizeof(std::uint64_t)),
                       "the list of blocks");
  blocks_.reserve(blocks);
  for (std::uint32_t t = 0; t < directory.tiles.size(); ++t) {
    for (const store::BlockEntry& e : request_.geometry->read_index(t, job_.compressor()))
      blocks_.push_back({e.page, e.y, e.x, e.triangles, e.chunk});
  }
  std::sort(blocks_.begin(), blocks_.end(), [](const Block& a, const Block& b) {
    // Blocks of one window were stored in the order of their triangles.
    return std::tie(a.page, a.y, a.x, a.chunk.offset) < std::tie(b.page, b.y, b.x, b.chunk.offset);
  });
}

/// Fills first_; returns the surface that the Gaussians stand for.
double TexelSource::count_blocks() {
  PageVector<std::uint64_t> costs;
  costs.reserve(blocks_.size());
  for (const Block& block : blocks_)
    costs.push_back(read_bytes(block.triangles, block.chunk.raw_bytes, 0));
  first_.assign(1, 0);
  first_.reserve(blocks_.size() + 1);
  double area = 0;
  using Counted = std::pair<std::uint64_t, double>;
  runtime::run_ordered<Counted>(
      job_.budget, costs, "counting Gaussians",
      [&](std::size_t b) {
        const store::GeometryBlock block = decode(blocks_[b]);
        const gaussian::MeshGaussians gaussians(
            block, request_.geometry->directory().pages[blocks_[b].page], sampling_);
        return Counted{gaussians.count(), gaussians.area()};
      },
      [&](std::size_t, const Counted& counted) {
        first_.push_back(first_.back() + counted.first);
        area += counted.second;  // in the order of the blocks: the same sum every time
        job_.meter.advance(1);
      });
  return area;
}

store::GeometryBlock TexelSource::decode(const Block& place) const {
  store::BlockEntry entry;
  entry.page = place.page;
  entry.x = place.x;
  entry.y = place.y;
  entry.triangles = place.triangles;
  entry.chunk = place.chunk;
  return request_.geometry->read_block(entry, job_.compressor());
}

void TexelSource::find_neighbours(const Block& block, gaussian::TexelNeighbours& neighbours) const {
  neighbours.start(block.x, block.y);
  const mesh::Lattice& lattice = request_.geometry->directory().pages[block.page];
  const auto before = [](const Block& b, const std::tuple<std::uint32_t, int, int>& place) {
    return std::tuple{b.page, b.y, b.x} < place;
  };
  for (int y = block.y - 1; y <= block.y + 1; ++y) {
    // Blocks are sorted by page, row and column: each of the three rows is one search. A full
    // window has several blocks, all of which count.
    auto near = std::lower_bound(blocks_.begin(), blocks_.end(),
                                 std::tuple{block.page, y, block.x - 1}, before);
    for (; near != blocks_.end() && near->page == block.page && near->y == y &&
           near->x <= block.x + 1;
         ++near)
      neighbours.add(decode(*near), lattice);
  }
}

void TexelSource::visit(std::uint64_t first, std::uint64_t last,
                        const std::function<void(const TexelGaussian&)>& each) const {
  // At a whole texel the tent gives that texel alone. Only triangles without a texel's centre, and
  // parts of texels that are split, ask for places between texels.
  const shading::TexelFormat format{4, Depth::float32, request_.linear, true, true};
  const BlendKernel kernel(request_.sigma);
  const bool sharpens = request_.sharpen > 0;
  std::optional<gaussian::TexelNeighbours> neighbours;
  if (sharpens) neighbours.emplace();
  ColourWindow window;
  using Colour = std::array<float, 4>;
  // Nothing in a UDIM tile without image.
  const auto colour_at = [&](const PageColour& page, const PagePlace& place, const Vec4f& vertex) {
    std::optional<shading::Factor> vertices;
    if (page.tinted) vertices = vertex_factor({vertex.x, vertex.y, vertex.z, vertex.w});
    const shading::Factor* const tint = vertices ? &*vertices : nullptr;
    shading::TexelValue value = constant_value(page, tint, format);
    if (page.column != nullptr || page.tile_set != nullptr) {
      const PageImage image = image_at(page, place);
      if (image.column == nullptr) return std::optional<Colour>();
      const ColourPlace at = window.find(image);
      projection::Taps taps;
      projection::tent(at.rest_x, at.rest_y, taps);
      value = blended(page, at, taps, format, tint);
    }
    Colour rgba;
    shading::store_texel(format, value, reinterpret_cast<std::byte*>(rgba.data()));
    return std::optional(rgba);
  };
  // c + sharpen (c - what the blend makes of c), within what colours are.
  const auto sharpen = [&](const PageColour& page, const gaussian::MeshGaussian& g,
                           const gaussian::TexelFrame& frame, Colour& rgba) {
    std::array<double, 3> sum{};
    double weights = 0;
    for (int dy = -BlendKernel::kReach; dy <= BlendKernel::kReach; ++dy) {
      for (int dx = -BlendKernel::kReach; dx <= BlendKernel::kReach; ++dx) {
        const bool is_here = dx == 0 && dy == 0;
        if (!is_here && !neighbours->continues(g, frame, dx, dy)) continue;
        const auto there =
            is_here ? std::optional(rgba) : colour_at(page, {g.x + dx, g.y + dy, 0, 0}, g.colour);
        if (!there) continue;
        for (std::size_t c = 0; c < 3; ++c)
          sum[c] += kernel(dx, dy) * static_cast<double>((*there)[c]);
        weights += kernel(dx, dy);
      }
    }
    for (std::size_t c = 0; c < 3; ++c) {
      const auto own = static_cast<double>(rgba[c]);
      const double sharp = own + request_.sharpen * (own - sum[c] / weights);
      rgba[c] = static_cast<float>(std::clamp(sharp, 0.0, std::max(1.0, own)));
    }
  };
  // The block that holds `first`. Blocks without Gaussians begin where the next one does, and are
  // passed over.
  auto b = static_cast<std::size_t>(std::upper_bound(first_.begin(), first_.end(), first) -
                                    first_.begin() - 1);
  for (; b < blocks_.size() && first_[b] < last; ++b) {
    if (first_[b] == first_[b + 1]) continue;
    const store::GeometryBlock block = decode(blocks_[b]);
    const gaussian::MeshGaussians gaussians(
        block, request_.geometry->directory().pages[blocks_[b].page], sampling_);
    const PageColour& page = request_.pages[blocks_[b].page];
    const bool has_image = page.column != nullptr || page.tile_set != nullptr;
    if (sharpens && has_image) find_neighbours(blocks_[b], *neighbours);
    std::uint32_t shaped = UINT32_MAX;  // the triangle whose shape it is
    gaussian::Footprint shape{};
    gaussian::TexelFrame frame{};
    const std::uint64_t begin = std::max(first, first_[b]) - first_[b];
    gaussians.visit(begin, std::min(last, first_[b + 1]) - first_[b],
                    [&](const gaussian::MeshGaussian& g) {
                      auto rgba = colour_at(page, {g.x, g.y, g.frac_x, g.frac_y}, g.colour);
                      if (!rgba) return;
                      // A triangle without a texel's centre has the colour of a place between
                      // texels.
                      const bool is_texel = g.frac_x == 0 && g.frac_y == 0;
                      if (g.triangle != shaped) {
                        shape = gaussians.footprint(g.triangle);
                        if (sharpens && has_image && is_texel) frame = gaussians.frame(g.triangle);
                      }
                      shaped = g.triangle;
                      if (sharpens && has_image && is_texel) sharpen(page, g, frame, *rgba);
                      each({g, shape, *rgba});
                    });
  }
}

bool to_splat(const TexelGaussian& texel, store::Splat& splat, store::SplatCounts& filtered) {
  const auto count = [&](store::SplatFilter why) {
    ++filtered[static_cast<std::size_t>(why)];
    return false;
  };
  const auto value = [](double v) { return static_cast<float>(v); };
  splat.mean = texel.place.mean;
  splat.sigma = {value(texel.shape.sigma[0]), value(texel.shape.sigma[1]),
                 value(texel.shape.sigma[2])};
  for (std::size_t k = 0; k < 4; ++k) splat.rotation[k] = value(texel.shape.rotation[k]);
  splat.alpha = std::clamp(texel.rgba[3], kLeastAlpha, 1.0F);
  splat.colour = {texel.rgba[0], texel.rgba[1], texel.rgba[2]};
  splat.normal = texel.place.normal;
  if (!std::isfinite(splat.sigma.x) || !std::isfinite(splat.rotation[0]))
    return count(store::SplatFilter::not_finite);
  if (!(splat.sigma.x > 0)) return count(store::SplatFilter::sizeless);
  return true;
}

void TexelSource::read(std::uint64_t first, std::uint64_t count, store::SplatRows& out,
                       store::SplatCounts& filtered) const {
  visit(first, first + count, [&](const TexelGaussian& texel) {
    store::Splat splat;
    if (to_splat(texel, splat, filtered)) out.splats.push_back(splat);
  });
}

PageVector<store::Splat> TexelSource::sample() const {
  // Evenly in the order of the source, but in pieces of neighbours: one Gaussian at a time would
  // decode a block each.
  store::SplatRows sample;
  sample.splats.reserve(std::min(count(), kSampleSplats));
  store::SplatCounts ignored{};
  const std::uint64_t length = kSampleSplats / kSamplePieces;
  const auto start = [&](std::uint64_t piece) {
    return count() / kSamplePieces * piece + std::min(piece, count() % kSamplePieces);
  };
  for (std::uint64_t piece = 0; piece < kSamplePieces; ++piece) {
    const std::uint64_t here = std::min(length, start(piece + 1) - start(piece));
    if (here > 0) read(start(piece), here, sample, ignored);
    job_.meter.advance(0);  // stops here if the caller asked to
  }
  return std::move(sample.splats);
}

std::uint64_t texel_count_bound(const surface::GeometryRequest& geometry) {
  // A convex shape holds no more lattice points than its area, half its perimeter and one.
  double most = 0;
  for (std::size_t p = 0; p < geometry.pages.size(); ++p) {
    const mesh::Lattice& page = geometry.pages[p];
    for (const std::uint32_t t : geometry.triangles->of(geometry.first_page + p)) {
      most += 1;
      if (page.width == 0) continue;
      const auto c = mesh::texel_corners(*geometry.mesh, page, {t, 0, 0});
      const auto side = [&](std::size_t a, std::size_t b) {
        return std::hypot(c[a].x - c[b].x, c[a].y - c[b].y);
      };
      most += std::abs(mesh::doubled_area(c[0], c[1], c[2])) / 2 +
              (side(0, 1) + side(1, 2) + side(2, 0)) / 2;
    }
  }
  return static_cast<std::uint64_t>(std::min(most, 1e15));
}

}  // namespace pounce::flow
