// SPDX-License-Identifier: Apache-2.0
//
// What is in a file, as JSON; the text for people is made from the same JSON, so that both always
// say the same.
//
// A file is told by its content where that says what it is. Meshes and packs are read whole, since
// whoever asks what is in a file also asks whether it is sound; a splat scene is read in pieces of
// 16,384 Gaussians, of an image the header alone. There is no budget here: a mesh is read if this
// process may use the memory that it is found to need, and all else takes little, whatever it says.
//
// The JSON has numbers as they are and texts as the file has them; whatever is only for the eye,
// such as lines and columns, is made in the text functions.
#include "pounce/inspect.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string_view>
#include <utility>
#include <vector>

#include "commands/inspect_mesh.h"
#include "core/bounds.h"
#include "core/file.h"
#include "core/hash.h"
#include "core/job_space.h"
#include "core/own_errors.h"
#include "core/system_limits.h"
#include "io/files/asset_file.h"
#include "io/files/finished_output.h"
#include "io/image/read.h"
#include "io/ply/ply_header.h"
#include "io/read_mesh.h"
#include "io/splats/ply_scene.h"
#include "io/splats/scene.h"
#include "store/blocks/splat_store.h"
#include "store/cache/cache_space.h"
#include "store/pack/pack.h"

namespace pounce {
namespace {

using Json = nlohmann::ordered_json;
using store::Splat;

enum class FileType { mesh, splats, image, pack };

constexpr std::string_view kPackStart = "POUNCEPK";
constexpr std::string_view kGlbStart = "glTF";

/// What is read beyond the usual.
struct Allowed {
  bool external = false;
  const ImageTrust& trust;
};

/// One at map coordinates is read again from where single precision is fine enough.
Json describe_mesh(const std::string& path, const Allowed& allowed) {
  // The first reading finds where the mesh is, in single precision, which is enough for that.
  mesh::Mesh mesh = io::read_mesh(path, {allowed.external, {}});
  Box3f box;
  for (const Vec3f& position : mesh.positions) box.extend(position);
  const Vec3d origin = origin_for(box);
  if (origin != Vec3d{}) {
    mesh = {};
    mesh = io::read_mesh(path, {allowed.external, {}, false, true, origin});
  }
  return commands::describe(mesh, origin, allowed.trust);
}

/// By the first bytes where they say it, else by the ending; what is neither mesh nor pack is left
/// to the image reader, which tells formats by content.
FileType file_type(const std::string& path, const ReadFile& file) {
  // Scenes first: a glTF may be a mesh or a scene, and only its content says which.
  if (const auto splats = io::source_splat_format(path)) {
    if (!splats->is_read()) throw Error(ErrorKind::input, io::why_not_read(path, *splats));
    return FileType::splats;
  }
  std::array<char, 8> start{};
  const std::size_t length = std::min<std::uint64_t>(start.size(), file.size_bytes());
  file.read(0, std::as_writable_bytes(std::span(start)).first(length));
  const std::string_view begins(start.data(), length);
  if (begins == kPackStart) return FileType::pack;
  // A PLY that is no scene is a mesh.
  if (begins.substr(0, kGlbStart.size()) == kGlbStart || io::is_ply(file)) return FileType::mesh;
  const std::string ending = io::lower_ending(path);
  if (ending == ".pack") return FileType::pack;
  const bool is_mesh =
      ending == ".glb" || ending == ".gltf" || ending == ".obj" || ending == ".stl";
  return is_mesh ? FileType::mesh : FileType::image;
}

/// Reads every chunk: a pack that is described is a sound one.
Json describe_pack(std::unique_ptr<ReadFile> file, const std::string& path) {
  const store::PackInfo info = store::read_pack_info(*file, path);
  const store::PackReader reader(std::move(file), path, info.kind, info.key);
  return {{"format_version", info.version}, {"kind", store::kind_name(info.kind)},
          {"key", to_hex(info.key)},        {"chunks", reader.verify()},
          {"bytes", reader.size_bytes()},   {"sound", true}};
}

/// Which job an image or a model says it was made by.
void add_job(const std::string& path, Json& json) {
  if (const auto job = io::read_job(path)) json["job"] = *job;
}

/// Of outputs of pounce alone: other files have no job.
std::string job_text(const Json& file) {
  return file.contains("job")
             ? fmt::format("written by pounce, job {}\n", file["job"].get<std::string>())
             : "";
}

/// An EXR may have nothing but layers: one of its channels says then what all are like.
io::ImageInfo info_of(const std::string& path, const std::vector<std::string>& exr_channels,
                      const Allowed& allowed) {
  try {
    return io::ImageReader(path, allowed.trust).info();
  } catch (const Error& error) {
    if (error.kind() != ErrorKind::input || exr_channels.empty()) throw;
  }
  mesh::ImageRef image;
  image.path = image.label = path;
  // Any channel will do to learn size and depth.
  image.channels = exr_channels.front();
  io::ImageInfo info = io::ImageReader(image).info();
  info.channels = 0;
  info.has_alpha = false;
  return info;
}

/// What can be named behind the path of an EXR.
Json layers_json(const std::vector<std::string>& exr_channels) {
  Json layers = Json::array();
  for (const io::Layer& layer : io::layers_of(exr_channels))
    layers.push_back({{"name", layer.name}, {"channels", layer.channels}});
  return layers;
}

/// Where there is a choice.
std::string layers_text(const Json& image) {
  std::string text;
  if (!image.contains("layers")) return text;
  std::size_t channels = 0;
  for (const Json& layer : image["layers"]) channels += layer["channels"].size();
  if (channels == image["channels"].get<std::size_t>()) return text;
  for (const Json& layer : image["layers"]) {
    const std::string name = layer["name"].get<std::string>();
    text += fmt::format("layer      {}: {}\n", name.empty() ? "(no name)" : name,
                        io::joined(layer["channels"].get<std::vector<std::string>>()));
  }
  return text;
}

/// Whatever is no other kind is taken for an image; the message then names all kinds.
Json describe_image(const std::string& path, const Allowed& allowed) {
  try {
    const std::vector<std::string> exr_channels =
        io::ImageReader::exr_channels(path, allowed.trust);
    Json json = commands::describe(info_of(path, exr_channels, allowed));
    if (!exr_channels.empty()) json["layers"] = layers_json(exr_channels);
    add_job(path, json);
    return json;
  } catch (const Error& error) {
    if (error.kind() != ErrorKind::input) throw;
    throw Error(
        ErrorKind::input,
        fmt::format("{}; it is not a mesh (.glb, .gltf, .obj, .ply, .stl), splat scene (PLY, "
                    "SPZ, SOG, .splat, .ksplat), point cloud (PLY, LAS) or tile pack either",
                    error.what()));
  }
}

/// In the file's coordinates. What is far away has the digits of its distance from the origin.
Json box_json(const Box3f& box, Vec3d origin) {
  const auto number = [](float from, double add) -> Json {
    const double own = commands::shortest(from);
    return add == 0 ? own : std::round((own + add) * 1e6) / 1e6;
  };
  const auto corner = [&](Vec3f v) {
    return Json{number(v.x, origin.x), number(v.y, origin.y), number(v.z, origin.z)};
  };
  return {{"lo", corner(box.lo)}, {"hi", corner(box.hi)}};
}

/// As PLY comments and --help call them.
const char* model_name(store::SplatModel model) {
  return model == store::SplatModel::standard      ? "default"
         : model == store::SplatModel::antialiased ? "antialiased"
                                                   : "2dgs";
}

/// Of the sample.
template <class Value>
Json quantiles(const PageVector<Splat>& sample, const Value& value) {
  std::vector<float> values;
  for (const Splat& s : sample) values.push_back(value(s));
  std::sort(values.begin(), values.end());
  const auto at = [&](std::size_t percent) {
    return commands::shortest(values[(values.size() - 1) * percent / 100]);
  };
  return {{"p10", at(10)}, {"p50", at(50)}, {"p90", at(90)}};
}

/// Holds at least 98 % of the sample: without the outermost 300th part on each of six sides,
/// the floaters that make the whole box of a capture useless.
Box3f most_of(const PageVector<Splat>& sample) {
  constexpr std::size_t kSidesPerCent = 300;  // 2 % on six sides
  // By axis, each sorted alone: a box, not a hull. Floaters are few, so they are at the ends.
  const std::size_t cut = sample.size() / kSidesPerCent;
  const auto ends = [&](float Vec3f::*axis) {
    std::vector<float> values;
    for (const Splat& s : sample) values.push_back(s.mean.*axis);
    std::sort(values.begin(), values.end());
    return std::pair{values[cut], values[values.size() - 1 - cut]};
  };
  const auto x = ends(&Vec3f::x), y = ends(&Vec3f::y), z = ends(&Vec3f::z);
  return {{x.first, y.first, z.first}, {x.second, y.second, z.second}};
}

std::string vector_text(const Json& v) {
  return fmt::format("{} {} {}", v[0].get<double>(), v[1].get<double>(), v[2].get<double>());
}

std::string quantiles_text(const Json& q) {
  return fmt::format("10 % {}, half {}, 90 % {}", q["p10"].get<double>(), q["p50"].get<double>(),
                     q["p90"].get<double>());
}

/// Of a PLY: which columns it has, since programs add and drop some, and how many are half floats.
void add_columns(const io::SplatPlyHeader& header, Json& json) {
  Json columns = Json::array();
  std::size_t halves = 0;
  for (const io::PlyColumn& column : header.columns) {
    columns.push_back(column.name);
    halves += column.type == io::PlyType::u16 && io::is_splat_column(column.name) ? 1 : 0;
  }
  json["row_bytes"] = header.row_bytes;
  json["columns"] = columns;
  json["half_columns"] = halves;
}

/// Where most of a scene is, and how opaque and large its Gaussians are.
void add_sample(const PageVector<Splat>& sample, const store::SplatLattice& lattice, Vec3d origin,
                Json& json) {
  json["box_98"] = box_json(most_of(sample), origin);
  json["middle_box"] = box_json(lattice.middle_box(), origin);
  json["opacity"] = quantiles(sample, [](const Splat& s) { return s.alpha; });
  json["size"] = quantiles(sample, [](const Splat& s) { return store::size_of(s); });
}

/// Counts what a transfer would use and leave out, in one pass over the scene. Formats that must be
/// unpacked first are, into a nameless file of the system's temporary folder.
Json describe_splats(const std::string& path) {
  constexpr std::uint64_t kRows = 16 << 10;
  const auto scene = io::open_splat_scene(path, {});
  const std::string folder = std::filesystem::temp_directory_path().string();
  // Unpacking takes disk that nobody was asked for: a tenth of what is free, as a job without
  // --max-temp.
  const std::uint64_t most_bytes = default_scratch_limit(posix_file_system(), folder);
  const auto too_much = [&] {
    return fmt::format(
        "{}: unpacking needs more than {} bytes in {} (a tenth of the free space there, at least 1 "
        "GiB); set the environment variable TMPDIR to a folder with more space",
        path, most_bytes, folder);
  };
  const auto files =
      make_counting_file_system(std::make_shared<ScratchAccount>(most_bytes, too_much));
  scene->prepare({files.get(), folder}, [] {});
  const io::SplatSceneInfo& info = scene->info();
  const PageVector<Splat> sample = io::sample(*scene);
  // As a transfer judges strays: by the middle of a sample.
  const store::SplatLattice lattice(sample);
  store::SplatCounts filtered{};
  std::uint64_t usable = 0, with_normal = 0;
  Box3f box;  // of all that have a place, the strays included: it says why there are strays
  store::SplatRows rows;
  // Without the options of a job: what is counted as usable is what a transfer would use by
  // default.
  for (std::uint64_t first = 0; first < info.splats; first += kRows) {
    rows.splats.clear();
    scene->read(first, std::min(kRows, info.splats - first), rows, filtered);
    for (const Splat& s : rows.splats) {
      box.extend(s.mean);
      if (const auto reason = lattice.filter(s)) {
        ++filtered[static_cast<std::size_t>(*reason)];
        continue;
      }
      ++usable;
      with_normal += s.normal != Vec3f{} ? 1 : 0;
    }
  }
  Json json{{"format", info.format},
            {info.are_points ? "points" : "gaussians", info.splats},
            {"usable", usable},
            {"filtered", Json::object()},
            {"colour_space", info.is_linear ? "linear" : "sRGB"},
            {"with_normal", with_normal}};
  if (!info.are_points) {
    json["sh_degree"] = info.sh_degree;
    json["model"] = model_name(info.model);
  }
  for (std::size_t k = 0; k < filtered.size(); ++k) {
    if (filtered[k] > 0)
      json["filtered"][store::filter_name(static_cast<store::SplatFilter>(k))] = filtered[k];
  }
  if (!box.empty()) json["box"] = box_json(box, info.origin);
  if (!sample.empty()) add_sample(sample, lattice, info.origin, json);
  if (info.are_points) {  // a cloud has neither
    json.erase("opacity");
    json.erase("size");
  }
  if (const auto* ply = dynamic_cast<const io::SplatPly*>(scene.get()))
    add_columns(ply->header(), json);
  json["notes"] = info.assumptions;
  return json;
}

/// One line for each thing, as of a mesh; what a file does not have is left out.
std::string splats_text(const Json& splats) {
  const char* const rows = splats.contains("points") ? "points" : "gaussians";
  std::string text =
      fmt::format("format     {}\n{:<10} {}, {} usable\n", splats["format"].get<std::string>(),
                  rows, splats[rows].get<std::uint64_t>(), splats["usable"].get<std::uint64_t>());
  for (const auto& [reason, count] : splats["filtered"].items())
    text += fmt::format("left out   {} {}\n", count.get<std::uint64_t>(), reason);
  if (splats.contains("columns")) {
    const auto halves = splats["half_columns"].get<std::size_t>();
    text += fmt::format("columns    {}{}, {} bytes per Gaussian\n", splats["columns"].size(),
                        halves == 0 ? "" : fmt::format(" ({} half floats)", halves),
                        splats["row_bytes"].get<unsigned>());
  }
  text += fmt::format("colours    {}", splats["colour_space"].get<std::string>());
  if (splats.contains("sh_degree")) {
    text += fmt::format(", spherical harmonics of degree {}\nmodel      {}",
                        splats["sh_degree"].get<unsigned>(), splats["model"].get<std::string>());
  }
  text += '\n';
  text += fmt::format("normals    {}\n", splats["with_normal"].get<std::uint64_t>());
  const auto box_text = [&](const char* name, const char* key) {
    if (!splats.contains(key)) return;
    text += fmt::format("{:<10} {}  to  {}\n", name, vector_text(splats[key]["lo"]),
                        vector_text(splats[key]["hi"]));
  };
  box_text("box", "box");
  box_text("box 98 %", "box_98");
  box_text("middle", "middle_box");
  if (splats.contains("opacity")) {
    text += fmt::format("opacity    {}\n", quantiles_text(splats["opacity"]));
    text += fmt::format("size       {} (largest sigma)\n", quantiles_text(splats["size"]));
  }
  for (const Json& note : splats["notes"])
    text += fmt::format("note       {}\n", note.get<std::string>());
  return text;
}

/// There is no budget here; what does not fit into this machine is not begun.
void require_memory(const std::string& path, const Allowed& allowed) {
  const std::uint64_t most = usable_memory().bytes;
  const std::uint64_t needed = io::mesh_cost(path, {allowed.external, {}}, most).peak_bytes;
  if (needed <= most) return;
  throw Error(ErrorKind::budget, fmt::format("{}: reading it needs {} MiB, more than the {} MiB "
                                             "that this process may use; split the model",
                                             path, needed >> 20, most >> 20));
}

/// A folder can only be a splat scene. A file is opened here once, so that what is no file or may
/// not be read is told in the same words whatever it would have been.
Json describe_file(const std::string& path, const Allowed& allowed) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) {
    if (const auto splats = io::splat_format(path)) {
      if (!splats->is_read()) throw Error(ErrorKind::input, io::why_not_read(path, *splats));
      Json json{{"file", path}, {"type", "splats"}};
      // "file" and "type" come first, in both forms, whatever follows.
      json.update(describe_splats(path));
      return json;
    }
    throw Error(
        ErrorKind::storage,
        fmt::format("{}: is a folder; specify a mesh, a splat scene, an image or a pack file",
                    path));
  }
  std::unique_ptr<ReadFile> file = posix_file_system().open(path);
  Json json{{"file", path}};
  switch (file_type(path, *file)) {
    case FileType::mesh:
      json["type"] = "mesh";
      require_memory(path, allowed);
      json.update(describe_mesh(path, allowed));
      add_job(path, json);
      break;
    case FileType::splats:
      json["type"] = "splats";
      json.update(describe_splats(path));
      break;
    case FileType::image:
      json["type"] = "image";
      json.update(describe_image(path, allowed));
      break;
    case FileType::pack:
      json["type"] = "pack";
      json.update(describe_pack(std::move(file), path));
      break;
  }
  return json;
}

/// In text a line is one thing: a name with a line end in it must not look like the next.
void join_lines(Json& value) {
  if (value.is_structured()) {
    for (Json& item : value) join_lines(item);
  } else if (value.is_string()) {
    for (char& c : value.get_ref<std::string&>()) {
      if (c == '\n' || c == '\r') c = ' ';
    }
  }
}

}  // namespace

std::string inspect_text(const std::string& path, bool allow_external, const ImageTrust& trust) {
  Json file = with_own_errors([&] { return describe_file(path, {allow_external, trust}); });
  join_lines(file);
  const std::string type = file["type"].get<std::string>();
  std::string text =
      fmt::format("{}: {}\n", file["file"].get<std::string>(), type == "pack" ? "tile pack" : type);
  if (type == "mesh") return text + commands::mesh_text(file) + job_text(file);
  if (type == "splats") return text + splats_text(file);
  if (type == "image")
    return text + commands::image_text(file) + "\n" + layers_text(file) + job_text(file);
  return text +
         fmt::format(
             "kind       {}\nkey        {}\nformat     version {}\nsize       {} bytes, {} chunks, "
             "every checksum matches\n",
             file["kind"].get<std::string>(), file["key"].get<std::string>(),
             file["format_version"].get<unsigned>(), file["bytes"].get<std::uint64_t>(),
             file["chunks"].get<std::uint64_t>());
}

std::string inspect_json(const std::string& path, bool allow_external, const ImageTrust& trust) {
  // A name inside a file need not be UTF-8; JSON must be.
  const Json file = with_own_errors([&] { return describe_file(path, {allow_external, trust}); });
  return file.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace pounce
