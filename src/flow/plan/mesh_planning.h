// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "flow/plan/colour_spaces.h"
#include "flow/plan/plan.h"
#include "flow/plan/source_images.h"
#include "mesh/mesh.h"

namespace pounce::flow {

/// What the steps of planning a source mesh share. Not thread-safe.
struct MeshPlanning {
  const TransferOptions& options;
  const mesh::Mesh& source;
  const bool as_gaussians;  ///< its texels become Gaussians
  const bool for_model;     ///< the images go into a model
  SourcePlan plan;
  ColourSpaces spaces;
  SourceImages images;
  std::vector<bool> used;  ///< by material: triangles really use it

  MeshPlanning(const TransferOptions& options, const mesh::Mesh& source, TexelsAs as,
               bool for_model);
  bool is_baked(Channel channel) const;
  /// Do the colours of the source's vertices multiply a channel? No output but these images can
  /// show them: a model has the vertices of the target.
  bool is_tinted(Channel channel) const;
  std::string name_of(Channel channel) const { return channel_name(options, channel); }
};

/// Plans one channel: what each source page gives to it, and what its output is.
ChannelPlan plan_channel(MeshPlanning& planning, Channel channel);
/// The images that a channel samples.
std::vector<const ColumnPlan*> images_of(const SourcePlan& plan, const ChannelPlan& channel);

}  // namespace pounce::flow
