// SPDX-License-Identifier: Apache-2.0
#include <catch2/catch.hpp>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "io/splats/ply_write.h"
#include "support/test_data.h"

using namespace pounce;
using namespace pounce::io;
using pounce::test::TempFolder;

namespace {

std::string read_all(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

}  // namespace

TEST_CASE("a splat PLY is its header and its rows, byte for byte", "[io]") {
  const TempFolder folder;
  const std::string path = folder.file("two.ply");
  {
    SplatPlyWriter writer(path);
    const SplatPlyRow row{{1, 2, 3}, {0, 0, 1}, {0.5F, -1, 1.5F}, 10, {-4, -5, -6}, {1, 0, 0, 0}};
    writer.write(std::vector{row});
    writer.write({});
    writer.write(std::vector{row});
    CHECK(writer.rows() == 2);
    CHECK_FALSE(std::filesystem::exists(path));
    writer.commit();
  }
  const std::string bytes = read_all(path);
  // The count is known at the end only: the comment before it leaves it room.
  const std::string header =
      "ply\nformat binary_little_endian 1.0\ncomment pounce gaussians" + std::string(19, ' ') +
      "\nelement vertex 2\n"
      "property float x\nproperty float y\nproperty float z\n"
      "property float nx\nproperty float ny\nproperty float nz\n"
      "property float f_dc_0\nproperty float f_dc_1\nproperty float f_dc_2\n"
      "property float opacity\n"
      "property float scale_0\nproperty float scale_1\nproperty float scale_2\n"
      "property float rot_0\nproperty float rot_1\nproperty float rot_2\nproperty float rot_3\n"
      "end_header\n";
  REQUIRE(bytes.size() == header.size() + 2 * 68);
  CHECK(bytes.substr(0, header.size()) == header);
  const float expected[17] = {1, 2, 3, 0, 0, 1, 0.5F, -1, 1.5F, 10, -4, -5, -6, 1, 0, 0, 0};
  CHECK(std::memcmp(bytes.data() + header.size(), expected, 68) == 0);
  CHECK(std::memcmp(bytes.data() + header.size() + 68, expected, 68) == 0);
}

TEST_CASE("a splat PLY that was not finished leaves nothing", "[io]") {
  const TempFolder folder;
  {
    SplatPlyWriter writer(folder.file("half.ply"));
    writer.write(std::vector<SplatPlyRow>(10000));
  }
  CHECK(std::filesystem::is_empty(folder.path()));
}
