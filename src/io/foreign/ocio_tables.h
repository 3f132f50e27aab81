// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <OpenColorIO/OpenColorIO.h>

#include <cstdint>
#include <initializer_list>
#include <set>
#include <string>

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

}  // namespace pounce::io
