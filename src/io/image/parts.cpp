// SPDX-License-Identifier: Apache-2.0
#include "io/image/parts.h"

#include <fmt/format.h>

#include <algorithm>

#include "pounce/error.h"

namespace pounce::io {

std::vector<Part> parts_of(OIIO::ImageInput& input) {
  constexpr int kMostParts = 1024;
  std::vector<Part> parts{{"", input.spec().channelnames}};
  const int count = std::min(input.spec().get_int_attribute("oiio:subimages", 1), kMostParts);
  if (count < 2) return parts;
  parts.clear();
  for (int i = 0; i < count && input.seek_subimage(i, 0); ++i) {
    parts.push_back(
        {input.spec().get_string_attribute("oiio:subimagename"), input.spec().channelnames});
  }
  input.seek_subimage(0, 0);
  return parts;
}

std::uint32_t levels_of(OIIO::ImageInput& input, int part) {
  int levels = 1;
  while (input.seek_subimage(part, levels)) ++levels;
  input.seek_subimage(part, 0);
  return static_cast<std::uint32_t>(levels);
}

std::vector<std::string> names_of(std::span<const Part> parts) {
  std::vector<std::string> names;
  for (const Part& part : parts) {
    const std::vector<std::string> own = part.full_names();
    names.insert(names.end(), own.begin(), own.end());
  }
  return names;
}

ChosenPart wanted_part(const std::string& label, const std::vector<Part>& parts,
                       const std::string& wanted) {
  ChosenPart chosen = named_channels(parts, wanted);
  if (!chosen.channels.places.empty()) return chosen;
  throw Error(ErrorKind::input,
              fmt::format("{}: \"{}\" is neither a layer nor 1 to {} different channels of this "
                          "file, which has {}",
                          label, wanted, kMostChannels, joined(names_of(parts))));
}

}  // namespace pounce::io
