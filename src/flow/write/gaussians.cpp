// SPDX-License-Identifier: Apache-2.0
//
//   source ─▶ parts of its order, in parallel: read, filter, choose, encode ─▶ in order: append
//
// Parts of the order are made in parallel and appended in order, so the file does not depend on
// threads. A part is small and its cost is known, so the budget decides how many are under way.
//
// With a limit on their number the source is read twice. The first time finds the importance of the
// last Gaussian that is wanted (stores/importance.h), the second writes those above it. Equal ones
// are decided by their ordinal among the wanted, hence each part must know how many come before it.
#include "flow/write/gaussians.h"

#include <algorithm>

#include "gaussian/gaussian_source.h"
#include "runtime/pump.h"
#include "sorting/importance.h"

namespace pounce::flow {
namespace {

using sorting::importance;
using sorting::ImportanceCut;

constexpr std::uint64_t kPartRows = 16384;
constexpr double kAfterCut = 0.7;  // of the progress bar

std::uint64_t part_bytes(const io::SplatWriterCost& cost, std::uint32_t lobes,
                         std::uint64_t read_bytes) {
  return gaussian::rows_bytes(kPartRows, lobes) + read_bytes +
         round_to_pages(kPartRows * cost.row_bytes) + round_to_pages(sizeof(io::SplatPiece));
}

io::SplatWriterCost cost_of(const GaussianFile& file) {
  return io::splat_writer_cost(*io::splat_output(file.path), file.facts.lobes);
}

struct Part {
  io::SplatPiece piece;
  store::SplatCounts filtered{};
};

class GaussianFileJob {
 public:
  GaussianFileJob(job::JobContext& job, const gaussian::GaussianSource& source,
                  const GaussianFile& file)
      : job_(job),
        source_(source),
        file_(file),
        writer_(io::open_splat_writer(file.path, file.facts, job.scratch_place())) {}

  std::uint64_t run() {
    const runtime::Lease lease(job_.budget, cost_of(file_).fixed_bytes, "writing " + file_.path);
    choose();
    write();
    report_left_out();
    // Nothing to write is no file: the caller reports why.
    if (writer_->rows() > 0) finish();
    return writer_->rows();
  }

 private:
  std::uint64_t end(std::size_t part) const {
    return std::min((part + 1) * kPartRows, source_.count());
  }

  void choose() {
    if (!file_.most) return;
    const StageTimer timer(job_.clock, "count");
    job_.meter.begin("count", source_.count(), "Gaussians", kAfterCut);
    cut_lease_ = runtime::Lease(job_.budget, ImportanceCut::bytes(source_.count(), kPartRows),
                                "selecting the most important Gaussians");
    cut_.emplace(job_, source_, file_.keep, *file_.most, kPartRows);
    io::check_splat_count(file_.path, cut_->taken(), file_.facts.lobes);
    job_.meter.end();
  }

  void write() {
    const StageTimer timer(job_.clock, "write");
    const std::uint64_t total = source_.count(), parts = (total + kPartRows - 1) / kPartRows;
    const runtime::Lease list(job_.budget, round_to_pages(parts * sizeof(std::uint64_t)),
                              "the list of parts");
    const PageVector<std::uint64_t> costs(
        parts, part_bytes(cost_of(file_), source_.lobes(), source_.read_bytes()));
    job_.meter.begin("write", total, "Gaussians", 1);
    runtime::run_ordered<Part>(
        job_.budget, costs, "writing " + file_.path, [&](std::size_t i) { return make(i); },
        [&](std::size_t i, const Part& part) {
          const WorkTimer encoding(job_.clock, "encode");
          writer_->append(part.piece);
          for (std::size_t k = 0; k < store::kSplatFilters; ++k) filtered_[k] += part.filtered[k];
          job_.meter.advance(end(i) - i * kPartRows);
        });
  }

  Part make(std::size_t i) const {
    Part part;
    const std::uint64_t first = i * kPartRows;
    store::SplatRows rows =
        gaussian::read_kept(source_, file_.keep, first, end(i) - first, part.filtered);
    if (cut_) {
      std::uint64_t ordinal = cut_->first(i);
      gaussian::leave_rows(rows, [&](const store::Splat& splat) {
        return cut_->takes(importance(splat), ordinal++);
      });
    }
    writer_->place(rows);
    part.piece = writer_->encode(rows);
    return part;
  }

  void report_left_out() {
    auto& filtered = job_.report.source_filtered;
    for (std::size_t k = 0; k < store::kSplatFilters; ++k) {
      if (filtered_[k] > 0)
        filtered[store::filter_name(static_cast<store::SplatFilter>(k))] += filtered_[k];
    }
    if (cut_ && cut_->left_out() > 0) filtered["less_important"] += cut_->left_out();
  }

  void finish() {
    const StageTimer timer(job_.clock, "write");
    writer_->commit([this] { job_.meter.advance(0); });
    job_.meter.end();
    Report& report = job_.report;
    report.warnings.insert(report.warnings.end(), writer_->warnings().begin(),
                           writer_->warnings().end());
    report.notes.insert(report.notes.end(), writer_->notes().begin(), writer_->notes().end());
    report.outputs = {file_.path};
    report.source_gaussians = writer_->rows();
    report.bytes_written += job::size_on_disk({file_.path}) + writer_->scratch_bytes();
  }

  job::JobContext& job_;
  const gaussian::GaussianSource& source_;
  const GaussianFile& file_;
  const std::unique_ptr<io::SplatWriter> writer_;
  runtime::Lease cut_lease_;
  std::optional<ImportanceCut> cut_;
  store::SplatCounts filtered_{};
};

}  // namespace

std::uint64_t write_gaussians(job::JobContext& job, const gaussian::GaussianSource& source,
                              const GaussianFile& file) {
  return GaussianFileJob(job, source, file).run();
}

std::uint64_t write_gaussians_least_bytes(const GaussianFile& file, std::uint64_t count,
                                          std::uint64_t read_bytes) {
  const io::SplatWriterCost cost = cost_of(file);
  const std::uint64_t parts = count / kPartRows + 1;
  return cost.fixed_bytes + part_bytes(cost, file.facts.lobes, read_bytes) +
         round_to_pages(parts * sizeof(std::uint64_t)) + kPageBytes +
         (file.most ? ImportanceCut::bytes(count, kPartRows) +
                          round_to_pages(kPartRows * sizeof(std::uint64_t))
                    : 0);
}

}  // namespace pounce::flow
