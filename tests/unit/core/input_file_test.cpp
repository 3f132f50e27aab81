// SPDX-License-Identifier: Apache-2.0
//
// What a job reads of a name stays one file, whatever is put in its place meanwhile.
#include "core/input_file.h"

#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <optional>
#include <thread>

#include "pounce/error.h"
#include "support/test_data.h"

using namespace pounce;

namespace {

std::string content(const std::string& path) {
  const auto file = open_input(path);
  std::string text(static_cast<std::size_t>(file->size_bytes()), '\0');
  file->read(0, std::as_writable_bytes(std::span(text)));
  return text;
}

void write(const std::string& path, const std::string& text) { std::ofstream(path) << text; }

/// Puts another file in its place, as editors and exporters do.
void replace(const std::string& path, const std::string& text) {
  write(path + ".new", text);
  std::filesystem::rename(path + ".new", path);
}

}  // namespace

TEST_CASE("an input is one file as long as a job lasts") {
  const test::TempFolder folder;
  const std::string path = folder.file("mesh.obj");
  write(path, "first");
  {
    const InputFiles job;
    CHECK(content(path) == "first");
    CHECK(is_input_in_place(path));
    replace(path, "second");
    CHECK(content(path) == "first");
    CHECK_FALSE(is_input_in_place(path));
    std::filesystem::remove(path);
    CHECK(content(path) == "first");
    CHECK_FALSE(is_input_in_place(path));
    write(path, "third");
    {
      const InputFiles another;  // begun now: it reads what is there now
      CHECK(content(path) == "third");
      CHECK(is_input_in_place(path));
    }
    CHECK(content(path) == "first");
    // Threads without a job of their own.
    std::string elsewhere;
    std::thread([&] { elsewhere = content(path); }).join();
    CHECK(elsewhere == "third");
  }
  CHECK(content(path) == "third");
}

TEST_CASE("an input that is changed in place is not the one that was opened") {
  const test::TempFolder folder;
  const std::string path = folder.file("mesh.obj");
  write(path, "first");
  const InputFiles job;
  CHECK(is_input_in_place(path));  // nobody has opened it
  CHECK(content(path) == "first");
  write(path, "longer than before");
  CHECK_FALSE(is_input_in_place(path));
}

TEST_CASE("inputs that are missing are asked for again") {
  const test::TempFolder folder;
  const std::string path = folder.file("mesh.obj");
  const InputFiles job;
  REQUIRE_THROWS_AS(open_input(path), Error);
  write(path, "there");
  CHECK(content(path) == "there");
}

TEST_CASE("threads may share the inputs of a job") {
  const test::TempFolder folder;
  const std::string path = folder.file("mesh.obj"), other = folder.file("other.obj");
  write(path, "first");
  write(other, "other");
  InputFiles job;
  CHECK(content(path) == "first");
  replace(path, "second");
  std::string shared, after;
  bool is_in_place = true;
  std::thread([&] {
    {
      const SharesInputs inputs(job);
      shared = content(path);
      is_in_place = is_input_in_place(path);
      CHECK(content(other) == "other");
    }
    after = content(path);
  }).join();
  CHECK(shared == "first");
  CHECK_FALSE(is_in_place);
  CHECK(after == "second");
  // What the other one opened is the job's as well.
  replace(other, "another");
  CHECK(content(other) == "other");
}

TEST_CASE("jobs may end in any order") {
  const test::TempFolder folder;
  const std::string path = folder.file("mesh.obj");
  write(path, "first");
  std::optional<InputFiles> one(std::in_place), other(std::in_place);
  CHECK(content(path) == "first");
  one.reset();
  replace(path, "second");
  CHECK(content(path) == "first");  // of the other one
  other.reset();
  CHECK(content(path) == "second");
}

TEST_CASE("of many inputs those used last stay open") {
  const test::TempFolder folder;
  const auto name = [&](int i) { return folder.file("buffer" + std::to_string(i)); };
  for (int i = 0; i < 80; ++i) write(name(i), "first");
  const auto open_files = [] {
    const std::filesystem::directory_iterator all("/proc/self/fd");
    return std::distance(begin(all), end(all));
  };
  const auto before = open_files();
  const InputFiles job;
  for (int i = 0; i < 80; ++i) {
    content(name(i));
    content(name(0));
  }
  CHECK(open_files() == before + 64);
  for (const int i : {0, 1, 79}) replace(name(i), "second");
  CHECK(content(name(0)) == "first");
  CHECK(content(name(79)) == "first");
  CHECK(content(name(1)) == "second");
}
