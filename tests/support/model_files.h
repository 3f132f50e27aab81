// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <cstring>
#include <fstream>
#include <iterator>
#include <memory>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/file.h"
#include "io/model/model_writer.h"
#include "support/memory_file_system.h"

namespace pounce::test {

inline std::string file_bytes(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw std::runtime_error("cannot read " + path);
  return {std::istreambuf_iterator<char>(file), {}};
}

/// A GLB taken apart by hand, every length checked.
struct Glb {
  std::string text, bin;
  std::vector<std::pair<std::uint32_t, std::string>> others;
  nlohmann::ordered_json doc;

  explicit Glb(const std::string& path) {
    const std::string all = file_bytes(path);
    const auto u32 = [&](std::size_t at) {
      std::uint32_t word = 0;
      if (at + 4 > all.size()) throw std::runtime_error("a GLB that ends early");
      std::memcpy(&word, all.data() + at, 4);
      return word;
    };
    if (all.substr(0, 4) != "glTF" || u32(4) != 2 || u32(8) != all.size())
      throw std::runtime_error("not a GLB header");
    for (std::size_t at = 12; at < all.size();) {
      const std::size_t size = u32(at);
      if (size % 4 != 0 || at % 4 != 0 || at + 8 + size > all.size())
        throw std::runtime_error("a GLB chunk of a wrong length");
      const std::uint32_t type = u32(at + 4);
      const std::string part = all.substr(at + 8, size);
      if (type == 0x4E4F534A)
        text = part;
      else if (type == 0x004E4942)
        bin = part;
      else
        others.emplace_back(type, part);
      at += 8 + size;
    }
    doc = nlohmann::ordered_json::parse(text);
  }
  /// The bytes of a buffer view in the BIN chunk.
  std::string view(std::size_t index) const {
    const auto& v = doc.at("bufferViews").at(index);
    if (v.at("buffer") != 0) throw std::runtime_error("a view outside of the BIN chunk");
    const std::size_t offset = v.value("byteOffset", std::size_t{0});
    const std::size_t size = v.at("byteLength");
    if (offset + size > doc.at("buffers").at(0).at("byteLength"))
      throw std::runtime_error("beyond the buffer");
    return bin.substr(offset, size);
  }
  std::string image(std::size_t index) const {
    return view(doc.at("images").at(index).at("bufferView"));
  }
  /// The image behind a textureInfo.
  std::string shown(const nlohmann::ordered_json& info) const {
    return image(doc.at("textures").at(info.at("index").get<std::size_t>()).at("source"));
  }
};

/// Stand-ins for encoded images, one for each texture of a request.
class FakeImages {
 public:
  explicit FakeImages(const std::vector<std::string>& images)
      : files_(test::make_memory_file_system()), file_(files_->create_scratch(".")) {
    for (const std::string& image : images) {
      places_.push_back({file_->size_bytes(), image.size()});
      file_->append(std::as_bytes(std::span(image)));
    }
    reader_ = file_->reader();
  }
  void write(const io::ModelRequest& request) const { io::write_model(request, *reader_, places_); }

 private:
  std::unique_ptr<FileSystem> files_;
  std::unique_ptr<WriteFile> file_;
  std::unique_ptr<ReadFile> reader_;
  std::vector<io::EncodedImage> places_;
};

}  // namespace pounce::test
