// SPDX-License-Identifier: Apache-2.0
//
// Rows that several commands have, written once for each kind of options.
#pragma once

#include <algorithm>
#include <iterator>
#include <string>
#include <utility>
#include <vector>

#include "options/codecs.h"
#include "options/row.h"

namespace pounce::options {

template <class Options>
using Rows = std::vector<Row<Options>>;

template <class Options>
void append(Rows<Options>& rows, Rows<Options> more) {
  std::move(more.begin(), more.end(), std::back_inserter(rows));
}

inline constexpr const char* kResourcesGroup = "Resources (the result does not depend on these)";

/// Memory and threads; no result depends on them.
template <class Options>
Rows<Options> machine_rows() {
  const std::string group = kResourcesGroup;
  const auto at = [](auto member) { return path(&Options::resources, member); };
  constexpr auto kHashed = Hashed::otherwise;
  constexpr std::uint64_t kMostThreads = 1024;
  return {
      row<Options>({.name = "memory",
                    .value = "SIZE",
                    .group = group,
                    .help = "Limit for all large allocations: 512MiB, 1.5G, 4096 (bytes); KiB, "
                            "MiB, GiB and TiB are powers of 1024, kB, MB, GB and TB of 1000. A "
                            "smaller limit re-reads more tiles; the result is identical",
                    .default_text = "half of the memory the process may use (cgroup included)",
                    .hashed = kHashed},
                   at(&Resources::memory_bytes), bytes()),
      row<Options>({.name = "threads",
                    .value = "N",
                    .group = group,
                    .help = "Worker threads, at most one per core",
                    .default_text = "all cores",
                    .hashed = kHashed},
                   at(&Resources::threads), integer<unsigned>(1, kMostThreads)),
  };
}

/// Where a job keeps what it makes on the way, and how much of it.
template <class Options>
Rows<Options> place_rows() {
  const std::string group = kResourcesGroup;
  const auto at = [](auto member) { return path(&Options::resources, member); };
  constexpr auto kHashed = Hashed::otherwise;
  return {
      row<Options>({.name = "cache",
                    .value = "DIR",
                    .group = group,
                    .help = "Cache folder. Stores prepared meshes and images for reuse",
                    .default_text = "$XDG_CACHE_HOME/pounce, else ~/.cache/pounce",
                    .hashed = kHashed},
                   at(&Resources::cache_dir), text(parse_path)),
      switch_row<Options>({.name = "no-cache",
                           .group = group,
                           .help = "Store nothing for reuse; tiles are kept in unnamed files",
                           .hashed = kHashed,
                           .excludes = "cache"},
                          at(&Resources::use_cache)),
      row<Options>({.name = "cache-readonly",
                    .value = "DIR",
                    .group = group,
                    .help = "Second cache: read where the first one has nothing, never written",
                    .default_text = "none",
                    .hashed = kHashed,
                    .excludes = "no-cache"},
                   at(&Resources::cache_readonly_dir), text(parse_path)),
      row<Options>({.name = "cache-limit",
                    .value = "SIZE|none",
                    .group = group,
                    .help = "Limit for the cache's disk space, such as 10GiB. Evicts what was "
                            "unused longest before anything is written; what does not fit is not "
                            "stored",
                    .default_text = "a tenth of the file system",
                    .hashed = kHashed},
                   at(&Resources::cache_limit_bytes), limit()),
      row<Options>({.name = "temp",
                    .value = "DIR",
                    .group = group,
                    .help = "Folder for scratch files",
                    .default_text = "the output's folder",
                    .hashed = kHashed},
                   at(&Resources::temp_dir), text(parse_path)),
      row<Options>({.name = "max-temp",
                    .value = "SIZE|none",
                    .group = group,
                    .help = "Limit for the disk space of scratch files, such as 10GiB. A job that "
                            "needs more exits with status 5",
                    .default_text = "a tenth of the free space there, at least 1 GiB",
                    .hashed = kHashed},
                   at(&Resources::max_temp_bytes), limit()),
      switch_row<Options>({.name = "no-wait",
                           .group = group,
                           .help = "Exit with status 75 instead of waiting for another process "
                                   "that is building a cache entry this job needs",
                           .hashed = kHashed},
                          at(&Resources::wait_for_cache)),
  };
}

/// Machine resources.
template <class Options>
Rows<Options> resource_rows() {
  Rows<Options> rows = machine_rows<Options>();
  append(rows, place_rows<Options>());
  return rows;
}

/// Which triangles of a mesh are used. `side`: "source" or "target".
template <class Options>
Rows<Options> mesh_use_rows(const std::string& side, MeshUse Options::*use) {
  const bool is_source = side == "source";
  const std::string group = is_source ? "Source" : "Target";
  const Source source = is_source ? Source::mesh : Source::mesh_or_splats;
  constexpr std::uint64_t kMostUvSets = 255;
  return {
      row<Options>({.name = side + "-mesh",
                    .value = "NAME",
                    .group = group,
                    .help = "Use only meshes with this name: node or mesh of a glTF, object or "
                            "group of an OBJ. Accepts * ? [a-c]; may be repeated",
                    .source = source},
                   path(use, &MeshUse::meshes), text(parse_name_pattern)),
      row<Options>({.name = side + "-material",
                    .value = "NAME",
                    .group = group,
                    .help = "Use only triangles of this material. Accepts * ? [a-c]; may be "
                            "repeated",
                    .source = source},
                   path(use, &MeshUse::materials), text(parse_name_pattern)),
      row<Options>({.name = side + "-uv-set",
                    .value = "N",
                    .group = group,
                    .help = is_source ? "Sample textures through this UV set"
                                      : "Write images over this UV set",
                    .default_text = is_source ? "as the materials state" : "0",
                    .usual = is_source ? "" : "0",
                    .source = source},
                   path(use, &MeshUse::uv_set), integer<std::uint32_t>(0, kMostUvSets)),
      row<Options>({.name = side + "-axes",
                    .value = "AXES",
                    .group = group,
                    .help = "Rotate the mesh: its axes in the wanted order, with a minus for each "
                            "reversed one, as in x,-y,-z; write =AXES if it begins with a minus",
                    .usual = "x,y,z",
                    .source = Source::mesh_or_splats},
                   path(use, &MeshUse::axes), axes(true)),
  };
}

/// Files that are read only where the user allows it.
template <class Options>
Row<Options> external_row() {
  return switch_row<Options>(
      {.name = "allow-external",
       .group = "Input files",
       .help = "Also read buffers, images and material files that a mesh names outside of its own "
               "folder (.., absolute paths, links), and tables that an OpenColorIO configuration "
               "names outside of its own. Refused by default: a model could copy any file into "
               "the output",
       .hashed = Hashed::otherwise},
      path(&Options::allow_external));
}

template <class Options>
Row<Options> format_row() {
  return custom_row<Options>(
      {.name = "allow-format",
       .value = "FORMATS",
       .group = "Input files",
       .help = "Also read images of these formats, separated by commas: bmp, tga. PNG, JPEG, "
               "TIFF, EXR, WebP, HDR and binary PNM are always read, whatever their names. Only "
               "for files you trust: decoders of further formats are easier to attack",
       .hashed = Hashed::otherwise},
      OptionValues::several,
      [](Options& options, const std::string& option, const std::string& text) {
        std::vector<ImageFormat>& allowed = options.trust.formats;
        for (const ImageFormat format : parse_formats(option, text)) {
          if (std::find(allowed.begin(), allowed.end(), format) == allowed.end())
            allowed.push_back(format);
        }
      },
      [](const Options& options) {
        Texts texts;
        for (const ImageFormat format : options.trust.formats)
          texts.emplace_back(image_format_name(format));
        return texts;
      });
}

template <class Options>
Row<Options> sandbox_row() {
  return row<Options>(
      {.name = "sandbox",
       .value = "auto|on|off",
       .group = "Input files",
       .help = "Decode images in a process that can open no file, reach no network and start no "
               "program, so that a damaged or hostile image cannot harm this one. auto: EXR, TIFF, "
               "HDR, BMP and Targa, where the system can; on: all images, or none; off: none. The "
               "result is identical",
       .hashed = Hashed::otherwise},
      path(&Options::trust, &ImageTrust::sandbox),
      name(sandbox_from_name, sandbox_name, "auto, on or off"));
}

template <class Options>
Row<Options> config_row(const std::string& group, Source source, Hashed hashed) {
  return row<Options>(
      {.name = "ocio",
       .value = "CONFIG",
       .group = group,
       .help = "OpenColorIO configuration (.ocio) for colour spaces that pounce does not know by "
               "itself. Its tables must be in its folder (else --allow-external). The last bits "
               "of such outputs may differ between kinds of processors",
       .source = source,
       .hashed = hashed},
      path(&Options::colour, &ColourOptions::config), text(parse_path));
}

/// Which Gaussians of a scene are used; `reach` leads to the SplatFilter.
template <class Options, class... Members>
Rows<Options> splat_filter_rows(const std::string& group, const std::string& box_axes,
                                Members... reach) {
  return {
      row<Options>({.name = "min-opacity",
                    .value = "A",
                    .group = group,
                    .help = "Skip Gaussians less opaque than this: against haze",
                    .default_text = "1/255",
                    .source = Source::splats},
                   path(reach..., &SplatFilter::min_opacity), least_opacity()),
      row<Options>({.name = "max-scale",
                    .value = "L",
                    .group = group,
                    .help = "Skip Gaussians whose largest standard deviation is above this, in "
                            "the scene's units: against sky and fog",
                    .default_text = "no limit",
                    .source = Source::splats},
                   path(reach..., &SplatFilter::max_scale), above_zero()),
      row<Options>({.name = "box",
                    .value = "X0,Y0,Z0,X1,Y1,Z1",
                    .group = group,
                    .help = "Skip Gaussians whose centre is outside of this box, " + box_axes,
                    .default_text = "no box",
                    .source = Source::splats},
                   path(reach..., &SplatFilter::box), box()),
  };
}

}  // namespace pounce::options
