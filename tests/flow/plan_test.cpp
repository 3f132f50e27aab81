// SPDX-License-Identifier: Apache-2.0
#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>

#include "pounce/transfer.h"
#include "support/bytes.h"
#include "support/test_data.h"

namespace pounce::test {
namespace {

struct Square {
  TempFolder folder;
  TransferOptions options;
  Square() {
    std::ofstream(folder.file("a.obj")) << "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt "
                                           "1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n";
    std::ofstream(folder.file("grey.pgm")) << "P5\n2 2\n255\n1234";
    options.source = folder.file("a.obj");
    options.targets = {folder.file("a.obj")};
    options.output = folder.file("o.png");
    options.image.coverage_output = folder.file("mask.png");
    options.material.textures = {{Channel::base_color, folder.file("grey.pgm")}};
    options.image.size = ImageSize{100, 90};
    options.resources.use_cache = false;
  }
  std::size_t files() const {
    const std::filesystem::directory_iterator all(folder.path());
    return static_cast<std::size_t>(std::distance(begin(all), end(all)));
  }
};

}  // namespace

TEST_CASE("a plan says what the job then does, and writes nothing", "[flow]") {
  Square square;
  square.options.resources.threads = 1;
  const PlanReport plan = pounce::plan(square.options);
  CHECK(square.files() == 2);
  CHECK(plan.threads == 1);
  CHECK(plan.memory_budget_bytes > plan.least_memory_bytes);
  CHECK(!plan.least_memory_for.empty());
  const Report report = transfer(square.options);
  CHECK(plan.outputs == report.outputs);
  CHECK(plan.inputs == report.inputs);
  CHECK(plan.warnings == report.warnings);
  CHECK(plan.least_memory_bytes == report.least_memory_bytes);
  CHECK(plan.least_memory_for == report.least_memory_for);
  CHECK(plan.disk_most.output_bytes == report.disk_most->output_bytes);
  CHECK(plan.disk_most.output_bytes >= report.output_bytes);
  CHECK(plan.kept.empty());

  square.options.skip_existing = true;
  const PlanReport again = pounce::plan(square.options);
  CHECK(again.outputs.empty());
  CHECK(again.kept ==
        std::vector<std::string>{square.options.output, square.options.image.coverage_output});
}

TEST_CASE("a job that is stopped while it writes says no fit that it has not found out", "[flow]") {
  Square square;
  std::ofstream(square.folder.file("off.obj"))
      << "v 0 0 0.05\nv 1 0 0.05\nv 1 1 0.05\nv 0 1 0.05\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
         "f 1/1 2/2 3/3 4/4\n";
  square.options.targets = {square.folder.file("off.obj")};
  Progress progress;
  bool wrote = false;
  progress.on_event = [&](const ProgressEvent& event) {
    if (event.stage != "write") return;
    wrote = true;
    progress.cancel();
  };
  Report so_far;
  CHECK(error_kind([&] { transfer(square.options, &progress, &so_far); }) ==
        static_cast<int>(ErrorKind::cancelled));
  CHECK(wrote);
  REQUIRE(so_far.targets.size() == 1);
  CHECK(so_far.targets.front().fit == std::nullopt);
  CHECK(transfer(square.options).targets.front().fit.has_value());
}

TEST_CASE("a plan that cannot be carried out throws what the job would", "[flow]") {
  Square square;
  std::string message;
  Report so_far;
  square.options.resources.memory_bytes = 1 << 20;
  const auto plan = [&] { pounce::plan(square.options, nullptr, &so_far); };
  CHECK(error_kind(plan, &message) == static_cast<int>(ErrorKind::budget));
  CHECK(message.find("needs at least") != std::string::npos);
  REQUIRE(so_far.failure);
  CHECK(so_far.failure->message == message);
  CHECK(so_far.least_memory_bytes > 1 << 20);
  square.options.resources.memory_bytes = 0;
  square.options.material.textures.front().path = square.folder.file("absent.png");
  CHECK(error_kind(plan) == kStorage);
}

}  // namespace pounce::test
