// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "planning/plan.h"
#include "pounce/options.h"
#include "pounce/report.h"
#include "surface/geometry_request.h"

namespace pounce::planning {

/// Records in the report which command runs, on what, and with which options. Called first of all,
/// so that the report of any failure has it.
void describe(const TransferOptions& options, bool plan_only, Report& report);
void describe(const MapsOptions& options, Report& report);
void describe(const GaussiansOptions& options, Report& report);
void describe(const ProxyOptions& options, Report& report);
void describe(const TexturedMeshOptions& options, Report& report);

/// Adds a file that the job reads, once.
void add_input(const std::string& path, Report& report);

// --- what is left behind -------------------------------------------------------------------------

/// One line of bounded length: what the materials that take part have and no output will have, by
/// its name in the file, with the images: textures that no channel takes, channels that nobody
/// chose, vertex colours. Empty: nothing. Channels that are left out by name are not missed.
std::string not_transferred(const TransferOptions& options, const SourcePlan& plan,
                            const mesh::Mesh& source);

/// In a line, of an output of images: the channels whose textures have factors, and whether these
/// are applied. Empty: none has.
std::string factors_note(const TransferOptions& options, const SourcePlan& plan,
                         const mesh::Mesh& source);

// --- UVs that repeat -----------------------------------------------------------------------------

/// Adds a warning for each material whose UVs lie over its image so many times that its Gaussians
/// are unreasonably many: each repetition writes all of the image's again. One stray texture
/// coordinate is enough.
void warn_of_repeats(const surface::GeometryRequest& request, std::vector<std::string>& warnings);

}  // namespace pounce::planning
