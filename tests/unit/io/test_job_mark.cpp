// SPDX-License-Identifier: Apache-2.0
//
// The job's hash inside an image: where other programs look for it, and found again.
#include <OpenImageIO/imageio.h>

#include <catch2/catch.hpp>
#include <filesystem>

#include "io/files/job_mark.h"
#include "io/image/write.h"
#include "support/gltf_builder.h"
#include "support/test_data.h"
#include "unit/io/image_files.h"

using namespace pounce;

namespace {

const std::string kJob = "00112233445566778899aabbccddeeff";

std::string write_image(const test::TempFolder& folder, const std::string& name,
                        const std::string& job) {
  const std::string path = folder.file(name);
  io::ImageWriteSpec spec{64, 48, 3, io::writable_depth(path, Depth::u8)};
  spec.job = job;
  io::ImageWriter writer(path, spec);
  const std::vector<std::byte> row(64 * 3 * 4);
  for (int y = 0; y < 48; ++y) writer.write_rows(1, row.data());
  writer.commit();
  return path;
}

}  // namespace

TEST_CASE("an image says which job made it, to us and to others", "[image][write]") {
  const std::string name = GENERATE("a.png", "a.jpg", "a.tif", "a.exr");
  CAPTURE(name);
  const test::TempFolder folder;
  const std::string path = write_image(folder, name, kJob);
  CHECK(io::read_job(path) == kJob);
  const auto input = OIIO::ImageInput::open(path);
  REQUIRE(input);
  CHECK(input->spec().get_string_attribute("Software") == io::software_name());
  CHECK(input->spec().get_string_attribute("ImageDescription") == "pounce:job=" + kJob);
  CHECK(input->spec().get_string_attribute("DateTime").empty());

  const std::string nameless = write_image(folder, "none" + name, "");
  CHECK_FALSE(io::read_job(nameless));
  CHECK(OIIO::ImageInput::open(nameless)->spec().get_string_attribute("Software") ==
        io::software_name());
}

TEST_CASE("what is no job is none", "[image][write]") {
  const test::TempFolder folder;
  const auto job_in = [&](const std::string& bytes) {
    const std::string path = folder.file("some.png");
    test::write_file(path, bytes);
    return io::read_job(path);
  };
  CHECK_FALSE(io::read_job(folder.file("absent.png")));
  CHECK_FALSE(job_in(""));
  CHECK_FALSE(job_in("pounce:job=0011"));                           // cut off
  CHECK_FALSE(job_in("pounce:job=" + std::string(31, '0') + "G"));  // no digit
  CHECK(job_in("pounce:job=none pounce:job=" + kJob) == kJob);
  CHECK_FALSE(job_in(std::string(70'000, ' ') + "pounce:job=" + kJob));  // in the pixels
  using namespace std::string_literals;
  CHECK_FALSE(job_in("II*\0"s));
  CHECK_FALSE(job_in("II*\0\xff\xff\xff\xff"s));
  CHECK_FALSE(job_in("II*\0\x08\0\0\0\xff\xff"s));  // fields that are not there
  CHECK_FALSE(job_in("glTF\2\0\0\0"s));
  // Across the windows in which a long text is read.
  for (const std::size_t before : {65500U, 65536U, 131000U}) {
    const std::string json = std::string(before, ' ') + "\"pounce\":{\"job\":\"" + kJob + "\"";
    const std::string path = folder.file("some.gltf");
    test::write_file(path, json);
    CHECK(io::read_job(path) == kJob);
  }
}
