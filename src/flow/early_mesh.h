// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <tbb/task_group.h>

#include <cstdint>
#include <functional>
#include <optional>

#include "job/job_context.h"
#include "mesh/mesh.h"

namespace pounce::flow {

/// A mesh that another thread reads while this one reads and plans another, where there are threads
/// and both take little of the memory. What goes wrong with it is left to who reads it when its
/// turn comes.
class EarlyMesh {
 public:
  /// `others_bytes`: of reading what is read meanwhile. `cost_bytes`: of reading this one; is told
  /// how much it may be. Both functions run in another thread and see the job's input files.
  EarlyMesh(job::JobContext& job, std::uint64_t others_bytes,
            std::function<std::uint64_t(std::uint64_t most_bytes)> cost_bytes,
            std::function<mesh::Mesh()> read);
  EarlyMesh(const EarlyMesh&) = delete;
  EarlyMesh& operator=(const EarlyMesh&) = delete;
  ~EarlyMesh();

  /// The mesh, once; nothing where it was not read, or not without an error.
  std::optional<mesh::Mesh> take();

 private:
  std::optional<mesh::Mesh> mesh_;
  tbb::task_group tasks_;
};

}  // namespace pounce::flow
