// SPDX-License-Identifier: Apache-2.0
//
// Where packs live that go with their process, and those that a cache has no room for.
#include <fmt/format.h>

#include <map>
#include <mutex>
#include <tuple>
#include <utility>

#include "pounce/error.h"
#include "store/cache/cache_space.h"
#include "store/cache/small_scratch.h"
#include "store/cache/store_folder.h"

namespace pounce::store {
namespace {

using Name = std::tuple<PackKind, std::uint64_t, std::uint64_t>;
Name name_of(PackKind kind, const Hash128& key) { return {kind, key.hi, key.lo}; }

/// Packs of this process alone: nameless files, kept open. No claims, since nobody else looks.
class ScratchStore final : public StoreFolder {
 public:
  ScratchStore(FileSystem& files, std::string folder)
      : files_(files), folder_(std::move(folder)), shared_(files_, folder_) {}

  std::unique_ptr<PackReader> find(PackKind kind, const Hash128& key, std::string*) override {
    const std::lock_guard lock(mutex_);
    const auto found = packs_.find(name_of(kind, key));
    return found == packs_.end() ? nullptr : open(*found->second);
  }

  std::unique_ptr<PackWriter> create(PackKind kind, const Hash128& key,
                                     const std::string&) override {
    // Images, of which there may be thousands, stay as long as the job: what of them is small need
    // not be removed from between others.
    return std::make_unique<PackWriter>(
        kind == PackKind::colour ? shared_.create() : files_.create_scratch(folder_), kind, key);
  }

  std::unique_ptr<PackReader> publish(std::unique_ptr<PackWriter> writer) override {
    if (writer == nullptr || !writer->finished()) {
      throw Error(ErrorKind::internal, "an unfinished pack was published (please report)");
    }
    auto reader = open(*writer);
    const std::lock_guard lock(mutex_);
    const Name name = name_of(writer->kind(), writer->key());
    packs_[name] = std::move(writer);
    return reader;
  }

  bool is_kept(const PackWriter&) override { return false; }
  bool discard(PackKind kind, const Hash128& key) override {
    const std::lock_guard lock(mutex_);
    packs_.erase(name_of(kind, key));
    return true;
  }
  bool persistent() const override { return false; }

 private:
  std::unique_ptr<PackReader> open(PackWriter& writer) const {
    return std::make_unique<PackReader>(
        writer.file().reader(),
        fmt::format("{}/(scratch {} pack)", folder_, kind_name(writer.kind())), writer.kind(),
        writer.key());
  }

  FileSystem& files_;
  const std::string folder_;
  SharedScratch shared_;
  std::mutex mutex_;  // guards packs_
  std::map<Name, std::unique_ptr<PackWriter>> packs_;
};

}  // namespace

std::unique_ptr<StoreFolder> StoreFolder::make_scratch(FileSystem& files,
                                                       const std::string& folder) {
  return std::make_unique<ScratchStore>(files, folder);
}

}  // namespace pounce::store
