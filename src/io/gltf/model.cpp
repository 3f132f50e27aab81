// SPDX-License-Identifier: Apache-2.0
#include "io/gltf/model.h"

#include <fmt/format.h>

#include <limits>
#include <new>

#include "pounce/error.h"

namespace pounce::io {
namespace {

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

tinygltf::Model load_model(const GltfFile& file) {
  nlohmann::json part;
  for (const char* key : {"asset", "scene", "scenes", "nodes", "meshes", "accessors", "bufferViews",
                          "materials", "textures", "samplers", "skins"}) {
    if (const auto it = file.document().find(key); it != file.document().end()) part[key] = *it;
  }
  drop_extras(part);
  // tinygltf wants indices to have a buffer view; glTF means zeros where they have none.
  if (const auto meshes = part.find("meshes"); meshes != part.end()) {
    for (auto& mesh : *meshes) {
      for (auto& primitive : mesh.at("primitives")) primitive.erase("indices");
    }
  }
  const std::string text = part.dump();
  part = nullptr;
  const auto fail = [&](const std::string& what) {
    throw Error(ErrorKind::input, fmt::format("{}: {}; export the model again", file.path(), what));
  };
  if (text.size() > std::numeric_limits<unsigned>::max()) fail("more than 4 GB of JSON");
  tinygltf::Model model;
  tinygltf::TinyGLTF loader;
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
    fail(fmt::format("cannot be understood ({})", error));
  }
  if (!is_complete(file.document(), model)) fail("holds entries that cannot be understood");
  for (std::size_t m = 0; m < model.meshes.size(); ++m) {
    const auto& primitives = file.document().at("meshes").at(m).at("primitives");
    for (std::size_t p = 0; p < primitives.size(); ++p)
      model.meshes[m].primitives[p].indices = primitives[p].value("indices", -1);
  }
  return model;
}

}  // namespace pounce::io
