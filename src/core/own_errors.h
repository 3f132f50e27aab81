// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <exception>
#include <filesystem>
#include <new>
#include <string>
#include <system_error>

#include "pounce/error.h"

namespace pounce {

/// Runs `work`, which nothing but an Error leaves. What the system refuses becomes one: no memory
/// Error(budget), no file, thread, lock or other thing of the system Error(storage). Whatever else
/// is thrown is a fault of ours: Error(internal), with what was thrown nested in it.
template <class Work>
decltype(auto) with_own_errors(const Work& work) {
  try {
    return work();
  } catch (const std::bad_alloc&) {
    throw Error(ErrorKind::budget,
                "out of memory; run with a smaller --memory or fewer --threads, or raise the limit "
                "(ulimit -v, ulimit -d, a control group)");
  } catch (const std::filesystem::filesystem_error& e) {
    throw Error(ErrorKind::storage, e.path1().string() + ": " + e.code().message());
  } catch (const std::system_error& e) {
    throw Error(ErrorKind::storage,
                std::string("the system refuses a resource that the job needs: ") + e.what() +
                    "; raise the limit (ulimit -u for threads, -v and -d for memory, -n for open "
                    "files), or run with fewer --threads");
  } catch (const Error&) {
    throw;
  } catch (const std::exception& e) {
    std::throw_with_nested(Error(ErrorKind::internal, std::string("an error inside pounce: ") +
                                                          e.what() + "; please report it"));
  } catch (...) {
    std::throw_with_nested(
        Error(ErrorKind::internal, "an error inside pounce: unknown exception; please report it"));
  }
}

}  // namespace pounce
