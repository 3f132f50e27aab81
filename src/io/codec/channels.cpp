// SPDX-License-Identifier: Apache-2.0
#include "io/codec/channels.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <string_view>

namespace pounce::io {
namespace {

/// "diffuse.R" is R of the layer "diffuse".
struct Name {
  std::string layer, channel;
};

Name parsed(const std::string& name) {
  const std::size_t dot = name.rfind('.');
  Name out =
      dot == std::string::npos ? Name{"", name} : Name{name.substr(0, dot), name.substr(dot + 1)};
  for (char& c : out.channel) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c + 32);
  }
  if (out.channel == "red" || out.channel == "green" || out.channel == "blue" ||
      out.channel == "alpha") {
    out.channel.resize(1);
  }
  return out;
}

using Layers = std::map<std::string, std::map<std::string, int>>;  // layer -> channel -> place

/// The places of R, G, B or Y in a layer; empty if it has none of these.
std::vector<int> colours_of(const std::map<std::string, int>& layer) {
  for (const std::vector<std::string>& wanted :
       {std::vector<std::string>{"r", "g", "b"}, std::vector<std::string>{"y"}}) {
    std::vector<int> places;
    for (const std::string& channel : wanted) {
      if (const auto at = layer.find(channel); at != layer.end()) places.push_back(at->second);
    }
    if (places.size() == wanted.size()) return places;
  }
  return {};
}

/// The names, once `places` are chosen.
void finish(const std::vector<std::string>& names, ChosenChannels& chosen) {
  for (const int place : chosen.places)
    chosen.names.push_back(names[static_cast<std::size_t>(place)]);
}

int place_of(const std::vector<std::string>& names, const std::string& name) {
  const auto at = std::find(names.begin(), names.end(), name);
  return at == names.end() ? -1 : static_cast<int>(at - names.begin());
}

/// What choose_channels() takes of one layer.
ChosenChannels of_layer(const std::vector<std::string>& names, const std::string& layer) {
  std::vector<std::string> own;
  std::vector<int> places;
  int alpha = -1;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const Name name = parsed(names[i]);
    if (name.layer != layer) continue;
    if (name.channel == "a") alpha = static_cast<int>(own.size());
    own.push_back(names[i]);
    places.push_back(static_cast<int>(i));
  }
  ChosenChannels chosen = own.empty() ? ChosenChannels{} : choose_channels(own, alpha);
  for (int& place : chosen.places) place = places[static_cast<std::size_t>(place)];
  return chosen;
}

/// The layer whose colours are taken: that without a name, the left eye's beside the right one's,
/// or the only one that has colours.
const std::map<std::string, int>* colour_layer(const Layers& layers) {
  const std::map<std::string, int>* found = nullptr;
  const auto left = layers.find("left");
  const bool views = left != layers.end() && layers.count("right") > 0 && layers.count("") == 0;
  if (views && !colours_of(left->second).empty()) return &left->second;
  for (const auto& [name, layer] : layers) {
    if (colours_of(layer).empty()) continue;
    if (name.empty()) return &layer;
    if (found != nullptr) return nullptr;
    found = &layer;
  }
  return found;
}

/// Has another layer colours of the same names as this one, as the other eye's view has?
bool is_repeated(const Layers& layers, const std::map<std::string, int>& layer) {
  const std::vector<int> own = colours_of(layer);
  return std::any_of(layers.begin(), layers.end(), [&](const auto& other) {
    return &other.second != &layer && colours_of(other.second).size() == own.size();
  });
}

}  // namespace

ChosenChannels choose_channels(const std::vector<std::string>& names, int alpha) {
  ChosenChannels chosen;
  Layers layers;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const Name name = parsed(names[i]);
    layers[name.layer].try_emplace(name.channel, static_cast<int>(i));
  }
  bool one_of_several = false;
  if (const auto* layer = colour_layer(layers)) {
    one_of_several = is_repeated(layers, *layer);
    chosen.places = colours_of(*layer);
    const auto named = layer->find("a");
    const int own = named != layer->end() ? named->second : layers.size() == 1 ? alpha : -1;
    if (own >= 0 && alpha >= 0) {
      chosen.places.push_back(own);
      chosen.has_alpha = true;
    }
  }
  if (!chosen.has_alpha && !one_of_several && names.size() <= kMostChannels) {
    // Whatever there is, in the file's order; alpha that is not the last is data like the others.
    chosen.places.clear();
    for (int i = 0; i < static_cast<int>(names.size()); ++i) chosen.places.push_back(i);
    chosen.has_alpha = names.size() > 1 && alpha == static_cast<int>(names.size()) - 1 &&
                       parsed(names.back()).layer == parsed(names.front()).layer;
  }
  finish(names, chosen);
  if (chosen.places.empty()) return chosen;
  for (int i = 0; i < static_cast<int>(names.size()); ++i) {
    if (std::find(chosen.places.begin(), chosen.places.end(), i) == chosen.places.end())
      chosen.left_out.push_back(names[static_cast<std::size_t>(i)]);
  }
  return chosen;
}

ChosenChannels named_channels(const std::vector<std::string>& names, const std::string& wanted) {
  if (place_of(names, wanted) < 0 && wanted.find(',') == std::string::npos)
    return of_layer(names, wanted);
  ChosenChannels chosen;
  std::string layer;  // with its dot
  for (std::size_t begin = 0; begin <= wanted.size();) {
    const std::size_t end = std::min(wanted.find(',', begin), wanted.size());
    const std::string name = wanted.substr(begin, end - begin);
    if (begin == 0) layer = name.substr(0, name.rfind('.') + 1);  // npos + 1 is 0
    // A layer's own channel first: "diffuse.R,G" is no G without a layer.
    int place = place_of(names, layer + name);
    if (place < 0) place = place_of(names, name);
    if (place < 0 ||
        std::find(chosen.places.begin(), chosen.places.end(), place) != chosen.places.end())
      return {};
    chosen.places.push_back(place);
    begin = end + 1;
  }
  if (chosen.places.size() > kMostChannels) return {};
  finish(names, chosen);
  chosen.has_alpha = chosen.places.size() > 1 && parsed(chosen.names.back()).channel == "a";
  return chosen;
}

std::vector<std::string> Part::full_names() const {
  std::vector<std::string> names = channels;
  for (std::string& full : names) {
    if (!name.empty() && full.find('.') == std::string::npos) full.insert(0, name + ".");
  }
  return names;
}

ChosenPart named_channels(const std::vector<Part>& parts, const std::string& wanted) {
  ChosenPart chosen;
  for (; chosen.part < parts.size(); ++chosen.part) {
    const Part& part = parts[chosen.part];
    chosen.channels = named_channels(part.channels, wanted);
    if (!chosen.channels.places.empty()) break;
    chosen.channels = named_channels(part.full_names(), wanted);
    chosen.channels.names.clear();
    finish(part.channels, chosen.channels);
    if (!chosen.channels.places.empty()) break;
  }
  return chosen;
}

std::vector<Layer> layers_of(const std::vector<std::string>& names) {
  std::vector<Layer> layers;
  for (const std::string& name : names) {
    const std::string layer = parsed(name).layer;
    auto at = std::find_if(layers.begin(), layers.end(),
                           [&](const Layer& one) { return one.name == layer; });
    if (at == layers.end()) at = layers.insert(at, {layer, {}});
    at->channels.push_back(layer.empty() ? name : name.substr(layer.size() + 1));
  }
  return layers;
}

FileChannels split_channels(const std::string& path) {
  const std::size_t colon = path.rfind(':');
  if (colon == std::string::npos || colon < 5 || colon + 1 == path.size()) return {path, ""};
  std::string ending = path.substr(colon - 4, 4);
  for (char& c : ending) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c;
  std::error_code unknown;
  if (ending != ".exr" || std::filesystem::exists(path, unknown)) return {path, ""};
  return {path.substr(0, colon), path.substr(colon + 1)};
}

std::vector<std::string> usual_names(std::uint32_t channels, bool has_alpha) {
  const std::uint32_t colours = channels - (has_alpha ? 1 : 0);
  std::vector<std::string> names{"R", "G", "B", "fourth"};
  names.resize(colours);
  if (colours == 1) names = {"Y"};
  if (has_alpha) names.push_back("A");
  return names;
}

bool are_usual(const std::vector<std::string>& names, bool has_alpha) {
  const auto usual = usual_names(static_cast<std::uint32_t>(names.size()), has_alpha);
  return names.size() < kMostChannels + (has_alpha ? 1 : 0) &&
         std::equal(names.begin(), names.end(), usual.begin(), usual.end(),
                    [](const std::string& a, const std::string& b) {
                      return parsed(a).layer.empty() && parsed(a).channel == parsed(b).channel;
                    });
}

std::string joined(const std::vector<std::string>& names) {
  std::string out;
  for (const std::string& name : names) out += (out.empty() ? "" : ", ") + name;
  return out;
}

}  // namespace pounce::io
