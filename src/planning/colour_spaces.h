// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "io/codec/colour_config.h"
#include "planning/plan.h"

namespace pounce::planning {

/// Throws Error(usage) for names of colour spaces that are not known, and for spaces that the
/// output's format cannot hold.
void check_colour_spaces(const TransferOptions& options);

/// The colour spaces of a job: what options, files and formats say of them. `options` must outlive
/// it. Not thread-safe.
class ColourSpaces {
 public:
  /// Reads --ocio's configuration. Throws Error(usage) for names that neither it nor we have.
  /// `for_model`: the output is the images of a model, which are sRGB.
  ColourSpaces(const TransferOptions& options, bool for_model);

  /// What --output-colorspace says.
  const std::optional<ColourSpace>& asked() const { return asked_; }
  /// What --source-colorspace says, in its order.
  const std::vector<ColourSpace>& given() const { return given_; }
  /// The same of a channel; nothing for data.
  std::optional<ColourSpace> given(Channel channel) const;
  /// What a channel's image holds: as the options say, else as its file says.
  ColourSpace of(Channel channel, const ColumnPlan& column) const;
  /// Does --source-colorspace say of this channel's image what its file says?
  bool said_anyway(Channel channel, const ColumnPlan& column) const;
  /// Does the configuration convert some of this channel? Grey becomes red, green and blue then.
  bool is_by_config(Channel channel) const;

  /// Decides the output's primaries and whether it is linear light, and what its file says of them:
  /// the source's, or what is painted onto, or what its format needs. `notes` tell conversions.
  void choose(const SourceLook& look, const std::optional<io::ImageInfo>& onto, ChannelPlan& plan,
              std::vector<std::string>& notes);
  /// How a channel's image of that space becomes the output; nothing where its samples mean what is
  /// `usual` for their depth and have the output's primaries. `plain`: nothing else is made of it.
  std::optional<shading::ColourInput> input(const ColourSpace& space, bool usual_linear, bool plain,
                                            const ChannelPlan& plan);
  /// Hands a plan what its formats and inputs point to, and says what that means.
  void finish(SourcePlan& plan) const;

 private:
  ColourSpace resolved(const char* option, const std::string& name) const;
  void refuse_other_meaning(const char* option, const std::string& name,
                            const ColourSpace& own) const;
  /// To linear light, or from it.
  const ColourTransform* transform(const std::string& name, bool to_linear);
  void note_conversion(const SourceLook& look, const ChannelPlan& plan, const ColourSpace& made,
                       std::vector<std::string>& notes) const;

  const TransferOptions& options_;
  const bool for_model_;
  std::unique_ptr<const io::ColourConfig> config_;
  std::optional<ColourSpace> asked_;
  std::vector<ColourSpace> given_;
  /// By name and direction.
  std::map<std::pair<std::string, bool>, std::shared_ptr<const ColourTransform>> transforms_;
};

/// The same as ColourSpaces::input() for spaces that no configuration says.
std::optional<shading::ColourInput> colour_input(const ColourSpace& space, bool usual_linear,
                                                 const ChannelPlan& plan);

}  // namespace pounce::planning
