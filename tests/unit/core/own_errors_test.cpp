// SPDX-License-Identifier: Apache-2.0
#include "core/own_errors.h"

#include <catch2/catch.hpp>

namespace pounce {
namespace {

/// What leaves with_own_errors() when `work` throws.
template <class Thrown>
Error told(const Thrown& thrown) {
  try {
    with_own_errors([&] { throw thrown; });
  } catch (const Error& e) {
    return e;
  }
  return {ErrorKind::internal, "nothing"};
}

TEST_CASE("what the system refuses is told as what it is", "[core]") {
  CHECK(told(std::bad_alloc()).kind() == ErrorKind::budget);
  const Error thread = told(
      std::system_error(std::make_error_code(std::errc::resource_unavailable_try_again), "thread"));
  CHECK(thread.kind() == ErrorKind::storage);
  CHECK(std::string(thread.what()).find("--threads") != std::string::npos);
  const Error file = told(std::filesystem::filesystem_error(
      "cannot get it", "some/file", std::make_error_code(std::errc::permission_denied)));
  CHECK(file.kind() == ErrorKind::storage);
  CHECK(std::string(file.what()) == "some/file: Permission denied");
}

}  // namespace
}  // namespace pounce
