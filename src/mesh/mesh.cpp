// SPDX-License-Identifier: Apache-2.0
//
// What is done with a mesh as a whole. Two things here are not obvious.
//
// Triangles that coincide are counted because the later of two is never hit, and its own part of
// the texture never shown. Places are compared bit by bit: what was copied coincides; what was
// computed twice hardly does. A table of all triangles would take as much memory as the mesh, so
// eight bits for each tell which hashes occur twice. That leaves few triangles of a sound mesh, and
// only these are sorted by hash, those of one hash compared.
//
// Parts come as runs, since readers emit triangles node by node: eight bytes a run instead of four
// a triangle, and equal sets of names are one part.
#include "mesh/mesh.h"

#include <fmt/format.h>
#include <fnmatch.h>

#include <algorithm>
#include <bit>
#include <numeric>
#include <set>
#include <span>
#include <tuple>
#include <utility>

#include "core/hash.h"
#include "pounce/error.h"

namespace pounce::mesh {
namespace {

template <class T>
std::uint64_t bytes_of(const std::vector<T>& items) {
  return items.capacity() * sizeof(T);
}

using Corners = std::array<std::uint32_t, 3>;
using Places = std::array<std::array<float, 3>, 3>;

/// Which corner a file names first says nothing; the order around does, it is the side that faces
/// out. The triangle's corners, from the one with the least coordinates on.
Corners from_least(const Mesh& mesh, const Corners& corners) {
  const auto place = [&](std::size_t k) {
    const Vec3f& p = mesh.positions[corners[k]];
    return std::tuple(p.x, p.y, p.z);
  };
  std::size_t least = 0;
  for (const std::size_t k : {1U, 2U}) {
    if (place(k) < place(least)) least = k;
  }
  return {corners[least], corners[(least + 1) % 3], corners[(least + 2) % 3]};
}

Places places_of(const Mesh& mesh, const Corners& corners) {
  Places out;
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec3f& p = mesh.positions[corners[k]];
    out[k] = {p.x + 0.0F, p.y + 0.0F, p.z + 0.0F};  // -0 is 0
  }
  return out;
}

bool looks_the_same(const Mesh& mesh, std::uint32_t a, std::uint32_t b) {
  // Of one material and with the same UVs it does not matter which of them is hit.
  if (mesh.triangle_material[a] != mesh.triangle_material[b]) return false;
  const Corners one = from_least(mesh, mesh.triangles[a]),
                other = from_least(mesh, mesh.triangles[b]);
  return std::all_of(mesh.uv_sets.begin(), mesh.uv_sets.end(), [&](const auto& uvs) {
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec2f p = uvs[one[k]], q = uvs[other[k]];
      if (p.x != q.x || p.y != q.y) return false;
    }
    return true;
  });
}

/// The same whichever of its corners a triangle names first.
std::uint64_t places_hash(const Mesh& mesh, const Corners& corners) {
  std::uint64_t sum = 0;
  for (const std::uint32_t corner : corners) {
    const Vec3f& p = mesh.positions[corner];
    const auto bits = [](float v) { return std::uint64_t{std::bit_cast<std::uint32_t>(v + 0.0F)}; };
    std::uint64_t h = (bits(p.x) | bits(p.y) << 32) * 0x9E3779B97F4A7C15ULL;
    h = (h ^ (h >> 32) ^ bits(p.z)) * 0xD6E8FEB86659FD93ULL;
    sum += h ^ (h >> 32);
  }
  sum *= 0x9E3779B97F4A7C15ULL;
  return sum ^ (sum >> 32);
}

/// A triangle behind the lower half of its hash: in order of hashes, and of the file.
using Entry = std::uint64_t;

std::uint32_t triangle_of(Entry entry) { return static_cast<std::uint32_t>(entry); }

/// Of triangles of one hash, in file order. Nearly always they have the same places.
std::uint64_t count_among(const Mesh& mesh, std::span<const Entry> entries) {
  std::uint64_t count = 0;
  const auto places = [&](const Entry& e) {
    return places_of(mesh, from_least(mesh, mesh.triangles[triangle_of(e)]));
  };
  // The later one counts, held against the first with its places: that is the one which rays hit.
  for (std::size_t i = 1; i < entries.size(); ++i) {
    const Places own = places(entries[i]);
    if (own[0] == own[1] || own[1] == own[2] || own[2] == own[0]) continue;  // no area
    const auto first = std::find_if(entries.begin(), entries.end(),
                                    [&](const Entry& e) { return places(e) == own; });
    if (!looks_the_same(mesh, triangle_of(*first), triangle_of(entries[i]))) ++count;
  }
  return count;
}

}  // namespace

void Mesh::append_copies(const std::vector<std::uint32_t>& originals) {
  const std::size_t total = positions.size() + originals.size();
  const auto extend = [&](auto& items) {
    if (items.empty()) return;
    items.reserve(total);
    for (const std::uint32_t vertex : originals) {
      const auto item = items[vertex];
      items.push_back(item);
    }
  };
  extend(positions);
  extend(normals);
  extend(tangents);
  for (auto& set : uv_sets) extend(set);
  for (auto& present : uv_present) extend(present);
  extend(own_tangents);
  extend(colours);
}

std::uint64_t Mesh::size_bytes() const {
  std::uint64_t total = sizeof(Mesh) + bytes_of(positions) + bytes_of(normals) +
                        bytes_of(tangents) + bytes_of(colours) + bytes_of(triangles) +
                        bytes_of(triangle_material) + bytes_of(rest) + bytes_of(rest_material) +
                        bytes_of(materials) + bytes_of(images) + bytes_of(warnings) +
                        parts.size_bytes() + bytes_of(files);
  for (const auto& set : uv_sets) total += bytes_of(set);
  for (const auto& present : uv_present) total += present.capacity() / 8;
  total += own_tangents.capacity() / 8;
  std::set<const void*> counted;  // images may share bytes
  for (const auto& image : images) {
    const bool is_new = image.bytes != nullptr && counted.insert(image.bytes.get()).second;
    if (is_new) total += image.bytes->capacity();
    total += image.path.capacity() + image.label.capacity() + image.problem.capacity();
  }
  return total;
}

std::uint64_t Parts::size_bytes() const {
  std::uint64_t total = names.capacity() * sizeof(std::string) +
                        part_names.capacity() * sizeof(part_names[0]) +
                        runs.capacity() * sizeof(Run);
  for (const auto& name : names) total += name.capacity();
  for (const auto& part : part_names) total += part.capacity() * sizeof(part[0]);
  return total;
}

void PartsBuilder::start(std::uint32_t first_triangle, const std::vector<std::string>& names) {
  end_run(first_triangle);
  names_ = names;
  first_ = first_triangle;
}

void PartsBuilder::end_run(std::uint32_t triangles) {
  // Ended by the next run's start, since a reader knows the names before the triangles.
  if (triangles == first_) return;
  std::vector<std::uint32_t> key;
  ++uses_;
  for (const std::string& name : names_) {
    if (name.empty()) continue;
    const auto [at, fresh] =
        name_index_.try_emplace(name, static_cast<std::uint32_t>(parts_.names.size()));
    if (fresh) parts_.names.push_back(name);
    last_use_.resize(parts_.names.size(), 0);
    // A node is often called as its mesh is: each name once.
    if (std::exchange(last_use_[at->second], uses_) != uses_) key.push_back(at->second);
  }
  const auto [at, fresh] =
      part_index_.try_emplace(key, static_cast<std::uint32_t>(parts_.part_names.size()));
  if (fresh) parts_.part_names.push_back(key);
  if (parts_.runs.empty() || parts_.runs.back().part != at->second)
    parts_.runs.push_back({first_, at->second});
}

Parts PartsBuilder::finish(std::uint32_t triangles) {
  end_run(triangles);
  parts_.names.shrink_to_fit();
  parts_.part_names.shrink_to_fit();
  parts_.runs.shrink_to_fit();
  return std::move(parts_);
}

void orient(Mesh& mesh, const Axes& axes) {
  if (axes == Axes{}) return;
  for (Vec3f& position : mesh.positions) position = axes.apply(position);
  for (Vec3f& normal : mesh.normals) normal = axes.apply(normal);
  const bool mirrors = axes.mirrors();
  for (Vec4f& tangent : mesh.tangents) {
    const Vec3f t = axes.apply(Vec3f{tangent.x, tangent.y, tangent.z});
    tangent = {t.x, t.y, t.z, mirrors ? -tangent.w : tangent.w};
  }
  // A mirror turns the winding round; turned once more, the outside is outside again.
  if (!mirrors) return;
  for (auto& triangle : mesh.triangles) std::swap(triangle[1], triangle[2]);
}

std::uint64_t count_coincident(const Mesh& mesh) {
  const std::size_t size = mesh.triangles.size();
  const std::size_t slots = std::bit_floor(std::max<std::size_t>(8 * size, 64));
  const int shift = 64 - std::countr_zero(slots);
  std::vector<bool> again(slots, false);
  std::uint64_t repeated = 0;
  {
    std::vector<bool> seen(slots, false);
    for (const Corners& corners : mesh.triangles) {
      const std::size_t slot = places_hash(mesh, corners) >> shift;
      if (!seen[slot]) {
        seen[slot] = true;
      } else {
        again[slot] = true;
        ++repeated;
      }
    }
  }
  if (repeated == 0) return 0;
  // At most twice as many are left, which are sorted an eighth of the mesh at a time.
  const std::uint64_t passes = 1 + 2 * repeated / (size / 8 + 1);
  std::uint64_t count = 0;
  std::vector<Entry> entries;
  for (std::uint64_t pass = 0; pass < passes; ++pass) {
    entries.clear();
    for (std::uint32_t t = 0; t < size; ++t) {
      const std::uint64_t hash = places_hash(mesh, mesh.triangles[t]);
      if (again[hash >> shift] && hash % passes == pass) entries.push_back(hash << 32 | t);
    }
    std::sort(entries.begin(), entries.end());
    for (auto from = entries.begin(); from != entries.end();) {
      const auto to =
          std::find_if(from, entries.end(), [&](Entry e) { return e >> 32 != *from >> 32; });
      if (to - from > 1) count += count_among(mesh, std::span(from, to));
      from = to;
    }
  }
  return count;
}

// --- what takes part -----------------------------------------------------------------------------
//
// Names are typed by people and made by programs, so a pattern that finds nothing is more often a
// mistake than a wish: it is refused, or warned of where another pattern does find something, with
// the names that there are and the nearest one. A name may have any characters, "[" too, hence a
// pattern matches the name that it equals, whatever it means as a pattern.

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
