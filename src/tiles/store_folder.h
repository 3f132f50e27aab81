// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "core/file.h"
#include "core/hash.h"
#include "tiles/pack.h"

namespace pounce::tiles {

/// Where finished packs live under their keys and unfinished ones are built. Either the tile cache
/// (a folder that outlives the process: `<root>/v1/<kind>/<key>.pack`) or a scratch store (nameless
/// files that vanish with the process). Publishing: write beside, fdatasync, rename, fsync the
/// folder; so a pack under its key is whole or not there. Thread-safe.
class StoreFolder {
 public:
  /// The cache. Creates the folders, takes the folder's lock (flock, dies with the process) and
  /// removes what dead runs left half-built. Nothing if another process holds the lock.
  static std::unique_ptr<StoreFolder> open_cache(FileSystem& files, const std::string& root);
  /// Scratch packs in `folder`, never visible under a name.
  static std::unique_ptr<StoreFolder> make_scratch(FileSystem& files, const std::string& folder);
  virtual ~StoreFolder() = default;

  /// A published pack, opened and its header, footer and directory checked; nothing if there is
  /// none. A damaged one is removed, reported through `warning` (appended to), and treated as
  /// absent.
  virtual std::unique_ptr<PackReader> find(PackKind kind, const Hash128& key,
                                           std::string* warning) = 0;
  /// A writer for a new pack.
  virtual std::unique_ptr<PackWriter> create(PackKind kind, const Hash128& key) = 0;
  /// Publishes a finished pack and opens it for reading.
  virtual std::unique_ptr<PackReader> publish(std::unique_ptr<PackWriter> writer) = 0;
  /// Removes a pack that turned out to be damaged.
  virtual void discard(PackKind kind, const Hash128& key) = 0;
  virtual bool persistent() const = 0;  ///< true for the cache
};

}  // namespace pounce::tiles
