// SPDX-License-Identifier: Apache-2.0
//
// The two kinds of scenes that come as PLY.
//
// A 3DGS PLY is a table of floats, one row per Gaussian, as its first trainer dumped it: columns
// are found by name, since tools reorder, drop and add them. Rows are read a few hundred KiB at a
// time and taken apart by column: 256 rows of one column are loaded into an array, whatever its
// type, and the exponentials run over arrays as vector code.
//
//   x y z, nx ny nz        place and normal; two columns of three are no normal
//   f_dc_0..2              harmonics of degree 0: colour = 0.5 + C0 f_dc
//   f_rest_0..             the others, channel by channel; their number says the degree
//   opacity                a logit: alpha = 1 / (1 + exp(-opacity))
//   scale_0..2             logarithms of sigma; a 2DGS scene has only two of them
//   rot_0..3               w x y z, of any length
//
// SuperSplat's compressed PLY has 256 Gaussians to a chunk, and 32 bits for each of position,
// rotation, scale and colour, as fractions of the chunk's bounds. A batch is a chunk.
//
// Neither says a number that could be trusted for an allocation: ply_rows_at() has compared all of
// them with the file's size before the first row is read, and buffers are of a piece's size.
#include "io/splats/ply_scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <optional>

#include "core/directions.h"
#include "core/input_file.h"
#include "core/portable_math.h"
#include "io/problems.h"

namespace pounce::io {
namespace {

constexpr const char* kWanted =
    "pounce reads the binary little-endian 3DGS PLY that trainers write (x y z, f_dc_0..2, "
    "opacity, scale_0..2, rot_0..3)";

/// Two bytes are half floats where they are unsigned; signed ones are somebody's own quantisation.
void check_types(const std::vector<PlyColumn>& columns, const std::string& path) {
  for (const PlyColumn& column : columns) {
    if (!is_splat_column(column.name) || column.type != PlyType::i16) continue;
    refuse(path,
           "its column \"{}\" has type short (int16), whose scale splat PLYs do not define; export "
           "it as float, or as half floats in ushort",
           shown(column.name));
  }
}

/// Text and big endian are told apart from what is no PLY at all: converting them is easy.
void check_encoding(const PlyHeader& header, const std::string& path) {
  if (header.format == "ascii") refuse(path, "an ASCII PLY; {}: export it as binary", kWanted);
  if (header.format == "binary_big_endian")
    refuse(path, "a big-endian PLY; {}: export it as little endian", kWanted);
  if (header.format != "binary_little_endian")
    refuse(path, "its format is \"{}\"; {}", shown(header.format), kWanted);
}

/// What the file is, where it is not what we read.
void check_kind(const PlyHeader& header, const std::string& path) {
  const PlyElement* vertex = header.find("vertex");
  if (vertex == nullptr) refuse(path, "the PLY has no element \"vertex\"; {}", kWanted);
  // A mesh or a point cloud is the usual mistake; they lack what only splats have.
  const auto has = [&](const char* name) { return find_column(vertex->columns, name) != nullptr; };
  if (!has("f_dc_0")) {
    for (const char* name : {"face", "tristrips"}) {
      if (const PlyElement* e = header.find(name); e != nullptr && e->count > 0) {
        refuse(
            path,
            "a mesh ({} vertices, {} {} rows) whose faces are no lists \"vertex_indices\"; export "
            "it with plain faces",
            vertex->count, e->count, name);
      }
    }
    if (!has("scale_0") && !has("rot_0")) {
      refuse(path,
             "a point cloud without colours ({} points); export it with red, green and blue for "
             "each point",
             vertex->count);
    }
  }
  for (const char* name : {"x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0",
                           "scale_1", "rot_0", "rot_1", "rot_2", "rot_3"}) {
    if (!has(name)) refuse(path, "the splat PLY has no column \"{}\"; {}", name, kWanted);
  }
  if (vertex->has_list) {
    refuse(path, "its vertices have a list property, which no splat scene has; {}", kWanted);
  }
  check_encoding(header, path);
  if (vertex->count == 0) refuse(path, "the splat PLY holds no Gaussians (element vertex 0)");
}

/// The file states no degree: it follows from the number of columns, 3 ((degree + 1)^2 - 1). Any
/// other number is a file that lost columns, and guessing which would colour the scene wrongly.
std::uint32_t sh_degree(const std::vector<PlyColumn>& columns, const std::string& path) {
  const auto rest = static_cast<std::uint32_t>(
      std::count_if(columns.begin(), columns.end(),
                    [](const PlyColumn& c) { return c.name.starts_with("f_rest_"); }));
  constexpr std::array<std::uint32_t, 5> kColumns{0, 9, 24, 45, 72};
  const auto found = std::find(kColumns.begin(), kColumns.end(), rest);
  if (found == kColumns.end()) {
    refuse(path,
           "{} f_rest columns do not match any degree of spherical harmonics (0, 9, 24, 45 or 72 "
           "do); export it again",
           rest);
  }
  return static_cast<std::uint32_t>(found - kColumns.begin());
}

SplatPlyHeader read_splat_ply_header(const ReadFile& file, const std::string& path) {
  if (file.size_bytes() == 0) refuse(path, "the file is empty; export it again");
  if (!is_ply(file)) refuse(path, "does not begin like a PLY file; {}", kWanted);
  const PlyHeader header = read_ply_header(file, path);
  check_kind(header, path);
  const PlyElement& vertex = *header.find("vertex");
  SplatPlyHeader result;
  result.rows_at = ply_rows_at(header, file.size_bytes(), path);
  result.splats = vertex.count;
  result.row_bytes = static_cast<std::uint32_t>(vertex.row_bytes);
  check_types(vertex.columns, path);
  result.columns = vertex.columns;
  result.sh_degree = sh_degree(vertex.columns, path);
  result.model = header.model;
  return result;
}

constexpr std::uint64_t kReadBytes = 256 << 10;

// The columns of a Gaussian, in the order of kNames; where each kind of them begins.
enum Column : std::size_t { kMean, kColour = 3, kOpacity = 6, kScale = 7, kRot = 10, kNormal = 14 };
constexpr std::array<const char*, 17> kNames{
    "x",       "y",     "z",     "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1",
    "scale_2", "rot_0", "rot_1", "rot_2",  "rot_3",  "nx",     "ny",      "nz"};

/// Where the column kNames[c] goes, before it is converted.
SplatBatch::Column& column_of(SplatBatch& batch, std::size_t c) {
  if (c < kColour) return batch.mean[c];
  if (c < kOpacity) return batch.colour[c - kColour];
  if (c < kScale) return batch.alpha;
  if (c < kRot) return batch.sigma[c - kScale];
  if (c < kNormal) return batch.rotation[c - kRot];
  return batch.normal[c - kNormal];
}

template <class T>
float number(T value) {
  return static_cast<float>(value);
}
float number(std::uint16_t half) { return half_to_float(half); }

// Columns of a row need not be aligned, so values are copied byte by byte.
template <class T>
void load_as(const std::byte* from, std::size_t stride, std::size_t rows, SplatBatch::Column& to) {
  for (std::size_t i = 0; i < rows; ++i) {
    T value;
    std::memcpy(&value, from + i * stride, sizeof value);
    to[i] = number(value);
  }
}

/// By PlyType. Shorts with sign were refused with the header.
using Loader = void (*)(const std::byte*, std::size_t, std::size_t, SplatBatch::Column&);
constexpr std::array<Loader, 8> kLoaders{
    load_as<std::int8_t>,  load_as<std::uint8_t>,  nullptr,        load_as<std::uint16_t>,
    load_as<std::int32_t>, load_as<std::uint32_t>, load_as<float>, load_as<double>};

constexpr std::uint64_t kChunkRows = 256;
static_assert(kChunkRows == SplatBatch::kRows);

/// `bits` bits from `shift` up, as 0..1.
float unorm(std::uint32_t packed, int shift, int bits) {
  const std::uint32_t most = (1U << bits) - 1;
  return static_cast<float>(packed >> shift & most) / static_cast<float>(most);
}

/// 11, 10 and 11 bits.
std::array<float, 3> unorm_3(std::uint32_t packed) {
  return {unorm(packed, 21, 11), unorm(packed, 11, 10), unorm(packed, 0, 11)};
}

// As the format's own decoder computes it, so that both ends of the range are exact.
float between(float low, float high, float t) { return low * (1 - t) + high * t; }

/// w, x, y, z. The largest component is left out and follows from the unit length; the other three
/// are then at most 1/sqrt(2), which their ten bits span from -1/sqrt(2) to 1/sqrt(2).
std::array<float, 4> rotation_of(std::uint32_t packed) {
  constexpr float kSqrt2 = 1.41421356F;
  const std::array<float, 3> rest{(unorm(packed, 20, 10) - 0.5F) * kSqrt2,
                                  (unorm(packed, 10, 10) - 0.5F) * kSqrt2,
                                  (unorm(packed, 0, 10) - 0.5F) * kSqrt2};
  return with_largest(packed >> 30, rest);
}

/// The ends of a byte's range are exact, what is between lies in the middle of its step.
float harmonic_of(std::byte value) {
  const auto b = std::to_integer<unsigned>(value);
  const float n = b == 0 ? 0 : b == 255 ? 1 : (static_cast<float>(b) + 0.5F) / 256;
  return (n - 0.5F) * 8;
}

/// Bounds of a chunk of a compressed PLY: of positions, of logarithms of sigma, of colours; the
/// three lower ends of each, then the three upper ones.
constexpr std::size_t kCompressedBounds = 18;

/// What the header of a SuperSplat compressed PLY says, checked against the size of the file.
struct CompressedPlyHeader {
  std::uint64_t splats = 0;
  std::uint64_t chunks_at = 0, rows_at = 0, harmonics_at = 0;
  std::uint32_t chunk_bytes = 0, row_bytes = 0;
  /// Where the bounds are in a chunk; of colours nothing in older files (they are 0 and 1).
  std::array<std::optional<std::uint32_t>, kCompressedBounds> bounds;
  std::array<std::uint32_t, 4> packed{};  ///< position, rotation, scale, colour in a row
  std::uint32_t harmonics = 0;            ///< bytes per Gaussian: 0, 9, 24 or 45
  std::uint32_t sh_degree = 0;
  store::SplatModel model = store::SplatModel::standard;
};

/// Finds elements and columns of a compressed PLY, whose types are fixed.
class CompressedHeaderReader {
 public:
  CompressedHeaderReader(const ReadFile& file, const std::string& path)
      : path_(path), file_bytes_(file.size_bytes()), header_(read_ply_header(file, path)) {}

  CompressedPlyHeader read() {
    check_encoding(header_, path_);
    const PlyElement &chunk = element("chunk"), &vertex = element("vertex");
    found_.splats = vertex.count;
    if (vertex.count == 0) fail("holds no Gaussians (element vertex 0)");
    found_.model = header_.model;
    found_.rows_at = ply_rows_at(header_, file_bytes_, path_);
    found_.chunks_at = ply_rows_at(header_, file_bytes_, path_, "chunk");
    found_.row_bytes = static_cast<std::uint32_t>(vertex.row_bytes);
    found_.chunk_bytes = static_cast<std::uint32_t>(chunk.row_bytes);
    if (const std::uint64_t chunks = (vertex.count - 1) / kChunkRows + 1; chunk.count < chunks) {
      fail(fmt::format("has {} chunks of 256, but its {} Gaussians need {}", chunk.count,
                       vertex.count, chunks));
    }
    find_bounds(chunk);
    constexpr std::array<const char*, 4> kPacked{"packed_position", "packed_rotation",
                                                 "packed_scale", "packed_color"};
    for (std::size_t k = 0; k < kPacked.size(); ++k)
      found_.packed[k] = column(vertex, kPacked[k], PlyType::u32);
    if (header_.find("sh") != nullptr) find_harmonics(element("sh"));
    return found_;
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    refuse(path_, "the compressed PLY {}; export it again", what);
  }
  const PlyElement& element(const char* name) const {
    const PlyElement* found = header_.find(name);
    if (found == nullptr) fail(fmt::format("has no element \"{}\"", name));
    if (found->has_list) fail(fmt::format("has a list in its element \"{}\"", name));
    return *found;
  }
  std::uint32_t column(const PlyElement& of, const std::string& name, PlyType type) const {
    const PlyColumn* found = find_column(of.columns, name);
    if (found == nullptr) fail(fmt::format("has no column \"{}\"", name));
    if (found->type != type) fail(fmt::format("has a column \"{}\" of an unknown type", name));
    return found->offset;
  }
  /// Older files have none for colours, which are fractions of 0 to 1 then.
  void find_bounds(const PlyElement& chunk) {
    constexpr std::array<const char*, kCompressedBounds> kBounds{
        "min_x",       "min_y",       "min_z",       "max_x",       "max_y",       "max_z",
        "min_scale_x", "min_scale_y", "min_scale_z", "max_scale_x", "max_scale_y", "max_scale_z",
        "min_r",       "min_g",       "min_b",       "max_r",       "max_g",       "max_b"};
    const bool has_colours = find_column(chunk.columns, "min_r") != nullptr;
    for (std::size_t k = 0; k < (has_colours ? kBounds.size() : 12); ++k)
      found_.bounds[k] = column(chunk, kBounds[k], PlyType::f32);
  }
  /// A byte each, channel by channel, and nothing else between them: so that a row is an array.
  void find_harmonics(const PlyElement& harmonics) {
    if (harmonics.count != found_.splats) {
      fail(fmt::format("has {} rows of spherical harmonics for {} Gaussians", harmonics.count,
                       found_.splats));
    }
    found_.sh_degree = sh_degree(harmonics.columns, path_);
    found_.harmonics = static_cast<std::uint32_t>(harmonics.row_bytes);
    found_.harmonics_at = ply_rows_at(header_, file_bytes_, path_, "sh");
    if (harmonics.columns.size() != found_.harmonics || found_.harmonics > 45)
      fail("has spherical harmonics that are not bytes, or other columns among them");
    for (std::uint32_t k = 0; k < found_.harmonics; ++k) {
      if (column(harmonics, fmt::format("f_rest_{}", k), PlyType::u8) != k)
        fail("has spherical harmonics in an unknown order");
    }
  }

  const std::string& path_;
  std::uint64_t file_bytes_;
  PlyHeader header_;
  CompressedPlyHeader found_;
};

class CompressedPly : public BatchScene {
 public:
  CompressedPly(const std::string& path, const Axes& axes);
  void decode(std::uint64_t first, std::uint64_t count, std::uint32_t lobes, SplatBatch& batch,
              const Take& take) const override;
  std::uint64_t decode_bytes() const override;

 private:
  std::unique_ptr<ReadFile> file_;
  CompressedPlyHeader header_;
};

CompressedPly::CompressedPly(const std::string& path, const Axes& axes)
    : BatchScene(axes),
      file_(open_input(path)),
      header_(CompressedHeaderReader(*file_, path).read()) {
  info_.format = "SuperSplat compressed PLY";
  info_.splats = header_.splats;
  info_.sh_degree = header_.sh_degree;
  info_.model = header_.model;
  info_.files = {path};
}

std::uint64_t CompressedPly::decode_bytes() const {
  return round_to_pages(kChunkRows * (header_.row_bytes + header_.harmonics)) +
         round_to_pages(header_.chunk_bytes);
}

void CompressedPly::decode(std::uint64_t first, std::uint64_t count, std::uint32_t lobes,
                           SplatBatch& batch, const Take& take) const {
  const std::uint64_t row_bytes = header_.row_bytes;
  const std::uint32_t stored = header_.harmonics / 3;
  const std::uint32_t harmonics = std::min(lobes, stored);
  PageVector<std::byte> rows(kChunkRows * row_bytes), bytes(kChunkRows * header_.harmonics);
  PageVector<std::byte> bounds(header_.chunk_bytes);
  // Without bounds of colours the lower ends are 0 and the upper ones 1.
  const auto bound = [&](std::size_t k) {
    return header_.bounds[k] ? value_at<float>(&bounds[*header_.bounds[k]]) : k < 15 ? 0.0F : 1.0F;
  };
  for (const std::uint64_t end = first + count; first < end;) {
    // All rows of a chunk share its bounds, so a batch ends where a chunk does. A range may begin
    // inside of one.
    const std::size_t n = std::min(end - first, kChunkRows - first % kChunkRows);
    file_->read(header_.chunks_at + first / kChunkRows * header_.chunk_bytes, bounds);
    file_->read(header_.rows_at + first * row_bytes, std::span(rows).first(n * row_bytes));
    std::array<float, kCompressedBounds> box;
    for (std::size_t k = 0; k < box.size(); ++k) box[k] = bound(k);
    for (std::size_t i = 0; i < n; ++i) {
      const auto packed = [&](std::size_t column) {
        return value_at<std::uint32_t>(&rows[i * row_bytes + header_.packed[column]]);
      };
      const auto mean = unorm_3(packed(0)), scale = unorm_3(packed(2));
      const auto q = rotation_of(packed(1));
      const std::uint32_t colour = packed(3);
      for (std::size_t k = 0; k < 3; ++k) {
        batch.mean[k][i] = between(box[k], box[3 + k], mean[k]);
        batch.sigma[k][i] = between(box[6 + k], box[9 + k], scale[k]);
        batch.colour[k][i] =
            between(box[12 + k], box[15 + k], unorm(colour, 24 - 8 * static_cast<int>(k), 8));
      }
      for (std::size_t k = 0; k < 4; ++k) batch.rotation[k][i] = q[k];
      batch.alpha[i] = unorm(colour, 0, 8);
    }
    if (harmonics > 0) {
      file_->read(header_.harmonics_at + first * header_.harmonics,
                  std::span(bytes).first(n * header_.harmonics));
      for (std::size_t i = 0; i < n; ++i) {
        for (std::size_t k = 0; k < harmonics; ++k) {
          for (std::size_t c = 0; c < 3; ++c) {
            batch.sh[3 * k + c][i] = harmonic_of(bytes[i * header_.harmonics + c * stored + k]);
          }
        }
      }
    }
    for (auto& sigma : batch.sigma) exponential(sigma, n);
    take(n);
    first += n;
  }
}

/// Has its element "vertex" one of these columns? A file that is damaged has none.
bool has_vertex_column(const ReadFile& file, const std::string& path,
                       std::initializer_list<const char*> names) {
  try {
    const PlyHeader header = read_ply_header(file, path);
    const PlyElement* vertex = header.find("vertex");
    return vertex != nullptr && std::any_of(names.begin(), names.end(), [&](const char* name) {
             return find_column(vertex->columns, name) != nullptr;
           });
  } catch (const Error& e) {
    if (e.kind() != ErrorKind::input) throw;
    return false;
  }
}

}  // namespace

bool holds_splats(const ReadFile& file, const std::string& path) {
  return has_vertex_column(file, path, {"f_dc_0", "packed_position"});
}

bool is_compressed_ply(const ReadFile& file, const std::string& path) {
  return has_vertex_column(file, path, {"packed_position"});
}

bool is_splat_column(std::string_view name) {
  constexpr std::array<std::string_view, 14> kSplatColumns{
      "x",     "y",     "z",     "opacity", "scale_0", "scale_1", "scale_2",
      "rot_0", "rot_1", "rot_2", "rot_3",   "nx",      "ny",      "nz"};
  return name.starts_with("f_dc_") || name.starts_with("f_rest_") ||
         std::find(kSplatColumns.begin(), kSplatColumns.end(), name) != kSplatColumns.end();
}

const PlyColumn* SplatPlyHeader::find(const std::string& name) const {
  return find_column(columns, name);
}

SplatPly::SplatPly(const std::string& path, const Axes& axes)
    : BatchScene(axes), file_(open_input(path)), header_(read_splat_ply_header(*file_, path)) {
  find_columns(path);
  info_.format = "3DGS PLY";
  info_.splats = header_.splats;
  info_.sh_degree = header_.sh_degree;
  info_.model = header_.model;
  info_.files = {path};
}

void SplatPly::find_columns(const std::string& path) {
  for (std::size_t c = 0; c < kNames.size(); ++c) {
    if (const PlyColumn* column = header_.find(kNames[c])) columns_[c] = *column;
  }
  // Two of three are no normal.
  if (std::any_of(columns_.begin() + kNormal, columns_.end(),
                  [](const PlyColumn& column) { return column.name.empty(); }))
    std::fill(columns_.begin() + kNormal, columns_.end(), PlyColumn{});
  // In the file all coefficients of red come first, then those of green: with degree 4 there are
  // more of them between two channels than we read.
  constexpr std::array<std::uint32_t, 5> kPerChannel{0, 3, 8, 15, 24};
  const std::uint32_t stored = kPerChannel[header_.sh_degree];
  for (std::uint32_t k = 0; k < std::min(stored, store::kMostLobes); ++k) {
    for (std::uint32_t channel = 0; channel < 3; ++channel) {
      const std::string name = fmt::format("f_rest_{}", channel * stored + k);
      const PlyColumn* column = header_.find(name);
      if (column == nullptr) {
        refuse(
            path,
            "the splat PLY has {} columns f_rest_0, f_rest_1, ..., but no \"{}\"; export it again",
            3 * stored, name);
      }
      harmonics_.push_back(*column);
    }
  }
}

// A row may have thousands of columns that nobody reads: fewer rows at once then.
std::uint64_t SplatPly::piece_rows() const {
  return std::max<std::uint64_t>(1, kReadBytes / header_.row_bytes);
}

std::uint64_t SplatPly::decode_bytes() const {
  return round_to_pages(piece_rows() * header_.row_bytes);
}

void SplatPly::decode(std::uint64_t first, std::uint64_t count, std::uint32_t lobes,
                      SplatBatch& batch, const Take& take) const {
  const std::size_t stride = header_.row_bytes;
  const std::size_t harmonics = std::min<std::size_t>(harmonics_.size(), 3 * lobes);
  PageVector<std::byte> raw(std::min(count, piece_rows()) * stride);
  for (const std::uint64_t end = first + count; first < end;) {
    const std::uint64_t rows = std::min(end - first, piece_rows());
    file_->read(header_.rows_at + first * stride, std::span(raw).first(rows * stride));
    for_batches(rows, [&](std::uint64_t begin, std::size_t n) {
      const auto load_column = [&](const PlyColumn& from, SplatBatch::Column& to) {
        kLoaders[static_cast<std::size_t>(from.type)](&raw[begin * stride + from.offset], stride, n,
                                                      to);
      };
      for (std::size_t c = 0; c < kNames.size(); ++c) {
        if (!columns_[c].name.empty()) load_column(columns_[c], column_of(batch, c));
      }
      for (std::size_t k = 0; k < harmonics; ++k) load_column(harmonics_[k], batch.sh[k]);
      for (std::size_t k = 0; k < 3; ++k) {  // a disc has no third scale: sigma stays 0
        if (!columns_[kScale + k].name.empty()) exponential(batch.sigma[k], n);
        colour_of_dc(batch.colour[k], n);
      }
      logistic(batch.alpha, n);
      take(n);
    });
    first += rows;
  }
}

std::unique_ptr<SplatScene> open_compressed_ply(const std::string& path, const Axes& axes) {
  return std::make_unique<CompressedPly>(path, axes);
}

}  // namespace pounce::io
