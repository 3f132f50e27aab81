// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <tbb/task_group.h>

#include <functional>
#include <optional>
#include <utility>

#include "projection/mesh_fit.h"

namespace pounce::flow {

/// How two meshes fit, found out by another thread while images are written. It takes milliseconds,
/// as long as a thousand texels on a side take many threads.
class BesideFit {
 public:
  BesideFit() = default;
  BesideFit(const BesideFit&) = delete;
  BesideFit& operator=(const BesideFit&) = delete;
  ~BesideFit() {
    tasks_.cancel();  // if it has not begun
    tasks_.wait();
  }

  bool has_begun() const { return find_ != nullptr; }
  /// What `find` reads must stay until end().
  void begin(std::function<projection::MeshFit()> find) {
    find_ = std::move(find);
    tasks_.run([this] { fit_ = find_(); });
  }
  /// Waits for it, and works on it where no other thread does. Throws what it throws.
  projection::MeshFit end() {
    tasks_.wait();
    return fit_;
  }

 private:
  std::function<projection::MeshFit()> find_;
  projection::MeshFit fit_;
  tbb::task_group tasks_;
};

}  // namespace pounce::flow
