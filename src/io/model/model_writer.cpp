// SPDX-License-Identifier: Apache-2.0
//
// A glTF file with new textures. Nothing goes through a glTF library: they drop what they do not
// know and spell numbers anew. The JSON is edited as text, where only the values that change are
// touched; the buffers are copied as they are, less the images that were replaced. What is in
// memory is the JSON (ModelPlan::least_bytes); bytes are copied 1 MiB at a time.
//
//   find_slots         which entries of the arrays the new textures take     layout.h
//   ModelBuffers       what the buffers will hold, without reading them      layout.h
//   edit_model_json    the document with all of that                         layout.h
//   write_glb          one file; write_gltf: several, which get their names together, the model
//                      last
//
// The plan is made before a job begins and the copy after it, from the same files, which stay open
// in between (open_input()). The target's images that stay are taken along only if they lie in its
// folder: a model must not carry files of this machine away under a harmless name.
//
// The target is read again for the copy, not kept since the plan: the job lies in between, and
// needs the memory for texels.
//
// Memory follows from the JSON alone (ModelPlan::least_bytes), whatever the size of the model: that
// is why buffers are lists of pieces, and why the images wait in a scratch file and not in memory.
#include "io/model/model_writer.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <memory>
#include <set>
#include <system_error>

#include "core/input_file.h"
#include "core/page_pool.h"
#include "core/posix_io.h"
#include "io/files/output_file.h"
#include "io/gltf/validate.h"
#include "io/model/layout.h"
#include "io/problems.h"
#include "io/read_mesh.h"
#include "pounce/error.h"

namespace pounce::io {
namespace {

namespace fs = std::filesystem;

constexpr std::uint32_t kGlbMagic = 0x46546C67;   // "glTF"
constexpr std::uint32_t kJsonChunk = 0x4E4F534A;  // "JSON"
constexpr std::uint32_t kBinChunk = 0x004E4942;   // "BIN\0"
constexpr std::uint64_t kCopyBytes = 1 << 20;
// nlohmann's tree: 16 bytes per value and about 100 per member; 8-12 bytes per byte of real files.
constexpr std::uint64_t kTreeBytesPerJsonByte = 20;
constexpr std::uint64_t kBytesPerEntry = 1200;
constexpr std::uint64_t kTextCopies = 6;

bool ends_with(const std::string& path, std::string_view ending) {
  if (path.size() <= ending.size()) return false;
  return std::equal(ending.rbegin(), ending.rend(), path.rbegin(), [](char e, char c) {
    return e == (c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c);
  });
}

/// A relative reference that leads from the model to a file in or below its folder.
// Only letters, digits and a few marks stay as they are: readers differ in what else they decode.
std::string uri_of(const std::string& path, const std::string& model) {
  const fs::path folder = fs::path(model).parent_path();
  const std::string relative =
      folder.empty() ? path : fs::path(path).lexically_relative(folder).string();
  std::string uri;
  for (const char c : relative) {
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                       std::string_view("-_.~/").find(c) != std::string_view::npos;
    uri += plain ? std::string(1, c) : fmt::format("%{:02X}", static_cast<unsigned char>(c));
  }
  return uri;
}

/// By the first bytes; "" when it is none that a GLB may hold.
std::string image_mime_type(const ReadFile& file) {
  // Names lie, and a GLB must state the type.
  std::string head(std::min<std::uint64_t>(file.size_bytes(), 12), '\0');
  file.read(0, std::as_writable_bytes(std::span(head)));
  if (head.starts_with("\x89PNG")) return "image/png";
  if (head.starts_with("\xFF\xD8\xFF")) return "image/jpeg";
  if (head.starts_with("RIFF") && head.ends_with("WEBP")) return "image/webp";
  if (head.starts_with("\xABKTX 20\xBB")) return "image/ktx2";
  return "";
}

/// Why a file cannot be taken along, "" if it can.
std::string why_unreadable(const std::string& path) {
  std::error_code error;
  const fs::file_type type = fs::status(path, error).type();
  if (type == fs::file_type::not_found) return "is missing";
  if (type != fs::file_type::none && type != fs::file_type::regular) return "is not a file";
  // By opening it: permissions alone do not say what a network file system will allow.
  const int file = open_for_reading(path);
  if (file >= 0) {
    ::close(file);
    return "";
  }
  // Another time there may be files to be had: that is no property of this one.
  if (errno == EMFILE || errno == ENFILE || errno == ENOMEM) return "";
  return fmt::format("cannot be read ({})", std::generic_category().message(errno));
}

/// A file that the target names beside its buffers: an image that stays.
struct StayingImage {
  std::size_t index = 0;
  std::string from;       ///< the file
  std::string to;         ///< of a .gltf, its copy
  std::string mime_type;  ///< of a .glb
};

/// Everything that is known before the new images are.
class ModelCopy {
 public:
  explicit ModelCopy(const ModelRequest& request)
      : request_(request),
        target_(request.target, request.allow_external),
        slots_(find_slots(target_.document(), request)),
        buffers_(target_, slots_, request.output) {
    find_images();
    if (!is_glb() && !target_.other_chunks().empty()) {
      warnings_.push_back(fmt::format(
          "{}: {} GLB chunks of unknown types are left out of a .gltf; write a .glb to keep them",
          request.target, target_.other_chunks().size()));
    }
  }

  ModelPlan plan() const {
    ModelPlan plan;
    plan.inputs = buffers_.inputs();
    plan.inputs.push_back(request_.target);
    if (!is_glb()) {
      for (const ModelTexture& texture : request_.textures) plan.outputs.push_back(texture.path);
      for (const ModelBuffer& buffer : buffers_.buffers()) {
        if (!buffer.path.empty()) plan.outputs.push_back(buffer.path);
      }
    }
    for (const StayingImage& image : images_) {
      plan.inputs.push_back(image.from);
      if (!is_glb()) plan.outputs.push_back(image.to);
    }
    plan.outputs.push_back(request_.output);
    plan.warnings = warnings_;
    // Of the JSON alone: images and buffers are streamed.
    plan.least_bytes = kTextCopies * target_.json_text_bytes() + 3 * target_.inline_bytes() +
                       kTreeBytesPerJsonByte * target_.json_bytes() +
                       kBytesPerEntry * gltf_entry_count(target_.document()) + kCopyBytes;
    return plan;
  }

  void write(const ReadFile& images, std::span<const EncodedImage> places) {
    std::vector<ModelPiece> pieces;
    // All new images are in one scratch file, in the order of the request's textures.
    for (const EncodedImage& place : places) {
      // Not owned: the caller keeps it open.
      pieces.push_back({std::shared_ptr<const ReadFile>(std::shared_ptr<void>(), &images), nullptr,
                        place.offset_bytes, place.size_bytes});
    }
    is_glb() ? write_glb(pieces) : write_gltf(pieces);
  }

 private:
  bool is_glb() const { return is_glb_path(request_.output); }

  void find_images();
  void write_glb(const std::vector<ModelPiece>& pieces);
  void write_gltf(const std::vector<ModelPiece>& pieces);
  std::string edited_json(const DocumentParts& parts) const;

  const ModelRequest& request_;
  GltfFile target_;
  ModelSlots slots_;
  ModelBuffers buffers_;
  std::vector<StayingImage> images_;
  std::vector<std::string> warnings_;
};

// Images that are not replaced go along, so that the output does not depend on the target's folder:
// into a .glb, or beside a .gltf under a name of its own. One that is missing or cannot be held is
// still named as before; the warning says so.
void ModelCopy::find_images() {
  const auto images = target_.document().find("images");
  if (images == target_.document().end()) return;
  std::set<std::size_t> replaced;
  for (const ModelSlots::Texture& slot : slots_.textures) replaced.insert(slot.image);
  const std::string stem = fs::path(request_.output).replace_extension().string();
  for (std::size_t i = 0; i < images->size(); ++i) {
    const auto uri = (*images)[i].find("uri");
    if (uri == (*images)[i].end() || replaced.contains(i)) continue;
    const auto& text = uri->get_ref<const std::string&>();
    if (GltfFile::is_data_uri(text)) continue;
    const std::string path = target_.resolve(text);
    if (path.empty()) continue;  // on the web
    if (const std::string why = why_unreadable(path); !why.empty()) {
      warnings_.push_back(fmt::format("{}: its image {} {}; {} still refers to it", request_.target,
                                      path, why, request_.output));
      continue;
    }
    // Refused, not left out: a copy without the image would look finished, and one with it would
    // give a file away that the user did not mean to pass on.
    if (!target_.may_read(path)) {
      refuse(request_.target, "its image {} {}, and {} would include it", path, kOutsideProblem,
             request_.output);
    }
    StayingImage image{i, path,
                       stem + fmt::format(".image{}", i) + fs::path(path).extension().string(), ""};
    if (is_glb()) {
      image.mime_type = image_mime_type(*open_input(path));
      if (image.mime_type.empty()) {
        warnings_.push_back(fmt::format(
            "{}: its image {} has a format that a .glb cannot contain; {} still refers to it",
            request_.target, path, request_.output));
        continue;
      }
    }
    images_.push_back(std::move(image));
  }
}

std::string ModelCopy::edited_json(const DocumentParts& parts) const {
  std::string json = edit_model_json(target_.json_text(), target_.document(), parts);
  // A chunk's padding is part of its bytes as they were read. The new chunk gets its own.
  while (!json.empty() && json.back() != '}') json.pop_back();  // padding of the old chunk
  return json;
}

// In pieces of 1 MiB, with a look at the disk after each: a full one ends the copy early.
void copy_piece(const ModelPiece& piece, OutputFile& out) {
  PageVector<std::byte> part(std::min(piece.size_bytes, kCopyBytes));
  for (std::uint64_t done = 0; done < piece.size_bytes;) {
    const std::size_t count = std::min<std::uint64_t>(part.size(), piece.size_bytes - done);
    const std::byte* from = part.data();
    if (piece.file != nullptr) {
      piece.file->read(piece.offset_bytes + done, std::span(part).first(count));
    } else if (piece.bytes != nullptr) {
      from = piece.bytes->data() + piece.offset_bytes + done;
    }
    std::fwrite(from, 1, count, out.stream());
    out.check();
    done += count;
  }
}

void copy_pieces(const std::vector<ModelPiece>& pieces, OutputFile& out) {
  for (const ModelPiece& piece : pieces) copy_piece(piece, out);
}

/// A GLB is little-endian, and so is every machine that this is built for.
void put(OutputFile& out, std::uint64_t word) {
  // The caller has compared the sum of all lengths with 32 bits.
  const auto narrow = static_cast<std::uint32_t>(word);
  std::fwrite(&narrow, sizeof narrow, 1, out.stream());
}

// Where images will be has to be known before the JSON is, and its length before the first byte is
// written: everything is laid out, then written once from front to back.
void ModelCopy::write_glb(const std::vector<ModelPiece>& pieces) {
  // First all places, then the text that names them, then the bytes. No step reads back what it
  // wrote.
  DocumentParts parts{request_, slots_, buffers_, {}, {}, {}, {}};
  for (const ModelPiece& piece : pieces) parts.image_places.push_back(buffers_.append(piece));
  for (const StayingImage& image : images_) {
    std::shared_ptr<ReadFile> file = open_input(image.from);
    const std::uint64_t size = file->size_bytes();
    parts.moved_images[image.index] = {"", image.mime_type,
                                       buffers_.append({std::move(file), nullptr, 0, size})};
  }
  // Chunks of a GLB begin at multiples of four; the JSON is padded with blanks, all else by zeros.
  buffers_.buffers().front().align(4);
  parts.buffer_uris.resize(buffers_.buffers().size());
  std::string json = edited_json(parts);
  while (json.size() % 4 != 0) json += ' ';

  const ModelBuffer& bin = buffers_.buffers().front();
  std::uint64_t total = 12 + 8 + json.size() + 8 + bin.size_bytes;
  for (const GlbChunk& chunk : target_.other_chunks()) total += 8 + (chunk.size_bytes + 3) / 4 * 4;
  if (total > std::numeric_limits<std::uint32_t>::max()) {
    throw Error(ErrorKind::usage,
                fmt::format("{}: {} bytes exceed the limit of a .glb (4 GiB); write a .gltf",
                            request_.output, total));
  }
  OutputFile out(request_.output);
  for (const std::uint64_t word : {std::uint64_t{kGlbMagic}, std::uint64_t{2}, total,
                                   std::uint64_t{json.size()}, std::uint64_t{kJsonChunk}}) {
    put(out, word);
  }
  std::fwrite(json.data(), 1, json.size(), out.stream());
  put(out, bin.size_bytes);
  put(out, kBinChunk);
  copy_pieces(bin.pieces, out);
  for (const GlbChunk& chunk : target_.other_chunks()) {
    const std::uint64_t padding = (4 - chunk.size_bytes % 4) % 4;
    put(out, chunk.size_bytes + padding);
    put(out, chunk.type);
    copy_piece({open_input(request_.target), nullptr, chunk.offset_bytes, chunk.size_bytes}, out);
    copy_piece({nullptr, nullptr, 0, padding}, out);
  }
  out.check();
  out.commit();
}

/// Gives all files their names. If that ends early, those that are new go again.
void commit_all(std::vector<std::unique_ptr<OutputFile>>& files,
                const std::vector<std::string>& paths) {
  std::vector<std::string> fresh;
  try {
    for (std::size_t i = 0; i < files.size(); ++i) {
      // Only names that were not taken before: an output that was replaced is the new file already,
      // and removing it would leave neither.
      std::error_code ignored;
      if (!fs::exists(paths[i], ignored)) fresh.push_back(paths[i]);
      files[i]->commit();
      files[i].reset();
    }
  } catch (...) {
    for (const std::string& path : fresh) {
      std::error_code ignored;
      fs::remove(path, ignored);
    }
    throw;
  }
}

// Images, then buffers, then the model: who opens a new .gltf while names are given finds what it
// names.
void ModelCopy::write_gltf(const std::vector<ModelPiece>& pieces) {
  DocumentParts parts{request_, slots_, buffers_, {}, {}, {}, {}};
  std::vector<std::string> paths;
  std::vector<std::unique_ptr<OutputFile>> files;
  // Nothing has a name before everything is written: a full disk leaves no file.
  const auto begin = [&](const std::string& path) -> OutputFile& {
    paths.push_back(path);
    return *files.emplace_back(std::make_unique<OutputFile>(path));
  };
  for (std::size_t k = 0; k < pieces.size(); ++k) {
    const std::string& path = request_.textures[k].path;
    copy_piece(pieces[k], begin(path));
    parts.image_uris.push_back(uri_of(path, request_.output));
  }
  for (const ModelBuffer& buffer : buffers_.buffers()) {
    parts.buffer_uris.push_back(buffer.path.empty() ? "" : uri_of(buffer.path, request_.output));
    if (!buffer.path.empty()) copy_pieces(buffer.pieces, begin(buffer.path));
  }
  for (const StayingImage& image : images_) {
    std::shared_ptr<ReadFile> file = open_input(image.from);
    const std::uint64_t size = file->size_bytes();
    copy_piece({std::move(file), nullptr, 0, size}, begin(image.to));
    parts.moved_images[image.index] = {uri_of(image.to, request_.output), "", {}};
  }
  // The document last: only now is it known under which names everything else is.
  const std::string json = edited_json(parts);
  OutputFile& out = begin(request_.output);
  std::fwrite(json.data(), 1, json.size(), out.stream());
  std::fputc('\n', out.stream());
  for (const auto& file : files) {
    // A full disk shows here at the latest, before any file has its name.
    std::fflush(file->stream());
    file->check();
  }
  commit_all(files, paths);
}

}  // namespace

bool is_glb_path(const std::string& path) { return ends_with(path, ".glb"); }
bool is_model_path(const std::string& path) {
  return is_glb_path(path) || ends_with(path, ".gltf");
}

ModelPlan plan_model(const ModelRequest& request) {
  if (!is_gltf(request.target)) {
    throw Error(
        ErrorKind::usage,
        fmt::format(
            "{}: a model can only be written from a .glb or .gltf target, but {} is neither; write "
            "images (such as 'NAME.<MATERIAL>.<CHANNEL>.png') or convert the target",
            request.output, request.target));
  }
  return ModelCopy(request).plan();
}

void write_model(const ModelRequest& request, const ReadFile& images,
                 std::span<const EncodedImage> places) {
  ModelCopy(request).write(images, places);
}

}  // namespace pounce::io
