// SPDX-License-Identifier: Apache-2.0
//
// Costs are areas in UV space: they are known from the mesh alone, before any store is there, and
// every task gets the same. What a store knows better, which texels of a page are covered, decides
// where an image is cut.
#include "planning/task_share.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <queue>
#include <set>
#include <utility>

#include "pounce/error.h"

namespace pounce::planning {
namespace {

/// What a texel costs that nothing covers, beside one that something does: it is encoded and
/// written (1.5 s of 6.4 at 8192²: docs/decisions/058-resume.md).
constexpr double kEmptyTexel = 0.25;
/// And an image of no size at all.
constexpr double kImage = 4096;
/// So much more than the mean a task may have to do before images are cut for it.
constexpr double kMostImbalance = 1.25;
/// Parts smaller than this share of a task's mean are not worth their files.
constexpr double kSmallestCut = 1.0 / 8;

/// Of the unit square; what lies several times over each other counts as often.
double uv_area(const mesh::Mesh& mesh, const std::vector<Vec2f>& uvs, std::uint32_t t) {
  const std::array<std::uint32_t, 3>& corners = mesh.triangles[t];
  const Vec2f a = uvs[corners[0]], b = uvs[corners[1]], c = uvs[corners[2]];
  const double ux = double{b.x} - double{a.x}, uy = double{b.y} - double{a.y};
  const double vx = double{c.x} - double{a.x}, vy = double{c.y} - double{a.y};
  return std::abs(ux * vy - uy * vx) / 2;
}

double covered_share(const surface::GeometryRequest& request) {
  const mesh::Mesh& mesh = *request.mesh;
  const std::uint32_t set = request.pages.front().uv_set;
  if (set >= mesh.uv_sets.size() || request.triangles == nullptr) return 1;
  double area = 0;
  for (const std::uint32_t t : request.triangles->of(request.first_page))
    area += uv_area(mesh, mesh.uv_sets[set], t);
  return std::min(area, 1.0);
}

/// Parts of a unit, if none may cost more than `most`.
std::size_t parts_of(const WorkUnit& unit, double most) {
  return std::max<std::size_t>(1, static_cast<std::size_t>(std::ceil(unit.cost / most)));
}

/// The longest first, to whoever has the least: at most a third above the best there is.
std::vector<StepShare> deal(const std::vector<WorkUnit>& units, std::uint32_t tasks,
                            double largest_part) {
  struct Piece {
    double cost;
    std::size_t unit, part;
  };
  std::vector<Piece> pieces;
  std::vector<StepShare> shares(units.size());
  for (std::size_t u = 0; u < units.size(); ++u) {
    const std::size_t parts = parts_of(units[u], largest_part);
    shares[u].tasks.resize(parts);
    shares[u].in_parts = units[u].in_parts || parts > 1;
    for (std::size_t part = 0; part < parts; ++part)
      pieces.push_back({units[u].cost / static_cast<double>(parts), u, part});
  }
  std::stable_sort(pieces.begin(), pieces.end(),
                   [](const Piece& a, const Piece& b) { return a.cost > b.cost; });
  using Load = std::pair<double, std::uint32_t>;
  std::priority_queue<Load, std::vector<Load>, std::greater<>> loads;
  for (std::uint32_t task = 1; task <= tasks; ++task) loads.emplace(0.0, task);
  for (const Piece& piece : pieces) {
    auto [load, task] = loads.top();
    loads.pop();
    shares[piece.unit].tasks[piece.part] = task;
    loads.emplace(load + piece.cost, task);
  }
  return shares;
}

bool is_of(const TaskShare& share, const StepShare& step) {
  if (share.role == TaskRole::prepare) return step.tasks.size() > 1;
  return share.role == TaskRole::assemble || step.has(share.task);
}

double mean_cost(const std::vector<WorkUnit>& units, std::uint32_t tasks) {
  const double all = std::accumulate(units.begin(), units.end(), 0.0,
                                     [](double sum, const WorkUnit& u) { return sum + u.cost; });
  return all / tasks;
}

}  // namespace

bool StepShare::has(std::uint32_t task) const {
  return std::find(tasks.begin(), tasks.end(), task) != tasks.end();
}

void add_units(const SourcePlan& source, const TargetPlan& target, bool is_model,
               std::vector<WorkUnit>& units) {
  for (std::size_t p = 0; p < source.passes.size(); ++p) {
    const PassPlan& pass = source.passes[p];
    const double size = static_cast<double>(pass.size.width) * pass.size.height;
    for (std::size_t page = 0; page < target.pages.size(); ++page) {
      const double covered = size * covered_share(target.requests[p][page]);
      units.push_back(
          {(covered + kEmptyTexel * size) * static_cast<double>(pass.channels.size()) + kImage,
           is_model});
    }
  }
}

double work_seconds(const std::vector<WorkUnit>& units, const TransferOptions& options,
                    const SourcePlan& source) {
  // Of a surface: docs/measured.md. Of Gaussians a guess: scenes differ tenfold, and nobody has
  // counted how many lie on a ray before they are sorted.
  constexpr double kSurface = 1.4e-7, kTexels = 1e-6, kScene = 2.5e-6;
  const bool is_scene = source.passes.front().source.mesh == nullptr;
  const double each = is_scene                                  ? kScene * (1 + options.splats.rays)
                      : options.mesh.method == Method::gaussian ? kTexels
                                                                : kSurface;
  double cost = 0;
  for (const WorkUnit& unit : units) cost += unit.cost;
  return cost * each;
}

std::vector<StepShare> share_out(const std::vector<WorkUnit>& units, std::uint32_t tasks,
                                 bool may_cut) {
  const double mean = mean_cost(units, tasks);
  std::vector<StepShare> best = deal(units, tasks, INFINITY);
  double least = imbalance(units, best, tasks);
  for (double cut = 1; may_cut && least > kMostImbalance && cut >= kSmallestCut; cut /= 2) {
    std::vector<StepShare> shares = deal(units, tasks, mean * cut);
    const double found = imbalance(units, shares, tasks);
    if (found >= least) continue;
    least = found;
    best = std::move(shares);
  }
  return best;
}

double imbalance(const std::vector<WorkUnit>& units, const std::vector<StepShare>& shares,
                 std::uint32_t tasks) {
  std::vector<double> loads(tasks);
  for (std::size_t u = 0; u < units.size(); ++u) {
    const double cost = units[u].cost / static_cast<double>(shares[u].tasks.size());
    for (const std::uint32_t task : shares[u].tasks) loads[task - 1] += cost;
  }
  const double mean = mean_cost(units, tasks);
  return mean > 0 ? *std::max_element(loads.begin(), loads.end()) / mean : 1;
}

void take_shares(const std::vector<StepShare>& shares, std::size_t first, const TaskShare& share,
                 const SourcePlan& source, TargetPlan& target) {
  target.shares.clear();
  std::set<std::string> others;
  for (const PassPlan& pass : source.passes) {
    std::vector<StepShare>& of_pass = target.shares.emplace_back();
    for (std::size_t page = 0; page < target.pages.size(); ++page) {
      of_pass.push_back(shares[first++]);
      if (is_of(share, of_pass.back())) continue;
      for (const std::size_t c : pass.channels) {
        ImageOutput& image = target.images[c][page];
        image.elsewhere = image.keep = true;
        others.insert({image.path, image.coverage_path});
      }
    }
  }
  // Whether others may write theirs they find out: each task asking for all of them is what a
  // thousand tasks would wait for (tools/farm-model.sh).
  std::erase_if(target.outputs, [&](const std::string& path) { return others.contains(path); });
}

void refuse_missing(const std::vector<MissingImage>& missing) {
  if (missing.empty()) return;
  constexpr std::size_t kToldTasks = 16;
  std::set<std::uint32_t> tasks;
  for (const MissingImage& image : missing) tasks.insert(image.tasks.begin(), image.tasks.end());
  std::vector<std::uint32_t> told(tasks.begin(), tasks.end());
  told.resize(std::min(told.size(), kToldTasks));
  throw Error(ErrorKind::busy,
              fmt::format("{}{}: not all of it is there; run what is missing of task{} {}{} again",
                          missing.front().path,
                          missing.size() > 1 ? fmt::format(" and {} more", missing.size() - 1) : "",
                          tasks.size() > 1 ? "s" : "", fmt::join(told, ", "),
                          tasks.size() > told.size() ? ", ..." : ""));
}

void visit_tasks(const store::GeometryStore& target, store::Compressor& compressor,
                 const StepShare& share,
                 const std::function<void(const store::BlockEntry&, std::uint32_t)>& visit) {
  std::uint64_t before = 0;
  const std::uint64_t all = target.directory().texels;
  for (std::uint32_t t = 0; t < target.directory().tiles.size(); ++t) {
    for (const store::BlockEntry& entry : target.read_index(t, compressor)) {
      visit(entry, share.tasks[part_of(before, entry.texels, all, share.tasks.size())]);
      before += entry.texels;
    }
  }
}

std::uint32_t part_of(std::uint64_t before, std::uint64_t texels, std::uint64_t all,
                      std::size_t parts) {
  if (all == 0 || parts < 2) return 0;
  // By its middle. In twice the texels, so that all is whole; a page has 2^32 at most.
  const std::uint64_t part = (2 * before + texels) * parts / (2 * all);
  return static_cast<std::uint32_t>(std::min<std::uint64_t>(part, parts - 1));
}

}  // namespace pounce::planning
