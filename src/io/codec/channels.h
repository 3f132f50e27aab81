// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace pounce::io {

inline constexpr std::size_t kMostChannels = 4;
/// Of an EXR: ImageInfo::hits_note.
inline constexpr const char* kHitsAttribute = "pounce:hits";

/// Which channels of a file make the image: places in the file, in the image's order.
struct ChosenChannels {
  std::vector<int> places;
  bool has_alpha = false;  ///< the last one is alpha, because the file says so
  std::vector<std::string> names;
  std::vector<std::string> left_out;
};

/// Chooses by name: R, G and B or Y, of no layer or else of the one layer that has them, with their
/// alpha; of the views of a stereo file ("Y", "right.Y") the one without a name, else the left one.
/// A file without such, or with more but no alpha, gives all that it has, up to four, as data.
/// `alpha` is the place that the file calls alpha, -1 for none. Empty places: too many channels,
/// and no names to choose by.
ChosenChannels choose_channels(const std::vector<std::string>& names, int alpha);

/// Chooses what the user names: channels between commas, of which those after the first may leave
/// out its layer ("diffuse.R,G,B"), or one layer ("diffuse"), of which choose_channels() takes its
/// share. The last of several is alpha where it is called A. Empty places: there is no such, a
/// channel is named twice, or more than four are.
ChosenChannels named_channels(const std::vector<std::string>& names, const std::string& wanted);

/// A part of a file that holds several images, and its channels. The part's name is the layer of
/// those that have none.
struct Part {
  std::string name;
  std::vector<std::string> channels;

  std::vector<std::string> full_names() const;
};
/// The same of the first part that has what is wanted, by its channels' own names or by their full
/// ones. Its places and names are those within the part.
struct ChosenPart {
  std::size_t part = 0;
  ChosenChannels channels;
};
ChosenPart named_channels(const std::vector<Part>& parts, const std::string& wanted);

/// Channels of one layer: "diffuse" and "R", "G", "B". Those without a layer are one without a
/// name.
struct Layer {
  std::string name;
  std::vector<std::string> channels;
};
/// The layers of channels with these full names, in their order.
std::vector<Layer> layers_of(const std::vector<std::string>& names);

/// "file.exr:diffuse.R,G,B" is a file and what is wanted of it, if no file has all that as its
/// name.
struct FileChannels {
  std::string file, channels;
};
FileChannels split_channels(const std::string& path);

/// "Y" or "R", "G", "B", ..., "A": the names of an image that has no others. A fourth colour is
/// "fourth".
std::vector<std::string> usual_names(std::uint32_t channels, bool has_alpha);

/// Are these the names that readers expect of so many channels, in any case of letters?
bool are_usual(const std::vector<std::string>& names, bool has_alpha);

/// "R, G, B".
std::string joined(const std::vector<std::string>& names);

}  // namespace pounce::io
