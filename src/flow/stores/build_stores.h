// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fmt/format.h>

#include <functional>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "io/image/read.h"
#include "job/job_context.h"
#include "mesh/block_bins.h"
#include "mesh/lattice.h"
#include "pounce/error.h"
#include "store/blocks/colour_store.h"
#include "store/blocks/geometry_store.h"
#include "store/blocks/hit_store.h"
#include "store/blocks/splat_store.h"
#include "surface/geometry_request.h"
#include "surface/source_block.h"

namespace pounce::flow {

/// Decodes all that a store holds. Throws Error(damaged_store) if anything of it is not what it
/// should be: checksums alone say nothing of packs that somebody else wrote.
void check_store(job::JobContext& job, const store::GeometryStore& store);
void check_store(job::JobContext& job, const store::ColourStore& store);
void check_store(job::JobContext& job, const store::SplatStore& store);
void check_store(job::JobContext& job, const store::HitStore& store);

/// Throws Error(damaged_store) if a source's largest blocks are smaller than it says: that it asks
/// for more memory than there is may be a lie.
void check_largest(job::JobContext& job, const store::GeometryStore& store);

/// A stored block of a source as projection uses it, which its index has announced.
surface::SourceBlock decoded_source(const store::GeometryStore& store,
                                    const store::BlockEntry& entry,
                                    const store::GeometryBlock& block,
                                    bool with_attributes = false);

/// The store that open(pack) makes of a pack of the cache; null if the caller is to make the pack
/// (store::StoreFolder::find). One that is damaged, or in a job that checks its packs has anything
/// damaged in it, is discarded with a warning.
template <class Open>
auto find_store(job::JobContext& job, store::PackKind kind, const Hash128& key, const Open& open)
    -> decltype(open(nullptr)) {
  while (auto pack = job.find_pack(kind, key)) {
    try {
      auto store = open(std::move(pack));
      if (job.check_packs) check_store(job, *store);
      return store;
    } catch (const Error& e) {
      if (e.kind() != ErrorKind::damaged_store) throw;
      const bool removed = job.stores->discard(kind, key);
      job.report.warnings.push_back(
          fmt::format("{} ({}; rebuilding it)", e.what(), removed ? "removed" : "ignored"));
    }
  }
  return nullptr;
}

/// Preconditions a source or vectorizes a target into a store, or finds it in the cache. Opens no
/// input; writes to job.report.
std::unique_ptr<store::GeometryStore> geometry_store(job::JobContext& job,
                                                     const surface::GeometryRequest& request,
                                                     bool* cached);

/// Work that needs no image, for the threads that decoding leaves idle: an image is decoded by one.
struct BesideImages {
  /// Opens no input. While it runs it alone writes to job.report and looks for packs.
  std::function<void()> make;
  std::uint64_t least_bytes = 0;  ///< that it must be able to lease
  bool is_made = false;           ///< there was a thread, an image and memory for it
};

/// One source image as a column of the source store.
struct ColourRequest {
  const mesh::ImageRef* image = nullptr;
  const io::ImageInfo* info = nullptr;  ///< of that image
  mesh::Wrap wrap_u = mesh::Wrap::repeat, wrap_v = mesh::Wrap::repeat;
  std::shared_ptr<const mesh::TileMask> wanted;  ///< the tiles that are kept; null: all
  const ImageTrust& trust;
  /// Not the image: this level of it, all tiles. One that is_halved_evenly().
  std::uint32_t level = 0;
};
/// What the image's column says of itself before its samples are read.
store::ColourDirectory image_directory(const ColourRequest& request);
/// Key of a whole column: content of the image, wrap modes. Reads the image where nobody remembers
/// its content.
Hash128 colour_key(job::JobContext& job, const ColourRequest& request);
/// Key of a level of the image whose whole column has that key.
Hash128 level_key(const Hash128& whole, std::uint32_t level);
/// Key of a column that has only these tiles of the whole one.
Hash128 some_tiles_key(const Hash128& whole, const mesh::TileMask& wanted);

struct FoundColumn {
  std::unique_ptr<store::ColourStore> store;
  bool cached = false;  ///< it was there already
};
/// Builds columns, side by side as memory allows, or finds them in the cache; `keys` are theirs.
/// Advances the meter by their rows of tiles. Counts images in the report. `beside`: made while the
/// last of them are, if it can be.
std::vector<FoundColumn> colour_stores(job::JobContext& job,
                                       std::span<const ColourRequest> requests,
                                       std::span<const Hash128> keys,
                                       BesideImages* beside = nullptr);
/// The same of one column, all of it, under the caller's lease of colour_least_bytes().
FoundColumn whole_colours(job::JobContext& job, const ColourRequest& request, const Hash128& key);
/// What building a column of such an image needs at once, at least.
std::uint64_t colour_least_bytes(const ColourRequest& request);
std::uint64_t colour_least_bytes(std::uint32_t width, std::uint64_t texel_bytes,
                                 std::uint64_t decoder_bytes);

/// One image of a hit map (projection/hit_block.h).
struct MapRequest {
  std::string path;
  ImageSize size;
  std::uint64_t decoder_bytes = 0;
  std::size_t source_pages = 0;
  float max_distance = 0;  ///< of the search that found them: for the report's distances
  ImageTrust trust = {};
};

/// The hits of an image as a store, as a search leaves them; or as the cache has them by the
/// image's content. Throws Error(input) for what no map has.
std::unique_ptr<store::HitStore> map_hits(job::JobContext& job, const MapRequest& request,
                                          bool* cached);
/// What that takes at once.
std::uint64_t map_hits_bytes(const MapRequest& request);

}  // namespace pounce::flow
