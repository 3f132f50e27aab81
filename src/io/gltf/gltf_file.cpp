// SPDX-License-Identifier: Apache-2.0
//
// Opening a glTF: chunks, JSON, buffers, and the document with types.
//
// tinygltf gives a document its types, but it trusts what it reads, keeps every buffer in memory
// twice and drops without a word what it does not like. So a file is opened here by four steps of
// our own, and tinygltf comes last:
//
//   find_chunks   where JSON and BIN lie in a .glb; sizes against the file's
//   json_size     depth and counts, before anything recurses or allocates by them
//   check_gltf    types, ranges, indices, the node graph; behind it the document is trusted
//   load_model    tinygltf sees a copy without buffers, images, extras and indices, and what it
//                 made of that is compared with the document, entry by entry
//
// A .glb is 12 bytes ("glTF", version 2, length) and chunks of (bytes, type, data): first the JSON,
// then at most one BIN, which is buffer 0 if that has no uri. Anything else is JSON with its
// buffers in other files or in data URIs.
//
// Buffers are opened, not read: geometry and images are read piece by piece when they are asked
// for. A buffer that is missing, outside of the model's folder or too short has a `problem` and no
// bytes; only who needs it is refused. Data URIs are the exception: they are decoded when the file
// is opened, and their text leaves the tree.
//
// Two trees exist for a while, the document's and the one that tinygltf parses; gltf_cost() counts
// both. The document stays, since images, extensions and a model output need what tinygltf drops.
#include "io/gltf/gltf_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <filesystem>
#include <limits>
#include <new>
#include <stdexcept>

#include "core/input_file.h"
#include "io/gltf/validate.h"
#include "io/problems.h"

namespace pounce::io {
namespace {

constexpr std::uint32_t kGlbMagic = 0x46546C67;   // "glTF"
constexpr std::uint32_t kJsonChunk = 0x4E4F534A;  // "JSON"
constexpr std::uint32_t kBinChunk = 0x004E4942;   // "BIN\0"
constexpr int kMaxJsonDepth = 64;                 // real files nest less than 20 deep
constexpr std::size_t kMaxOtherChunks = 1000;

std::uint32_t read_u32(const ReadFile& file, std::uint64_t offset) {
  std::array<std::byte, 4> raw{};
  file.read(offset, raw);
  std::uint32_t value = 0;
  std::memcpy(&value, raw.data(), 4);
  return value;
}

std::string read_text(const ReadFile& file, std::uint64_t offset, std::uint64_t size) {
  std::string text(size, '\0');
  file.read(offset, std::as_writable_bytes(std::span(text)));
  return text;
}

int hex_digit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

/// A broken sequence, or one that stands for a zero byte, stays as it is: it may be part of a name.
std::string percent_decoded(const std::string& uri) {
  std::string out;
  out.reserve(uri.size());
  for (std::size_t i = 0; i < uri.size(); ++i) {
    const int hi = uri[i] == '%' && i + 2 < uri.size() ? hex_digit(uri[i + 1]) : -1;
    const int lo = hi >= 0 ? hex_digit(uri[i + 2]) : -1;
    if (lo >= 0 && hi * 16 + lo != 0) {
      out.push_back(static_cast<char>(hi * 16 + lo));
      i += 2;
    } else {
      out.push_back(uri[i]);
    }
  }
  return out;
}

std::array<std::int8_t, 256> make_base64_table() {
  std::array<std::int8_t, 256> table{};
  table.fill(-1);
  const std::string_view letters =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  for (std::size_t i = 0; i < letters.size(); ++i) {
    table[static_cast<unsigned char>(letters[i])] = static_cast<std::int8_t>(i);
  }
  return table;
}

/// Without padding too; any other character is an error, white space as well. The text is in memory
/// once (in the tree) and the bytes beside it: gltf_cost() counts three times the bytes for both.
std::vector<std::byte> decode_base64(std::string_view text) {
  static const std::array<std::int8_t, 256> table = make_base64_table();
  while (!text.empty() && text.back() == '=') text.remove_suffix(1);
  if (text.size() % 4 == 1) throw std::invalid_argument("base64 text of invalid length");
  std::vector<std::byte> bytes;
  bytes.reserve(text.size() / 4 * 3 + 2);
  std::uint32_t bits = 0;
  int bit_count = 0;
  for (const char c : text) {
    const int value = table[static_cast<unsigned char>(c)];
    if (value < 0) throw std::invalid_argument("a character that is not valid in base64");
    bits = ((bits << 6) | static_cast<std::uint32_t>(value)) & 0xFFFFFF;
    bit_count += 6;
    if (bit_count >= 8) {
      bit_count -= 8;
      bytes.push_back(static_cast<std::byte>((bits >> bit_count) & 0xFF));
    }
  }
  return bytes;
}

/// Surely there; what cannot be looked at is not.
bool is_there(const std::string& path) {
  std::error_code ignored;
  return std::filesystem::exists(path, ignored);
}

/// Surely not there; opening what cannot be looked at says why.
bool is_missing(const std::string& path) {
  std::error_code ignored;
  return std::filesystem::status(path, ignored).type() == std::filesystem::file_type::not_found;
}

/// A problem may be that of any number of images.
std::string shown_uri(const std::string& uri) {
  constexpr std::size_t kMost = 200;
  return uri.size() <= kMost ? uri : uri.substr(0, kMost) + "...";
}

/// Recursive, which the limit of depth allows.
void drop_extras(nlohmann::json& value) {
  if (value.is_object()) value.erase("extras");
  for (auto& item : value) {
    if (item.is_structured()) drop_extras(item);
  }
}

/// tinygltf drops what it does not like without a word; indices would then mean something else.
bool is_complete(const nlohmann::json& document, const tinygltf::Model& model) {
  const auto same = [&](const char* key, std::size_t count) {
    const auto it = document.find(key);
    return (it == document.end() ? 0 : it->size()) == count;
  };
  if (!same("nodes", model.nodes.size()) || !same("meshes", model.meshes.size()) ||
      !same("accessors", model.accessors.size()) ||
      !same("bufferViews", model.bufferViews.size()) ||
      !same("materials", model.materials.size()) || !same("textures", model.textures.size()) ||
      !same("samplers", model.samplers.size()) || !same("skins", model.skins.size()) ||
      !same("scenes", model.scenes.size())) {
    return false;
  }
  for (std::size_t i = 0; i < model.meshes.size(); ++i) {
    const auto& wanted = document.at("meshes").at(i).at("primitives");
    const auto& found = model.meshes[i].primitives;
    if (wanted.size() != found.size()) return false;
    for (std::size_t p = 0; p < found.size(); ++p) {
      const auto targets = wanted[p].find("targets");
      if ((targets == wanted[p].end() ? 0 : targets->size()) != found[p].targets.size())
        return false;
    }
  }
  return true;
}

}  // namespace

DataUri decode_data_uri(std::string_view uri) {
  const std::size_t comma = uri.find(',');
  if (comma == std::string_view::npos) throw std::invalid_argument("a data URI without a comma");
  std::string_view head = uri.substr(5, comma - 5);
  constexpr std::string_view kBase64 = ";base64";
  if (!head.ends_with(kBase64)) throw std::invalid_argument("a data URI that is not base64");
  head.remove_suffix(kBase64.size());
  return {std::string(head.substr(0, head.find(';'))), decode_base64(uri.substr(comma + 1))};
}

JsonSize gltf_json_size(const std::string& path) {
  const auto file = open_input(path);
  const std::uint64_t size = file->size_bytes();
  if (size < 20 || read_u32(*file, 0) != kGlbMagic) return json_size(*file, 0, size);
  return json_size(*file, 20, std::min<std::uint64_t>(read_u32(*file, 12), size - 20));
}

bool GltfFile::is_data_uri(std::string_view uri) { return uri.starts_with("data:"); }

std::string GltfFile::resolve(const std::string& uri) const {
  // pounce opens no connections: what is on the web counts as not there.
  const std::size_t scheme = uri.find("://");
  if (scheme != std::string::npos || uri.empty()) return {};
  const std::filesystem::path folder = std::filesystem::path(path_).parent_path();
  const std::string decoded = (folder / percent_decoded(uri)).string();
  // Some writers forget to encode a '%' that belongs to the name.
  if (const std::string raw = (folder / uri).string();
      raw != decoded && is_missing(decoded) && is_there(raw)) {
    return raw;
  }
  return decoded;
}

// Each step is done only when the one before found nothing wrong, and each costs more than the one
// before: chunks, scan, parse, checks, buffers.
GltfFile::GltfFile(const std::string& path, bool allow_external)
    : path_(path), folder_(path, allow_external) {
  const std::shared_ptr<ReadFile> file = open_input(path);
  find_chunks(*file);
  // tinygltf and nlohmann's writer recurse, and the parser's own callback for this is quadratic.
  const JsonSize size = json_size(*file, json_offset_, json_text_bytes_);
  if (size.depth > kMaxJsonDepth) {
    refuse(path_, "JSON nested deeper than {} levels; this is not a usable glTF file",
           kMaxJsonDepth);
  }
  long_string_bytes_ = size.long_bytes;
  parse(read_text(*file, json_offset_, json_text_bytes_));
  // From here on the document is trusted.
  warnings_ = check_gltf(path_, document_);
  if (const auto it = document_.find("buffers"); it != document_.end()) {
    buffers_.resize(it->size());
    for (std::size_t i = 0; i < it->size(); ++i) open_buffer(i, (*it)[i]);
  }
  measure_packed();
  if (const auto it = document_.find("images"); it != document_.end()) {
    for (const auto& image : *it) {
      const auto uri = image.find("uri");
      if (uri == image.end() || !is_data_uri(uri->get_ref<const std::string&>())) continue;
      image_text_bytes_ += uri->get_ref<const std::string&>().size();
    }
    // Images stay in the tree as text until materials are read; mesh_cost() counts them apart.
    json_bytes_ -= image_text_bytes_;
  }
}

// The length in the header counts, not the file's: bytes behind it belong to whatever the GLB was
// put into. Chunks of unknown meaning are remembered, since a copy of the model keeps them.
void GltfFile::find_chunks(const ReadFile& file) {
  const std::uint64_t file_bytes = file.size_bytes();
  const auto fail = [&](const std::string& what) {
    refuse(path_, "{}; the file is damaged, export it again", what);
  };
  // What is no GLB is taken for JSON, whatever its ending.
  if (file_bytes < 4 || read_u32(file, 0) != kGlbMagic) {
    json_text_bytes_ = file_bytes;
    return;
  }

  if (file_bytes < 20) fail("the GLB header is truncated");
  if (const std::uint32_t version = read_u32(file, 4); version != 2) {
    refuse(path_, "GLB version {}, but only version 2 is supported; export the model as glTF 2.0",
           version);
  }
  const std::uint64_t length = read_u32(file, 8);
  if (length > file_bytes) {
    fail(fmt::format("the GLB header states {} bytes, but the file has {}", length, file_bytes));
  }
  std::uint64_t offset = 12;
  // Every step is held against the length before it is taken, so the loop cannot leave the file.
  for (std::size_t chunk = 0; offset < length; ++chunk) {
    if (length - offset < 8) fail(fmt::format("the header of GLB chunk {} is truncated", chunk));
    const std::uint64_t chunk_bytes = read_u32(file, offset);
    const std::uint32_t type = read_u32(file, offset + 4);
    offset += 8;
    if (chunk_bytes > length - offset) fail(fmt::format("GLB chunk {} is truncated", chunk));
    if ((chunk == 0) != (type == kJsonChunk))
      fail("the first GLB chunk, and only it, must be JSON");
    if (chunk == 0) {
      json_offset_ = offset;
      json_text_bytes_ = chunk_bytes;
    } else if (type != kBinChunk) {
      if (other_chunks_.size() == kMaxOtherChunks) {
        fail(fmt::format("more than {} GLB chunks of unknown types", kMaxOtherChunks));
      }
      other_chunks_.push_back({type, offset, chunk_bytes});
    }
    if (type == kBinChunk) {
      if (has_bin_chunk_) fail("two BIN chunks");
      has_bin_chunk_ = true;
      bin_offset_ = offset;
      bin_bytes_ = chunk_bytes;
    }
    offset += chunk_bytes;
  }
}

// Read again rather than kept: only a model output needs it, and it would be in memory all the time
// beside the tree.
std::string GltfFile::json_text() const {
  std::string text = read_text(*open_input(path_), json_offset_, json_text_bytes_);
  constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
  if (text.starts_with(kByteOrderMark)) text.erase(0, kByteOrderMark.size());
  return text;
}

void GltfFile::parse(const std::string& text) {
  try {
    document_ = nlohmann::json::parse(text);
  } catch (const nlohmann::json::exception& e) {
    refuse(path_, "invalid JSON ({}); the file is damaged, export it again", e.what());
  }
  json_bytes_ = text.size();
}

// Three kinds: the BIN chunk, a data URI, a file. Whatever is wrong ends in `problem`, in the words
// that read_view() and messages about images put the file's name in front of.
void GltfFile::open_buffer(std::size_t index, nlohmann::json& buffer) {
  GltfBuffer& out = buffers_[index];
  out.size_bytes = buffer.at("byteLength").get<std::uint64_t>();
  std::uint64_t available = 0;
  if (const auto uri_it = buffer.find("uri"); uri_it == buffer.end()) {
    if (index != 0 || !has_bin_chunk_) {
      out.problem = "has neither a uri nor a BIN chunk";
      return;
    }
    out.path = path_;
    out.offset_bytes = bin_offset_;
    available = bin_bytes_;
  } else if (const auto& uri = uri_it->get_ref<std::string&>(); is_data_uri(uri)) {
    try {
      out.bytes = std::make_shared<const std::vector<std::byte>>(decode_data_uri(uri).bytes);
    } catch (const std::invalid_argument& e) {
      out.problem = fmt::format("has {}", e.what());
      return;
    }
    available = out.bytes->size();
    inline_bytes_ += available;
    json_bytes_ -= uri.size();
    uri_it->get_ref<std::string&>() = "data:";  // the text is not needed again
  } else {
    out.path = resolve(uri);
    if (out.path.empty() || is_missing(out.path)) {
      out.problem = fmt::format("is the file \"{}\", which is missing", shown_uri(uri));
      return;
    }
    if (!may_read(out.path)) {
      out.problem = fmt::format("is the file \"{}\", which {}", shown_uri(uri), kOutsideProblem);
      return;
    }
  }
  if (!out.path.empty()) {
    try {
      out.file = open_input(out.path);
    } catch (const Error& e) {
      out.problem = fmt::format("cannot be read ({})", e.what());
      out.refused = e.kind() == ErrorKind::storage;
      return;
    }
    if (out.path != path_) available = out.file->size_bytes();
  }
  if (out.size_bytes > available) {
    out.problem = fmt::format("should have {} bytes, but has {}", out.size_bytes, available);
  }
}

bool GltfFile::requires_extension(std::string_view name) const {
  const auto required = document_.find("extensionsRequired");
  if (required == document_.end()) return false;
  return std::any_of(required->begin(), required->end(),
                     [&](const nlohmann::json& item) { return item == name; });
}

void GltfFile::read_view(std::size_t view, std::uint64_t offset, std::span<std::byte> out) const {
  const nlohmann::json& json = document_.at("bufferViews").at(view);
  if (const auto packed = meshopt_view(json)) {
    const std::span<const std::byte> bytes = unpacked(view, *packed);
    // Within it for sure: a packed view has the size that its accessors were compared with.
    if (!out.empty()) std::memcpy(out.data(), bytes.data() + offset, out.size());
    return;
  }
  read_buffer(json.at("buffer").get<std::size_t>(),
              json.value("byteOffset", std::uint64_t{0}) + offset, out);
}

// Within the buffer for sure: check_gltf() has compared the view with the stated length,
// open_buffer() that length with the file.
void GltfFile::read_buffer(std::size_t index, std::uint64_t start, std::span<std::byte> out) const {
  const GltfBuffer& buffer = buffers_.at(index);
  // What the system refuses (permissions, descriptors) is an error of storage: the file may be
  // fine.
  if (buffer.refused) {
    throw Error(ErrorKind::storage, fmt::format("{}: buffer {} {}", path_, index, buffer.problem));
  }
  if (!buffer.problem.empty()) {
    refuse(path_, "buffer {} {}; restore the missing data or export the model again", index,
           buffer.problem);
  }
  if (buffer.bytes != nullptr) {
    if (!out.empty()) std::memcpy(out.data(), buffer.bytes->data() + start, out.size());
  } else {
    buffer.file->read(buffer.offset_bytes + start, out);
  }
}

std::uint64_t GltfFile::total_buffer_bytes() const {
  std::uint64_t total = 0;
  for (const GltfBuffer& buffer : buffers_) {
    if (buffer.problem.empty()) total += buffer.size_bytes;
  }
  return total;
}

tinygltf::Model load_model(const GltfFile& file) {
  // Without "buffers", so tinygltf loads none; nothing here asks it for bytes. Views keep their
  // indices into the document's list.
  nlohmann::json part;
  for (const char* key : {"asset", "scene", "scenes", "nodes", "meshes", "accessors", "bufferViews",
                          "materials", "textures", "samplers", "skins"}) {
    if (const auto it = file.document().find(key); it != file.document().end()) part[key] = *it;
  }
  // They may be of any size and depth, and tinygltf copies them into every object.
  drop_extras(part);
  // tinygltf wants indices to have a buffer view; glTF means zeros where they have none.
  if (const auto meshes = part.find("meshes"); meshes != part.end()) {
    for (auto& mesh : *meshes) {
      for (auto& primitive : mesh.at("primitives")) primitive.erase("indices");
    }
  }
  const std::string text = part.dump();
  // The tree goes before the text is parsed again: one of them is enough at a time.
  part = nullptr;
  const auto fail = [&](const std::string& what) {
    refuse(file.path(), "{}; export the model again", what);
  };
  if (text.size() > std::numeric_limits<unsigned>::max()) fail("more than 4 GB of JSON");
  tinygltf::Model model;
  tinygltf::TinyGLTF loader;
  // There are no images in the document; the loader is set so that tinygltf never opens a file.
  loader.SetImageLoader([](tinygltf::Image*, const int, std::string*, std::string*, int, int,
                           const unsigned char*, int, void*) { return true; },
                        nullptr);
  std::string error, warning;
  bool loaded = false;
  try {
    loaded = loader.LoadASCIIFromString(&model, &error, &warning, text.data(),
                                        static_cast<unsigned>(text.size()), "");
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception& e) {
    error = e.what();
  }
  if (!loaded) {
    // tinygltf tells what its parser threw, but not that it was no fault of the file.
    if (error.find(std::bad_alloc().what()) != std::string::npos) throw std::bad_alloc();
    while (!error.empty() && (error.back() == '\n' || error.back() == ' ')) error.pop_back();
    fail(fmt::format("cannot be parsed ({})", error));
  }
  if (!is_complete(file.document(), model)) fail("has entries that cannot be parsed");
  // Back to what the document says of indices, which it was checked for.
  for (std::size_t m = 0; m < model.meshes.size(); ++m) {
    const auto& primitives = file.document().at("meshes").at(m).at("primitives");
    for (std::size_t p = 0; p < primitives.size(); ++p)
      model.meshes[m].primitives[p].indices = primitives[p].value("indices", -1);
  }
  return model;
}

}  // namespace pounce::io
