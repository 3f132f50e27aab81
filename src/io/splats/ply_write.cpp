// SPDX-License-Identifier: Apache-2.0
#include "io/splats/ply_write.h"

#include <fmt/format.h>

#include <cstring>
#include <limits>

#include "core/portable_math.h"

namespace pounce::io {
namespace {

/// The header of a file of so many rows; as long as that of any other number.
std::string header(std::uint64_t rows, const SplatFileFacts& facts) {
  const std::string count = std::to_string(rows);
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

}  // namespace

SplatPlyWriter::SplatPlyWriter(const std::string& path, const SplatFileFacts& facts)
    : SplatWriter(path, facts, SplatOutput::ply, nullptr) {
  if (facts.is_linear) {
    refuse("these colours are linear light, which PLY cannot say; write a .glb, which can");
  }
  put_header();
}

void SplatPlyWriter::put_header() {
  const std::string text = header(rows_, facts_);
  put(std::as_bytes(std::span(text)));
}

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
    for (std::size_t c = 0; c < 3; ++c) {  // channel by channel
      for (std::size_t k = 0; k < lobes; ++k) add(half_to_float(rows.sh[3 * (i * lobes + k) + c]));
    }
    add(logit(s.alpha));
    for (const float v : {s.sigma.x, s.sigma.y, s.sigma.z}) add(log_sigma(v));
    for (const float v : s.rotation) add(v);
  }
}

void SplatPlyWriter::commit(const std::function<void()>&) {
  if (std::fseek(file_.stream(), 0, SEEK_SET) != 0) file_.fail("its header cannot be finished");
  put_header();
  file_.commit();
}

}  // namespace pounce::io
