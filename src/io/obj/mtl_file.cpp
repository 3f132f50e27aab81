// SPDX-License-Identifier: Apache-2.0
//
// tinyobjloader keeps 2.5 kB for each material, used or not. It is given one material at a time, of
// that only the statements that count, and what is kept of it is small.
#include "io/obj/mtl_file.h"

#include <fmt/format.h>
#include <tiny_obj_loader.h>

#include <algorithm>
#include <array>
#include <map>
#include <sstream>
#include <string_view>
#include <utility>
#include <vector>

#include "core/file.h"
#include "pounce/error.h"

namespace pounce::io {
namespace {

constexpr std::uint64_t kMaxMtlBytes = 64 << 20;
constexpr std::size_t kMaxLineBytes = 1 << 20;
constexpr std::size_t kMaxMaterialBytes = 2 << 20;  // of all that counts of one
constexpr std::size_t kPieceBytes = 256 << 10;
/// A kept material without its texts, and where it is found by name: an estimate upwards.
constexpr std::uint64_t kMtlBytesPerMaterial = 560;
constexpr std::uint64_t kBytesPerText = 40;

constexpr std::array<std::string_view, 19> kCounting = {
    "Kd",     "d",      "Tr",       "Ke",       "map_Kd", "map_Ke", "map_Ka",
    "map_Ks", "map_Ns", "map_bump", "map_Bump", "bump",   "disp",   "map_d",
    "refl",   "map_Pr", "map_Pm",   "map_Ps",   "norm"};

/// Of those that count: the others are colours and numbers.
bool is_texture(std::string_view word) { return word.size() > 2; }

std::string_view first_word(std::string_view line) {
  const std::size_t first = line.find_first_not_of(" \t");
  if (first == std::string_view::npos) return {};
  const std::size_t last = line.find_first_of(" \t", first);
  return line.substr(first, last == std::string_view::npos ? last : last - first);
}

/// Calls f(line) for every line, without its end.
template <class F>
void for_each_line(const std::string& path, F f) {
  const auto file = posix_file_system().open(path);
  const std::uint64_t size = file->size_bytes();
  if (size > kMaxMtlBytes) {
    throw Error(ErrorKind::input, path + ": larger than 64 MiB, which no material file is");
  }
  std::vector<char> piece;
  std::string line;
  constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
  bool is_first = true;
  const auto end_line = [&] {
    std::string_view text(line);
    if (is_first && text.starts_with(kByteOrderMark)) text.remove_prefix(kByteOrderMark.size());
    is_first = false;
    f(text);
    line.clear();
  };
  for (std::uint64_t offset = 0; offset < size; offset += piece.size()) {
    piece.resize(std::min<std::uint64_t>(size - offset, kPieceBytes));
    file->read(offset, std::as_writable_bytes(std::span(piece)));
    for (const char c : piece) {
      if (c != '\n' && c != '\r') {
        if (line.size() == kMaxLineBytes) {
          throw Error(ErrorKind::input,
                      path + ": a line longer than 1 MiB, which no material file has");
        }
        line.push_back(c);
      } else if (!line.empty()) {
        end_line();
      }
    }
  }
  if (!line.empty()) end_line();
}

MtlTexture texture(const std::string& name, const tinyobj::texture_option_t& options) {
  return {name,
          options.clamp,
          {options.scale[0], options.scale[1]},
          {options.origin_offset[0], options.origin_offset[1]}};
}

/// Gives the statements of one material to tinyobjloader.
void parse(const std::string& statements, const std::function<void(MtlMaterial&&)>& found) {
  if (statements.empty()) return;
  std::istringstream stream(statements);
  std::map<std::string, int> by_name;
  std::vector<tinyobj::material_t> materials;
  std::string warning, error;
  tinyobj::LoadMtl(&by_name, &materials, &stream, &warning, &error);
  for (const tinyobj::material_t& in : materials) {
    MtlMaterial out;
    out.name = in.name;
    std::copy_n(in.diffuse, 3, out.diffuse.begin());
    std::copy_n(in.emission, 3, out.emission.begin());
    out.dissolve = in.dissolve;
    out.base_color = texture(in.diffuse_texname, in.diffuse_texopt);
    out.emissive = texture(in.emissive_texname, in.emissive_texopt);
    for (const auto& [slot, texture] :
         std::initializer_list<std::pair<const char*, const std::string&>>{
             {"map_Ka", in.ambient_texname},
             {"map_Ks", in.specular_texname},
             {"map_Ns", in.specular_highlight_texname},
             {"map_Bump", in.bump_texname},
             {"disp", in.displacement_texname},
             {"map_d", in.alpha_texname},
             {"refl", in.reflection_texname},
             {"map_Pr", in.roughness_texname},
             {"map_Pm", in.metallic_texname},
             {"map_Ps", in.sheen_texname},
             {"norm", in.normal_texname}}) {
      if (!texture.empty()) out.others.emplace_back(slot, texture);
    }
    found(std::move(out));
  }
}

}  // namespace

void read_mtl(const std::string& path, const std::function<void(MtlMaterial&&)>& found) {
  std::string statements;  // of the material at hand, from its "newmtl" on
  for_each_line(path, [&](std::string_view line) {
    const std::string_view word = first_word(line);
    if (word == "newmtl") {
      parse(statements, found);
      // tinyobjloader invents a diffuse colour of 0.6 where a material has a map but no Kd, and
      // black where it has neither. This makes white the default.
      statements = fmt::format("{}\nKd 1 1 1\n", line);
    } else if (!statements.empty() &&
               std::find(kCounting.begin(), kCounting.end(), word) != kCounting.end()) {
      statements.append(line).push_back('\n');
      if (statements.size() > kMaxMaterialBytes) {
        throw Error(ErrorKind::input,
                    path + ": a material longer than 2 MiB, which no material file has");
      }
    }
  });
  parse(statements, found);
}

MtlSize mtl_size(const std::string& path) {
  MtlSize size;
  std::uint64_t materials = 0, texts = 0, longest = 0;
  for_each_line(path, [&](std::string_view line) {
    const std::string_view word = first_word(line);
    const bool is_new = word == "newmtl";
    materials += is_new ? 1 : 0;
    // A name is kept twice.
    const bool is_counting = std::find(kCounting.begin(), kCounting.end(), word) != kCounting.end();
    if (is_new || is_counting) texts += line.size() * (is_new ? 2 : 1) + kBytesPerText;
    longest = std::max<std::uint64_t>(longest, line.size());
    if (is_counting && is_texture(word)) {
      ++size.textures;
      size.texture_bytes += line.size();
      size.longest_texture_bytes = std::max<std::uint64_t>(size.longest_texture_bytes, line.size());
    }
  });
  size.bytes = materials * kMtlBytesPerMaterial + texts + 8 * longest + (2U << 20);
  return size;
}

}  // namespace pounce::io
