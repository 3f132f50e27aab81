// SPDX-License-Identifier: Apache-2.0
//
// Materials of an OBJ: the MTL files that it names, and what of them its faces use.
//
// An MTL file is a list of materials, each from its "newmtl" to the next. What is no number counts
// as missing: these files are written by hand, too, and a colour that cannot be read is no reason
// to be without the textures. They are read one material at a time; what is kept of one is bounded,
// and mtl_size() foretells all of it.
//
//   newmtl NAME          the next material; the first of a name counts
//   Kd, map_Kd; d, Tr    base colour; d wins over Tr
//   Ke, map_Ke           emission
//   norm, with -bm       a tangent-space normal map and its strength
//   -s, -o, -clamp       scale and offset of UVs, and whether they end at the border
//   other maps           listed, not read: among them map_Bump, which may be heights or normals
//
// Names are the hard part. An "mtllib" may name one file with blanks or several without; paths come
// from other machines, with backslashes and drives, or lead out of the model's folder, which only
// the user may allow. A texture is then looked for beside the MTL. What is not found is told with
// its cure, never guessed further, and a model without its materials is still a model.
//
// A mesh material is made when the first face uses it, so unused ones, which libraries are full of,
// cost nothing and ask for no images.
//
// What is read of an MTL is old, and what it says is often a default that nobody chose. So the
// rules lean to showing a texture: black, invisible or dark beside a map counts as not said.
#include "io/obj/materials.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "core/file.h"
#include "core/input_file.h"
#include "io/obj/numbers.h"
#include "io/obj/obj_text.h"
#include "io/read_mesh.h"

namespace pounce::io {
namespace {

namespace fs = std::filesystem;

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
        refuse(path_, "a material longer than 2 MiB; this is not a material file");
      }
    }
  }

  /// Hands over the material at hand.
  void finish() {
    if (!material_) return;
    material_->base_color = std::move(textures_[0]);
    material_->emissive = std::move(textures_[1]);
    material_->normal = std::move(textures_[2]);
    // The order is that of the table, not of the file: messages list the maps alike for all
    // materials.
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
  if (open_input(path)->size_bytes() > kMaxMtlBytes)
    refuse(path, "larger than 64 MiB; this is not a material file");
  return {path, ObjText::Kind::mtl};
}

constexpr std::size_t kListedUnknown = 5;

std::string slashed(std::string name) {
  std::replace(name.begin(), name.end(), '\\', '/');
  return name;
}

bool is_file(const fs::path& path) {
  std::error_code error;
  return fs::is_regular_file(path, error);
}

fs::path library_path(const std::string& obj_path, const std::string& name) {
  return fs::path(obj_path).parent_path() / slashed(name);
}

}  // namespace

void read_mtl(const std::string& path, const std::function<void(MtlMaterial&&)>& found) {
  ObjText text = open_mtl(path);
  MtlReader reader(path, found);
  for (std::string_view statement; text.next(statement);) reader.add(statement);
  reader.finish();
}

MtlSize mtl_size(const std::string& path) {
  ObjText text = open_mtl(path);
  MtlSize size;
  // Statement by statement as reading does it, but nothing is kept: the count comes before the
  // lease.
  std::uint64_t materials = 0, texts = 0;
  for (std::string_view statement; text.next(statement);) {
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

// A blank may be part of a name or stand between two: both readings are tried, the whole first.
std::vector<std::string> library_names(std::string_view said) {
  said.remove_prefix(std::min(said.find_first_not_of(" \t"), said.size()));
  std::vector<std::string> names{std::string(said)};
  if (said.find(' ') == std::string_view::npos) return names;
  for (std::size_t at = 0; at < said.size();) {
    const std::size_t end = std::min(said.find(' ', at), said.size());
    if (end > at) names.emplace_back(said.substr(at, end - at));
    at = end + 1;
  }
  return names;
}

std::optional<std::string> material_library(const std::string& obj_path, const AssetFolder& folder,
                                            const std::string& name) {
  const fs::path path = library_path(obj_path, name);
  if (!is_file(path) || !folder.holds(path.string())) return std::nullopt;
  return path.string();
}

ObjMaterials::ObjMaterials(const std::string& obj_path, bool allow_external, bool tells,
                           mesh::Mesh& mesh, MeshWarnings& warnings)
    : path_(obj_path),
      folder_(obj_path, allow_external),
      mesh_(mesh),
      warnings_(warnings),
      tells_(tells) {}

void refuse_libraries(const std::string& obj_path) {
  refuse(obj_path,
         "refers to more than {} material files; split the model or remove those that no face uses",
         kMaxLibraries);
}

// Of several names the first that can be read counts, and one that was loaded before is passed
// over: exporters repeat the statement for every object.
void ObjMaterials::load(const std::string& said) {
  std::vector<std::string> names = library_names(said);
  if (std::error_code error; fs::exists(library_path(path_, names[0]), error)) {
    names.resize(1);
  } else if (names.size() > 1) {
    names.erase(names.begin());
  }
  // A file that exists under the whole text is meant, blanks and all; else each word is a file.
  for (const std::string& name : names) {
    if (loaded_names_.contains(name) || !can_load(name)) continue;
    loaded_names_.insert(name);
    return;
  }
}

bool ObjMaterials::can_load(const std::string& name) {
  const std::string path = library_path(path_, name).lexically_normal().string();
  // By where the name leads, so that "./a.mtl" and "a.mtl" are read once.
  const auto [library, is_new] = libraries_.try_emplace(path, false);
  // Also of one that failed: its warning was given, and exporters repeat "mtllib" for each object.
  if (!is_new) return library->second;
  if (libraries_.size() > kMaxLibraries) refuse_libraries(path_);
  const std::string shown = library_path(path_, name).string();
  // What is wrong decides which cure the user is told; none of it is a reason to refuse the model.
  std::string cure = "is missing: restore it", refused;
  try {
    if (!is_file(shown)) {
      std::error_code ignored;
      if (fs::status(shown, ignored).type() == fs::file_type::not_found)
        throw Error(ErrorKind::storage, "no such file");
      cure = "is not a readable file: replace it by one";
      throw Error(ErrorKind::storage, "not a readable file");
    }
    if (!folder_.holds(shown)) {
      cure = kOutsideProblem;
      throw Error(ErrorKind::input, std::string("it ") + kOutsideProblem);
    }
    cure = "cannot be read: grant this user access";
    read(shown);
    library->second = true;
  } catch (const Error& e) {
    if (e.kind() == ErrorKind::input && folder_.holds(shown)) cure = "is damaged: export it again";
    if (e.kind() == ErrorKind::storage && is_file(shown)) refused = e.what();
    if (tells_) warnings_.add("material file {} cannot be read ({})", shown, e.what());
    mesh_.unread_files.push_back({shown, cure, refused});
  }
  return library->second;
}

void ObjMaterials::read(const std::string& path) {
  // Materials keep where they were read: their textures lie beside the MTL, not beside the OBJ.
  const std::string& folder = *folders_.insert(fs::path(path).parent_path().string()).first;
  read_mtl(path, [&](MtlMaterial&& material) {
    const auto id = static_cast<int>(loaded_.size());
    if (!ids_.try_emplace(material.name, id).second) return;  // the first of a name counts
    loaded_.push_back({std::move(material), &folder});
  });
  mesh_.files.push_back(path);
}

void ObjMaterials::use(const std::string& name) {
  // The material of a name that no library has is made, too: its faces stay apart from others.
  const auto found = ids_.find(name);
  in_use_ = found != ids_.end() ? std::pair(found->second, std::string()) : std::pair(-1, name);
  current_.reset();
}

std::uint32_t ObjMaterials::current() {
  if (!current_) {
    const auto found = made_.find(in_use_);
    current_ = found != made_.end() ? found->second : made_[in_use_] = make();
  }
  return *current_;
}

// Numbered as faces first use them: the same order as in the mesh, whatever the libraries hold.
std::uint32_t ObjMaterials::make() {
  if (mesh_.materials.size() == kMaxMaterials) {
    refuse(path_, "its faces use more than {} materials; split the model", kMaxMaterials);
  }
  mesh::Material out;
  const auto& [id, name] = in_use_;
  if (id >= 0) {
    fill(out, loaded_.at(static_cast<std::size_t>(id)));
  } else if (!name.empty()) {
    out.name = name;
    if (++unknown_count_ <= kListedUnknown) unknown_.push_back(name);
  } else {
    out.name = "default";
  }
  mesh_.materials.push_back(std::move(out));
  return static_cast<std::uint32_t>(mesh_.materials.size() - 1);
}

void ObjMaterials::finish() {
  if (!tells_) return;
  for (const std::string& name : unknown_) {
    warnings_.add("no material file defines the material \"{}\"; it has no textures", name);
  }
  if (unknown_count_ > unknown_.size()) {
    warnings_.add("no material file defines {} more materials; they have no textures",
                  unknown_count_ - unknown_.size());
  }
}

void ObjMaterials::warn_of_unread(const MtlMaterial& material, const char* statement,
                                  std::string_view how) {
  if (how.empty()) return;
  warnings_.add(
      "material \"{}\": \"{} {}\" is not supported and is ignored; write it as \"{} r g b\"",
      material.name, statement, how, statement);
}

void ObjMaterials::fill(mesh::Material& out, const Loaded& loaded) {
  const MtlMaterial& in = loaded.material;
  out.name = in.name;
  warn_of_unread(in, "Kd", in.unread_diffuse);
  warn_of_unread(in, "Ke", in.unread_emission);
  auto& base = out.factors[static_cast<std::size_t>(Channel::base_color)];
  base = {in.diffuse[0], in.diffuse[1], in.diffuse[2], in.dissolve};
  // Black or invisible beside a texture is what exporters write where they mean nothing by it.
  if (!in.base_color.name.empty()) {
    if (base[0] == 0 && base[1] == 0 && base[2] == 0) base[0] = base[1] = base[2] = 1;
    if (base[3] == 0) base[3] = 1;
  }
  // "Ke 0 0 0" beside a map would mean that the map is never seen: it is what exporters write by
  // default.
  const bool dark = in.emission[0] == 0 && in.emission[1] == 0 && in.emission[2] == 0;
  auto& emissive = out.factors[static_cast<std::size_t>(Channel::emissive)];
  emissive = {in.emission[0], in.emission[1], in.emission[2], 1};
  if (dark && !in.emissive.name.empty()) emissive = {1, 1, 1, 1};
  bind(out, Channel::base_color, in.base_color, *loaded.folder);
  bind(out, Channel::emissive, in.emissive, *loaded.folder);
  bind(out, Channel::normal, in.normal, *loaded.folder);
  const float strength = in.normal.strength;
  out.factors[static_cast<std::size_t>(Channel::normal)] = {strength, strength, 1, 1};
  for (const auto& [slot, texture] : in.others) {
    out.other_textures.push_back({slot, image(texture, *loaded.folder)});
  }
}

void ObjMaterials::bind(mesh::Material& material, Channel channel, const MtlTexture& texture,
                        const std::string& folder) {
  if (texture.name.empty()) return;
  mesh::TextureBinding binding;
  binding.image = image(texture.name, folder);
  binding.wrap_u = binding.wrap_v = texture.clamp ? mesh::Wrap::clamp : mesh::Wrap::repeat;
  // "-s" and "-o" scale and move with v up: v_up' = s v_up + o, written for v down = 1 - v_up.
  const auto [su, sv] = texture.scale;
  const auto [ou, ov] = texture.offset;
  binding.transform = {su, 0, ou, 0, sv, 1 - sv - ov};
  material.textures[static_cast<std::size_t>(channel)] = binding;
}

// One entry for each file, however many materials name it; what is wrong with it is said when
// somebody wants to read it.
std::uint32_t ObjMaterials::image(const std::string& name, const std::string& folder) {
  std::string clean = slashed(name);
  while (!clean.empty() && (clean.back() == ' ' || clean.back() == '\t')) clean.pop_back();
  fs::path path = fs::path(folder) / clean;
  // Paths of another machine ("C:/art/skin.png") or to elsewhere on this one: the file is often
  // beside the MTL.
  const auto is_readable = [&](const fs::path& file) {
    return is_file(file) && folder_.holds(file.string());
  };
  // Only where the named file cannot be read, or a texture beside the MTL would hide the one that
  // is meant.
  const bool is_moved = [&] {
    const fs::path beside = fs::path(folder) / fs::path(clean).filename();
    if (is_readable(path) || !is_readable(beside)) return false;
    path = beside;
    return true;
  }();
  if (is_moved && moved_.insert(clean).second) {
    mesh_.notes.push_back(
        fmt::format("{}: {} is missing or not readable; {} of the same name is used instead", path_,
                    name, path.string()));
  }
  const auto [it, is_new] =
      images_.try_emplace(path.string(), static_cast<std::uint32_t>(mesh_.images.size()));
  if (is_new) {
    mesh::ImageRef& out = mesh_.images.emplace_back();
    out.path = out.label = path.string();
    std::error_code error;  // whatever else is wrong with it, reading says
    if (fs::status(path, error).type() == fs::file_type::not_found) {
      out.problem = fmt::format("the file is missing (referenced by a material of {})", path_);
      out.missing = true;
    } else if (!folder_.holds(path.string())) {
      out.problem =
          fmt::format("the file (referenced by a material of {}) {}", path_, kOutsideProblem);
    }
  }
  return it->second;
}

}  // namespace pounce::io
