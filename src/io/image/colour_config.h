// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <OpenColorIO/OpenColorIO.h>

#include <cstdint>
#include <initializer_list>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "core/colour_space.h"
#include "io/files/asset_file.h"

namespace pounce::io {

/// The tables (LUT files) that the conversions of an OpenColorIO configuration may read, looked at
/// before OpenColorIO opens any: it would wait for a pipe for ever, and read a device until memory
/// ends. Not thread-safe.
class ColourTables {
 public:
  /// Of the configuration `config_path`. Tables lie in its folder, unless `allow_external`, and
  /// loading all of them takes no more than `most_bytes` of memory.
  ColourTables(const std::string& config_path, bool allow_external, std::uint64_t most_bytes)
      : config_path_(config_path), folder_(config_path, allow_external), most_bytes_(most_bytes) {}

  /// Looks at every table that a conversion between these spaces may read, and at some that it may
  /// not. Throws Error(storage) for what is no file or cannot be read, Error(input) for a table
  /// outside of the folder or one that names further files, Error(budget). What is missing is
  /// passed over: OpenColorIO knows whether it is needed.
  void check(const OCIO_NAMESPACE::ConstConfigRcPtr& config,
             std::initializer_list<const char*> spaces);
  /// Reads all tables so far again. Throws Error(storage) if one cannot be read.
  void check_reading() const;

  /// What loading the tables so far takes in memory, at most, and what stays of it.
  std::uint64_t loading_bytes() const { return loading_bytes_; }
  std::uint64_t kept_bytes() const { return kept_bytes_; }

 private:
  class Finder;
  void add(const std::string& path);
  void require(std::uint64_t bytes) const;

  std::string config_path_;
  AssetFolder folder_;
  std::uint64_t most_bytes_ = 0, loading_bytes_ = 0, kept_bytes_ = 0;
  std::set<std::string> paths_;
};

/// An OpenColorIO configuration: colour spaces by name. What it has in common with ours is linear
/// light of ACES2065-1, its role aces_interchange or a space that is called so, or else linear
/// light of Rec. 709 under one of its usual names.
///
/// Thread-safe.
class ColourConfig {
 public:
  /// Throws Error(storage) or Error(input), naming the file. Its tables lie in its folder, unless
  /// `allow_external`; loading them takes no more than `most_bytes`.
  explicit ColourConfig(const std::string& path, bool allow_external = false,
                        std::uint64_t most_bytes = UINT64_MAX);
  ~ColourConfig();
  ColourConfig(const ColourConfig&) = delete;
  ColourConfig& operator=(const ColourConfig&) = delete;

  const std::string& path() const { return path_; }
  /// Has it a space (or a role, or another name of one) that is called so, in any case of letters?
  bool has(const std::string& name) const;
  /// What that space is called itself.
  std::string full_name(const std::string& name) const;
  /// Is that space one of data, which is never converted?
  bool is_data(const std::string& name) const;
  /// What its spaces are called, as far as it shows them.
  std::vector<std::string> names() const;

  /// From that space to linear light of Rec. 709, and back. Throws Error(input), naming the file,
  /// where it has no such transform: no space in common with ours, what goes one way only, a table
  /// that lies elsewhere or is none; MissingFile where a table is missing, Error(storage) where one
  /// cannot be read or is no file, Error(budget) where tables need too much memory.
  std::shared_ptr<const ColourTransform> to_linear(const std::string& name) const;
  std::shared_ptr<const ColourTransform> from_linear(const std::string& name) const;

  /// What loading the tables of all transforms so far took in memory, at most, and what stays.
  std::uint64_t table_loading_bytes() const;
  std::uint64_t table_bytes() const;

 private:
  struct Impl;
  std::string path_;
  std::unique_ptr<const Impl> impl_;
};

}  // namespace pounce::io
