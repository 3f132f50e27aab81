// SPDX-License-Identifier: Apache-2.0
//
// The hash of its job that every output records. What it must know is simple to forget one by one,
// so nothing is listed that could be: files go in whole, as they are on disk, and all options but
// those whose rows say that they change no byte, or that what they come to is hashed.
//
// Too much in the hash writes an image again, too little keeps a wrong one. What is left out is
// what provably changes no byte: names, folders and times of files, resources, the other images of
// the job. The hash is of one image, so that a tile, a target or a channel has the same one alone
// and among others (docs/decisions/029-job-hash.md).
//
// The order of what is added is part of the hash. Options and files are added after their number,
// so that no two lists of them look alike.
#include "planning/job_hash.h"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <set>
#include <string_view>
#include <system_error>
#include <utility>

#include "io/files/asset_file.h"
#include "io/files/finished_output.h"
#include "options/table.h"
#include "pounce/version.h"

namespace pounce::planning {
namespace {

/// What the ending of an output says, without its spelling.
std::string kind_of(const std::string& path) {
  const std::string ending = io::lower_ending(path);
  if (ending == ".jpeg") return ".jpg";
  return ending == ".tiff" ? ".tif" : ending;
}

/// Options that say of an image what holds without them (docs/decisions/029-job-hash.md); those
/// whose defaults do not depend on files were not described in the first place.
std::vector<std::string> said_anyway(const ChannelPlan& channel, const TargetPlan& target,
                                     const ImageOutput& image) {
  std::vector<std::string> options = channel.said_anyway;
  if (target.usual_distance) options.emplace_back("max-distance");
  if (image.usual_tiles) options.emplace_back("tile-size");
  if (image.usual_levels) options.emplace_back("mipmap");
  return options;
}

/// Is this a file that this user may read? What a mesh names and nobody needs may be anything, a
/// name that no file can have included. A disk that fails is no answer: reading it says so.
bool is_readable(const std::string& path) {
  namespace fs = std::filesystem;
  std::error_code error;
  const fs::file_type type = fs::status(path, error).type();
  if (type == fs::file_type::none) return error == std::errc::io_error;
  return type == fs::file_type::regular && (::access(path.c_str(), R_OK) == 0 || errno != EACCES);
}

void add_page(const TargetPage& page, bool by_tile, Hasher& hash) {
  hash.add(page.material.value_or(UINT32_MAX));
  hash.add(by_tile ? page.udim : 0);
}

/// A place that was found on another channel's larger lattice is rounded there, not in the image. A
/// map has no images of its own, and places on the lattices of all.
void add_scaled_pages(const SourcePlan& plan, const PassPlan& pass, const ChannelPlan& channel,
                      Hasher& hash) {
  if (channel.channel == Channel::hits) {
    for (const mesh::Lattice& lattice : pass.source.pages) {
      hash.add(lattice.width);
      hash.add(lattice.height);
    }
  }
  for (std::size_t p = 0; p < std::min(channel.pages.size(), pass.source.pages.size()); ++p) {
    const ImageSize own = sampled_size(plan, channel.pages[p]);
    const mesh::Lattice& lattice = pass.source.pages[p];
    if (own.width == 0 || (own.width == lattice.width && own.height == lattice.height)) continue;
    hash.add(std::string_view("lattice"));
    hash.add(lattice.width);
    hash.add(lattice.height);
  }
}

}  // namespace

JobHash::JobHash(job::JobContext& job, const TransferOptions& options)
    : job_(job), options_(options::hashed_texts(options)) {}

JobHash::JobHash(job::JobContext& job, const MapsOptions& options)
    : job_(job), options_(options::hashed_texts(options)) {}

void JobHash::begin(const std::vector<std::string>& said_anyway, Hasher& hash) const {
  const auto counts = [&](const OptionReport& option) {
    return std::find(said_anyway.begin(), said_anyway.end(), option.name) == said_anyway.end();
  };
  // Another version may give other bytes.
  hash.add(std::string_view("pounce " POUNCE_VERSION));
  hash.add(static_cast<std::uint64_t>(std::count_if(options_.begin(), options_.end(), counts)));
  for (const OptionReport& option : options_) {
    if (!counts(option)) continue;
    hash.add(std::string_view(option.name));
    hash.add(std::uint64_t{option.values.size()});
    for (const std::string& value : option.values) hash.add(std::string_view(value));
  }
}

/// What is not there, or not for this user, is no part of the job: what needs it says so. A read
/// that fails ends the job: its outputs would name another one.
void JobHash::add_file(const std::string& path, Hasher& hash) {
  // All images of a job share their files: each is read once.
  const auto known = contents_.find(path);
  if (known != contents_.end()) return hash.add(known->second);
  Hash128 content;
  if (is_readable(path)) content = file_hash(job_, path);
  contents_.emplace(path, content);
  hash.add(content);
}

void JobHash::add_files(const std::vector<std::string>& paths, Hasher& hash) {
  hash.add(std::uint64_t{paths.size()});
  for (const std::string& path : paths) add_file(path, hash);
}

/// Of an image inside of another file that file counts, and the place.
void JobHash::add_image(const mesh::ImageRef& image, Hasher& hash) {
  hash.add(image.offset_bytes);
  hash.add(image.size_bytes);
  if (!image.channels.empty()) hash.add(std::string_view(image.channels));
  if (image.bytes == nullptr) return add_file(image.path, hash);
  Hasher bytes;
  bytes.add(std::span<const std::byte>(*image.bytes));
  hash.add(bytes.digest());
}

void JobHash::add_source_images(const SourcePlan& plan, const ChannelPlan& channel, Hasher& hash) {
  const auto add_column = [&](std::size_t index) {
    const ColumnPlan& column = plan.columns[index];
    add_image(column.image, hash);
    hash.add(column.wrap_u);
    hash.add(column.wrap_v);
  };
  for (const PageTexture& page : channel.pages) {
    hash.add(page.column >= 0);
    hash.add(page.tile_set >= 0);
    if (page.column >= 0) add_column(static_cast<std::size_t>(page.column));
    if (page.tile_set < 0) continue;
    for (const auto& [tile, column] :
         plan.tile_sets[static_cast<std::size_t>(page.tile_set)].columns) {
      hash.add(tile.column);
      hash.add(tile.row);
      add_column(column);
    }
  }
}

void JobHash::add_output(const ChannelPlan& channel, const ImageOutput& image, Hasher& hash) {
  hash.add(std::string_view(channel.name));
  if (is_other(channel.channel)) hash.add(channel.format.is_colour);
  // As resolved, not as stated: a size that follows from an image is the same as one that was
  // given.
  hash.add(std::string_view(kind_of(image.path)));
  hash.add(image.lattice.width);
  hash.add(image.lattice.height);
  hash.add(channel.format.channels);
  hash.add(channel.format.depth);
  hash.add(image.padding);
  hash.add(image.onto.has_value());
  if (!image.onto) return;
  // In place the old image is gone once the new one is there, which must know that it is painted:
  // its job is that of the paint.
  if (image.onto->in_place) {
    hash.add(std::string_view("in place"));
  } else {
    add_file(image.onto->path, hash);
  }
  hash.add(!image.onto->mask_path.empty());
  if (!image.onto->mask_path.empty()) add_file(image.onto->mask_path, hash);
}

std::string JobHash::of_image(const std::vector<std::string>& source, const SourcePlan& plan,
                              const std::vector<std::string>& target, const TargetPlan& target_plan,
                              std::size_t channel, std::size_t page) {
  Hasher hash;
  begin(said_anyway(plan.channels[channel], target_plan, target_plan.images[channel][page]), hash);
  add_files(source, hash);
  add_source_images(plan, plan.channels[channel], hash);
  // Channels of a pass share a search. Where that shows in the bytes of this one, the hash says so.
  for (const PassPlan& pass : plan.passes) {  // whose stores have the triangles as they are
    const bool is_of =
        std::find(pass.channels.begin(), pass.channels.end(), channel) != pass.channels.end();
    if (!is_of) continue;
    if (pass.has_shape) hash.add(std::string_view("shape"));
    add_scaled_pages(plan, pass, plan.channels[channel], hash);
  }
  add_files(target, hash);
  add_page(target_plan.pages[page], target_plan.by_tile, hash);
  add_output(plan.channels[channel], target_plan.images[channel][page], hash);
  if (plan.channels[channel].format.is_colour) {
    for (const auto& transform : plan.transforms) hash.add(transform->identity());
  }
  return to_hex(hash.digest());
}

std::string JobHash::of_model(const std::string& path, const TargetPlan& target_plan) {
  Hasher hash;
  hash.add(std::string_view(kind_of(path)));
  for (const auto& images : target_plan.images) {
    for (const ImageOutput& image : images) hash.add(std::string_view(image.job));
  }
  add_files(target_plan.inputs, hash);
  return to_hex(hash.digest());
}

std::string JobHash::of_map(const std::vector<std::string>& target, const TargetPage& page,
                            ImageSize size, const std::string& map, const std::string& path) {
  Hasher hash;
  begin({}, hash);
  hash.add(size.width);
  hash.add(size.height);
  add_files(target, hash);
  add_page(page, true, hash);
  hash.add(std::string_view(map));
  hash.add(std::string_view(kind_of(path)));
  return to_hex(hash.digest());
}

// --- keys of pages -------------------------------------------------------------------------------
//
// What an image's texels become depends on more than the image: factors, colour spaces, constants
// in its place. A store of texels as they become needs all of that in its key.

namespace {

void add_input(const shading::ColourInput& input, Hasher& hash) {
  hash.add(input.linear);
  for (const double v : input.primaries.value_or(Matrix3{})) hash.add(v);
  if (input.transform == nullptr) return;
  hash.add(input.transform->identity());
}

void add_factor(const shading::Factor& factor, Hasher& hash) {
  for (const double v : factor.scale) hash.add(v);
  for (const double v : factor.offset) hash.add(v);
  hash.add(factor.is_colour);
  hash.add(factor.spreads);
}

}  // namespace

bool texels_are_linear(const SourcePlan& plan) {
  const auto is_linear = [&](const PageTexture& page) {
    if (page.input) return page.input->linear || page.input->primaries.has_value();
    if (page.column >= 0) return plan.columns[static_cast<std::size_t>(page.column)].info.linear;
    if (page.tile_set < 0) return false;
    const TileSetPlan& set = plan.tile_sets[static_cast<std::size_t>(page.tile_set)];
    return std::any_of(set.columns.begin(), set.columns.end(), [&](const auto& column) {
      const auto input = set.inputs.find(column.first);
      if (input == set.inputs.end()) return plan.columns[column.second].info.linear;
      return input->second.linear || input->second.primaries.has_value();
    });
  };
  const auto& pages = plan.channels.front().pages;
  return std::any_of(pages.begin(), pages.end(), is_linear);
}

void add_page(const PageTexture& page, const std::vector<Hash128>& columns, Hasher& hash) {
  hash.add(page.column);
  hash.add(page.tile_set);
  if (page.column >= 0) hash.add(columns[static_cast<std::size_t>(page.column)]);
  for (const double v : page.constant.v) hash.add(v);
  hash.add(page.constant.linear);
  if (page.input) add_input(*page.input, hash);
  if (page.factor) add_factor(*page.factor, hash);
  if (page.tinted) hash.add(std::string_view("tinted"));
}

void add_tile_set(const TileSetPlan& set, const std::vector<Hash128>& columns, Hasher& hash) {
  hash.add(static_cast<std::uint64_t>(set.columns.size()));
  for (const auto& [tile, column] : set.columns) {
    hash.add(tile.column);
    hash.add(tile.row);
    hash.add(columns[column]);
    if (const auto input = set.inputs.find(tile); input != set.inputs.end())
      add_input(input->second, hash);
  }
}

}  // namespace pounce::planning
