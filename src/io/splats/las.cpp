// SPDX-License-Identifier: Apache-2.0
//
// LAS, the format of surveys (ASPRS, LAS Specification 1.4 R15; 1.2 and 1.3 are the same with a
// shorter header). Little endian; offsets in bytes:
//
//        0  "LASF"              94  u16  size of the header        131  f64 x 3  scale
//       24  u8  major version   96  u32  where points begin        155  f64 x 3  offset
//       25  u8  minor version  104  u8   point format; +128: LAZ   247  u64      points (1.4)
//                              105  u16  bytes of a point
//                              107  u32  points (up to 1.3, and in 1.4 where they fit)
//
// A point begins with its place, three i32, x = scale * stored + offset. Where its colours are,
// three u16, depends on its format; so do its flags. The header's box is not believed.
//
// Colours should use all of 16 bits. Many programs write those of 8 bits as they are, so what has
// none above 255 in a sample is taken for such.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>

#include "core/input_file.h"
#include "io/problems.h"
#include "io/splats/point_scene.h"

namespace pounce::io {
namespace {

constexpr std::uint64_t kLeastHeader = 227, kHeaderOf14 = 375;
constexpr std::uint8_t kCompressed = 0xC0;  // LAZ marks the format by its upper bits

struct PointFormat {
  std::uint32_t bytes = 0, colours = 0;
  bool is_extended = false;  ///< flags and classes as from format 6 on
};

/// Null: none that has colours.
const PointFormat* coloured_format(unsigned number) {
  static constexpr PointFormat k2{26, 20, false}, k3{34, 28, false}, k5{63, 28, false},
      k7{36, 30, true}, k8{38, 30, true}, k10{67, 30, true};
  switch (number) {
    case 2:
      return &k2;
    case 3:
      return &k3;
    case 5:
      return &k5;
    case 7:
      return &k7;
    case 8:
      return &k8;
    case 10:
      return &k10;
    default:
      return nullptr;
  }
}

constexpr unsigned kLowNoise = 7, kHighNoise = 18;

/// Up to format 5 a byte has the class, and above it synthetic, key point, withheld.
bool is_withheld(const std::byte* row) {
  const auto b = std::to_integer<unsigned>(row[15]);
  return (b & 0x80) != 0 || (b & 0x1F) == kLowNoise;
}
/// From 6 on flags and class are bytes of their own.
bool is_withheld_extended(const std::byte* row) {
  const auto flags = std::to_integer<unsigned>(row[15]), kind = std::to_integer<unsigned>(row[16]);
  return (flags & 4) != 0 || kind == kLowNoise || kind == kHighNoise;
}

class Las : public PointScene {
 public:
  Las(const std::string& path, const Axes& axes) : PointScene(path, axes) {
    auto file = open_input(path);
    const std::uint64_t size = file->size_bytes();
    if (!is_las(*file)) refuse(path, "does not begin like a LAS file (\"LASF\"); export it again");
    if (size < kLeastHeader) fail(fmt::format("its header ends at byte {}", size));
    std::array<std::byte, kHeaderOf14> head{};
    file->read(0, std::span(head).first(std::min<std::uint64_t>(size, head.size())));
    const auto major = std::to_integer<unsigned>(head[24]);
    const auto minor = std::to_integer<unsigned>(head[25]);
    if (major != 1 || minor < 2 || minor > 4)
      refuse(path, "LAS version {}.{}; versions 1.2 to 1.4 are supported, convert it", major,
             minor);
    const auto stated = std::to_integer<std::uint8_t>(head[104]);
    if ((stated & kCompressed) != 0)
      refuse(path, "a compressed LAS (LAZ); unpack it, for example with laszip or pdal translate");
    const PointFormat* const format = coloured_format(stated);
    if (format == nullptr) {
      refuse(
          path,
          "its points have no colours (point format {}); export it with RGB (format 2, 3, 5, 7, 8 "
          "or 10)",
          stated);
    }
    PointRows rows;
    rows.at = value_at<std::uint32_t>(&head[96]);
    rows.stride = value_at<std::uint16_t>(&head[105]);
    rows.count = value_at<std::uint32_t>(&head[107]);
    if (minor == 4 && size >= kHeaderOf14)
      rows.count = std::max(rows.count, value_at<std::uint64_t>(&head[247]));
    if (rows.stride < format->bytes) {
      fail(fmt::format("its points have {} bytes, format {} needs {}", rows.stride, stated,
                       format->bytes));
    }
    if (rows.count == 0) fail("it holds no points");
    if (rows.at < kLeastHeader || rows.at > size || rows.count > (size - rows.at) / rows.stride) {
      refuse(path,
             "truncated: its header states {} points of {} bytes, but the file has {} bytes; "
             "copy or export it again",
             rows.count, rows.stride, size);
    }
    for (std::uint32_t k = 0; k < 3; ++k) {
      const auto scale = value_at<double>(&head[131 + 8 * k]);
      const auto offset = value_at<double>(&head[155 + 8 * k]);
      if (!std::isfinite(scale) || !std::isfinite(offset) || scale == 0)
        fail("its scale or offset is no number");
      rows.columns[k] = {PlyType::i32, 4 * k, scale, offset};
      rows.columns[3 + k] = {PlyType::u16, format->colours + 2 * k, fraction_of(PlyType::u16), 0.0};
    }
    rows.is_withheld = format->is_extended ? is_withheld_extended : is_withheld;
    info_.format = fmt::format("LAS 1.{}, point format {}", minor, stated);
    info_.splats = rows.count;
    set_rows(std::move(file), rows);
    look();
  }

  std::uint64_t unpacked_bytes() const override { return 0; }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    refuse(path_, "a damaged LAS: {}; export it again", what);
  }

  /// How colours are stored, and where the cloud is.
  void look() {
    double most = 0;
    for_sample([&](const std::byte* row) {
      const auto at = [&](std::size_t v) { return value(*rows_.columns[v], row); };
      most = std::max({most, at(3), at(4), at(5)});
    });
    if (most * 65535 <= 255.5) {
      for (std::size_t v = 3; v < 6; ++v) rows_.columns[v]->scale = fraction_of(PlyType::u8);
      info_.assumptions.push_back(path_ + ": no colour is above 255; they are taken for 8 bits");
    }
    set_origin(middle_box());
  }
};

}  // namespace

bool is_las(const ReadFile& file) {
  if (file.size_bytes() < 4) return false;
  const auto mark = read_value<std::uint32_t>(file, 0);
  return mark == 0x4653414C;  // "LASF"
}

std::unique_ptr<SplatScene> open_las(const std::string& path, const Axes& axes) {
  return std::make_unique<Las>(path, axes);
}

}  // namespace pounce::io
