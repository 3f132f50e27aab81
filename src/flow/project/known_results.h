// SPDX-License-Identifier: Apache-2.0
//
// Results that outlive their job. What a page becomes that is blended from Gaussians depends on
// two stores, on how they are blended and on the format of the texels, so the cache keeps it under
// the key of these: another kind of file, another gutter or another image to paint over needs no
// projection. Of meshes it keeps hits instead (known_hits.h), which other textures can use, too.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/hash.h"
#include "flow/project/page_projector.h"
#include "job/job_context.h"
#include "shading/result_block.h"
#include "shading/texel_input.h"
#include "store/blocks/geometry_store.h"
#include "store/blocks/result_store.h"

namespace pounce::flow {

/// A page whose results may be known.
struct KnownPage {
  Hash128 key;  ///< of all that decides them: begin_key(), and how they are blended
  const store::GeometryStore* target = nullptr;
  std::vector<shading::TexelFormat> formats;  ///< of its images
};

/// Adds what decides the results of any kind of source.
void begin_key(const Hash128& source, const store::GeometryStore& target, Hasher& hash);
void add_format(const shading::TexelFormat& format, Hasher& hash);
void add_input(const shading::ColourInput& input, Hasher& hash);

/// Keeps the results of a page while they are made. Where they cannot be stored, publish() says so
/// as a warning: the job is done without.
class ResultKeeper {
 public:
  /// After a look in the cache that has found nothing: others wait for them from then on.
  ResultKeeper(job::JobContext& job, const KnownPage& page);
  void store(const PieceWork& work);  ///< not thread-safe
  void publish();                     ///< after the last one

 private:
  /// Does a step of storing, and stores no more where the disk refuses it, or the cache has no
  /// room: then it would only take that of the job's own scratch.
  template <typename Step>
  void while_stored(const Step& step);

  job::JobContext& job_;
  runtime::Lease index_lease_;
  std::unique_ptr<store::ResultStoreWriter> writer_;  ///< null: refused
  store::ResultCounts counts_;
  std::string refusal_;
};

/// What projects a page: its results from the cache, or what `make` makes of it, kept as they are
/// made. `make` gets no keeper where nothing is kept: without a cache, where the budget is so tight
/// that an index more would cost the projection its memory, for texels that go through a colour
/// transform, whose last bits may be a processor's own, and where a part of the page is there.
std::unique_ptr<Projection> known_or_made(
    job::JobContext& job, KnownPage page,
    std::function<std::unique_ptr<Projection>(ResultKeeper*)> make);

}  // namespace pounce::flow
