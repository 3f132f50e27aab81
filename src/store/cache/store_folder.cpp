// SPDX-License-Identifier: Apache-2.0
#include "store/cache/store_folder.h"

#include <fmt/format.h>

#include <map>
#include <mutex>
#include <tuple>
#include <utility>

#include "pounce/error.h"
#include "store/cache/cache_layout.h"

namespace pounce::store {
namespace {

class ScratchStore final : public StoreFolder {
 public:
  ScratchStore(FileSystem& files, std::string folder) : files_(files), folder_(std::move(folder)) {}

  std::unique_ptr<PackReader> find(PackKind kind, const Hash128& key, std::string*) override {
    const std::lock_guard lock(mutex_);
    const auto found = packs_.find(Name(kind, key.hi, key.lo));
    return found == packs_.end() ? nullptr : open(*found->second);
  }

  std::unique_ptr<PackWriter> create(PackKind kind, const Hash128& key,
                                     const std::string&) override {
    return std::make_unique<PackWriter>(files_.create_scratch(folder_), kind, key);
  }

  std::unique_ptr<PackReader> publish(std::unique_ptr<PackWriter> writer) override {
    if (writer == nullptr || !writer->finished()) {
      throw Error(ErrorKind::internal, "an unfinished pack was published (please report)");
    }
    auto reader = open(*writer);
    const std::lock_guard lock(mutex_);
    const Name name(writer->kind(), writer->key().hi, writer->key().lo);
    packs_[name] = std::move(writer);
    return reader;
  }

  bool discard(PackKind kind, const Hash128& key) override {
    const std::lock_guard lock(mutex_);
    packs_.erase(Name(kind, key.hi, key.lo));
    return true;
  }
  bool persistent() const override { return false; }

 private:
  using Name = std::tuple<PackKind, std::uint64_t, std::uint64_t>;

  std::unique_ptr<PackReader> open(PackWriter& writer) const {
    return std::make_unique<PackReader>(
        writer.file().reader(),
        fmt::format("{}/(scratch {} pack)", folder_, kind_name(writer.kind())), writer.kind(),
        writer.key());
  }

  FileSystem& files_;
  const std::string folder_;
  std::mutex mutex_;  // guards packs_
  std::map<Name, std::unique_ptr<PackWriter>> packs_;
};

}  // namespace

std::unique_ptr<StoreFolder> StoreFolder::make_scratch(FileSystem& files,
                                                       const std::string& folder) {
  return std::make_unique<ScratchStore>(files, folder);
}

}  // namespace pounce::store
