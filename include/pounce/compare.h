// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "pounce/error.h"
#include "pounce/export.h"
#include "pounce/options.h"

namespace pounce {

/// How alike two images are over a mask. Samples are compared as stored, scaled to 0..1 for integer
/// images; only the colour channels both images have (an alpha that serves as mask is not
/// compared).
struct Comparison {
  double similarity = 0;     ///< 1 - mean absolute error
  double psnr_db = 0;        ///< 10 log10(1 / mean squared error); +infinity when equal
  double largest_error = 0;  ///< largest absolute difference of one sample
  std::uint32_t largest_x = 0, largest_y = 0;  ///< texel where it is
  std::uint64_t texels = 0;                    ///< compared
  int channels = 0;                            ///< compared per texel
};

/// Compares image files of one size. The mask is the image `mask_path` (non-zero first channel =
/// compare), else B's alpha if it has one, else everything. Throws Error(input) for unreadable
/// files, different sizes, an empty mask. Reads in strips: memory does not grow with the height.
/// `trust`: as in TransferOptions.
POUNCE_API Comparison compare(const std::string& a_path, const std::string& b_path,
                              const std::string& mask_path = {}, const ImageTrust& trust = {});

}  // namespace pounce
