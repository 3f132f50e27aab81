// SPDX-License-Identifier: Apache-2.0
//
// A source image becomes a column of colour tiles.
//
// The image is read once, top to bottom, in strips of one row of tiles; strips are cut, filtered
// and compressed beside the reading and written in order. Tiles carry an apron of two texels, so
// the first row of tiles needs the last rows of a repeating image: its strip waits until the end.
//
// Of an image of which the mesh shows little, the tiles that it shows are all that is kept, and
// rows after the last of them are not even decoded. Small images are built side by side.
//
// Of an image that is seen from afar a smaller level is all that is kept: rows are averaged two by
// two as they come (shading/mip_levels.h), and the image itself is never stored.
//
// Memory is that of a few strips and the decoder, whatever the image's height. A strip overlaps the
// next one by the aprons of both; these rows are copied, since a decoder goes forward only. The
// strip at the top is kept to the end: a repeating image needs its first rows below its last ones,
// and the other way round.
//
// The result depends on the image and its wrap modes alone. Which tiles are kept is part of the
// key.
#include <fmt/format.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>
#include <tbb/parallel_pipeline.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <utility>

#include "core/portable_math.h"
#include "flow/stores/build_stores.h"
#include "flow/stores/level_rows.h"
#include "io/files/asset_file.h"
#include "io/image/read.h"
#include "job/run_job.h"
#include "shading/mip_levels.h"

namespace pounce::flow {
namespace {

using mesh::kBlockEdge;
using store::kApron;
using store::kColourTileEdge;

constexpr std::uint64_t kMostTokens = 2;
constexpr std::uint32_t kStripRows = kColourTileEdge;

/// Rows [first, first + kStripRows) of an image, as far as they were read.
struct Strip {
  std::uint32_t tile_row = 0;
  std::int64_t first = 0;  ///< image row of rows[0]
  std::int64_t count = 0;
  PageVector<std::byte> rows;
};
using StripPtr = std::shared_ptr<Strip>;

struct StoredRow {
  std::uint32_t tile_row = 0;
  std::vector<std::vector<std::byte>> tiles;
};

/// What one token of the pipeline owns.
struct Slot {
  StripPtr strip;
  StoredRow stored;
};

/// What a column says of itself before its image is read.
store::ColourDirectory column_of(const ColourRequest& request) {
  return shading::level_of(image_directory(request), request.level);
}

bool is_same(const io::ImageInfo& a, const io::ImageInfo& b) {
  return a.width == b.width && a.height == b.height && a.channels == b.channels &&
         a.depth == b.depth && a.linear == b.linear && a.has_alpha == b.has_alpha &&
         a.premultiplied == b.premultiplied;
}

class ColumnBuilder {
 public:
  /// `lease`: of colour_least_bytes().
  ColumnBuilder(job::JobContext& job, const ColourRequest& request, const Hash128& key,
                runtime::Lease lease)
      : job_(job),
        reader_(*request.image, request.trust),
        wanted_(request.wanted.get()),
        lease_(std::move(lease)) {
    const io::ImageInfo& info = reader_.info();
    // Levels, tiles and leases were planned for what its header said then.
    if (!is_same(info, *request.info))
      throw Error(ErrorKind::input, request.image->label + ": the file changed while it was read");
    image_ = column_of(request);
    if (image_.premultiplied) reader_.keep_premultiplied();
    row_bytes_ = image_.width * image_.texel_bytes();
    rows_ = std::make_unique<LevelRows>(reader_, image_, request.level);
    end_row_ = rows_to_read();
    writer_ = std::make_unique<store::ColourStoreWriter>(
        job.stores->create(
            store::PackKind::colour, key,
            fmt::format("{}, {} x {}, {} x {}",
                        std::filesystem::path(request.image->label).filename().string(),
                        image_.width, image_.height, info.channels, depth_name(info.depth))),
        image_.tiles_y());
  }

  /// Reads the image and writes its tiles. Builders of several images may do so at once.
  void build() {
    // A pipeline forgets the tokens under way when a stage throws, so they are not what owns rows.
    // They leave in order, so those under way are neighbours: each has its own slot.
    std::array<Slot, kMostTokens> slots;
    tbb::parallel_pipeline(
        kMostTokens,
        tbb::make_filter<void, Slot*>(tbb::filter_mode::serial_in_order,
                                      [&](tbb::flow_control& flow) -> Slot* {
                                        if (next_row_ == end_row_) {
                                          flow.stop();
                                          return nullptr;
                                        }
                                        Slot& slot = slots[next_row_ % kMostTokens];
                                        slot.strip = read_strip();
                                        return &slot;
                                      }) &
            tbb::make_filter<Slot*, Slot*>(tbb::filter_mode::parallel,
                                           [&](Slot* slot) {
                                             const StripPtr strip = std::move(slot->strip);
                                             slot->stored = {};
                                             if (strip->tile_row > 0) slot->stored = encode(*strip);
                                             return slot;
                                           }) &
            tbb::make_filter<Slot*, void>(tbb::filter_mode::serial_in_order, [&](Slot* slot) {
              if (!slot->stored.tiles.empty()) write(slot->stored);
              slot->stored = {};
              ++rows_passed_;
              job_.meter.advance(1);
            }));
    // A pipeline that is stopped from outside returns as if it had ended. The column must not be
    // published then.
    if (rows_passed_ < end_row_) throw_stopped();
    write(encode(*top_));
    // Rows that nobody wants have no tiles, but an index: a column always has the shape of its
    // image.
    for (; next_row_ < image_.tiles_y(); ++next_row_) {
      write({next_row_, std::vector<std::vector<std::byte>>(image_.tiles_x())});
      job_.meter.advance(1);
    }
  }

  std::unique_ptr<store::ColourStore> publish() {
    return std::make_unique<store::ColourStore>(
        job_.stores->publish(writer_->finish(image_, job_.compressor())), image_, job_.compressor(),
        wanted_ != nullptr);
  }

 private:
  bool wants(std::uint32_t tile_x, std::uint32_t tile_y) const {
    return wanted_ == nullptr || wanted_->has(tile_x, tile_y);
  }

  /// How many rows of tiles to read: the first is always among them. Above the first row of a
  /// repeating image is its last.
  std::uint32_t rows_to_read() const {
    if (wanted_ == nullptr || (wanted_->has_row(0) && image_.wrap_v == mesh::Wrap::repeat))
      return image_.tiles_y();
    return std::max(wanted_->end_row(), std::uint32_t{1});
  }

  StripPtr read_strip() {
    // Shared: a strip is used by its token, as the one before by the next strip, and the first one
    // to the end.
    auto strip = std::make_shared<Strip>();
    strip->tile_row = next_row_++;
    strip->first = std::max<std::int64_t>(std::int64_t{strip->tile_row} * kBlockEdge - kApron, 0);
    const std::int64_t last = std::min<std::int64_t>(
        std::int64_t{strip->tile_row} * kBlockEdge + kBlockEdge + kApron, image_.height);
    strip->count = last - strip->first;
    strip->rows.resize(static_cast<std::size_t>(strip->count) * row_bytes_);
    // The strip before this one already read the rows that both share.
    std::int64_t have = 0;
    if (previous_ != nullptr) {
      have = previous_->first + previous_->count - strip->first;
      std::memcpy(strip->rows.data(),
                  previous_->rows.data() +
                      static_cast<std::size_t>(strip->first - previous_->first) * row_bytes_,
                  static_cast<std::size_t>(have) * row_bytes_);
    }
    const auto fresh = static_cast<std::uint32_t>(strip->count - have);
    std::byte* const at = strip->rows.data() + static_cast<std::size_t>(have) * row_bytes_;
    if (fresh > 0) {
      const WorkTimer decoding(job_.clock, "decode");
      rows_->read(fresh, at);
    }
    if (fresh > 0) {
      clean(at, std::size_t{fresh} * image_.width * image_.channels);
    }
    // Only the stage that reads moves these two, and it runs one strip at a time.
    if (strip->tile_row == 0) top_ = strip;
    previous_ = strip;
    return strip;
  }

  /// Float samples: NaN and infinity become 0, counted.
  void clean(std::byte* samples, std::size_t count) {
    if (!store::is_float(image_.depth)) return;
    const std::size_t size = store::depth_bytes(image_.depth);
    for (std::size_t i = 0; i < count; ++i) {
      std::byte* const at = samples + i * size;
      float value;
      if (image_.depth == Depth::half) {
        std::uint16_t bits;
        std::memcpy(&bits, at, 2);
        value = half_to_float(bits);
      } else {
        std::memcpy(&value, at, 4);
      }
      if (std::isfinite(value)) continue;
      std::memset(at, 0, size);
      ++image_.nonfinite;
    }
  }

  /// Row y of the image, wherever it was kept; y is inside the image.
  const std::byte* row(const Strip& strip, std::int64_t y) const {
    // The last strip is only asked for by the first one, once reading is over: until then the
    // reader moves it.
    const Strip* const kept[] = {&strip, top_.get(),
                                 strip.tile_row == 0 ? previous_.get() : &strip};
    for (const Strip* s : kept) {
      if (y >= s->first && y < s->first + s->count) {
        return s->rows.data() + static_cast<std::size_t>(y - s->first) * row_bytes_;
      }
    }
    throw Error(ErrorKind::internal, "an image row was let go too early");
  }

  StoredRow encode(const Strip& strip) {
    StoredRow out;
    out.tile_row = strip.tile_row;
    out.tiles.resize(image_.tiles_x());
    if (wanted_ != nullptr && !wanted_->has_row(strip.tile_row)) return out;
    const std::size_t texel = image_.texel_bytes();
    std::vector<const std::byte*> rows(kColourTileEdge,
                                       nullptr);  // null: beyond what any blend reads
    for (int r = 0; r < kColourTileEdge; ++r) {
      const std::int64_t y = std::int64_t{strip.tile_row} * kBlockEdge + r - kApron;
      if (y < std::int64_t{image_.height} + kApron) {
        rows[static_cast<std::size_t>(r)] =
            row(strip, store::wrapped(y, image_.height, image_.wrap_v));
      }
    }
    tbb::parallel_for(std::uint32_t{0}, image_.tiles_x(), [&](std::uint32_t tx) {
      if (!wants(tx, strip.tile_row)) return;
      std::vector<std::byte> tile(std::size_t{kColourTileEdge} * kColourTileEdge * texel);
      for (std::size_t r = 0; r < rows.size(); ++r) {
        if (rows[r] == nullptr) continue;
        std::byte* const to = tile.data() + r * kColourTileEdge * texel;
        const std::int64_t x0 = std::int64_t{tx} * kBlockEdge - kApron;
        // Most rows are one copy. At the left and right border each texel of the apron is looked up
        // as the image wraps.
        if (x0 >= 0 && x0 + kColourTileEdge <= image_.width) {
          std::memcpy(to, rows[r] + static_cast<std::size_t>(x0) * texel, kColourTileEdge * texel);
          continue;
        }
        for (std::int64_t i = 0;
             i < kColourTileEdge && x0 + i < std::int64_t{image_.width} + kApron; ++i) {
          const auto x =
              static_cast<std::size_t>(store::wrapped(x0 + i, image_.width, image_.wrap_u));
          std::memcpy(to + static_cast<std::size_t>(i) * texel, rows[r] + x * texel, texel);
        }
      }
      store::encode_tile(image_, tile, job_.compressor(), store::kZstdLevel, job_.stores_room(),
                         out.tiles[tx]);
    });
    return out;
  }

  /// Where another image of the batch, or the graph that asked for this one, has ended with an
  /// error, TBB stops what runs beside it without a word. The first error is what the job says.
  [[noreturn]] static void throw_stopped() {
    throw Error(ErrorKind::cancelled, "an image was not read to its end");
  }

  void write(const StoredRow& row) {
    for (std::uint32_t tx = 0; tx < image_.tiles_x(); ++tx) {
      if (wants(tx, row.tile_row) && row.tiles[tx].empty()) throw_stopped();
    }
    const auto raw_bytes = static_cast<std::uint32_t>(std::size_t{kColourTileEdge} *
                                                      kColourTileEdge * image_.texel_bytes());
    writer_->add_row(row.tile_row, row.tiles, raw_bytes, job_.compressor());
  }

  job::JobContext& job_;
  io::ImageReader reader_;
  const mesh::TileMask* wanted_;  ///< null: every tile
  runtime::Lease lease_;
  store::ColourDirectory image_;  ///< or the level that is built
  std::size_t row_bytes_ = 0;
  std::unique_ptr<LevelRows> rows_;
  std::unique_ptr<store::ColourStoreWriter> writer_;
  std::uint32_t next_row_ = 0, end_row_ = 0, rows_passed_ = 0;
  StripPtr top_, previous_;
};

}  // namespace

store::ColourDirectory image_directory(const ColourRequest& request) {
  const io::ImageInfo& info = *request.info;
  store::ColourDirectory image;
  image.width = info.width;
  image.height = info.height;
  image.channels = info.channels;
  image.depth = info.depth;
  image.linear = info.linear;
  image.has_alpha = info.has_alpha;
  // Float colours stay as the file has them, so that they can be written so again bit by bit.
  image.premultiplied = info.premultiplied && info.linear;
  image.wrap_u = request.wrap_u;
  image.wrap_v = request.wrap_v;
  return image;
}

std::uint64_t colour_least_bytes(std::uint32_t width, std::uint64_t texel_bytes,
                                 std::uint64_t decoder_bytes) {
  const std::uint64_t strip = round_to_pages(std::uint64_t{kStripRows} * width * texel_bytes);
  const std::uint64_t tile = std::uint64_t{kColourTileEdge} * kColourTileEdge * texel_bytes;
  // The first strip, the one before, and per token one strip raw and one compressed; scratch of the
  // encoders.
  return decoder_bytes + strip * (2 + 2 * kMostTokens) + 16 * tile;
}

Hash128 colour_key(job::JobContext& job, const ColourRequest& request) {
  Hash128 content;
  {
    const WorkTimer decoding(job.clock, "decode");
    // Of the encoded bytes: a column is found without decoding, and an image that is renamed or
    // moved keeps its column. Bytes that are in memory have no file whose hash could be remembered.
    const mesh::ImageRef& image = *request.image;
    const auto hash = [&image] { return io::hash_image(image); };
    content = image.bytes != nullptr
                  ? hash()
                  : job.content_hash(image.path, image.offset_bytes, image.size_bytes, hash);
  }
  Hasher hash;
  hash.add(std::string_view("colour column"));
  hash.add(store::kFormatVersion);
  hash.add(content);
  hash.add(request.wrap_u);
  hash.add(request.wrap_v);
  if (!request.image->channels.empty()) hash.add(std::string_view(request.image->channels));
  return hash.digest();
}

Hash128 level_key(const Hash128& whole, std::uint32_t level) {
  Hasher hash;
  hash.add(std::string_view("colour level"));
  hash.add(store::kFormatVersion);
  hash.add(whole);
  hash.add(level);
  return hash.digest();
}

Hash128 some_tiles_key(const Hash128& whole, const mesh::TileMask& wanted) {
  Hasher hash;
  hash.add(std::string_view("some tiles of a colour column"));
  hash.add(whole);
  // By the tiles themselves: another mesh that shows the same part of the image shares the column.
  hash.add(std::as_bytes(wanted.bytes()));
  return hash.digest();
}

std::uint64_t colour_least_bytes(const ColourRequest& request) {
  const io::ImageInfo& info = *request.info;
  return colour_least_bytes(info.width, info.channels * store::depth_bytes(info.depth),
                            info.decoder_bytes);
}

namespace {

std::unique_ptr<store::ColourStore> find_colours(job::JobContext& job, const ColourRequest& request,
                                                 const Hash128& key) {
  return find_store(
      job, store::PackKind::colour, key, [&](std::unique_ptr<store::PackReader> pack) {
        return std::make_unique<store::ColourStore>(std::move(pack), column_of(request),
                                                    job.compressor(), request.wanted != nullptr);
      });
}

/// Columns whose images are read at the same time, as far as memory lets it.
class ColumnBatch {
 public:
  ColumnBatch(job::JobContext& job, std::vector<FoundColumn>& columns)
      : job_(job), columns_(columns) {}

  /// Is there no room for another image beside those of the batch?
  bool is_full(std::uint64_t least_bytes) const {
    // Each has two strips under way, which keep a thread or two busy.
    return builders_.size() == job_.threads ||
           (!builders_.empty() && job_.budget.leased() + least_bytes > job_.budget.limit());
  }
  void add(std::size_t column, const ColourRequest& request, const Hash128& key,
           runtime::Lease lease) {
    builders_.emplace_back(column,
                           std::make_unique<ColumnBuilder>(job_, request, key, std::move(lease)));
  }
  void build(BesideImages* beside = nullptr) {
    if (beside != nullptr && has_room(*beside)) {
      // Who waits for a part of an image may not begin all of the other work.
      tbb::parallel_invoke([this] { tbb::this_task_arena::isolate([this] { build_images(); }); },
                           beside->make);
      beside->is_made = true;
    } else {
      build_images();
    }
    job_.report.images_decoded += builders_.size();
    builders_.clear();
  }

 private:
  /// What is built is published at once: others may wait for it, and what fails beside it is no
  /// reason to build it again.
  void build_images() {
    tbb::parallel_for(std::size_t{0}, builders_.size(),
                      [&](std::size_t i) { builders_[i].second->build(); });
    for (auto& [column, builder] : builders_) {
      columns_[column].store = builder->publish();
      builder.reset();  // and its memory
    }
  }

  bool has_room(const BesideImages& beside) const {
    return job_.threads > 1 && !builders_.empty() &&
           job_.budget.leased() + beside.least_bytes <= job::bytes_at_once(job_);
  }

  job::JobContext& job_;
  std::vector<FoundColumn>& columns_;
  std::vector<std::pair<std::size_t, std::unique_ptr<ColumnBuilder>>> builders_;
};

}  // namespace

std::vector<FoundColumn> colour_stores(job::JobContext& job,
                                       std::span<const ColourRequest> requests,
                                       std::span<const Hash128> keys, BesideImages* beside) {
  std::vector<FoundColumn> columns(requests.size());
  ColumnBatch batch(job, columns);
  for (std::size_t i = 0; i < requests.size(); ++i) {
    // Images are gathered until threads or memory are used up, then built at once. A small image
    // keeps a thread or two busy, so hundreds of them would otherwise be read one after the other.
    const std::uint64_t least = colour_least_bytes(requests[i]);
    if (batch.is_full(least)) batch.build();
    columns[i].store = find_colours(job, requests[i], keys[i]);
    columns[i].cached = columns[i].store != nullptr;
    if (columns[i].cached) continue;
    batch.add(i, requests[i], keys[i],
              runtime::Lease(job.budget, least, "decoding " + requests[i].image->label));
  }
  batch.build(beside);
  return columns;
}

FoundColumn whole_colours(job::JobContext& job, const ColourRequest& request, const Hash128& key) {
  FoundColumn column{find_colours(job, request, key), true};
  if (column.store != nullptr) return column;
  ColumnBuilder builder(job, request, key, {});
  builder.build();
  return {builder.publish(), false};
}

}  // namespace pounce::flow
