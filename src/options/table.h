// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "pounce/option_table.h"

namespace pounce::options {

// What the flow asks of the table. `Options` is that of a command.

/// The options that differ from their defaults and count in the hash of a job by their texts.
template <class Options>
std::vector<OptionReport> hashed_texts(const Options& options);

/// Throws Error(usage) for a number that the command line would refuse: C++ callers have no parser.
template <class Options>
void check_ranges(const Options& options);

/// Throws Error(usage) for an option that does not apply to the source: a splat scene, or else a
/// mesh.
template <class Options>
void refuse_unsuitable(const Options& options, bool is_splat_scene);

/// Throws Error(usage) for an option of a format that no output has.
void refuse_formats(const TransferOptions& options);

/// Throws Error(usage) for an option that does not apply to the method.
void refuse_unsuitable(const TransferOptions& options, Method method);

}  // namespace pounce::options
