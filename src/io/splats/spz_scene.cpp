// SPDX-License-Identifier: Apache-2.0
//
// SPZ: the Gaussians attribute by attribute, a byte for most values. Versions 1 to 3 are one gzip
// member around header and attributes; version 4 has a plain header and a Zstandard frame for each
// attribute. The attributes of one Gaussian are spread over the whole file, so no range can be read
// while it is compressed: prepare() unpacks it into a nameless scratch file, whose size is known
// before (unpacked_bytes()), and decode() reads six pieces of that.
//
// The header announces how many Gaussians there are, and so how much scratch is taken: a few bytes
// could ask for any amount. They are compared with the most that the compression can do for a file
// of this size (kMostGzipRatio, kMostZstdRatio) when it is opened, and with what really comes out
// while it is unpacked.
//
//   offset  type  header
//        0  u32   "NGSP"
//        4  u32   version, 1 to 4
//        8  u32   Gaussians
//       12  u8    degree of harmonics, 0 to 4
//       13  u8    bits behind the point of a position
//       14  u8    flags: 1 = trained with antialiasing, 2 = has extensions
//       15  u8    version 4: streams; then u32 at 16: where their list of (packed, unpacked) u64 is
//
//   bytes per Gaussian: positions 9 (version 1: 6, halves), opacity 1, colour 3, scale 3, rotation
//   3 (from version 3: 4), harmonics 0, 9, 24, 45 or 72; all of one kind before the next
//
// No version says how its axes lie, and writers disagree, except in an extension: a record behind
// the Gaussians (in front of them in version 4). Where it is there the scene is turned; where not,
// that is an assumption which the user is told of.
//
// Unpacking costs scratch of the scene's size. To decode the attributes in step would cost none,
// but only from the start and in one thread, and the store asks for ranges from many.
#include "io/splats/spz_scene.h"

#include <fmt/format.h>

#include <cmath>

#include "core/portable_math.h"
#include "io/problems.h"
#include "io/splats/unpack.h"

namespace pounce::io {
namespace {

constexpr std::uint32_t kMagic = 0x5053474E;  // "NGSP"
constexpr std::uint16_t kGzip = 0x8B1F;
constexpr std::uint64_t kHeaderBytes = 16, kHeaderBytes4 = 32, kStreamBytes = 16;
constexpr std::uint64_t kPieceBytes = 64 << 10;
constexpr std::uint64_t kMostExtensionBytes = 64 << 10;
// What the two compressions can do at best: gzip one bit for 258 bytes; of zstd the bound that the
// format's own library sets.
constexpr std::uint64_t kMostGzipRatio = 1032, kMostZstdRatio = 1024;
constexpr unsigned kAntialiased = 1, kExtensions = 2;
constexpr std::uint32_t kCoordinateSystem = 0xADBE0003;
constexpr std::uint64_t kMostBytesPerGaussian = 65 + 27;  // degree 4

/// How x, y and z of a file lie, by the number in its extension.
constexpr std::array<const char*, 16> kSystems{"LDB", "RDB", "LUB", "RUB", "LDF", "RDF",
                                               "LUF", "RUF", "LFD", "RFD", "LFU", "RFU",
                                               "LBD", "RBD", "LBU", "RBU"};

/// Turns a system to that of PLY scenes: right, down, forward.
Axes to_ply_axes(std::string_view system) {
  // A letter names where an axis of the file points; its place among the three says which axis it
  // is.
  constexpr std::array<std::string_view, 3> kAxes{"RL", "DU", "FB"};
  Axes axes;
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t at = system.find_first_of(kAxes[i]);
    axes.from[i] = static_cast<std::uint8_t>(at);
    axes.sign[i] = system[at] == kAxes[i][0] ? 1 : -1;
  }
  return axes;
}

/// `second` after `first`.
Axes compose(const Axes& first, const Axes& second) {
  Axes axes;
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t k = second.from[i];
    axes.from[i] = first.from[k];
    axes.sign[i] = static_cast<std::int8_t>(second.sign[i] * first.sign[k]);
  }
  return axes;
}

/// Versions 1 and 2: w, x, y, z of three bytes x, y, z. Writers make w positive.
std::array<float, 4> rotation_of_bytes(const std::byte* at) {
  std::array<float, 4> q;
  for (std::size_t k = 0; k < 3; ++k) q[1 + k] = byte_at(at + k) / 127.5F - 1;
  q[0] = largest_of_four(q[1], q[2], q[3]);
  return q;
}

/// From version 3: w, x, y, z of two bits that name the largest of x, y, z, w, and the others as
/// signs and magnitudes of 9 bits.
std::array<float, 4> rotation_of_bits(std::uint32_t bits) {
  // The three that are stored are at most 1/sqrt(2), or one of them would be the largest.
  constexpr float kUnit = 0.70710678F / 511;
  std::array<float, 3> rest;
  for (std::size_t k = 0; k < 3; ++k) {
    const std::uint32_t field = bits >> (20 - 10 * k);
    rest[k] = static_cast<float>(field & 511) * ((field & 512) != 0 ? -kUnit : kUnit);
  }
  const auto [x, y, z, w] = with_largest(bits >> 30, rest);
  return {w, x, y, z};
}

/// A coordinate of 24 bits with sign, the lowest byte first.
float fixed_of(const std::byte* at, float unit) {
  // The three bytes go to the top, and the shift back down extends the sign.
  const auto byte = [&](std::size_t k) { return std::to_integer<std::uint32_t>(at[k]) << 8 * k; };
  const auto shifted = static_cast<std::int32_t>((byte(0) | byte(1) | byte(2)) << 8);
  return static_cast<float>(shifted >> 8) * unit;
}

}  // namespace

bool is_spz(const ReadFile& file) {
  if (file.size_bytes() < 4) return false;
  if (read_value<std::uint32_t>(file, 0) == kMagic) return true;
  if (read_value<std::uint16_t>(file, 0) != kGzip) return false;
  // Four bytes are inflated, whatever the file: most that begin like gzip are something else.
  try {
    std::array<std::byte, 4> start{};
    return GzipReader(file, "").read(start) == start.size() &&
           value_at<std::uint32_t>(start.data()) == kMagic;
  } catch (const Error& e) {
    if (e.kind() != ErrorKind::input) throw;
    return false;
  }
}

void SpzScene::fail(const std::string& what) const {
  refuse(name_, "{}; copy or export it again", what);
}

SpzScene::SpzScene(std::unique_ptr<ReadFile> file, const std::string& name, const Axes& axes,
                   const std::function<void()>& poll)
    : BatchScene(axes), file_(std::move(file)), name_(name), axes_(axes) {
  info_.files = {name};
  const std::uint64_t size = file_->size_bytes();
  if (size == 0) fail("the file is empty");
  is_gzip_ = size >= 2 && read_value<std::uint16_t>(*file_, 0) == kGzip;
  std::array<std::byte, kHeaderBytes> raw{};
  if (is_gzip_) {
    if (GzipReader(*file_, name_).read(raw) < raw.size()) fail("the SPZ header is truncated");
  } else {
    if (size < raw.size()) fail("the SPZ header is truncated");
    file_->read(0, raw);
  }
  read_header(raw);
  if (version_ == 4) {
    read_contents();
    return;
  }
  // Compared by dividing: what a header states may be anything, and a product could overflow.
  const std::uint64_t needed = kHeaderBytes + content_bytes();
  if (is_gzip_ ? needed / kMostGzipRatio > size : needed > size) {
    fail(fmt::format(
        "the header states {} Gaussians, {} bytes, more than the file's {} bytes can contain",
        info_.splats, needed, size));
  }
  for (std::size_t k = 0, at = kHeaderBytes; k < kBlocks; at += block_bytes(k++)) at_[k] = at;
  if (has_extensions_ && is_gzip_) {
    find_extensions(poll);
  } else if (has_extensions_) {
    PageVector<std::byte> records(std::min(kMostExtensionBytes, size - needed));
    file_->read(needed, records);
    read_extensions(records);
  } else if (!is_gzip_ && needed != size) {
    fail(fmt::format("the header states {} bytes, but the file has {}", needed, size));
  }
  assume_axes();
}

/// They are behind the Gaussians, so all of these are inflated: that a job says how a scene lies
/// before it begins, and from a cached store too, is worth it. What is cut off is told by
/// prepare().
void SpzScene::find_extensions(const std::function<void()>& poll) {
  static_assert(GzipReader::kBytes + kMostExtensionBytes <= kOpenSplatBytes);
  GzipReader reader(*file_, name_);
  PageVector<std::byte> piece(kMostExtensionBytes);
  // What comes out is thrown away: nothing is kept before the job has leased its memory and
  // scratch.
  for (std::uint64_t left = kHeaderBytes + content_bytes(); left > 0;) {
    const std::size_t got = reader.read(std::span(piece).first(std::min(left, piece.size())));
    if (got == 0) return;
    left -= got;
    poll();
  }
  read_extensions(std::span(piece).first(reader.read(piece)));
}

// Every number is checked that sizes follow from; the sizes themselves are in content_bytes().
void SpzScene::read_header(std::span<const std::byte, 16> raw) {
  if (value_at<std::uint32_t>(raw.data()) != kMagic)
    fail("does not begin with \"NGSP\", compressed or not, so it is not an SPZ");
  version_ = value_at<std::uint32_t>(&raw[4]);
  if (version_ < 1 || version_ > 4 || (version_ == 4 && is_gzip_)) {
    refuse(name_,
           "SPZ version {}{}; versions 1 to 4 are supported, 4 without gzip: convert it to one of "
           "these or to PLY",
           version_, is_gzip_ ? " in gzip" : "");
  }
  info_.splats = value_at<std::uint32_t>(&raw[8]);
  info_.sh_degree = std::to_integer<unsigned>(raw[12]);
  fraction_bits_ = std::to_integer<unsigned>(raw[13]);
  const auto flags = std::to_integer<unsigned>(raw[14]);
  has_extensions_ = (flags & kExtensions) != 0;
  info_.format = fmt::format("SPZ v{}", version_);
  if ((flags & kAntialiased) != 0) info_.model = store::SplatModel::antialiased;
  if (info_.splats == 0) fail("the SPZ holds no Gaussians");
  if (info_.splats > 0x7FFFFFFF) fail("the header states more than 2^31 - 1 Gaussians");
  if (info_.sh_degree > 4) {
    fail(fmt::format("the header states degree {} of spherical harmonics, but the highest is 4",
                     info_.sh_degree));
  }
  if (fraction_bits_ > 30)
    fail(fmt::format("the header states {} fractional bits, but positions have 24 bits",
                     fraction_bits_));
  // All sizes follow from version and degree: the file states none of them.
  constexpr std::array<std::uint64_t, 5> kHarmonicBytes{0, 9, 24, 45, 72};
  row_bytes_ = {version_ == 1 ? 6U : 9U,        1, 3, 3, version_ < 3 ? 3U : 4U,
                kHarmonicBytes[info_.sh_degree]};
}

/// Version 4: its list of streams, each checked against what the header means.
void SpzScene::read_contents() {
  const std::uint64_t size = file_->size_bytes();
  if (size < kHeaderBytes4) fail("the SPZ header is truncated");
  if (content_bytes() / kMostZstdRatio > size) {
    fail(fmt::format("the header states {} Gaussians, more than the file's {} bytes can contain",
                     info_.splats, size));
  }
  const auto count = read_value<std::uint8_t>(*file_, 15);
  const std::uint64_t list = read_value<std::uint32_t>(*file_, 16);
  const std::size_t expected = info_.sh_degree == 0 ? kBlocks - 1 : kBlocks;
  if (count != expected)
    fail(fmt::format("the header states {} streams, but there must be {}", count, expected));
  if (list < kHeaderBytes4 || list + expected * kStreamBytes > size)
    fail("its list of streams is outside of the file");
  std::uint64_t at = list + expected * kStreamBytes, unpacked = 0;
  for (std::size_t k = 0; k < expected; ++k) {
    const auto packed = read_value<std::uint64_t>(*file_, list + k * kStreamBytes);
    const auto bytes = read_value<std::uint64_t>(*file_, list + k * kStreamBytes + 8);
    if (bytes != block_bytes(k)) {
      fail(fmt::format("stream {} states {} bytes, but {} Gaussians need {}", k, bytes,
                       info_.splats, block_bytes(k)));
    }
    if (packed > size - at) fail(fmt::format("stream {} extends beyond the end of the file", k));
    streams_.push_back({at, packed});
    at_[k] = unpacked;
    at += packed;
    unpacked += bytes;
  }
  if (at != size) fail(fmt::format("{} bytes follow the last stream", size - at));
  if (has_extensions_) {
    PageVector<std::byte> records(std::min(kMostExtensionBytes, list - kHeaderBytes4));
    file_->read(kHeaderBytes4, records);
    read_extensions(records);
  }
  assume_axes();
}

std::uint64_t SpzScene::content_bytes() const {
  std::uint64_t total = 0;
  for (std::size_t k = 0; k < kBlocks; ++k) total += block_bytes(k);
  return total;
}

/// Records of a type, a length and as many bytes; nothing but the axes concerns us.
void SpzScene::read_extensions(std::span<const std::byte> records) {
  while (records.size() >= 8) {
    const auto type = value_at<std::uint32_t>(records.data());
    const std::uint64_t bytes = value_at<std::uint32_t>(&records[4]);
    records = records.subspan(8);
    // A record that is cut off is no reason to refuse a scene: it is about axes at most.
    if (bytes > records.size()) return;
    if (type == kCoordinateSystem && bytes == 4) {
      const auto system = value_at<std::uint32_t>(records.data());
      if (system < 1 || system > kSystems.size()) return;
      const char* const name = kSystems[system - 1];
      // What the file says comes first, then what the user asks for on top of it.
      set_axes(compose(to_ply_axes(name), axes_));
      info_.assumptions.push_back(fmt::format(
          "its axes are stated as {}; rotated to those of PLY scenes, RDF (right, down, forward)",
          name));
      own_axes_ = name;
    }
    records = records.subspan(bytes);
  }
}

void SpzScene::assume_axes() {
  if (!own_axes_.empty() || axes_ != Axes{}) return;  // it is said, by the file or by the user
  info_.assumptions.emplace_back(
      "SPZ does not define its axes (writers disagree): read as stored; --source-axes x,-y,-z "
      "rotates a scene that is upside down");
}

// Frames are unpacked one after the other, so the largest window counts; beside it are a piece of
// what comes out and what may follow the Gaussians.
std::uint64_t SpzScene::prepare_bytes() const {
  std::uint64_t most = is_gzip_ ? GzipReader::kBytes : 0;
  for (const Stream& stream : streams_)
    most = std::max(most, ZstdReader::bytes(*file_, stream.offset_bytes, stream.size_bytes));
  return most + kPieceBytes + kMostExtensionBytes;
}

std::uint64_t SpzScene::unpacked_bytes() const {
  return is_gzip_ || version_ == 4 ? kHeaderBytes + content_bytes() : 0;
}

void SpzScene::prepare(const ScratchFolder& folder, const std::function<void()>& poll) {
  if (!is_gzip_ && version_ < 4) return;
  scratch_ = folder.create();
  if (is_gzip_) {
    unpack_gzip(*scratch_, poll);
  } else {
    unpack_streams(*scratch_, poll);
  }
  unpacked_ = scratch_->reader();
}

void SpzScene::unpack_gzip(WriteFile& to, const std::function<void()>& poll) {
  GzipReader reader(*file_, name_);
  PageVector<std::byte> piece(kPieceBytes);
  const std::uint64_t needed = kHeaderBytes + content_bytes();
  for (std::uint64_t at = 0; at < needed;) {
    const auto part = std::span(piece).first(std::min<std::uint64_t>(piece.size(), needed - at));
    if (const std::size_t got = reader.read(part); got < part.size()) {
      fail(fmt::format("the header states {} Gaussians, {} bytes, but only {} exist", info_.splats,
                       needed, at + got));
    }
    to.append(part);
    at += part.size();
    poll();
  }
  // What follows may only be extensions: anything else means that the header and the bytes belong
  // to different files. Reading to the end also compares the checksum of the gzip member.
  PageVector<std::byte> rest(kMostExtensionBytes);
  const std::size_t got = reader.read(rest);
  if (got == rest.size() || (got > 0 && !has_extensions_))
    fail("more bytes follow its Gaussians than the header states");
}

// Each frame has to give exactly what its block needs: no more, which would shift the next one.
void SpzScene::unpack_streams(WriteFile& to, const std::function<void()>& poll) const {
  PageVector<std::byte> piece(kPieceBytes);
  for (std::size_t k = 0; k < streams_.size(); ++k) {
    ZstdReader reader(*file_, streams_[k].offset_bytes, streams_[k].size_bytes, name_);
    std::uint64_t left = block_bytes(k);
    while (const std::size_t got = reader.read(piece)) {
      if (got > left) fail(fmt::format("stream {} is longer than stated", k));
      to.append(std::span(piece).first(got));
      left -= got;
      poll();
    }
    if (left > 0) fail(fmt::format("stream {} ends {} bytes too early", k, left));
  }
}

std::uint64_t SpzScene::decode_bytes() const {
  return round_to_pages(kPieceRows * kMostBytesPerGaussian);
}

void SpzScene::decode(std::uint64_t first, std::uint64_t count, std::uint32_t lobes,
                      SplatBatch& batch, const Take& take) const {
  // An SPZ that is neither gzip nor version 4 is read where it is.
  const ReadFile& file = unpacked_ != nullptr ? *unpacked_ : *file_;
  const std::uint64_t most = std::min(count, kPieceRows);
  PageVector<std::byte> raw(most * kMostBytesPerGaussian);
  const std::size_t harmonics = std::min<std::uint64_t>(3 * lobes, row_bytes_[kHarmonics]);
  const float unit = std::ldexp(1.0F, -static_cast<int>(fraction_bits_));
  for (const std::uint64_t end = first + count; first < end;) {
    const std::uint64_t rows = std::min(end - first, kPieceRows);
    // One read per attribute and piece: its rows are together in the file.
    std::array<const std::byte*, kBlocks> blocks{};
    for (std::size_t k = 0, at = 0; k < (harmonics > 0 ? kBlocks : kBlocks - 1); ++k) {
      const auto part = std::span(raw).subspan(at, rows * row_bytes_[k]);
      file.read(at_[k] + first * row_bytes_[k], part);
      blocks[k] = part.data();
      at += part.size();
    }
    for_batches(rows, [&](std::uint64_t begin, std::size_t n) {
      for (std::size_t i = 0; i < n; ++i) {
        const auto row = [&](Block block) {
          return blocks[block] + (begin + i) * row_bytes_[block];
        };
        for (std::size_t k = 0; k < 3; ++k) {
          const std::byte* const p = row(kPositions);
          // The constants are the format's: harmonics of degree 0 in steps of 0.15 / 255,
          // logarithms of sizes in sixteenths from -10.
          batch.mean[k][i] = version_ == 1 ? half_to_float(value_at<std::uint16_t>(p + 2 * k))
                                           : fixed_of(p + 3 * k, unit);
          batch.colour[k][i] = (byte_at(row(kColours) + k) / 255 - 0.5F) / 0.15F;
          batch.sigma[k][i] = byte_at(row(kScales) + k) / 16 - 10;
        }
        batch.alpha[i] = byte_at(row(kAlphas)) / 255;
        const auto q = version_ < 3 ? rotation_of_bytes(row(kRotations))
                                    : rotation_of_bits(value_at<std::uint32_t>(row(kRotations)));
        for (std::size_t k = 0; k < 4; ++k) batch.rotation[k][i] = q[k];
        for (std::size_t k = 0; k < harmonics; ++k)
          batch.sh[k][i] = (byte_at(row(kHarmonics) + k) - 128) / 128;
      }
      for (std::size_t k = 0; k < 3; ++k) {
        exponential(batch.sigma[k], n);
        colour_of_dc(batch.colour[k], n);
      }
      take(n);
    });
    first += rows;
  }
}

}  // namespace pounce::io
