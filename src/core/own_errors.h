// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <new>
#include <string>
#include <system_error>

#include "pounce/error.h"

namespace pounce {

/// Runs `work`. What the system refuses leaves it as an Error, too: no memory as Error(budget), no
/// file, thread, lock or other thing of the system as Error(storage).
template <class Work>
decltype(auto) with_own_errors(const Work& work) {
  try {
    return work();
  } catch (const std::bad_alloc&) {
    throw Error(ErrorKind::budget,
                "out of memory; run it with a smaller --memory or with fewer --threads, or give it "
                "more (ulimit -v, ulimit -d, a control group)");
  } catch (const std::filesystem::filesystem_error& e) {
    throw Error(ErrorKind::storage, e.path1().string() + ": " + e.code().message());
  } catch (const std::system_error& e) {
    throw Error(ErrorKind::storage,
                std::string("the system refuses what the job needs: ") + e.what() +
                    "; raise the limit (ulimit -u for threads, -v and -d for memory, -n for open "
                    "files), or run it with fewer --threads");
  }
}

}  // namespace pounce
