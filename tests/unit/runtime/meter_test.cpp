// SPDX-License-Identifier: Apache-2.0
#include "runtime/meter.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <vector>

namespace pounce::runtime {
namespace {

struct Watched {
  Progress progress;
  std::vector<ProgressEvent> events;
  Meter meter{&progress};
  Watched() {
    progress.on_event = [this](const ProgressEvent& event) { events.push_back(event); };
  }
  bool rises() const {
    return std::is_sorted(events.begin(), events.end(),
                          [](const ProgressEvent& a, const ProgressEvent& b) {
                            return a.fraction < b.fraction || a.elapsed_s < b.elapsed_s;
                          });
  }
};

}  // namespace

TEST_CASE("work that goes on during a wait counts after it", "[flow]") {
  Watched job;
  job.meter.begin("decode", 10, "rows", 0.5);
  job.meter.advance(2);
  job.meter.wait("waiting for process 1");
  job.meter.advance(6);
  job.meter.wait("waiting for process 2");
  CHECK(job.events.back().stage == "waiting for process 2");
  CHECK(job.events.back().fraction == Approx(0.4));
  job.meter.resume();
  CHECK(job.events.back().stage == "decode");
  CHECK(job.events.back().done == 8);
  CHECK(job.events.back().fraction == Approx(0.4));
  CHECK(job.rises());
}

TEST_CASE("a stage that ends before the last one did does not take the bar back", "[flow]") {
  Watched job;
  job.meter.begin("project", 4, "texels", 0.8);
  job.meter.advance(4);
  job.meter.end();
  job.meter.begin("write", 4, "rows", 0.3);
  job.meter.advance(2);
  job.meter.end();
  CHECK(job.events.back().fraction == Approx(0.8));
  CHECK(job.rises());
}

TEST_CASE("what took no work is told from what did", "[flow]") {
  Watched job;
  job.meter.begin("precondition", 0, "tiles", 0.2);
  job.meter.end(true);  // out of the cache
  CHECK(job.events.back().fraction == Approx(0.2));
  CHECK(job.events.back().kept == Approx(0.2));
  job.meter.keep(0.5);  // pages that are up to date
  job.meter.begin("project", 4, "texels", 0.9);
  CHECK(job.events.back().fraction == Approx(0.5));
  CHECK(job.events.back().kept == Approx(0.5));
  job.meter.advance(3);
  job.meter.end();
  CHECK(job.events.back().fraction == Approx(0.9));
  CHECK(job.events.back().kept == Approx(0.5));
  job.meter.keep(0.7);  // is behind already
  job.meter.finish();
  CHECK(job.events.back().fraction == 1);
  CHECK(job.events.back().kept == Approx(0.5));
  CHECK(job.rises());
}

TEST_CASE("a job that begins again has the rest of the bar", "[flow]") {
  Watched job;
  job.meter.begin("decode", 2, "rows", 0.5);
  job.meter.advance(2);
  job.meter.end();
  job.meter.restart();
  job.meter.begin("decode", 2, "rows", 0.5);
  CHECK(job.events.back().fraction == Approx(0.5));
  job.meter.end();
  CHECK(job.events.back().fraction == Approx(0.75));
  job.meter.finish();
  CHECK(job.events.back().fraction == 1);
  CHECK(job.rises());
}

}  // namespace pounce::runtime
