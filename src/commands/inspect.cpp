// SPDX-License-Identifier: Apache-2.0
#include "pounce/inspect.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string_view>
#include <vector>

#include "commands/inspect_mesh.h"
#include "commands/inspect_splats.h"
#include "core/file.h"
#include "core/hash.h"
#include "core/job_space.h"
#include "core/own_errors.h"
#include "core/system_limits.h"
#include "io/files/file_ending.h"
#include "io/files/job_mark.h"
#include "io/image/read.h"
#include "io/read_mesh.h"
#include "io/splats/scene.h"
#include "store/pack/pack.h"

namespace pounce {
namespace {

using Json = nlohmann::ordered_json;

enum class FileType { mesh, splats, image, pack };

constexpr std::string_view kPackStart = "POUNCEPK";
constexpr std::string_view kGlbStart = "glTF";

/// What is read beyond the usual.
struct Allowed {
  bool external = false;
  const std::vector<ImageFormat>& formats;
};

/// One at map coordinates is read again from where single precision is fine enough.
Json describe_mesh(const std::string& path, const Allowed& allowed) {
  mesh::Mesh mesh = io::read_mesh(path, {allowed.external, {}});
  Box3f box;
  for (const Vec3f& position : mesh.positions) box.extend(position);
  const Vec3d origin = origin_for(box);
  if (origin != Vec3d{}) {
    mesh = {};
    mesh = io::read_mesh(path, {allowed.external, {}, false, true, origin});
  }
  return commands::describe(mesh, origin, allowed.formats);
}

/// By the first bytes where they say it, else by the ending; what is neither mesh nor pack is left
/// to the image reader, which tells formats by content.
FileType file_type(const std::string& path, const ReadFile& file) {
  if (const auto splats = io::source_splat_format(path)) {
    if (!splats->is_read()) throw Error(ErrorKind::input, io::why_not_read(path, *splats));
    return FileType::splats;
  }
  std::array<char, 8> start{};
  const std::size_t length = std::min<std::uint64_t>(start.size(), file.size_bytes());
  file.read(0, std::as_writable_bytes(std::span(start)).first(length));
  const std::string_view begins(start.data(), length);
  if (begins == kPackStart) return FileType::pack;
  if (begins.substr(0, kGlbStart.size()) == kGlbStart) return FileType::mesh;
  const std::string ending = io::lower_ending(path);
  if (ending == ".pack") return FileType::pack;
  const bool is_mesh = ending == ".glb" || ending == ".gltf" || ending == ".obj";
  return is_mesh ? FileType::mesh : FileType::image;
}

const char* kind_name(store::PackKind kind) {
  switch (kind) {
    case store::PackKind::geometry:
      return "geometry";
    case store::PackKind::colour:
      return "colour";
    case store::PackKind::splats:
      return "splats";
    case store::PackKind::results:
      break;
  }
  return "results";
}

/// Reads every chunk: a pack that is described is a sound one.
Json describe_pack(std::unique_ptr<ReadFile> file, const std::string& path) {
  const store::PackInfo info = store::read_pack_info(*file, path);
  const store::PackReader reader(std::move(file), path, info.kind, info.key);
  return {{"format_version", info.version}, {"kind", kind_name(info.kind)},
          {"key", to_hex(info.key)},        {"chunks", reader.verify()},
          {"bytes", reader.size_bytes()},   {"sound", true}};
}

/// Which job an image or a model says it was made by.
void add_job(const std::string& path, Json& json) {
  if (const auto job = io::read_job(path)) json["job"] = *job;
}

std::string job_text(const Json& file) {
  return file.contains("job")
             ? fmt::format("made by pounce, job {}\n", file["job"].get<std::string>())
             : "";
}

/// An EXR may have nothing but layers: one of its channels says then what all are like.
io::ImageInfo info_of(const std::string& path, const std::vector<std::string>& exr_channels,
                      const Allowed& allowed) {
  try {
    return io::ImageReader(path, allowed.formats).info();
  } catch (const Error& error) {
    if (error.kind() != ErrorKind::input || exr_channels.empty()) throw;
  }
  mesh::ImageRef image;
  image.path = image.label = path;
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

Json describe_image(const std::string& path, const Allowed& allowed) {
  try {
    const std::vector<std::string> exr_channels =
        io::ImageReader::exr_channels(path, allowed.formats);
    Json json = commands::describe(info_of(path, exr_channels, allowed));
    if (!exr_channels.empty()) json["layers"] = layers_json(exr_channels);
    add_job(path, json);
    return json;
  } catch (const Error& error) {
    if (error.kind() != ErrorKind::input) throw;
    throw Error(ErrorKind::input,
                fmt::format("{}; it is no mesh (.glb, .gltf, .obj), no splat scene (PLY, SPZ, SOG, "
                            ".splat, .ksplat) and no tile pack either",
                            error.what()));
  }
}

/// There is no budget here; what does not fit into this machine is not begun.
void require_memory(const std::string& path, const Allowed& allowed) {
  const std::uint64_t most = usable_memory().bytes;
  const std::uint64_t needed = io::mesh_cost(path, {allowed.external, {}}, most).peak_bytes;
  if (needed <= most) return;
  throw Error(ErrorKind::budget,
              fmt::format("{}: reading it takes {} MiB, more than the {} MiB that this "
                          "process may use; split the model",
                          path, needed >> 20, most >> 20));
}

Json describe_file(const std::string& path, const Allowed& allowed) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) {
    if (const auto splats = io::splat_format(path); splats && splats->is_read()) {
      Json json{{"file", path}, {"type", "splats"}};
      json.update(commands::describe_splats(path));
      return json;
    } else if (splats) {
      throw Error(ErrorKind::input, io::why_not_read(path, *splats));
    }
    throw Error(
        ErrorKind::storage,
        fmt::format("{}: is a folder; name a mesh, a splat scene, an image or a pack file", path));
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
      json.update(commands::describe_splats(path));
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

std::string inspect_text(const std::string& path, bool allow_external,
                         const std::vector<ImageFormat>& allowed_formats) {
  Json file = with_own_errors([&] {
    return describe_file(path, {allow_external, allowed_formats});
  });
  join_lines(file);
  const std::string type = file["type"].get<std::string>();
  std::string text =
      fmt::format("{}: {}\n", file["file"].get<std::string>(), type == "pack" ? "tile pack" : type);
  if (type == "mesh") return text + commands::mesh_text(file) + job_text(file);
  if (type == "splats") return text + commands::splats_text(file);
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

std::string inspect_json(const std::string& path, bool allow_external,
                         const std::vector<ImageFormat>& allowed_formats) {
  // A name inside a file need not be UTF-8; JSON must be.
  const Json file = with_own_errors([&] {
    return describe_file(path, {allow_external, allowed_formats});
  });
  return file.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace pounce
