// SPDX-License-Identifier: Apache-2.0
//
// An MTL file is a list of materials, each from its "newmtl" to the next. What is no number counts
// as missing: these files are written by hand, too, and a colour that cannot be read is no reason
// to be without the textures.
#include "io/obj/mtl_file.h"

#include <algorithm>
#include <array>
#include <optional>
#include <string_view>
#include <utility>

#include "core/file.h"
#include "core/input_file.h"
#include "io/obj/text.h"
#include "pounce/error.h"

namespace pounce::io {
namespace {

constexpr std::uint64_t kMaxMtlBytes = 64 << 20;
constexpr std::size_t kMaxMaterialBytes = 2 << 20;  // of all that counts of one
/// A kept material without its texts, and where it is found by name: an estimate upwards.
constexpr std::uint64_t kMtlBytesPerMaterial = 640;
constexpr std::uint64_t kBytesPerText = 40;

/// The first three have channels, the others are told of in this order. What "map_Bump" names may
/// be heights, or in some exporters' files a normal map: nothing says which.
constexpr std::array<const char*, kMaxMtlTextures> kTextures = {
    "map_Kd", "map_Ke", "norm", "map_Ka", "map_Ks", "map_Ns", "map_Bump",
    "disp",   "map_d",  "refl", "map_Pr", "map_Pm", "map_Ps"};

std::optional<std::size_t> texture_index(std::string_view word) {
  if (word == "bump" || word == "map_bump") word = "map_Bump";
  const auto* const found = std::find(kTextures.begin(), kTextures.end(), word);
  if (found == kTextures.end()) return std::nullopt;
  return static_cast<std::size_t>(found - kTextures.begin());
}

/// How many words an option before a texture's name takes, at most; 0 for what is no option.
std::size_t option_words(std::string_view word) {
  constexpr std::array<std::string_view, 9> kOneWord = {"-blendu",  "-blendv", "-boost",
                                                        "-bm",      "-clamp",  "-colorspace",
                                                        "-imfchan", "-texres", "-type"};
  if (word == "-o" || word == "-s" || word == "-t") return 3;
  if (word == "-mm") return 2;
  return std::find(kOneWord.begin(), kOneWord.end(), word) != kOneWord.end() ? 1 : 0;
}

/// Takes over what a texture statement says: options, then a name to the end of the line.
void read_texture(std::string_view rest, MtlTexture& texture) {
  while (!rest.empty()) {
    std::string_view behind = rest;
    const std::string_view word = next_word(behind);
    const std::size_t word_count = option_words(word);
    if (word_count == 0) {
      rest.remove_prefix(static_cast<std::size_t>(word.data() - rest.data()));
      texture.name = rest.substr(0, rest.find('\0'));
      return;
    }
    rest = behind;
    std::array<std::string_view, 3> values;
    for (std::size_t i = 0; i < word_count; ++i) {
      std::string_view after = rest;
      const std::string_view value = next_word(after);
      // "-s u [v [w]]": the name may come after the first of three numbers.
      if (word_count == 3 && i > 0 && !to_float(value)) break;
      values[i] = value;
      rest = after;
    }
    if (word == "-clamp") texture.clamp = !values[0].starts_with("off");
    if (word == "-s") texture.scale = {to_float_or(values[0], 1), to_float_or(values[1], 1)};
    if (word == "-bm") texture.strength = to_float_or(values[0], 1);
    if (word == "-o") texture.offset = {to_float_or(values[0], 0), to_float_or(values[1], 0)};
  }
}

/// Collects the statements of one material after the other.
class MtlReader {
 public:
  MtlReader(const std::string& path, const std::function<void(MtlMaterial&&)>& found)
      : path_(path), found_(found) {}

  void add(std::string_view statement) {
    std::string_view rest = statement;
    const std::string_view word = next_word(rest);
    if (word == "newmtl") {
      finish();
      material_.emplace().name = name_in(rest);
      textures_ = {};
      has_dissolve_ = false;
      bytes_ = 0;
    } else if (material_ && !rest.empty() && set(word, rest)) {
      bytes_ += statement.size();
      if (bytes_ > kMaxMaterialBytes) {
        throw Error(ErrorKind::input,
                    path_ + ": a material longer than 2 MiB, which no material file has");
      }
    }
  }

  /// Hands over the material at hand.
  void finish() {
    if (!material_) return;
    material_->base_color = std::move(textures_[0]);
    material_->emissive = std::move(textures_[1]);
    material_->normal = std::move(textures_[2]);
    for (std::size_t i = 3; i < kTextures.size(); ++i) {
      if (!textures_[i].name.empty())
        material_->others.emplace_back(kTextures[i], std::move(textures_[i].name));
    }
    found_(std::move(*material_));
  }

 private:
  /// Is it a statement that counts?
  bool set(std::string_view word, std::string_view rest) {
    if (const auto texture = texture_index(word)) {
      read_texture(rest, textures_[*texture]);
    } else if (word == "Kd") {
      read_colour(rest, material_->diffuse, material_->unread_diffuse);
    } else if (word == "Ke") {
      read_colour(rest, material_->emission, material_->unread_emission);
    } else if (word == "d") {
      material_->dissolve = to_float_or(next_word(rest), 0);
      has_dissolve_ = true;
    } else if (word == "Tr") {
      if (!has_dissolve_) material_->dissolve = 1 - to_float_or(next_word(rest), 0);
    } else {
      return false;
    }
    return true;
  }

  /// "r [g [b]]", where those left out are as r; "xyz x y z" and "spectral file" are not read.
  static void read_colour(std::string_view rest, std::array<float, 3>& colour,
                          std::string_view& unread) {
    std::string_view word = next_word(rest);
    unread = word == "xyz" ? "xyz" : word == "spectral" ? "spectral" : "";
    if (!unread.empty()) return;
    colour.fill(to_float_or(word, 0));
    for (std::size_t i = 1; i < 3; ++i) {
      word = next_word(rest);
      if (!word.empty()) colour[i] = to_float_or(word, 0);
    }
  }

  const std::string& path_;
  const std::function<void(MtlMaterial&&)>& found_;
  std::optional<MtlMaterial> material_;
  std::array<MtlTexture, kMaxMtlTextures> textures_;  ///< of it
  bool has_dissolve_ = false;                         ///< has it a "d", which wins over a "Tr"?
  std::size_t bytes_ = 0;
};

ObjText open_mtl(const std::string& path) {
  if (open_input(path)->size_bytes() > kMaxMtlBytes) {
    throw Error(ErrorKind::input, path + ": larger than 64 MiB, which no material file is");
  }
  return {path, ObjText::Kind::mtl};
}

}  // namespace

void read_mtl(const std::string& path, const std::function<void(MtlMaterial&&)>& found) {
  ObjText text = open_mtl(path);
  MtlReader reader(path, found);
  for (std::string statement; text.next(statement);) reader.add(statement);
  reader.finish();
}

MtlSize mtl_size(const std::string& path) {
  ObjText text = open_mtl(path);
  MtlSize size;
  std::uint64_t materials = 0, texts = 0;
  for (std::string statement; text.next(statement);) {
    std::string_view rest = statement;
    const std::string_view word = next_word(rest);
    if (word == "newmtl") {
      ++materials;
      texts += 2 * statement.size() + kBytesPerText;  // a name is kept twice
    } else if (texture_index(word)) {
      texts += statement.size() + kBytesPerText;
      ++size.textures;
      size.texture_bytes += statement.size();
      size.longest_texture_bytes =
          std::max<std::uint64_t>(size.longest_texture_bytes, statement.size());
    }
  }
  size.bytes = materials * kMtlBytesPerMaterial + texts;
  size.longest_line_bytes = text.longest_bytes();
  return size;
}

}  // namespace pounce::io
