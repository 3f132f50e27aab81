// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/file.h"
#include "core/hash.h"
#include "store/pack/pack.h"

namespace pounce::store {

/// How a job uses the tile cache.
struct CacheOptions {
  /// Room on disk that the cache may take, packs that are being written included; 0 = no limit.
  std::uint64_t limit_bytes = 0;
  /// Folder for packs that the limit leaves no room for; empty = the cache's own.
  std::string scratch_folder;
  /// Another cache that is read and never written; empty = none.
  std::string second_root;
  /// Read every byte of a pack before it is believed: one of them turned out to be damaged.
  bool verify = false;
  /// Called some twenty times a second while another process (`holder`, "process 123") makes the
  /// pack at `path`. May throw, which ends the waiting.
  std::function<void(const std::string& holder, const std::string& path)> waiting;
};

/// Where finished packs live under their keys and unfinished ones are built. Either the tile cache
/// (a folder that outlives the process and serves several at once: docs/cache.md) or a scratch
/// store (nameless files that vanish with the process). Thread-safe.
///
/// Use: find(); if there is nothing, create(), append, publish(). In a cache a find() that finds
/// nothing claims the key: other processes wait until the pack is published or its writer is gone.
/// Who looks for another key meanwhile does not wait for it, so that two processes cannot wait for
/// each other, but may make a copy of what is being made.
class StoreFolder {
 public:
  /// The cache. Creates its folders and removes what dead runs left half-built. Where nothing can
  /// be written it is only read from. Throws Error(storage) if it can be neither, or knows no
  /// locks.
  static std::unique_ptr<StoreFolder> open_cache(FileSystem& files, const std::string& root,
                                                 CacheOptions options = {});
  /// Scratch packs in `folder`, never visible under a name.
  static std::unique_ptr<StoreFolder> make_scratch(FileSystem& files, const std::string& folder);
  virtual ~StoreFolder() = default;

  /// A published pack, opened and its header, footer and directory checked; it is not removed by
  /// anybody as long as it is open. Nothing if there is none; then the key is this store's to make.
  /// Waits for another process that makes it, unless this store has claimed another key: then the
  /// work may be done twice, but nobody waits for somebody who waits. A damaged pack is removed,
  /// reported through `warning` (appended to), and treated as absent.
  virtual std::unique_ptr<PackReader> find(PackKind kind, const Hash128& key,
                                           std::string* warning) = 0;
  /// Gives up a key that find() left to this store: others need not wait for it any more.
  virtual void give_up(PackKind, const Hash128&) {}
  /// A writer for a new pack. `label` says to people what it is made from; names of files, not
  /// paths.
  virtual std::unique_ptr<PackWriter> create(PackKind kind, const Hash128& key,
                                             const std::string& label = {}) = 0;
  /// Publishes a finished pack and opens it for reading. One that somebody else published meanwhile
  /// stays.
  virtual std::unique_ptr<PackReader> publish(std::unique_ptr<PackWriter> writer) = 0;
  /// Will publish() leave what is written for other jobs? Not where nothing may be written, nor
  /// where the limit has refused it: then a note says so.
  virtual bool is_kept(const PackWriter& writer) = 0;
  /// Removes a pack that turned out to be damaged. Who reads it goes on reading. False: it is not
  /// ours to remove; then this store behaves as if it were not there.
  virtual bool discard(PackKind kind, const Hash128& key) = 0;
  /// Whether new packs of this kind are added from now on, as at first. Others are of this store
  /// alone, and nobody is asked to wait for them; what is there already is found all the same.
  virtual void add_new(PackKind, bool) {}
  virtual bool persistent() const = 0;  ///< true for the cache
  /// What a user should know of how the store went, each once; empty afterwards.
  virtual std::vector<std::string> take_notes() { return {}; }
};

}  // namespace pounce::store
