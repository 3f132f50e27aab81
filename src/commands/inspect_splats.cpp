// SPDX-License-Identifier: Apache-2.0
#include "commands/inspect_splats.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <utility>
#include <vector>

#include "core/bounds.h"
#include "io/files/shortest.h"
#include "io/splats/ply_scene.h"
#include "io/splats/scene.h"
#include "store/blocks/splat_lattice.h"

namespace pounce::commands {
namespace {

using Json = nlohmann::ordered_json;
using store::Splat;

Json box_json(const Box3f& box) {
  const auto corner = [](Vec3f v) {
    return Json{io::shortest(v.x), io::shortest(v.y), io::shortest(v.z)};
  };
  return {{"lo", corner(box.lo)}, {"hi", corner(box.hi)}};
}

const char* model_name(store::SplatModel model) {
  switch (model) {
    case store::SplatModel::standard:
      return "default";
    case store::SplatModel::antialiased:
      return "antialiased";
    case store::SplatModel::flat:
      break;
  }
  return "2dgs";
}

/// Of the sample.
template <class Value>
Json quantiles(const PageVector<Splat>& sample, const Value& value) {
  std::vector<float> values;
  for (const Splat& s : sample) values.push_back(value(s));
  std::sort(values.begin(), values.end());
  const auto at = [&](std::size_t percent) {
    return io::shortest(values[(values.size() - 1) * percent / 100]);
  };
  return {{"p10", at(10)}, {"p50", at(50)}, {"p90", at(90)}};
}

/// Holds at least 98 % of the sample: without the outermost 300th part on each of six sides,
/// the floaters that make the whole box of a capture useless.
Box3f most_of(const PageVector<Splat>& sample) {
  constexpr std::size_t kSidesPerCent = 300;  // 2 % on six sides
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

}  // namespace

Json describe_splats(const std::string& path) {
  constexpr std::uint64_t kRows = 16 << 10;
  const auto scene = io::open_splat_scene(path, {});
  const std::string folder = std::filesystem::temp_directory_path().string();
  const std::uint64_t most_bytes = default_scratch_limit(posix_file_system(), folder);
  const auto too_much = [&] {
    return fmt::format(
        "{}: unpacked it takes more than {} bytes in {} (a tenth of what is free there, 1 GiB at "
        "least); name a folder with more room in the environment variable TMPDIR",
        path, most_bytes, folder);
  };
  const auto files =
      make_counting_file_system(std::make_shared<ScratchAccount>(most_bytes, too_much));
  scene->prepare({files.get(), folder}, [] {});
  const io::SplatSceneInfo& info = scene->info();
  const PageVector<Splat> sample = io::sample(*scene);
  const store::SplatLattice lattice(sample);
  store::SplatCounts filtered{};
  std::uint64_t usable = 0, with_normal = 0;
  Box3f box;  // of all that have a place, the strays included: it says why there are strays
  store::SplatRows rows;
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
            {"gaussians", info.splats},
            {"usable", usable},
            {"filtered", Json::object()},
            {"sh_degree", info.sh_degree},
            {"model", model_name(info.model)},
            {"colour_space", info.is_linear ? "linear" : "sRGB"},
            {"with_normal", with_normal}};
  for (std::size_t k = 0; k < filtered.size(); ++k) {
    if (filtered[k] > 0)
      json["filtered"][store::filter_name(static_cast<store::SplatFilter>(k))] = filtered[k];
  }
  if (!box.empty()) json["box"] = box_json(box);
  if (!sample.empty()) {
    json["box_98"] = box_json(most_of(sample));
    json["middle_box"] = box_json(lattice.middle_box());
    json["opacity"] = quantiles(sample, [](const Splat& s) { return s.alpha; });
    json["size"] = quantiles(sample, [](const Splat& s) { return store::size_of(s); });
  }
  if (const auto* ply = dynamic_cast<const io::SplatPly*>(scene.get()))
    add_columns(ply->header(), json);
  json["notes"] = info.assumptions;
  return json;
}

std::string splats_text(const Json& splats) {
  std::string text =
      fmt::format("format     {}\ngaussians  {}, {} usable\n", splats["format"].get<std::string>(),
                  splats["gaussians"].get<std::uint64_t>(), splats["usable"].get<std::uint64_t>());
  for (const auto& [reason, count] : splats["filtered"].items())
    text += fmt::format("left out   {} {}\n", count.get<std::uint64_t>(), reason);
  if (splats.contains("columns")) {
    const auto halves = splats["half_columns"].get<std::size_t>();
    text += fmt::format("columns    {}{}, {} bytes per Gaussian\n", splats["columns"].size(),
                        halves == 0 ? "" : fmt::format(" ({} half floats)", halves),
                        splats["row_bytes"].get<unsigned>());
  }
  text +=
      fmt::format("colours    {}, spherical harmonics of degree {}\n",
                  splats["colour_space"].get<std::string>(), splats["sh_degree"].get<unsigned>());
  text += fmt::format("model      {}\n", splats["model"].get<std::string>());
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

}  // namespace pounce::commands
