// SPDX-License-Identifier: Apache-2.0
#include "progress_bar.h"

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "job.h"

using namespace pounce;
using namespace pounce::cli;

namespace {

const ProgressEvent kHalf{"project", 0.5, 3000000, 6000000, "texels", 2.0};

std::string shown(ProgressKind kind, const std::vector<ProgressEvent>& events) {
  std::FILE* const file = std::tmpfile();
  REQUIRE(file != nullptr);
  {
    ProgressBar bar(kind, file);
    for (const ProgressEvent& event : events) bar.show(event);
  }
  std::string text(static_cast<std::size_t>(std::ftell(file)), '\0');
  std::rewind(file);
  REQUIRE(std::fread(text.data(), 1, text.size(), file) == text.size());
  std::fclose(file);
  return text;
}

}  // namespace

TEST_CASE("steady work has the time left that its speed says", "[cli]") {
  TimeLeft left;
  for (int tenth = 0; tenth <= 40; ++tenth) left.update(0.01 * tenth, 0, 0.1 * tenth);
  CHECK(left.seconds() == Approx(6.0).epsilon(0.01));  // 60 % left at 10 % a second
}

TEST_CASE("nothing is said of the time left before there is something to judge by", "[cli]") {
  TimeLeft left;
  CHECK(left.seconds() < 0);
  left.update(0, 0, 0);
  left.update(0.001, 0, 0.01);
  CHECK(left.seconds() < 0);
  left.update(0.1, 0, 1);
  CHECK(left.seconds() == Approx(9.0));
}

TEST_CASE("one slow moment hardly moves the time left, a lasting slowness does", "[cli]") {
  TimeLeft left;
  double fraction = 0;
  double now = 0;
  const auto work = [&](double seconds, double share_per_s) {
    for (int i = 0; i < static_cast<int>(seconds * 10 + 0.5); ++i) {
      now += 0.1;
      fraction += share_per_s / 10;
      left.update(fraction, 0, now);
    }
  };
  work(20, 0.01);  // 80 s left
  work(0.5, 0);
  CHECK(left.seconds() < 90);
  work(40, 0.005);  // 60 % left at half the speed: 120 s
  CHECK(left.seconds() == Approx(120).epsilon(0.05));
}

TEST_CASE("what was kept says nothing of the speed of work", "[cli]") {
  TimeLeft left;
  left.update(0.02, 0, 0.5);     // meshes were read
  left.update(0.32, 0.3, 0.51);  // and 30 % of the job is up to date
  for (int second = 1; second <= 40; ++second)
    left.update(0.32 + 0.01 * second, 0.3, 0.51 + second);
  CHECK(left.seconds() == Approx(28).epsilon(0.02));  // 28 % left at 1 % a second
  left.update(0.8, 0.38, 40.52);                      // other jobs made some of it meanwhile
  CHECK(left.seconds() == Approx(20).epsilon(0.05));
}

TEST_CASE("the bar's line never exceeds the terminal's width", "[cli]") {
  for (std::size_t columns = 1; columns <= 200; ++columns) {
    CAPTURE(columns);
    CHECK(bar_line(kHalf, {1.5e6, 75}, columns).size() <= columns);
  }
}

TEST_CASE("the bar shows stage, share, rate and time left", "[cli]") {
  CHECK(bar_line(kHalf, {1.5e6, 75}, 70) ==
        "project      [###########............]  50 %  1:15 left  1.5 Mtexels/s");
  CHECK(bar_line(kHalf, {1.5e6, 75}, 20) == "project       50 %");
}

TEST_CASE("only finished work is 100 percent", "[cli]") {
  CHECK(plain_line({"write", 0.999, 0, 0, "", 1}, {}) == "write:  99 %");
  CHECK(plain_line({"write", 1, 10, 10, "rows", 1}, {}) == "write: 100 %, 10/10 rows");
}

TEST_CASE("plain progress is one line per stage and one every few seconds", "[cli]") {
  std::vector<ProgressEvent> events;
  for (std::uint64_t i = 0; i <= 120; ++i) {
    events.push_back(
        {"project", static_cast<double>(i) / 120, i, 120, "texels", static_cast<double>(i) / 10});
  }
  const std::string text = shown(ProgressKind::plain, events);
  CHECK(std::count(text.begin(), text.end(), '\n') == 3);  // at 5 s, 10 s and the end at 12 s
  CHECK(text.find('\r') == std::string::npos);
}

TEST_CASE("the bar is erased at the end", "[cli]") {
  const std::string text = shown(ProgressKind::bar, {kHalf});
  const std::string ending = "\r\033[K";
  REQUIRE(text.size() > ending.size());
  CHECK(text.substr(text.size() - ending.size()) == ending);
  CHECK(text.find('\n') == std::string::npos);
}

TEST_CASE("json progress is one object per line that parses", "[cli]") {
  ProgressEvent odd = kHalf;
  odd.stage = "a\"b\n\xff";
  const std::string line = shown(ProgressKind::json, {odd});
  CHECK(std::count(line.begin(), line.end(), '\n') == 1);
  const auto json = nlohmann::json::parse(line);
  CHECK(json["fraction"] == 0.5);
  CHECK(json["done"] == 3000000);
  CHECK(json["left_s"] == 2.0);  // half done after 2 s
}

TEST_CASE("counts and bytes are written for people", "[cli]") {
  CHECK(with_commas(0) == "0");
  CHECK(with_commas(999) == "999");
  CHECK(with_commas(1000) == "1,000");
  CHECK(with_commas(12345678) == "12,345,678");
  CHECK(bytes_text(1023) == "1023 B");
  CHECK(bytes_text(1536) == "1.5 KiB");
  CHECK(bytes_text(536870912) == "512.0 MiB");
}
