// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <tiffio.h>

#include "corpus.h"

namespace pounce::test::corpus {

struct Tiff {
  std::uint32_t width = 37, height = 29;
  std::uint16_t photometric = PHOTOMETRIC_MINISBLACK;
  std::uint16_t bits = 8, format = SAMPLEFORMAT_UINT, samples = 1;
  std::vector<std::uint16_t> extra = {};  ///< what the last samples are; empty: not said
  bool planes = false;
  std::uint32_t rows = 8;                         ///< per strip
  std::uint32_t tile_width = 0, tile_height = 0;  ///< 0: strips
  std::uint16_t compression = COMPRESSION_NONE, predictor = PREDICTOR_NONE;
  const char* mode = "w";
  std::uint16_t orientation = 0, fill_order = 0;
  std::uint16_t subsampling = 0;          ///< of YCbCr
  int pages = 1, levels = 1, inside = 0;  ///< images after the first, smaller ones, SubIFDs
  bool profile = false, any_palette = false;
};

/// Writes it as `file`. Kinds that no rule tells how to read have nothing expected of them.
void add(Entries& entries, const std::string& name, const Tiff& tiff);

}  // namespace pounce::test::corpus
