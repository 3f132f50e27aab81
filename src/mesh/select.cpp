// SPDX-License-Identifier: Apache-2.0
//
// Names are typed by people and made by programs, so a pattern that finds nothing is more often a
// mistake than a wish: it is refused, or warned of where another pattern does find something, with
// the names that there are and the nearest one. A name may have any characters, "[" too, hence a
// pattern matches the name that it equals, whatever it means as a pattern.
#include "mesh/select.h"

#include <fmt/format.h>
#include <fnmatch.h>

#include <algorithm>
#include <numeric>

#include "pounce/error.h"

namespace pounce::mesh {
namespace {

constexpr std::size_t kListedNames = 10;
constexpr std::size_t kMostTypos = 2;
constexpr std::size_t kLongestCompared = 64;  // characters; beyond, two names are never "near"

std::string lower(std::string text) {
  for (char& c : text) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  return text;
}

/// How many characters must be changed, added or left out to get from a to b.
std::size_t typos(const std::string& a, const std::string& b) {
  // Levenshtein's table, of which only the last row is kept.
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = row[0]++;
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({replaced, row[j] + 1, row[j + 1] + 1});
    }
  }
  return row.back();
}

/// Was that name meant? In another case, a part of it, or mistyped.
bool is_near(const std::string& pattern, const std::string& name) {
  const std::string a = lower(pattern), b = lower(name);
  if (matches(a, b) || matches("*" + a + "*", b)) return true;
  return std::max(a.size(), b.size()) <= kLongestCompared && typos(a, b) <= kMostTypos;
}

/// "a", "b" and 3 more.
std::string listed(const std::vector<std::string>& names) {
  std::string text;
  for (std::size_t i = 0; i < std::min(names.size(), kListedNames); ++i) {
    text += fmt::format("{}\"{}\"", i == 0 ? "" : ", ", names[i]);
  }
  if (names.size() > kListedNames) text += fmt::format(" and {} more", names.size() - kListedNames);
  return text;
}

/// One filter of a selection: the names it looks at, and which of them its patterns take.
class Filter {
 public:
  Filter(const std::vector<std::string>& patterns, std::vector<std::string> names,
         std::string option)
      : patterns_(patterns), names_(std::move(names)), option_(std::move(option)) {}

  /// By name: is it taken? Adds a warning for each pattern that takes none.
  std::vector<bool> apply(Mesh& mesh) const {
    std::vector<bool> taken(names_.size(), patterns_.empty());
    std::vector<std::string> idle;
    for (const std::string& pattern : patterns_) {
      bool any = false;
      for (std::size_t i = 0; i < names_.size(); ++i) {
        if (!matches(pattern, names_[i])) continue;
        taken[i] = any = true;
      }
      if (!any) idle.push_back(pattern);
    }
    // One of several may be for other files of a batch; all of them hardly.
    if (!patterns_.empty() && idle.size() == patterns_.size()) refuse(mesh);
    for (const std::string& pattern : idle) {
      mesh.warnings.push_back(fmt::format("{}: {} {}: matches nothing; available are {}", mesh.path,
                                          option_, pattern, listed(names_)));
    }
    return taken;
  }

 private:
  [[noreturn]] void refuse(const Mesh& mesh) const {
    std::string near;
    for (const std::string& name : names_) {
      if (std::any_of(patterns_.begin(), patterns_.end(),
                      [&](const std::string& pattern) { return is_near(pattern, name); })) {
        near = fmt::format("; did you mean \"{}\"?", name);
        break;
      }
    }
    std::string wanted;
    for (const std::string& pattern : patterns_) wanted += " " + pattern;
    throw Error(ErrorKind::input, fmt::format("{}: {}{}: matches nothing; available are {}{}",
                                              mesh.path, option_, wanted, listed(names_), near));
  }

  const std::vector<std::string>& patterns_;
  std::vector<std::string> names_;
  std::string option_;
};

std::vector<std::string> used_material_names(const Mesh& mesh, std::vector<std::size_t>& index) {
  std::vector<bool> used(mesh.materials.size());
  for (const std::uint32_t m : mesh.triangle_material) used[m] = true;
  std::vector<std::string> names;
  index.assign(mesh.materials.size(), 0);
  for (std::size_t m = 0; m < used.size(); ++m) {
    if (!used[m]) continue;
    index[m] = names.size();
    names.push_back(mesh.materials[m].name);
  }
  return names;
}

/// By part: is it taken?
std::vector<bool> taken_parts(const Parts& parts, const std::vector<bool>& taken_names,
                              bool everything) {
  std::vector<bool> taken(parts.part_names.size(), everything);
  for (std::size_t p = 0; p < taken.size(); ++p) {
    for (const std::uint32_t name : parts.part_names[p]) taken[p] = taken[p] || taken_names[name];
  }
  return taken;
}

}  // namespace

bool matches(const std::string& pattern, const std::string& name) {
  return pattern == name || fnmatch(pattern.c_str(), name.c_str(), 0) == 0;
}

void select(Mesh& mesh, const Selection& selection, const std::string& side, bool keep_rest) {
  if (selection.everything()) return;
  std::vector<std::size_t> material_index;
  const std::vector<std::string> material_names = used_material_names(mesh, material_index);
  // Both filters are asked before anything changes: a pattern that finds nothing leaves the mesh
  // whole.
  const std::vector<bool> materials =
      Filter(selection.materials, material_names, "--" + side + "-material").apply(mesh);
  const std::vector<bool> names =
      Filter(selection.meshes, mesh.parts.names, "--" + side + "-mesh").apply(mesh);
  const std::vector<bool> parts = taken_parts(mesh.parts, names, selection.meshes.empty());

  // Triangles move to the front in place: a mesh may be most of what the memory holds.
  Parts left;
  std::uint32_t kept = 0;
  const std::size_t count = mesh.triangles.size();
  // Runs are in the order of triangles, so one walk serves both, and what is left of a run is a run
  // again.
  for (std::size_t r = 0, t = 0; t < count; ++r) {
    // A mesh made without a file has no runs: one part without a name.
    const bool named = r < mesh.parts.runs.size();
    const std::uint32_t part = named ? mesh.parts.runs[r].part : 0;
    const std::size_t end =
        r + 1 < mesh.parts.runs.size() ? mesh.parts.runs[r + 1].first_triangle : count;
    const std::uint32_t before = kept;
    for (; t < end; ++t) {
      const std::uint32_t material = mesh.triangle_material[t];
      if ((named && !parts[part]) || !materials[material_index[material]]) {
        if (keep_rest) {
          mesh.rest.push_back(mesh.triangles[t]);
          mesh.rest_material.push_back(material);
        }
        continue;
      }
      mesh.triangles[kept] = mesh.triangles[t];
      mesh.triangle_material[kept++] = mesh.triangle_material[t];
    }
    if (named && kept > before) left.runs.push_back({before, part});
  }
  if (kept == 0) {
    throw Error(ErrorKind::input, fmt::format("{}: no triangle is in both --{}-mesh and "
                                              "--{}-material; the meshes are {}, the materials {}",
                                              mesh.path, side, side, listed(mesh.parts.names),
                                              listed(material_names)));
  }
  // The rest of the job leases what the mesh takes now.
  mesh.triangles.resize(kept);
  mesh.triangle_material.resize(kept);
  mesh.triangles.shrink_to_fit();
  mesh.triangle_material.shrink_to_fit();
  mesh.rest.shrink_to_fit();
  mesh.rest_material.shrink_to_fit();
  mesh.parts.runs = std::move(left.runs);
}

}  // namespace pounce::mesh
