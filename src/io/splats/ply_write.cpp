// SPDX-License-Identifier: Apache-2.0
#include "io/splats/ply_write.h"

#include <fmt/format.h>

#include <bit>
#include <limits>

namespace pounce::io {
namespace {

static_assert(std::endian::native == std::endian::little);

/// The header of a file of so many rows; as long as that of any other number.
std::string header(std::uint64_t rows) {
  const std::string count = std::to_string(rows);
  const std::string padding(std::numeric_limits<std::uint64_t>::digits10 + 1 - count.size(), ' ');
  std::string text = fmt::format(
      "ply\nformat binary_little_endian 1.0\ncomment pounce gaussians{}\nelement vertex {}\n",
      padding, count);
  for (const char* name : {"x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2", "opacity",
                           "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"}) {
    text += fmt::format("property float {}\n", name);
  }
  return text + "end_header\n";
}

}  // namespace

SplatPlyWriter::SplatPlyWriter(const std::string& path) : file_(path) { write_header(); }

void SplatPlyWriter::write_header() {
  const std::string text = header(rows_);
  std::fwrite(text.data(), 1, text.size(), file_.stream());
}

void SplatPlyWriter::write(std::span<const SplatPlyRow> rows) {
  std::fwrite(rows.data(), sizeof(SplatPlyRow), rows.size(), file_.stream());
  file_.check();  // a full disk ends the job now, not after the last row
  rows_ += rows.size();
}

void SplatPlyWriter::commit() {
  if (std::fseek(file_.stream(), 0, SEEK_SET) != 0) file_.fail("its header cannot be finished");
  write_header();
  file_.commit();
}

}  // namespace pounce::io
