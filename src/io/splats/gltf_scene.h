// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <tiny_gltf.h>

#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "io/gltf/accessor.h"
#include "io/gltf/file.h"
#include "io/splats/placement.h"
#include "io/splats/spz.h"

namespace pounce::io {

/// Does a .gltf or .glb, whatever its name, hold a primitive of KHR_gaussian_splatting? Looks for
/// the word first, so that a mesh costs no more than one reading of its JSON.
bool is_splat_gltf(const std::string& path);

/// The Gaussians of a glTF scene: all primitives of KHR_gaussian_splatting that it shows, one after
/// the other, placed by their nodes. Values come from accessors, or from SPZ in a buffer view.
class GltfSplats : public BatchScene {
 public:
  /// Reads the JSON. Throws Error(input) where it is damaged, holds Gaussians in a form that is not
  /// read (another kernel, another compression: by name) or more JSON than a scene can need.
  /// `poll`: as SpzScene, of SPZ within it.
  GltfSplats(const std::string& path, const Axes& axes, const std::function<void()>& poll);

  void prepare(const ScratchFolder& folder, const std::function<void()>& poll) override;
  std::uint64_t prepare_bytes() const override;
  std::uint64_t unpacked_bytes() const override;
  void decode(std::uint64_t first, std::uint64_t count, std::uint32_t lobes, SplatBatch& batch,
              const Take& take) const override;
  std::uint64_t decode_bytes() const override;

 private:
  /// A primitive as a node shows it.
  struct Part {
    explicit Part(const SplatPlacement& where) : placement(where) { harmonics.fill(-1); }
    std::uint64_t first = 0, count = 0;
    SplatPlacement placement;
    int position = -1, rotation = -1, scale = -1, opacity = -1;  ///< accessors
    std::array<int, 1 + store::kMostLobes> harmonics;            ///< -1 beyond the degree
    const SpzScene* spz = nullptr;                               ///< in place of accessors
  };

  [[noreturn]] void fail(const std::string& what) const;
  void add(int mesh, std::size_t primitive, const SplatPlacement& placement,
           const std::function<void()>& poll);
  void check_kind(const nlohmann::json& extension, const std::string& place);
  const SpzScene& open_spz(const nlohmann::json& extension, const std::string& place,
                           const std::function<void()>& poll);
  int accessor(const tinygltf::Primitive& primitive, const std::string& name, int type,
               std::uint64_t count, const std::string& place) const;
  void find_accessors(const tinygltf::Primitive& primitive, const std::string& place, Part& part);
  void decode_accessors(const Part& part, std::uint64_t first, std::size_t rows,
                        std::uint32_t lobes, SplatBatch& batch) const;

  GltfFile file_;
  tinygltf::Model model_;
  AccessorReader accessors_;
  std::uint64_t json_cost_ = 0;
  std::string colour_space_;
  bool names_no_kernel_ = false;                          ///< some primitive
  std::map<std::size_t, std::unique_ptr<SpzScene>> spz_;  ///< by buffer view
  std::vector<Part> parts_;
};

}  // namespace pounce::io
