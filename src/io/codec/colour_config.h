// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "core/colour_space.h"

namespace pounce::io {

/// An OpenColorIO configuration: colour spaces by name. What it has in common with ours is linear
/// light of ACES2065-1, its role aces_interchange or a space that is called so, or else linear
/// light of Rec. 709 under one of its usual names. It is read by the module (foreign/module.h).
///
/// Thread-safe.
class ColourConfig {
 public:
  /// Throws Error(storage) or Error(input), naming the file. Its tables lie in its folder, unless
  /// `allow_external`; loading them takes no more than `most_bytes`.
  static std::unique_ptr<const ColourConfig> load(const std::string& path,
                                                  bool allow_external = false,
                                                  std::uint64_t most_bytes = UINT64_MAX);
  virtual ~ColourConfig() = default;
  ColourConfig(const ColourConfig&) = delete;
  ColourConfig& operator=(const ColourConfig&) = delete;

  virtual const std::string& path() const = 0;
  /// Has it a space (or a role, or another name of one) that is called so, in any case of letters?
  virtual bool has(const std::string& name) const = 0;
  /// What that space is called itself.
  virtual std::string full_name(const std::string& name) const = 0;
  /// Is that space one of data, which is never converted?
  virtual bool is_data(const std::string& name) const = 0;
  /// What its spaces are called, as far as it shows them.
  virtual std::vector<std::string> names() const = 0;

  /// From that space to linear light of Rec. 709, and back. Throws Error(input), naming the file,
  /// where it has no such transform: no space in common with ours, what goes one way only, a table
  /// that lies elsewhere or is none; MissingFile where a table is missing, Error(storage) where one
  /// cannot be read or is no file, Error(budget) where tables need too much memory.
  virtual std::shared_ptr<const ColourTransform> to_linear(const std::string& name) const = 0;
  virtual std::shared_ptr<const ColourTransform> from_linear(const std::string& name) const = 0;

  /// What loading the tables of all transforms so far took in memory, at most, and what stays.
  virtual std::uint64_t table_loading_bytes() const = 0;
  virtual std::uint64_t table_bytes() const = 0;

 protected:
  ColourConfig() = default;
};

}  // namespace pounce::io
