// SPDX-License-Identifier: Apache-2.0
#include <catch2/catch.hpp>
#include <string>
#include <vector>

#include "core/file.h"
#include "io/splats/unpack.h"
#include "pounce/error.h"
#include "support/bytes.h"
#include "support/memory_file_system.h"
#include "support/test_data.h"
#include "support/vp8l_builder.h"

using namespace pounce;
using test::little_endian;

namespace {

/// An archive as writers make it that do not know sizes beforehand: zeros in the local headers, a
/// descriptor behind the bytes.
struct ZipBuilder {
  struct Entry {
    std::string name, data;
    std::uint32_t flags = 0x808, method = 0;
    std::uint32_t header_at = 0;  ///< set by bytes(), unless it is there
    std::uint32_t stored = 0;     ///< bytes as the directory has them, unless 0
  };
  std::vector<Entry> entries;
  std::string comment, before_end;
  std::uint32_t more_entries = 0, disk = 0;

  std::string bytes() const {
    std::string archive, directory;
    for (const Entry& e : entries) {
      const std::uint64_t at = e.header_at != 0 ? e.header_at : archive.size();
      archive += "PK\3\4" + little_endian(20, 2) + little_endian(e.flags, 2) +
                 little_endian(e.method, 2) + std::string(16, '\0') +
                 little_endian(e.name.size(), 2) + little_endian(3, 2) + e.name + "abc" + e.data +
                 "PK\7\x8" + std::string(12, 'd');
      const std::uint64_t size = e.stored != 0 ? e.stored : e.data.size();
      directory += "PK\1\2" + little_endian(20, 2) + little_endian(20, 2) +
                   little_endian(e.flags, 2) + little_endian(e.method, 2) + std::string(8, '\0') +
                   little_endian(size, 4) + little_endian(size, 4) +
                   little_endian(e.name.size(), 2) + little_endian(5, 2) + little_endian(2, 2) +
                   std::string(8, '\0') + little_endian(at, 4) + e.name + "extraco";
    }
    const std::uint64_t at = archive.size(), count = entries.size() + more_entries;
    return archive + directory + before_end + "PK\5\6" + little_endian(disk, 2) +
           little_endian(disk, 2) + little_endian(count, 2) + little_endian(count, 2) +
           little_endian(directory.size(), 4) + little_endian(at, 4) +
           little_endian(comment.size(), 2) + comment;
  }
};

std::vector<io::StoredEntry> read(const std::string& bytes) {
  const auto files = test::make_memory_file_system();
  files->create("s.sog")->append(std::as_bytes(std::span(bytes)));
  return io::read_stored_zip(*files->open("s.sog"), "s.sog");
}

void check_refused(const std::string& bytes, const std::string& words) {
  std::string message;
  CHECK(test::error_kind([&] { read(bytes); }, &message) == static_cast<int>(ErrorKind::input));
  INFO(message);
  CHECK(message.starts_with("s.sog: "));
  CHECK(message.find(words) != std::string::npos);
}

ZipBuilder two_entries() {
  return {{{"meta.json", "{}"}, {"means_l.webp", "RIFF1234"}}, "", "", 0, 0};
}

}  // namespace

TEST_CASE("stored entries are found where the directory says", "[zip]") {
  ZipBuilder zip = two_entries();
  SECTION("without a comment") {}
  SECTION("with one that looks like an end") { zip.comment = "PK\5\6" + std::string(30, 'x'); }
  SECTION("with the longest") { zip.comment = std::string(65535, 'c'); }
  SECTION("beside a folder") { zip.entries.push_back({"folder/", ""}); }
  const std::vector<io::StoredEntry> entries = read(zip.bytes());
  REQUIRE(entries.size() == 2);
  CHECK(entries[0].name == "meta.json");
  CHECK(entries[0].at == 30 + 9 + 3);
  CHECK(entries[0].bytes == 2);
  CHECK(entries[1].name == "means_l.webp");
  CHECK(entries[1].at == 44 + 16 + 30 + 12 + 3);
  CHECK(entries[1].bytes == 8);
  CHECK(zip.bytes().substr(entries[1].at, 8) == "RIFF1234");
}

TEST_CASE("an archive without entries has none", "[zip]") {
  CHECK(read(ZipBuilder{}.bytes()).empty());
}

TEST_CASE("archives are known by how they begin", "[zip]") {
  const auto files = test::make_memory_file_system();
  const auto is_zip = [&](const std::string& bytes) {
    test::write_whole(*files, "a", std::as_bytes(std::span(bytes)));
    return io::is_zip(*files->open("a"));
  };
  CHECK(is_zip(two_entries().bytes()));
  CHECK(is_zip(ZipBuilder{}.bytes()));
  CHECK_FALSE(is_zip("ply\nformat binary_little_endian 1.0"));
  CHECK_FALSE(is_zip("PK\3\4"));
}

TEST_CASE("archives that cannot be read as they are are refused by name", "[zip]") {
  ZipBuilder zip = two_entries();
  SECTION("compressed") {
    zip.entries[1].method = 8;
    check_refused(zip.bytes(), "its entry \"means_l.webp\" is compressed (method 8)");
  }
  SECTION("encrypted") {
    zip.entries[0].flags = GENERATE(0x809U, 0x848U, 0x2808U);
    check_refused(zip.bytes(), "its entry \"meta.json\" is encrypted");
  }
  SECTION("ZIP64 by its locator") {
    zip.before_end = "PK\6\7" + std::string(16, '\0');
    check_refused(zip.bytes(), "is a ZIP64 archive");
  }
  SECTION("ZIP64 by an entry's size") {
    zip.entries[0].stored = 0xFFFFFFFF;
    check_refused(zip.bytes(), "its entry \"meta.json\" uses ZIP64");
  }
  SECTION("ZIP64 by the number of entries") {
    zip.more_entries = 65533;
    check_refused(zip.bytes(), "is a ZIP64 archive");
  }
  SECTION("one of several parts") {
    zip.disk = 1;
    check_refused(zip.bytes(), "is one of several parts");
  }
  SECTION("too many entries") {
    zip.more_entries = 4095;
    check_refused(zip.bytes(), "lists 4097 entries");
  }
  SECTION("too large a directory") {
    zip.entries.assign(17, {std::string(62'000, 'n'), ""});
    check_refused(zip.bytes(), "lists 17 entries in 1054901 bytes");
  }
  SECTION("two entries of one name, which is cut and made harmless") {
    zip.entries[0].name = zip.entries[1].name = "\x1B[31m" + std::string(100, 'n');
    check_refused(zip.bytes(), "has two entries \"?[31m" + std::string(75, 'n') + "...\"");
  }
}

TEST_CASE("entries that lie where they cannot are refused", "[zip]") {
  ZipBuilder zip = two_entries();
  SECTION("beyond the end") {
    zip.entries[1].stored = 9 + 16;
    check_refused(zip.bytes(), "its entry \"means_l.webp\" is outside of it");
  }
  SECTION("up to the directory, which is no fault") {
    zip.entries[1].stored = 8 + 16;
    CHECK(read(zip.bytes())[1].bytes == 24);
  }
  SECTION("over another") {
    zip.entries[0].stored = 2 + 16 + 1;
    check_refused(zip.bytes(), "\"meta.json\" and \"means_l.webp\" overlap");
  }
  SECTION("in the same place") {
    zip.entries.insert(zip.entries.begin(), {"first", "12345"});
    const std::uint32_t second = 30 + 5 + 3 + 5 + 16;
    zip.entries[2].header_at = second;
    check_refused(zip.bytes(), "\"meta.json\" and \"means_l.webp\" overlap");
  }
  SECTION("not where the directory says") {
    zip.entries[1].header_at = 3;
    check_refused(zip.bytes(), "is not where its directory states");
  }
  SECTION("in the directory") {
    zip.entries[1].header_at = 150;
    check_refused(zip.bytes(), "is outside of it");
  }
}

TEST_CASE("entries may be listed in another order than they lie in", "[zip]") {
  ZipBuilder zip = two_entries();
  zip.entries.push_back({"third", "3"});
  std::string bytes = zip.bytes();
  // The place of the first and the third entry, 42 bytes into their part of the directory.
  const std::size_t first = bytes.find("PK\1\2") + 42;
  const std::size_t third = bytes.rfind("PK\1\2") + 42;
  for (std::size_t i = 0; i < 4; ++i) std::swap(bytes[first + i], bytes[third + i]);
  const auto entries = read(bytes);
  REQUIRE(entries.size() == 3);
  CHECK(entries[0].at > entries[1].at);
  CHECK(entries[1].at > entries[2].at);
}

TEST_CASE("directories that contradict themselves are refused", "[zip]") {
  std::string bytes = two_entries().bytes();
  const std::size_t second = bytes.rfind("PK\1\2");
  SECTION("a name beyond the end") { bytes[second + 29] = 1; }
  SECTION("a stored entry of two sizes") { bytes[second + 20] = 7; }
  SECTION("another mark") { bytes[second] = 'Q'; }
  check_refused(bytes, "its directory is damaged at entry 2 of 2");
}

TEST_CASE("archives that were cut off or have wrong bytes are refused or read", "[zip]") {
  const std::string bytes = two_entries().bytes();
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    CAPTURE(size);
    check_refused(bytes.substr(0, size),
                  size < 22 ? "not a complete ZIP archive" : "has no directory");
  }
  int refused = 0;
  for (std::size_t at = 0; at < bytes.size(); ++at) {
    for (int bit = 0; bit < 8; ++bit) {
      std::string wrong = bytes;
      wrong[at] = static_cast<char>(wrong[at] ^ 1 << bit);
      CAPTURE(at, bit);
      const int kind = test::error_kind([&] {
        for (const io::StoredEntry& entry : read(wrong))
          if (entry.at + entry.bytes > wrong.size()) FAIL("an entry beyond the end");
      });
      REQUIRE((kind == 0 || kind == static_cast<int>(ErrorKind::input)));
      refused += kind != 0;
    }
  }
  CHECK(refused > 400);
}

TEST_CASE("real bundles hold the images of a scene", "[zip][external]") {
  const auto data = test::test_data();
  if (!data) return;
  const std::string path = (*data / "captures/angel.sog").string();
  const auto file = posix_file_system().open(path);
  CHECK(io::is_zip(*file));
  const std::vector<io::StoredEntry> entries = io::read_stored_zip(*file, path);
  REQUIRE(entries.size() == 6);
  CHECK(entries[0].name == "means_l.webp");
  CHECK(entries[0].bytes == 215790);
  CHECK(entries[5].name == "meta.json");
  CHECK(entries[5].bytes == 10324);
  std::array<std::byte, 4> start;
  file->read(entries[4].at, start);
  CHECK(std::string(reinterpret_cast<const char*>(start.data()), 4) == "RIFF");
}
