// SPDX-License-Identifier: Apache-2.0
//
// The job's hash inside an image: where other programs look for it, and found again.
#include <OpenImageIO/imageio.h>

#include <catch2/catch.hpp>
#include <filesystem>

#include "io/files/finished_output.h"
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
  CHECK_FALSE(job_in("pounce:job=" + std::string(32, 'A')));  // not as we write it
  // Across the windows in which a long text is read.
  for (const std::size_t before : {65500U, 65535U, 65536U, 65570U, 131000U}) {
    const std::string json = std::string(before, ' ') + "\"pounce\":{\"job\":\"" + kJob + "\"";
    const std::string path = folder.file("some.gltf");
    test::write_file(path, json);
    CHECK(io::read_job(path) == kJob);
  }
}

namespace {

std::string number(std::uint64_t value, std::size_t size) {
  std::string out;
  for (std::size_t i = 0; i < size; ++i) out += static_cast<char>(value >> 8 * i);
  return out;
}

/// A TIFF with these texts as fields, (tag, text), and no picture; then `rest`.
std::string tiff(bool big, const std::vector<std::pair<int, std::string>>& texts,
                 const std::string& rest = "") {
  const std::size_t word = big ? 8 : 4, header = big ? 16 : 8, count = big ? 8 : 2;
  std::string out = big ? std::string("II+\0\10\0\0\0", 8) : std::string("II*\0", 4);
  out += number(header, word) + number(texts.size(), count);
  std::size_t place = header + count + texts.size() * (4 + 2 * word) + word;
  std::string data;
  for (const auto& [tag, text] : texts) {
    out += number(static_cast<std::uint64_t>(tag), 2) + number(2, 2) + number(text.size(), word) +
           number(place, word);
    data += text;
    place += text.size();
  }
  return out + number(0, word) + data + rest;
}

}  // namespace

TEST_CASE("a TIFF's job is in its description and nowhere else", "[image][write]") {
  const bool big = GENERATE(false, true);
  CAPTURE(big);
  const test::TempFolder folder;
  const auto job_in = [&](const std::string& bytes) {
    const std::string path = folder.file("some.tif");
    test::write_file(path, bytes);
    return io::read_job(path);
  };
  constexpr int kDescription = 270, kSoftware = 305;
  const std::string mark = io::job_description(kJob);
  CHECK(job_in(tiff(big, {{kDescription, mark}})) == kJob);
  CHECK(job_in(tiff(big, {{kSoftware, "a program"}, {kDescription, "of a cat, " + mark}})) == kJob);
  CHECK_FALSE(job_in(tiff(big, {{kSoftware, mark}})));
  CHECK_FALSE(job_in(tiff(big, {}, mark)));  // in the pixels
  // What follows the description does not belong to it.
  CHECK_FALSE(job_in(tiff(big, {{kDescription, "of a cat, "}}, mark)));
  CHECK_FALSE(job_in(tiff(big, {{kDescription, mark.substr(0, 20)}}, mark.substr(20))));
  // Far behind the pixels, as libtiff puts it, and more fields than any file has.
  CHECK(job_in(tiff(big, {{kSoftware, std::string(200'000, 'x')}, {kDescription, mark}})) == kJob);
  const std::vector<std::pair<int, std::string>> many(4097, {kDescription, mark});
  CHECK_FALSE(job_in(tiff(big, many)));
}

TEST_CASE("a model's job is in its JSON and nowhere else", "[image][write]") {
  const test::TempFolder folder;
  const std::string mark = "\"pounce\":" + io::job_extras(kJob);
  const auto job_in = [&](const std::string& json, const std::string& binary) {
    const std::string path = folder.file("some.glb");
    test::write_file(path, "glTF" + number(2, 4) + number(28 + json.size() + binary.size(), 4) +
                               number(json.size(), 4) + "JSON" + json + number(binary.size(), 4) +
                               std::string("BIN\0", 4) + binary);
    return io::read_job(path);
  };
  CHECK(job_in("{" + mark + "}", "") == kJob);
  CHECK(job_in(std::string(100'000, ' ') + mark, "") == kJob);
  CHECK_FALSE(job_in("{}", mark));
  CHECK_FALSE(job_in("{\"pounce\":{\"job\":\"" + kJob.substr(1) + "\"}}", ""));
  CHECK_FALSE(job_in("{" + io::job_description(kJob) + "}", ""));  // an image's words
  // Content decides, not the name; JSON alone is told by its name.
  test::write_file(folder.file("some.gltf"), "{" + mark + "}");
  CHECK(io::read_job(folder.file("some.gltf")) == kJob);
  test::write_file(folder.file("some.txt"), "{" + mark + "}");
  CHECK_FALSE(io::read_job(folder.file("some.txt")));
}
