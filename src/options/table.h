// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "pounce/option_table.h"

namespace pounce::options {

/// The kinds of sources that an option applies to, as bits. Elsewhere it is refused, unless it has
/// its default.
enum class Source : std::uint8_t {
  mesh = 1,
  splats = 2,
  mesh_or_splats = 3,
  map = 4,  ///< of hits
  mesh_or_map = 5,
  any = 7
};
constexpr bool applies_to(Source source, Source kind) {
  return (static_cast<unsigned>(source) & static_cast<unsigned>(kind)) != 0;
}

// What the flow asks of the table. `Options` is that of a command.

/// The options that differ from their defaults and count in the hash of a job by their texts.
template <class Options>
std::vector<OptionReport> hashed_texts(const Options& options);

/// Throws Error(usage) for a number that the command line would refuse: C++ callers have no parser.
template <class Options>
void check_ranges(const Options& options);

/// Throws Error(usage) for an option that does not apply to the source, which is of one kind.
template <class Options>
void refuse_unsuitable(const Options& options, Source kind);

/// Throws Error(usage) for an option of a format that no output has.
void refuse_formats(const TransferOptions& options);

/// Throws Error(usage) for an option that does not apply to the method.
void refuse_unsuitable(const TransferOptions& options, Method method);

}  // namespace pounce::options
