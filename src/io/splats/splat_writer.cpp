// SPDX-License-Identifier: Apache-2.0
//
// Gaussians on their way into a file: what all formats share, and the two that write floats (PLY
// and glTF). SPZ is a file of its own.
//
// Rows come in pieces, in the order of the source. encode() may run in many threads at once and
// makes columns of a piece; append() is called in order and puts each column where it goes. PLY has
// one column, its rows, which go straight to the output. The others store attribute by attribute:
// each waits in a nameless file until commit(), which copies them one behind the other. In glTF the
// JSON comes first and has the number of Gaussians and the bounds of their places; in PLY the
// header, written again over the first one, which is as long for any number of rows.
//
// Memory is fixed (splat_writer_cost(), leased by the caller): a buffer for each nameless file and
// one piece. The output is an OutputFile, so a job that fails leaves none.
//
// Why columns wait in files and not in memory: a scene may have more Gaussians than the budget has
// bytes, and neither SPZ nor glTF can be begun before the last one is known.
//
// To read the source again for each attribute instead would decode it twice, an SPZ five times
// (docs/decisions/025).
#include "io/splats/splat_writer.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>

#include "core/directions.h"
#include "core/portable_math.h"
#include "io/files/asset_file.h"
#include "io/problems.h"

namespace pounce::io {
namespace {

static_assert(std::endian::native == std::endian::little);

constexpr std::uint64_t kCopyBytes = 256 << 10;
/// A nameless file's buffer.
constexpr std::uint64_t kColumnBytes = 256 << 10;
/// The stream's buffer of 256 KiB; of an SPZ what zlib holds (262), what comes out of it (64), and
/// a piece's places in fixed point (192).
constexpr std::uint64_t kFinishBytes = 832 << 10;

/// Bytes per row of the columns that a format keeps.
std::vector<std::uint32_t> splat_columns(SplatOutput kind, std::uint32_t lobes) {
  constexpr std::uint32_t kPlyFloats = 17, kVector = 3 * sizeof(float);
  switch (kind) {
    case SplatOutput::ply:
      return {(kPlyFloats + 3 * lobes) * std::uint32_t{sizeof(float)}};
    case SplatOutput::spz: {
      std::vector<std::uint32_t> bytes{kVector, 1, 3, 3, 3};  // places become fixed point later
      if (lobes > 0) bytes.push_back(3 * lobes);
      return bytes;
    }
    case SplatOutput::glb:
      break;
  }
  std::vector<std::uint32_t> bytes{kVector, 4 * sizeof(float), kVector, sizeof(float), kVector};
  bytes.insert(bytes.end(), lobes, kVector);
  return bytes;
}

std::uint64_t sum(const std::vector<std::uint32_t>& values) {
  return std::accumulate(values.begin(), values.end(), std::uint64_t{0});
}

/// Of a disc without any thickness: its logarithm would be infinite.
constexpr float kLeastSigma = 1e-20F;
/// Alpha 0 and 1 have infinite logits. exp(-10) is a 22000th.
constexpr float kLargestLogit = 10;

/// A 3DGS PLY: binary little endian, the column order of its first trainer.
class SplatPlyWriter : public SplatWriter {
 public:
  SplatPlyWriter(const std::string& path, const SplatFileFacts& facts);
  void commit(const std::function<void()>& poll) override;

 private:
  void encode_columns(const store::SplatRows& rows, std::span<std::byte* const> columns,
                      SplatTally& tally) const override;
  void put_header();
};

/// The header of a PLY of so many rows; as long as that of any other number: a comment is padded by
/// as many blanks as the number is short of its longest. So it is written first with 0 rows and
/// again at the end, and the rows need not be copied behind it.
std::string ply_header(std::uint64_t rows, const SplatFileFacts& facts) {
  const std::string count = std::to_string(rows);
  // As many blanks as the longest count has more digits.
  const std::string padding(std::numeric_limits<std::uint64_t>::digits10 + 1 - count.size(), ' ');
  std::string text =
      fmt::format("ply\nformat binary_little_endian 1.0\ncomment pounce gaussians{}\n", padding);
  if (facts.model == store::SplatModel::antialiased) text += "comment SplatRenderMode: mip\n";
  if (facts.model == store::SplatModel::flat) text += "comment SplatRenderMode: 2dgs\n";
  text += fmt::format("element vertex {}\n", count);
  const auto add = [&text](const std::string& name) { text += "property float " + name + "\n"; };
  for (const char* name : {"x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"})
    add(name);
  for (std::uint32_t k = 0; k < 3 * facts.lobes; ++k) add(fmt::format("f_rest_{}", k));
  for (const char* name :
       {"opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"})
    add(name);
  return text + "end_header\n";
}

SplatPlyWriter::SplatPlyWriter(const std::string& path, const SplatFileFacts& facts)
    : SplatWriter(path, facts, SplatOutput::ply, nullptr) {
  if (facts.is_linear) {
    refuse("these colours are linear, which PLY cannot state; write a .glb");
  }
  put_header();
}

void SplatPlyWriter::put_header() {
  const std::string text = ply_header(rows_, facts_);
  put(std::as_bytes(std::span(text)));
}

// A row of floats for each Gaussian, in the order in which ply_header() names them.
void SplatPlyWriter::encode_columns(const store::SplatRows& rows,
                                    std::span<std::byte* const> columns, SplatTally&) const {
  std::byte* out = columns[0];
  const auto add = [&out](float value) {
    std::memcpy(out, &value, sizeof value);
    out += sizeof value;
  };
  const std::size_t lobes = rows.lobes;
  for (std::size_t i = 0; i < rows.splats.size(); ++i) {
    const store::Splat& s = rows.splats[i];
    for (const float v : {s.mean.x, s.mean.y, s.mean.z, s.normal.x, s.normal.y, s.normal.z}) add(v);
    for (const float v : {s.colour.x, s.colour.y, s.colour.z}) add(dc_of(v));
    // All coefficients of red first, then of green and blue, as 3DGS' trainer stores them; in the
    // store they are coefficient by coefficient.
    for (std::size_t c = 0; c < 3; ++c) {  // channel by channel
      for (std::size_t k = 0; k < lobes; ++k) add(half_to_float(rows.sh[3 * (i * lobes + k) + c]));
    }
    add(logit(s.alpha));
    for (const float v : {s.sigma.x, s.sigma.y, s.sigma.z}) add(log_sigma(v));
    for (const float v : s.rotation) add(v);
  }
}

// The header again, with the number of rows that came; padding keeps its length.
void SplatPlyWriter::commit(const std::function<void()>&) {
  if (std::fseek(file_.stream(), 0, SEEK_SET) != 0) file_.fail("its header cannot be completed");
  put_header();
  file_.commit();
}

/// A .glb of one primitive of KHR_gaussian_splatting: floats, a buffer view for each accessor.
class GltfSplatWriter : public SplatWriter {
 public:
  GltfSplatWriter(const std::string& path, const SplatFileFacts& facts,
                  const ScratchFolder& folder);
  void commit(const std::function<void()>& poll) override;

 private:
  void encode_columns(const store::SplatRows& rows, std::span<std::byte* const> columns,
                      SplatTally& tally) const override;
  std::string document() const;
};

/// The columns of a .glb, as splat_columns() has them; behind the last one of each coefficient.
enum GltfColumn : std::size_t { kPlaces, kRotations, kSizes, kAlphas, kColours, kHarmonics };

constexpr const char* kPrefix = "KHR_gaussian_splatting:";

/// What the accessor of a column is called in its primitive.
std::string attribute(std::size_t column) {
  constexpr std::array<const char*, kHarmonics> kNames{"POSITION", "ROTATION", "SCALE", "OPACITY",
                                                       "SH_DEGREE_0_COEF_0"};
  if (column == kPlaces) return kNames[0];
  if (column < kHarmonics) return std::string(kPrefix) + kNames[column];
  // Degree d has 2 d + 1 coefficients, so the first of the next degree is that much farther on.
  std::size_t degree = 1, first = kHarmonics;
  while (column >= first + 2 * degree + 1) first += 2 * degree++ + 1;
  return fmt::format("{}SH_DEGREE_{}_COEF_{}", kPrefix, degree, column - first);
}

const char* type_of(std::size_t column) {
  return column == kRotations ? "VEC4" : column == kAlphas ? "SCALAR" : "VEC3";
}

GltfSplatWriter::GltfSplatWriter(const std::string& path, const SplatFileFacts& facts,
                                 const ScratchFolder& folder)
    : SplatWriter(path, facts, SplatOutput::glb, &folder) {
  if (facts.model == store::SplatModel::antialiased) {
    notes_.emplace_back(
        "these Gaussians were trained with antialiasing, which glTF cannot state: viewers show "
        "them slightly too opaque");
  }
  if (facts.model == store::SplatModel::flat)
    notes_.emplace_back(
        "glTF cannot state that these Gaussians are discs (2DGS): they are written flat");
}

void GltfSplatWriter::encode_columns(const store::SplatRows& rows,
                                     std::span<std::byte* const> columns, SplatTally&) const {
  const auto put_floats = [](std::byte* at, std::size_t row, const auto& values) {
    std::memcpy(at + row * sizeof values, values.data(), sizeof values);
  };
  const std::size_t lobes = rows.lobes;
  for (std::size_t i = 0; i < rows.splats.size(); ++i) {
    const store::Splat& s = rows.splats[i];
    // glTF has w last, PLY and the store first.
    const auto& [w, x, y, z] = s.rotation;
    put_floats(columns[kPlaces], i, std::array{s.mean.x, s.mean.y, s.mean.z});
    put_floats(columns[kRotations], i, std::array{x, y, z, w});
    put_floats(columns[kSizes], i, std::array{s.sigma.x, s.sigma.y, s.sigma.z});
    put_floats(columns[kAlphas], i, std::array{s.alpha});
    put_floats(columns[kColours], i,
               std::array{dc_of(s.colour.x), dc_of(s.colour.y), dc_of(s.colour.z)});
    for (std::size_t k = 0; k < lobes; ++k) {
      const std::uint16_t* const sh = &rows.sh[3 * (i * lobes + k)];
      put_floats(columns[kHarmonics + k], i,
                 std::array{half_to_float(sh[0]), half_to_float(sh[1]), half_to_float(sh[2])});
    }
  }
}

// Written by hand: a dozen fixed members need no library, and the text is the same everywhere.
// Bounds of positions are the only ones that glTF requires.
std::string GltfSplatWriter::document() const {
  const std::vector<std::uint32_t>& bytes = column_bytes();
  std::string attributes, accessors, views;
  std::uint64_t at = 0;
  for (std::size_t k = 0; k < bytes.size(); ++k) {
    const char* const comma = k == 0 ? "" : ",";
    attributes += fmt::format("{}\"{}\":{}", comma, attribute(k), k);
    const Vec3f &lo = tally_.box.lo, &hi = tally_.box.hi;
    const std::string bounds =  // {} of a float is the shortest text that reads back as the same
        k != kPlaces ? ""
                     : fmt::format(",\"min\":[{},{},{}],\"max\":[{},{},{}]", lo.x, lo.y, lo.z, hi.x,
                                   hi.y, hi.z);
    accessors +=
        fmt::format("{}{{\"bufferView\":{},\"componentType\":5126,\"count\":{},\"type\":\"{}\"{}}}",
                    comma, k, rows_, type_of(k), bounds);
    views += fmt::format("{}{{\"buffer\":0,\"byteOffset\":{},\"byteLength\":{},\"target\":34962}}",
                         comma, at, rows_ * bytes[k]);
    at += rows_ * bytes[k];
  }
  // The means stay small numbers, exact in single precision; the node moves them to their place.
  const Vec3d& o = facts_.origin;
  const std::string translation =
      o == Vec3d{} ? "" : fmt::format(",\"translation\":[{},{},{}]", o.x, o.y, o.z);
  std::string text = fmt::format(
      "{{\"asset\":{{\"version\":\"2.0\",\"generator\":\"pounce\"}},"
      "\"extensionsUsed\":[\"KHR_gaussian_splatting\"],\"scene\":0,\"scenes\":[{{\"nodes\":[0]}}],"
      "\"nodes\":[{{\"mesh\":0{}}}],\"meshes\":[{{\"primitives\":[{{\"mode\":0,\"attributes\":{{{}}"
      "},"
      "\"extensions\":{{\"KHR_gaussian_splatting\":{{\"kernel\":\"ellipse\",\"colorSpace\":\"{}\"}}"
      "}}}}]}}],\"accessors\":[{}],\"bufferViews\":[{}],\"buffers\":[{{\"byteLength\":{}}}]}}",
      translation, attributes, facts_.is_linear ? "lin_rec709_display" : "srgb_rec709_display",
      accessors, views, at);
  text.resize((text.size() + 3) / 4 * 4, ' ');  // chunks of a GLB begin at multiples of four
  return text;
}

// All lengths are known by now, so the file is written once from front to back.
void GltfSplatWriter::commit(const std::function<void()>& poll) {
  if (tally_.normals > 0)
    notes_.emplace_back(
        "the normals of the source are not written: splats in glTF have no normals");
  const std::string json = document();
  const std::uint64_t binary = rows_ * row_bytes();  // a multiple of four
  const auto put_numbers = [this](std::initializer_list<std::uint64_t> numbers) {
    for (const std::uint64_t number : numbers) {
      const auto value = static_cast<std::uint32_t>(number);
      put(std::as_bytes(std::span(&value, 1)));
    }
  };
  put_numbers({0x46546C67, 2, 12 + 8 + json.size() + 8 + binary});  // "glTF"
  put_numbers({json.size(), 0x4E4F534A});                           // "JSON"
  put(std::as_bytes(std::span(json)));
  put_numbers({binary, 0x004E4942});  // "BIN"
  for (std::size_t k = 0; k < kHarmonics + facts_.lobes; ++k)
    for_column(k, poll, [&](std::span<const std::byte> bytes) { put(bytes); });
  file_.commit();
}

}  // namespace

// By log_same(): logarithms of C libraries differ in the last bit, and so would the files.
float log_sigma(float sigma) {
  return static_cast<float>(log_same(static_cast<double>(std::max(sigma, kLeastSigma))));
}

float logit(float alpha) {
  if (!(alpha > 0)) return -kLargestLogit;
  if (alpha >= 1) return kLargestLogit;
  const auto a = static_cast<double>(alpha);
  return std::clamp(static_cast<float>(log_same(a / (1 - a))), -kLargestLogit, kLargestLogit);
}

float dc_of(float colour) {
  return static_cast<float>((static_cast<double>(colour) - 0.5) / kShDegree0);
}

// The ending decides: whoever reads the file goes by it, too.
std::optional<SplatOutput> splat_output(const std::string& path) {
  const std::string ending = lower_ending(path);
  if (ending == ".ply") return SplatOutput::ply;
  if (ending == ".spz") return SplatOutput::spz;
  if (ending == ".glb") return SplatOutput::glb;
  return std::nullopt;
}

SplatWriterCost splat_writer_cost(SplatOutput kind, std::uint32_t lobes) {
  const std::vector<std::uint32_t> columns = splat_columns(kind, lobes);
  const std::uint64_t files = kind == SplatOutput::ply ? 0 : columns.size();
  return {files * kColumnBytes + kCopyBytes + kFinishBytes, sum(columns)};
}

// Before the first row is read where the number is known, and at every piece: a source may only be
// found too large while it is read.
void check_splat_count(const std::string& path, std::uint64_t splats, std::uint32_t lobes) {
  const SplatOutput kind = splat_output(path).value();
  const auto refuse_beyond = [&](std::uint64_t most, const std::string& why) {
    if (splats > most) refuse(path, "{}", why);
  };
  if (kind == SplatOutput::spz) {
    constexpr std::uint64_t kMost = 0x7FFFFFFF;
    refuse_beyond(kMost,
                  "an SPZ is limited to 2^31 - 1 Gaussians; write a .ply, or fewer with --count");
  }
  if (kind == SplatOutput::glb) {
    constexpr std::uint64_t kMostJsonBytes = 16 << 10;
    const std::uint64_t most = (std::numeric_limits<std::uint32_t>::max() - kMostJsonBytes) /
                               sum(splat_columns(kind, lobes));
    refuse_beyond(most, fmt::format("a .glb is limited to 4 GiB, which is {} Gaussians of this "
                                    "kind; write a .ply or .spz, or fewer with --count",
                                    most));
  }
}

// What the format cannot say of the whole scene is refused by the constructors, before any row.
std::unique_ptr<SplatWriter> open_splat_writer(const std::string& path, const SplatFileFacts& facts,
                                               const ScratchFolder& folder) {
  switch (splat_output(path).value()) {
    case SplatOutput::ply:
      return std::make_unique<SplatPlyWriter>(path, facts);
    case SplatOutput::spz:
      return open_spz_writer(path, facts, folder);
    case SplatOutput::glb:
      break;
  }
  return std::make_unique<GltfSplatWriter>(path, facts, folder);
}

void SplatTally::add(const SplatTally& other) {
  box.extend(other.box);
  for (std::size_t e = 0; e < sizes.size(); ++e) sizes[e] += other.sizes[e];
  too_small += other.too_small;
  too_large += other.too_large;
  too_far += other.too_far;
  clipped += other.clipped;
  normals += other.normals;
}

SplatWriter::SplatWriter(const std::string& path, const SplatFileFacts& facts, SplatOutput kind,
                         const ScratchFolder* folder)
    : path_(path),
      facts_(facts),
      added_(kind == SplatOutput::glb ? Vec3d{} : facts.origin),
      file_(path),
      column_bytes_(splat_columns(kind, facts.lobes)) {
  // Positions were read less their origin so that single precision is fine enough; a format without
  // a transform gets them back, and with them the steps that a float has there.
  if (added_ != Vec3d{}) {
    const double farthest = std::max({std::abs(added_.x), std::abs(added_.y), std::abs(added_.z)});
    constexpr double kLastPlace = std::numeric_limits<float>::epsilon();
    notes_.push_back(
        fmt::format("{}: positions are written in single precision, in steps of about {:.1g} this "
                    "far from the origin; a .glb keeps full precision with a node's translation",
                    path_, farthest * kLastPlace));
  }
  if (folder == nullptr) return;
  for (std::size_t k = 0; k < column_bytes_.size(); ++k) files_.push_back(folder->create());
}

std::uint64_t SplatWriter::row_bytes() const { return sum(column_bytes_); }

void SplatWriter::refuse(const std::string& what) const { io::refuse(path_, "{}", what); }

// Added in double precision, rounded once.
void SplatWriter::place(store::SplatRows& rows) const {
  if (added_ == Vec3d{}) return;
  for (store::Splat& s : rows.splats) s.mean = Vec3f(Vec3d(s.mean) + added_);
}

// Columns of a piece lie one behind the other in one buffer, each as long as its rows need.
SplatPiece SplatWriter::encode(const store::SplatRows& rows) const {
  SplatPiece piece;
  piece.rows = rows.splats.size();
  piece.bytes.resize(piece.rows * row_bytes());
  std::vector<std::byte*> columns;
  std::byte* at = piece.bytes.data();
  for (const std::uint32_t bytes : column_bytes_) {
    columns.push_back(at);
    at += piece.rows * bytes;
  }
  for (const store::Splat& s : rows.splats) {
    piece.tally.box.extend(s.mean);
    // Bounds and sizes are collected while rows pass: SPZ chooses its fixed point by them at the
    // end, and glTF must state the bounds of its positions.
    // The exponent of a float is its logarithm, rounded down: no other is as quick and as exact.
    ++piece.tally.sizes[std::bit_cast<std::uint32_t>(store::size_of(s)) >> 23 & 255];
    piece.tally.normals += s.normal != Vec3f{} ? 1 : 0;
  }
  encode_columns(rows, columns, piece.tally);
  return piece;
}

// In the order of the source, whatever the order in which pieces were encoded.
void SplatWriter::append(const SplatPiece& piece) {
  if (piece.rows == 0) return;  // a part of a source of which nothing is wanted
  check_splat_count(path_, rows_ + piece.rows, facts_.lobes);
  const std::byte* at = piece.bytes.data();
  for (std::size_t k = 0; k < column_bytes_.size(); ++k) {
    const std::span<const std::byte> bytes(at, piece.rows * column_bytes_[k]);
    files_.empty() ? put(bytes) : files_[k]->append(bytes);
    at += bytes.size();
  }
  rows_ += piece.rows;
  tally_.add(piece.tally);
}

void SplatWriter::put(std::span<const std::byte> bytes) {
  std::fwrite(bytes.data(), 1, bytes.size(), file_.stream());
  file_.check();  // a full disk ends the job now, not after the last row
}

void SplatWriter::for_column(std::size_t column, const std::function<void()>& poll,
                             const std::function<void(std::span<const std::byte>)>& take) const {
  const std::uint64_t row = column_bytes_[column], size = rows_ * row;
  PageVector<std::byte> piece(std::min(size, kCopyBytes / row * row));  // whole rows
  const auto from = files_[column]->reader();
  for (std::uint64_t at = 0; at < size; at += piece.size()) {
    const auto part = std::span(piece).first(std::min<std::uint64_t>(piece.size(), size - at));
    from->read(at, part);
    take(part);
    poll();
  }
}

}  // namespace pounce::io
