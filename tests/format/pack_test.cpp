// SPDX-License-Identifier: Apache-2.0
//
// Every way in which the bytes of a pack can be wrong must be noticed before anybody uses them.
#include "store/pack/pack.h"

#include <catch2/catch.hpp>
#include <cstring>
#include <functional>

#include "store/pack/codec.h"
#include "support/bytes.h"
#include "support/hex_dump.h"
#include "support/memory_file_system.h"

namespace pounce::store {
namespace {

using test::error_kind;
using test::kDamaged;
using test::random_bytes;

constexpr Hash128 kKey{0x0011223344556677u, 0x8899aabbccddeeffu};

/// A pack in memory with all that is needed to read it again.
struct SmallPack {
  std::vector<std::byte> bytes;
  std::vector<ChunkRef> refs;  // the last is the directory
  std::vector<ChunkKind> kinds;
  std::vector<std::vector<std::byte>> payloads;
};

/// Payloads are stored as they are: packs do not look into them.
SmallPack make_pack(const std::vector<std::size_t>& sizes, const Hash128& key = kKey,
                    PackKind kind = PackKind::geometry) {
  const auto files = test::make_memory_file_system();
  SmallPack pack;
  PackWriter writer(files->create("pack"), kind, key);
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    pack.payloads.push_back(random_bytes(sizes[i], static_cast<std::uint32_t>(i + 1)));
    const bool last = i + 1 == sizes.size();
    pack.kinds.push_back(last     ? ChunkKind::directory
                         : i == 0 ? ChunkKind::block
                                  : ChunkKind::index_page);
    pack.refs.push_back(writer.append(pack.kinds.back(), pack.payloads.back(), 1000));
  }
  writer.finish(pack.refs.back());
  pack.bytes = test::read_whole(*files, "pack");
  REQUIRE(pack.bytes.size() == writer.size_bytes());
  return pack;
}

std::unique_ptr<PackReader> open_pack(std::span<const std::byte> bytes, const Hash128& key = kKey,
                                      PackKind kind = PackKind::geometry) {
  const auto files = test::make_memory_file_system();
  test::write_whole(*files, "pack", bytes);
  return std::make_unique<PackReader>(files->open("pack"), "some.pack", kind, key);
}

/// A file that remembers the largest read it was asked for.
class WatchedFile final : public ReadFile {
 public:
  WatchedFile(std::unique_ptr<ReadFile> file, std::size_t& most)
      : file_(std::move(file)), most_(most) {}
  std::uint64_t size_bytes() const override { return file_->size_bytes(); }
  void read(std::uint64_t offset, std::span<std::byte> out) const override {
    most_ = std::max(most_, out.size());
    file_->read(offset, out);
  }

 private:
  std::unique_ptr<ReadFile> file_;
  std::size_t& most_;
};

/// What a reader does that knows the index: open, then read every chunk it refers to.
void read_by_refs(std::span<const std::byte> bytes, const SmallPack& pack) {
  const auto reader = open_pack(bytes);
  for (std::size_t i = 0; i < pack.refs.size(); ++i) {
    const StoredChunk chunk = reader->read(pack.refs[i], pack.kinds[i]);
    REQUIRE(test::bytes_of(chunk.payload()) == pack.payloads[i]);
  }
}

/// Both ways to read everything must notice.
void check_damaged(const std::vector<std::byte>& bytes, const SmallPack& pack) {
  std::string message;
  CHECK(error_kind([&] { read_by_refs(bytes, pack); }, &message) == kDamaged);
  CHECK_THAT(message, Catch::Contains("some.pack") && Catch::Contains("at byte") &&
                          Catch::Contains("delete it or run with --no-cache"));
  CHECK(error_kind([&] { open_pack(bytes)->verify(); }) == kDamaged);
}

TEST_CASE("what was appended is read back and every chunk is counted", "[format]") {
  const SmallPack pack = make_pack({100, 0, 1, 7, 8, 9, 100'000, 40});
  read_by_refs(pack.bytes, pack);
  const auto reader = open_pack(pack.bytes);
  CHECK(reader->verify() == 8);
  CHECK(reader->directory() == pack.refs.back());
  CHECK(reader->size_bytes() == pack.bytes.size());
  CHECK(reader->name() == "some.pack");
  for (const ChunkRef& ref : pack.refs) CHECK(ref.offset % 8 == 0);
}

TEST_CASE("bytes read are counted with headers and padding", "[format]") {
  const SmallPack pack = make_pack({9, 40});
  const auto reader = open_pack(pack.bytes);
  CHECK(reader->bytes_read() == 128);
  reader->read(pack.refs[0], ChunkKind::block);
  CHECK(reader->bytes_read() == 128 + 32 + 16);
}

TEST_CASE("every flipped byte of a pack is noticed", "[format]") {
  const SmallPack pack = make_pack({61, 8, 0, 30});
  for (std::size_t at = 0; at < pack.bytes.size(); ++at) {
    for (const unsigned mask : {0x01u, 0x80u, 0xffu}) {
      auto bad = pack.bytes;
      bad[at] ^= static_cast<std::byte>(mask);
      CAPTURE(at, mask);
      check_damaged(bad, pack);
    }
  }
}

TEST_CASE("a pack that ends anywhere but at its end is noticed", "[format]") {
  const SmallPack pack = make_pack({61, 8, 30});
  for (std::size_t size = 0; size < pack.bytes.size(); ++size) {
    const std::vector<std::byte> bad(pack.bytes.begin(),
                                     pack.bytes.begin() + static_cast<long>(size));
    CAPTURE(size);
    check_damaged(bad, pack);
  }
  for (const std::size_t more : {1u, 8u, 64u, 4096u}) {
    std::vector<std::byte> bad(pack.bytes.size() + more);
    std::copy(pack.bytes.begin(), pack.bytes.end(), bad.begin());
    CAPTURE(more);
    check_damaged(bad, pack);
  }
  // The footer at the end again, as if the end of an older, longer file were left over.
  std::vector<std::byte> twice(pack.bytes.size() + 64);
  std::copy(pack.bytes.begin(), pack.bytes.end(), twice.begin());
  std::copy_n(pack.bytes.end() - 64, 64, twice.end() - 64);
  check_damaged(twice, pack);
}

TEST_CASE("ranges that a crash left as zeros are noticed", "[format]") {
  const SmallPack pack = make_pack({300, 200, 100});
  for (const std::size_t size : {8u, 64u, 512u}) {
    for (std::size_t at = 0; at < pack.bytes.size(); at += 8) {
      auto bad = pack.bytes;
      const std::size_t end = std::min(at + size, bad.size());
      std::fill(bad.begin() + static_cast<long>(at), bad.begin() + static_cast<long>(end),
                std::byte{0});
      if (bad == pack.bytes) continue;
      CAPTURE(at, size);
      check_damaged(bad, pack);
    }
  }
}

TEST_CASE("two chunks of equal size that changed places are noticed", "[format]") {
  const SmallPack pack = make_pack({64, 64, 64, 8});
  auto bad = pack.bytes;
  const auto chunk = [&](std::size_t i) {
    return bad.begin() + static_cast<long>(pack.refs[i].offset);
  };
  std::swap_ranges(chunk(1), chunk(1) + 96, chunk(2));  // same kind, same sizes
  check_damaged(bad, pack);
}

TEST_CASE("a chunk of another pack at the same place is noticed", "[format]") {
  const SmallPack pack = make_pack({64, 8});
  const SmallPack other = make_pack({64, 8}, {1, 2});
  REQUIRE(pack.refs == other.refs);
  auto bad = pack.bytes;
  std::copy_n(other.bytes.begin() + 64, 96, bad.begin() + 64);
  check_damaged(bad, pack);
}

TEST_CASE("a stale pack under a new key is noticed", "[format]") {
  const SmallPack pack = make_pack({64, 8});
  std::string message;
  for (const Hash128 key : {Hash128{kKey.hi, 1}, Hash128{1, kKey.lo}, Hash128{}}) {
    CHECK(error_kind([&] { open_pack(pack.bytes, key); }, &message) == kDamaged);
    CHECK_THAT(message, Catch::Contains(to_hex(kKey)) && Catch::Contains(to_hex(key)));
  }
}

TEST_CASE("a pack or chunk of another kind is noticed", "[format]") {
  const SmallPack pack = make_pack({64, 8});
  CHECK(error_kind([&] { open_pack(pack.bytes, kKey, PackKind::colour); }) == kDamaged);
  const auto reader = open_pack(pack.bytes);
  CHECK(error_kind([&] { reader->read(pack.refs[0], ChunkKind::index_page); }) == kDamaged);
  CHECK(error_kind([&] { reader->read(pack.refs[1], ChunkKind::block); }) == kDamaged);
}

/// Changes a field of the header or footer and makes the checksum right again.
std::vector<std::byte> with_field(const SmallPack& pack, std::size_t frame, std::size_t field,
                                  std::uint64_t value, std::size_t field_bytes) {
  auto bytes = pack.bytes;
  std::memcpy(&bytes[frame + field], &value, field_bytes);
  const std::uint64_t sum = checksum(std::span(bytes).subspan(frame, 56));
  std::memcpy(&bytes[frame + 56], &sum, 8);
  return bytes;
}

TEST_CASE("packs of a future version are refused by version, not by accident", "[format]") {
  const SmallPack pack = make_pack({64, 8});
  std::string message;
  CHECK(error_kind([&] { open_pack(with_field(pack, 0, 8, kFormatVersion + 1, 4)); }, &message) ==
        kDamaged);
  CHECK_THAT(message, Catch::Contains("version 4") && Catch::Contains("version 3"));
  CHECK(error_kind([&] { open_pack(with_field(pack, 0, 12, 4, 4)); }) == kDamaged);  // kind
  CHECK(error_kind([&] { open_pack(with_field(pack, 0, 32, 1, 8)); }) == kDamaged);  // reserved
}

TEST_CASE("sizes and places are bounded before anything is read or allocated", "[format]") {
  const SmallPack pack = make_pack({64, 8});
  const std::size_t footer = pack.bytes.size() - 64;
  CHECK(error_kind([&] { open_pack(with_field(pack, footer, 8, ~0ull, 8)); }) == kDamaged);
  CHECK(error_kind([&] { open_pack(with_field(pack, footer, 8, 0, 8)); }) == kDamaged);
  CHECK(error_kind([&] { open_pack(with_field(pack, footer, 16, 0xffffffffu, 4)); }) == kDamaged);
  CHECK(error_kind([&] { open_pack(with_field(pack, footer, 20, 0xffffffffu, 4)); }) == kDamaged);
  CHECK(error_kind([&] { open_pack(with_field(pack, footer, 32, 1, 8)); }) == kDamaged);
  CHECK(error_kind([&] { open_pack(with_field(pack, footer, 24, 3, 8))->verify(); }) == kDamaged);
  const ChunkRef block = pack.refs[0];
  CHECK(error_kind([&] { open_pack(with_field(pack, footer, 8, block.offset, 8))->verify(); }) ==
        kDamaged);

  const auto files = test::make_memory_file_system();
  test::write_whole(*files, "pack", pack.bytes);
  std::size_t most = 0;
  const PackReader reader(std::make_unique<WatchedFile>(files->open("pack"), most), "some.pack",
                          PackKind::geometry, kKey);
  for (const ChunkRef bad :
       {ChunkRef{64, 0xffffffffu, 1000}, ChunkRef{64, 64, 0xffffffffu},
        ChunkRef{64, kLargestChunkBytes, 1000}, ChunkRef{~0ull - 7, 64, 1000},
        ChunkRef{0, 64, 1000}, ChunkRef{65, 64, 1000}, ChunkRef{64, 64, 999},
        ChunkRef{64, 63, 1000}, ChunkRef{64, 72, 1000}, ChunkRef{footer, 0, 0}}) {
    CAPTURE(bad.offset, bad.stored_bytes, bad.raw_bytes);
    CHECK(error_kind([&] { reader.read(bad, ChunkKind::block); }) == kDamaged);
    CHECK(most < 10'000);  // nor is more allocated for it
  }
}

TEST_CASE("a writer refuses chunks that no reader would take", "[format]") {
  const auto files = test::make_memory_file_system();
  PackWriter writer(files->create("pack"), PackKind::results, kKey);
  const std::vector<std::byte> large(std::size_t{kLargestChunkBytes} + 1);
  constexpr int kInternal = static_cast<int>(ErrorKind::internal);
  CHECK(error_kind([&] { writer.append(ChunkKind::block, large, 10); }) == kInternal);
  CHECK(error_kind([&] { writer.append(ChunkKind::block, {}, kLargestChunkBytes + 1); }) ==
        kInternal);
  writer.finish(writer.append(ChunkKind::directory, {}, 0));
  CHECK(error_kind([&] { writer.append(ChunkKind::block, {}, 0); }) == kInternal);
  CHECK(error_kind([&] { writer.finish({}); }) == kInternal);
}

TEST_CASE("a pack tells what it is to a program that does not know", "[format]") {
  const SmallPack pack = make_pack({64, 8}, {5, 6}, PackKind::colour);
  const auto files = test::make_memory_file_system();
  test::write_whole(*files, "pack", pack.bytes);
  const PackInfo info = read_pack_info(*files->open("pack"), "pack");
  CHECK(info.version == kFormatVersion);
  CHECK(info.kind == PackKind::colour);
  CHECK(info.key == Hash128{5, 6});
}

/// Sixteen bytes per line, as the documentation shows them.
TEST_CASE("the hex dump in the documentation is what the writer makes", "[format]") {
  const auto files = test::make_memory_file_system();
  PackWriter writer(files->create("pack"), PackKind::geometry, kKey);
  Compressor compressor;
  std::vector<std::byte> stored;
  compressor.compress({}, stored);
  writer.finish(writer.append(ChunkKind::directory, stored, 0));
  CHECK(test::documented_dump("hexdump") == test::hex_dump(test::read_whole(*files, "pack")));
}

}  // namespace
}  // namespace pounce::store
