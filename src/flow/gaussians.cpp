// SPDX-License-Identifier: Apache-2.0
//
// The source alone, preconditioned and written for other programs: a mesh as Gaussians.
//
//   mesh + image ─▶ source store ─▶ count ─▶ parts ─▶ rows of a 3DGS PLY
//
// Blocks are written by page, then from top to bottom and left to right of the page, and a block's
// Gaussians by triangle: an order that no tile cut, thread or budget knows of. A first pass over
// the blocks counts their Gaussians, so that even a block of millions (an image repeated over one
// triangle) is cut into parts whose bytes are known before they are made.
#include "pounce/gaussians.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <tuple>

#include "flow/describe_job.h"
#include "flow/job.h"
#include "flow/ordered_stream.h"
#include "flow/output_names.h"
#include "flow/page_colour.h"
#include "flow/plan.h"
#include "flow/uv_repeats.h"
#include "io/file_ending.h"
#include "io/read_mesh.h"
#include "io/splat_ply_write.h"
#include "source/texel_gaussians.h"

namespace pounce {
namespace flow {
namespace {

// Shares of the progress bar.
constexpr double kAfterReading = 0.02, kAfterColours = 0.3, kAfterGeometry = 0.4,
                 kAfterCount = 0.45;

constexpr std::uint64_t kPartRows = 16384;
/// Opacity is a logit: alpha 0 and 1 would be infinite. exp(-10) is a 22000th.
constexpr float kLargestLogit = 10;
/// A decoded block's vertices and triangles, and what counting them takes.
constexpr std::uint64_t kPerTriangle = 300;

bool ends_in_ply(const std::string& path) { return io::lower_ending(path) == ".ply"; }

/// A block in the order of the output.
struct BlockPlace {
  std::uint32_t page = 0;
  std::int32_t y = 0, x = 0;
  std::uint32_t triangles = 0;
  tiles::ChunkRef chunk;
  std::uint64_t gaussians = 0;
};

/// Some of a block's Gaussians: what is made and written at once.
struct Part {
  std::size_t block = 0;
  std::uint64_t begin = 0, end = 0;
};

float opacity_of(float alpha) {
  if (!(alpha > 0)) return -kLargestLogit;
  if (alpha >= 1) return kLargestLogit;
  const double logit = std::log(double{alpha} / (1 - double{alpha}));
  return std::clamp(static_cast<float>(logit), -kLargestLogit, kLargestLogit);
}

class GaussiansJob {
 public:
  GaussiansJob(const GaussiansOptions& options, JobRun& run, bool rebuild)
      : options_(options),
        job_(open_job(options.resources, options.output, false, rebuild, false, run)) {
    job_->tile_cap_bytes = kTileCapBytes;
  }

  void run() {
    plan();
    precondition_colours();
    precondition_geometry();
    // From here on only the stores are read, never the inputs.
    count();
    write();
  }

 private:
  std::uint64_t reading_bytes() const {
    return io::mesh_cost(options_.source, {options_.allow_external, {}}, job_->budget.limit())
        .peak_bytes;
  }

  void plan() {
    const StageTimer timer(job_->clock, "read");
    job_->meter.begin("read mesh", 1, "meshes", kAfterReading);
    require_reading(*job_, reading_bytes(), options_.source);
    mesh_ = io::read_mesh(options_.source, {options_.allow_external, {}});
    TransferOptions transfer;
    transfer.source = options_.source;
    transfer.source_textures = options_.source_textures;
    transfer.channels = {Channel::base_color};
    transfer.output = "colours.exr";  // a format that holds any image: nothing is written there
    plan_ = plan_source(transfer, mesh_);
    warn_of_repeats(request(), plan_.warnings);
    for (const auto* warnings : {&mesh_.warnings, &plan_.warnings}) {
      job_->report.warnings.insert(job_->report.warnings.end(), warnings->begin(), warnings->end());
    }
    for (const std::string& file : mesh_.files) add_input(file, job_->report);
    for (const ColumnPlan& column : plan_.columns) add_input(column.image.path, job_->report);
    check_output();
    require_least(*job_, least());
    mesh_lease_ = Lease(job_->budget, mesh_.size_bytes(), "the mesh");
    leases_.emplace_back(job_->budget, job_->threads * tiles::Compressor::context_bytes(),
                         "the compressors");
    job_->meter.end();
  }

  void check_output() const {
    check_outputs({options_.output});
    std::vector<std::string> inputs{options_.source};
    for (const ColumnPlan& column : plan_.columns) inputs.push_back(column.image.path);
    for (const std::string& input : inputs) {
      std::error_code ignored;
      if (!input.empty() && std::filesystem::equivalent(options_.output, input, ignored)) {
        throw Error(ErrorKind::usage,
                    options_.output + ": is also an input; write to another file");
      }
    }
  }

  const GeometryRequest& request() const { return plan_.passes.front().source; }

  /// What making one part takes: its rows, its block and the tiles of its colours.
  static std::uint64_t part_bytes(std::uint64_t rows, std::uint64_t triangles,
                                  std::uint64_t chunk_bytes, std::uint64_t colour_tile_bytes) {
    return round_to_pages(rows * sizeof(io::SplatPlyRow)) + triangles * kPerTriangle +
           2 * chunk_bytes + (ColourWindow::kTiles + 2) * colour_tile_bytes + (64 << 10);
  }

  LeastMemory least() const {
    const std::uint64_t contexts = job_->threads * tiles::Compressor::context_bytes();
    const std::uint64_t beside = contexts + mesh_.size_bytes();
    LeastMemory most{reading_bytes(), "reading " + options_.source};
    const auto need = [&most](std::uint64_t bytes, const std::string& why) {
      if (bytes > most.bytes) most = {bytes, why};
    };
    std::uint64_t tile = 0;
    for (const ColumnPlan& column : plan_.columns) {
      const std::uint64_t texel = column.info.channels * tiles::depth_bytes(column.info.depth);
      need(beside + colour_least_bytes(column.info.width, texel, column.info.decoder_bytes),
           "reading " + column.image.label);
      tile =
          std::max(tile, round_to_pages(tiles::kColourTileEdge * tiles::kColourTileEdge * texel));
    }
    const std::uint64_t building = geometry_least_bytes(request(), job_->tile_cap_bytes);
    need(beside + building, "preconditioning " + options_.source);
    const std::uint64_t triangles =
        std::min<std::uint64_t>(mesh_.triangles.size(), tiles::kMostTrianglesPerBlock);
    // The lists of blocks and parts take less than twice what binning took for each block.
    need(contexts + 2 * building +
             part_bytes(kPartRows, triangles, triangles * 160 + (1 << 16), tile),
         "writing " + options_.output);
    return most;
  }

  void precondition_colours() {
    const StageTimer timer(job_->clock, "precondition");
    std::uint64_t rows = 0;
    for (const ColumnPlan& column : plan_.columns) rows += (column.info.height + 63) / 64;
    job_->meter.begin("source colours", rows, "rows of tiles", kAfterColours);
    for (const ColumnPlan& column : plan_.columns) {
      bool cached = false;
      columns_.push_back(colour_store(
          *job_, {&column.image, &column.info, column.wrap_u, column.wrap_v}, &cached));
      const tiles::ColourStore& store = *columns_.back();
      if (store.directory().nonfinite > 0) {
        job_->report.source_filtered["nonfinite samples"] += store.directory().nonfinite;
        job_->report.warnings.push_back(
            fmt::format("{}: {} samples are NaN or infinite and count as 0", column.image.label,
                        store.directory().nonfinite));
      }
      job_->count_store(store.pack(), cached);
      job_->report.source_store_bytes += store.pack().size_bytes();
    }
    for (const TileSetPlan& set : plan_.tile_sets) {
      tile_sets_.push_back({set.size.width, set.size.height, {}});
      for (const auto& [tile, column] : set.columns)
        tile_sets_.back().tiles[tile] = columns_[column].get();
    }
    job_->meter.end();
    for (const PageTexture& page : plan_.channels.front().pages) {
      pages_.push_back(
          {page.column < 0 ? nullptr : columns_[static_cast<std::size_t>(page.column)].get(),
           page.tile_set < 0 ? nullptr : &tile_sets_[static_cast<std::size_t>(page.tile_set)],
           page.constant});
    }
  }

  void precondition_geometry() {
    const StageTimer timer(job_->clock, "precondition");
    job_->meter.begin("precondition", 0, "tiles", kAfterGeometry);
    bool cached = false;
    store_ = geometry_store(*job_, request(), &cached);
    const tiles::GeometryDirectory& directory = store_->directory();
    leases_.emplace_back(job_->budget, store_->size_bytes(), "the directory of the source store");
    job_->report.source_tiles = directory.tiles.size();
    job_->report.source_store_bytes += store_->pack().size_bytes();
    job_->count_store(store_->pack(), cached);
    if (directory.degenerate > 0)
      job_->report.source_filtered["degenerate triangles"] = directory.degenerate;
    mesh_ = {};
    mesh_lease_ = {};
    job_->meter.end();
  }

  // --- the order of the output
  // --------------------------------------------------------------------

  void count() {
    const StageTimer timer(job_->clock, "count");
    const tiles::GeometryDirectory& directory = store_->directory();
    std::uint64_t blocks = 0;
    for (const tiles::TileEntry& tile : directory.tiles) blocks += tile.blocks;
    job_->meter.begin("count", blocks, "blocks", kAfterCount);
    leases_.emplace_back(job_->budget,
                         round_to_pages(blocks * (sizeof(BlockPlace) + sizeof(std::uint64_t))),
                         "the list of blocks");
    blocks_.reserve(blocks);
    for (std::uint32_t t = 0; t < directory.tiles.size(); ++t) {
      for (const tiles::BlockEntry& e : store_->read_index(t, job_->compressor()))
        blocks_.push_back({e.page, e.y, e.x, e.triangles, e.chunk, 0});
    }
    std::sort(blocks_.begin(), blocks_.end(), [](const BlockPlace& a, const BlockPlace& b) {
      // Blocks of one window were stored in the order of their triangles.
      return std::tie(a.page, a.y, a.x, a.chunk.offset) <
             std::tie(b.page, b.y, b.x, b.chunk.offset);
    });
    PageVector<std::uint64_t> costs;
    costs.reserve(blocks);
    for (const BlockPlace& block : blocks_)
      costs.push_back(part_bytes(0, block.triangles, block.chunk.raw_bytes, 0));
    run_ordered<std::uint64_t>(
        job_->budget, costs, "counting Gaussians",
        [&](std::size_t b) {
          const tiles::GeometryBlock block = read(blocks_[b]);
          return source::MeshGaussians(block, lattice(blocks_[b])).count();
        },
        [&](std::size_t b, std::uint64_t count) {
          blocks_[b].gaussians = count;
          job_->meter.advance(1);
        });
    job_->meter.end();
  }

  const mesh::Lattice& lattice(const BlockPlace& block) const {
    return store_->directory().pages[block.page];
  }

  tiles::GeometryBlock read(const BlockPlace& block) {
    tiles::BlockEntry entry;
    entry.page = block.page;
    entry.x = block.x;
    entry.y = block.y;
    entry.triangles = block.triangles;
    entry.chunk = block.chunk;
    return store_->read_block(entry, job_->compressor());
  }

  // --- the rows
  // -----------------------------------------------------------------------------------

  void write() {
    const StageTimer timer(job_->clock, "write");
    std::uint64_t most_tile = 0, total = 0, part_count = 0;
    for (const auto& column : columns_) most_tile = std::max(most_tile, column->tile_bytes());
    for (const BlockPlace& block : blocks_) {
      total += block.gaussians;
      part_count += (block.gaussians + kPartRows - 1) / kPartRows;
    }
    const Lease list(job_->budget,
                     round_to_pages(part_count * (sizeof(Part) + sizeof(std::uint64_t))),
                     "the list of parts");
    PageVector<Part> parts;
    PageVector<std::uint64_t> costs;
    parts.reserve(part_count);
    costs.reserve(part_count);
    for (std::size_t b = 0; b < blocks_.size(); ++b) {
      for (std::uint64_t begin = 0; begin < blocks_[b].gaussians; begin += kPartRows) {
        const std::uint64_t end = std::min(begin + kPartRows, blocks_[b].gaussians);
        parts.push_back({b, begin, end});
        costs.push_back(
            part_bytes(end - begin, blocks_[b].triangles, blocks_[b].chunk.raw_bytes, most_tile));
      }
    }
    job_->meter.begin("write", total, "Gaussians", 1);
    SourceCache cache(*job_, *store_);
    io::SplatPlyWriter writer(options_.output);
    using Rows = PageVector<io::SplatPlyRow>;
    run_ordered<Rows>(
        job_->budget, costs, "writing " + options_.output,
        [&](std::size_t i) { return make_rows(parts[i], cache); },
        [&](std::size_t i, Rows& rows) {
          const WorkTimer encoding(job_->clock, "encode");
          writer.write(rows);
          job_->meter.advance(parts[i].end - parts[i].begin);
        });
    finish(writer, total);
    job_->meter.end();
  }

  void finish(io::SplatPlyWriter& writer, std::uint64_t counted) {
    const std::uint64_t rows = writer.rows();
    if (rows == 0) {
      throw Error(ErrorKind::input, options_.source +
                                        ": none of its triangles has an area and a colour, so "
                                        "there is no Gaussian to write");
    }
    if (rows < counted)
      job_->report.source_filtered["in a UDIM tile without image"] = counted - rows;
    writer.commit();
    job_->report.outputs = {options_.output};
    job_->report.source_gaussians = rows;
    job_->report.bytes_written += rows * sizeof(io::SplatPlyRow);
    job_->report.bytes_read += store_->pack().bytes_read();
    for (const auto& column : columns_) job_->report.bytes_read += column->pack().bytes_read();
    job_->report.tiles_read = store_->directory().tiles.size();
  }

  PageVector<io::SplatPlyRow> make_rows(const Part& part, SourceCache& cache) {
    const BlockPlace& place = blocks_[part.block];
    const tiles::GeometryBlock block = read(place);
    const source::MeshGaussians gaussians(block, lattice(place));
    const PageColour& page = pages_[place.page];
    ColourWindow window(cache);
    PageVector<io::SplatPlyRow> rows;
    rows.reserve(part.end - part.begin);
    io::SplatPlyRow row{};
    std::uint32_t shaped = UINT32_MAX;  // the triangle whose shape `row` has
    gaussians.visit(part.begin, part.end, [&](const source::MeshGaussian& g) {
      if (!set_colour(page, window, g, row)) return;
      if (g.triangle != shaped) set_shape(gaussians.footprint(g.triangle), row);
      shaped = g.triangle;
      std::memcpy(row.position, &g.mean, sizeof row.position);
      std::memcpy(row.normal, &g.normal, sizeof row.normal);
      rows.push_back(row);
    });
    return rows;
  }

  static void set_shape(const source::Footprint& shape, io::SplatPlyRow& row) {
    for (std::size_t i = 0; i < 3; ++i) row.scale[i] = static_cast<float>(std::log(shape.sigma[i]));
    for (std::size_t i = 0; i < 4; ++i) row.rotation[i] = static_cast<float>(shape.rotation[i]);
  }

  /// False: there is no image where the colour would be.
  static bool set_colour(const PageColour& page, ColourWindow& window,
                         const source::MeshGaussian& g, io::SplatPlyRow& row) {
    static const texture::TexelFormat kCodedRgba{4, Depth::float32, false, true, true};
    texture::TexelValue value = page.constant;
    if (page.column != nullptr || page.tile_set != nullptr) {
      const ColourPlace at = window.find(page, {g.x, g.y, g.frac_x, g.frac_y});
      if (at.image == nullptr) return false;
      projection::Taps taps;
      projection::tent(at.rest_x, at.rest_y, taps);
      value = blended(at, taps, false);
    }
    float rgba[4];
    texture::store_texel(kCodedRgba, value, reinterpret_cast<std::byte*>(rgba));
    for (std::size_t c = 0; c < 3; ++c)
      row.dc[c] = static_cast<float>((double{rgba[c]} - 0.5) / io::kDegree0);
    row.opacity = opacity_of(rgba[3]);
    return true;
  }

  const GaussiansOptions& options_;
  std::unique_ptr<JobContext> job_;
  mesh::Mesh mesh_;
  Plan plan_;
  Lease mesh_lease_;
  std::vector<Lease> leases_;  ///< what stays in use until the job ends
  std::vector<std::unique_ptr<tiles::ColourStore>> columns_;
  std::vector<TileColumns> tile_sets_;
  std::vector<PageColour> pages_;
  std::unique_ptr<tiles::GeometryStore> store_;
  PageVector<BlockPlace> blocks_;
};

void check_options(const GaussiansOptions& o) {
  if (o.source.empty() || o.output.empty())
    throw Error(ErrorKind::usage, "a source and an output are needed");
  if (ends_in_ply(o.source)) {
    throw Error(ErrorKind::usage,
                o.source +
                    ": Gaussians are made from a textured mesh (.glb, .gltf or .obj); a "
                    "splat scene has them already");
  }
  if (!ends_in_ply(o.output))
    throw Error(ErrorKind::usage, o.output + ": Gaussians are written as .ply; name it so");
}

}  // namespace
}  // namespace flow

Report gaussians(const GaussiansOptions& options, Progress* progress, Report* so_far) {
  return flow::run_job(options.resources, progress, so_far, [&](flow::JobRun& run, bool rebuild) {
    flow::describe(options, run.report);
    flow::check_options(options);
    flow::GaussiansJob(options, run, rebuild).run();
  });
}

}  // namespace pounce
