// SPDX-License-Identifier: Apache-2.0
//
// Painting over, as far as it is decided before any work: which image each output is painted onto,
// whether the two fit, and where charts lie that padding must leave alone.
//
// A channel has one format, but --onto may name many images, one per UDIM tile. The first one by
// name decides the format before pages are known (onto_header()); each page's own image is then
// held against it (plan_onto()).
#include "planning/image_output.h"

#include <fmt/format.h>
#include <fnmatch.h>

#include <algorithm>
#include <filesystem>

#include "io/files/asset_file.h"
#include "planning/output_names.h"
#include "pounce/error.h"

namespace pounce::planning {
namespace {

namespace fs = std::filesystem;

std::string header_text(const io::ImageInfo& info) {
  return fmt::format("{} x {} texels, {} channels, {}", info.width, info.height, info.channels,
                     depth_name(info.depth));
}

/// The pattern's file name as one for fnmatch(): every token may be anything.
std::string any_name(const std::string& name) {
  std::string out;
  for (std::size_t at = 0; at < name.size(); ++at) {
    const std::size_t close = name[at] == '<' ? name.find('>', at) : std::string::npos;
    if (close != std::string::npos) {
      out += '*';
      at = close;
    } else {
      if (std::string_view("*?[\\").find(name[at]) != std::string_view::npos) out += '\\';
      out += name[at];
    }
  }
  return out;
}

std::string replaced(std::string pattern, const std::string& token, const std::string& value) {
  const std::string all = "<" + token + ">";
  for (std::size_t at = pattern.find(all); at != std::string::npos; at = pattern.find(all))
    pattern.replace(at, all.size(), value);
  return pattern;
}

io::ImageInfo checked_header(const std::string& option, const std::string& path, ImageSize size,
                             const std::vector<ImageFormat>& allowed) {
  std::error_code error;
  if (fs::status(path, error).type() == fs::file_type::not_found) {
    throw Error(ErrorKind::storage, fmt::format("{}: missing for {}; create it (an empty image "
                                                "will do), or list the existing UDIMs with --tiles",
                                                path, option));
  }
  const io::ImageInfo info = io::ImageReader(path, allowed).info();
  if (info.width != size.width || info.height != size.height) {
    throw Error(ErrorKind::input,
                fmt::format("{}: {} has {} x {} texels, but the output has {} x {}; resize it, or "
                            "remove --size to use the size of the image that is painted over",
                            path, option, info.width, info.height, size.width, size.height));
  }
  return info;
}

}  // namespace

std::optional<io::ImageInfo> onto_header(const TransferOptions& options,
                                         const std::string& channel) {
  if (options.composite.onto.empty()) return std::nullopt;
  const std::string pattern = replaced(options.composite.onto, "CHANNEL", channel);
  if (pattern.find('<') == std::string::npos)
    return io::ImageReader(pattern, options.allowed_formats).info();
  const fs::path path(pattern);
  const std::string wanted = any_name(path.filename().string());
  const fs::path folder = path.has_parent_path() ? path.parent_path() : fs::path(".");
  // By name, since the order of a folder's entries differs between file systems, and the format
  // must not.
  std::string first;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    const std::string name = entry.path().filename().string();
    if (fnmatch(wanted.c_str(), name.c_str(), 0) == 0 && (first.empty() || name < first))
      first = name;
  }
  if (first.empty()) {
    throw io::MissingFile(fmt::format("{}: --onto: no such file; name existing images", pattern));
  }
  return io::ImageReader((path.parent_path() / first).string(), options.allowed_formats).info();
}

OntoImage plan_onto(const TransferOptions& options, const std::string& output,
                    const std::map<std::string, std::string>& tokens, ImageSize size,
                    const shading::TexelFormat& format, const SourceSamples& source) {
  OntoImage onto;
  onto.allowed_formats = options.allowed_formats;
  onto.path = expand_pattern(options.composite.onto, tokens);
  const io::ImageInfo info = checked_header("--onto", onto.path, size, options.allowed_formats);
  onto.decoder_bytes = info.decoder_bytes;
  if (!options.composite.mask.empty()) {
    onto.mask_path = expand_pattern(options.composite.mask, tokens);
    onto.decoder_bytes +=
        checked_header("--mask", onto.mask_path, size, options.allowed_formats).decoder_bytes;
  }
  // A smaller number of channels is converted, grey to colour for instance. A channel that has no
  // place in the output, or that would change its meaning, is an error.
  const bool lost_alpha = info.has_alpha && !format.has_alpha;
  const bool made_alpha = !info.has_alpha && info.channels == 4 && format.has_alpha;
  if (info.channels > format.channels || lost_alpha || made_alpha) {
    throw Error(ErrorKind::input, fmt::format("{}: --onto image has {}, unlike the first image of "
                                              "the pattern; convert them to one format",
                                              onto.path, header_text(info)));
  }
  onto.alpha = format.has_alpha && source.alpha && info.has_alpha ? shading::PaintAlpha::mix
                                                                  : shading::PaintAlpha::keep;
  onto.keep_last = format.colours() == 4 && source.colours < 4;
  // Only between EXRs of one depth and number of channels can old samples stay as they are,
  // multiplied. Everything else is straight while it is composited.
  onto.premultiplied = info.premultiplied && format.has_alpha && info.format == "openexr" &&
                       info.depth == format.depth && info.channels == format.channels &&
                       io::is_exr(output, format.depth);
  return onto;
}

std::vector<std::shared_ptr<const mesh::UvOccupancy>> occupied_pages(
    const mesh::Mesh& target, const std::vector<TargetPage>& pages, bool by_tile,
    std::uint32_t uv_set) {
  std::vector<std::shared_ptr<mesh::UvOccupancy>> made;
  // Triangles that were not selected count, too: their texels are somebody's paint.
  std::map<std::pair<std::int64_t, std::uint32_t>, std::size_t> page_of;  // (material, UDIM)
  for (std::size_t p = 0; p < pages.size(); ++p) {
    made.push_back(std::make_shared<mesh::UvOccupancy>());
    page_of[{pages[p].material ? std::int64_t{*pages[p].material} : -1, pages[p].udim}] = p;
  }
  const bool by_material = !pages.empty() && pages.front().material.has_value();
  const auto add = [&](const std::array<std::uint32_t, 3>& corners, std::uint32_t material) {
    const std::int64_t set = by_material ? std::int64_t{material} : -1;
    std::array<Vec2f, 3> uv;
    std::array<Vec2d, 3> precise;
    for (std::size_t k = 0; k < 3; ++k) {
      if (!target.has_uv(uv_set, corners[k])) return;
      uv[k] = target.uv_sets[uv_set][corners[k]];
      precise[k] = {uv[k].x, uv[k].y};
    }
    if (!by_tile) {
      const auto at = page_of.find({set, mesh::kFirstUdim});
      if (at != page_of.end()) made[at->second]->add_wrapped(uv);
      return;
    }
    mesh::visit_uv_tiles(precise, [&](mesh::UvTile tile) {
      const auto udim = mesh::udim_number(tile);
      const auto at = udim ? page_of.find({set, *udim}) : page_of.end();
      if (at != page_of.end()) made[at->second]->add(uv, tile.column, mesh::period_y(tile));
    });
  };
  for (std::size_t t = 0; t < target.triangles.size(); ++t)
    add(target.triangles[t], target.triangle_material[t]);
  for (std::size_t t = 0; t < target.rest.size(); ++t) add(target.rest[t], target.rest_material[t]);
  for (const auto& each : made) each->finish();
  return {made.begin(), made.end()};
}

}  // namespace pounce::planning
