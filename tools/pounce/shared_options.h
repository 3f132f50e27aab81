// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>
#include <vector>

#include "job.h"
#include "pounce/options.h"

namespace pounce::cli {

/// Makes a command's help read: purpose, usage line and worked examples, options by group, exit
/// statuses.
void set_help_text(CLI::App& command, const std::string& usage_and_examples);

/// Adds an option whose one value goes, as text, to `parse`, which throws Error(usage).
template <class Parse>
CLI::Option* add_value(CLI::App& command, const std::string& name, const std::string& value_name,
                       const std::string& group, const std::string& help, Parse parse) {
  return command.add_option_function<std::string>(name, std::move(parse), help)
      ->type_name(value_name)  // for "1 required SIZE missing"
      ->option_text(value_name)
      ->group(group);
}

/// Adds an option without a value that sets `flag` to `value`.
CLI::Option* add_switch(CLI::App& command, const std::string& name, const std::string& group,
                        const std::string& help, bool& flag, bool value = true);

/// --allow-external, for commands that read meshes.
void add_external_option(CLI::App& command, const std::string& group, bool& allow);
/// --allow-format, for commands that read images.
void add_format_option(CLI::App& command, const std::string& group,
                       std::vector<ImageFormat>& allowed);
/// --ocio, for what names colour spaces.
void add_config_option(CLI::App& command, const std::string& group, std::string& config);
/// --memory, --threads, --cache and --no-cache.
void add_resource_options(CLI::App& command, Resources& resources);
/// --SIDE-mesh, --SIDE-material, --SIDE-uv-set and --SIDE-axes; `side` is "source" or "target".
void add_mesh_options(CLI::App& command, const std::string& side, const std::string& group,
                      MeshUse& use);
/// --min-opacity, --max-scale and --box: which Gaussians of a splat scene are wanted. The box is
/// `box_axes`.
void add_filter_options(CLI::App& command, const std::string& group, const std::string& box_axes,
                        std::optional<double>& min_opacity, std::optional<double>& max_scale,
                        std::optional<AxisBox>& box);
/// --report, --progress, -q and -v.
void add_job_options(CLI::App& command, JobSettings& settings);

}  // namespace pounce::cli
