// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace pounce::mesh {

/// The names that triangles can be selected by. A part is a set of names that some triangles share:
/// node and mesh of a glTF file, object and groups of an OBJ file. Triangles are in file order, so
/// their parts are runs.
struct Parts {
  struct Run {
    std::uint32_t first_triangle = 0;  ///< to the next run's, the last one to the end
    std::uint32_t part = 0;            ///< index into part_names
    bool operator==(const Run&) const = default;
  };
  std::vector<std::string> names;                      ///< each once, in order of appearance
  std::vector<std::vector<std::uint32_t>> part_names;  ///< by part: indices into names
  std::vector<Run> runs;                               ///< first_triangle ascending, from 0

  std::uint64_t size_bytes() const;
};

/// Makes Parts while a file is read.
class PartsBuilder {
 public:
  /// From triangle `first_triangle` on, the triangles have these names (without repetitions, empty
  /// ones left out). Called in order; where no triangle follows, it leaves no trace.
  void start(std::uint32_t first_triangle, const std::vector<std::string>& names);
  /// `triangles`: how many there are.
  Parts finish(std::uint32_t triangles);

 private:
  void end_run(std::uint32_t triangles);

  Parts parts_;
  std::map<std::string, std::uint32_t> name_index_;
  std::map<std::vector<std::uint32_t>, std::uint32_t> part_index_;
  std::vector<std::uint64_t> last_use_;  ///< by name: the run that had it last
  std::uint64_t uses_ = 0;               ///< runs so far
  std::vector<std::string> names_;
  std::uint32_t first_ = 0;
};

}  // namespace pounce::mesh
