// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "mesh/mesh.h"
#include "planning/colour_spaces.h"
#include "planning/plan.h"
#include "planning/source_images.h"

namespace pounce::planning {

/// What the steps of planning a source mesh share. Not thread-safe.
struct MeshPlanning {
  const TransferOptions& options;
  const mesh::Mesh& source;
  const bool as_gaussians;  ///< its texels become Gaussians
  const bool for_model;     ///< the images go into a model
  const bool merges;        ///< all of the source's materials become one
  SourcePlan plan;
  ColourSpaces spaces;
  SourceImages images;
  std::vector<bool> used;  ///< by material: triangles really use it

  MeshPlanning(const TransferOptions& options, const mesh::Mesh& source, TexelsAs as,
               bool for_model, bool merges);
  bool is_baked(Channel channel) const;
  /// Do the colours of the source's vertices multiply a channel? No output but these images can
  /// show them: a model has the vertices of the target.
  bool is_tinted(Channel channel) const;
  /// Do materials that become one differ by their factors? Images or not: a constant stands in the
  /// channel's image beside them.
  bool is_told_apart(Channel channel) const;
  std::string name_of(Channel channel) const { return channel_name(options, channel); }
};

/// Plans one channel: what each source page gives to it, and what its output is.
ChannelPlan plan_channel(MeshPlanning& planning, Channel channel);
/// The images that a channel samples.
std::vector<const ColumnPlan*> images_of(const SourcePlan& plan, const ChannelPlan& channel);

}  // namespace pounce::planning
