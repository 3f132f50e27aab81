// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfPixelType.h>

#include <map>
#include <optional>

#include "corpus.h"

namespace pounce::test::corpus {

struct ExrChannel {
  std::string name;
  Imf::PixelType type = Imf::HALF;
  int sampling = 1;
};

struct Exr {
  std::uint32_t width = 37, height = 29;
  std::vector<ExrChannel> channels;
  Imf::Compression compression = Imf::ZIP_COMPRESSION;
  Imf::LineOrder order = Imf::INCREASING_Y;
  std::uint32_t tile_width = 0, tile_height = 0;  ///< 0: rows
  Imf::LevelMode levels = Imf::ONE_LEVEL;
  Imf::LevelRoundingMode rounding = Imf::ROUND_DOWN;
  int left = 0, top = 0;                     ///< of the data window
  std::optional<Imath::Box2i> display = {};  ///< else that of the data
  bool odd_values = false;                   ///< infinite ones, NaN, the smallest ones
  bool attributes = false;                   ///< chromaticities and others
  std::string part = {};                     ///< the name of a part, and of a view
  std::string view = {};
  // What is read of it: these channels, the last one alpha or not.
  std::vector<std::string> wanted;
  bool has_alpha = false;
  bool no_rule = false;
};

/// The channels' samples, four bytes or two each, row by row.
using Planes = std::map<std::string, std::vector<std::byte>>;

Imf::Header header_of(const Exr& exr);
Planes planes_of(const Exr& exr, Random& random);
/// Into a file of this header alone.
void write_file(const Exr& exr, const Planes& planes, const std::string& path);
/// What is read of such planes.
std::optional<Picture> expected(const Exr& exr, const Planes& planes);

void add(Entries& entries, const std::string& name, const Exr& exr);

/// Half R, G, B and A.
Exr usual_exr();

}  // namespace pounce::test::corpus
