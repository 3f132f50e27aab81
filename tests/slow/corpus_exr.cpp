// SPDX-License-Identifier: Apache-2.0
#include "corpus_exr.h"

#include <fmt/format.h>

#include <array>

namespace pounce::test::corpus {
namespace {

struct Coding {
  const char* name;
  Imf::Compression compression;
};
constexpr std::array<Coding, 10> kCodings{{{"none", Imf::NO_COMPRESSION},
                                           {"rle", Imf::RLE_COMPRESSION},
                                           {"zips", Imf::ZIPS_COMPRESSION},
                                           {"zip", Imf::ZIP_COMPRESSION},
                                           {"piz", Imf::PIZ_COMPRESSION},
                                           {"pxr24", Imf::PXR24_COMPRESSION},
                                           {"b44", Imf::B44_COMPRESSION},
                                           {"b44a", Imf::B44A_COMPRESSION},
                                           {"dwaa", Imf::DWAA_COMPRESSION},
                                           {"dwab", Imf::DWAB_COMPRESSION}}};

Exr exr_of(const std::vector<ExrChannel>& channels, const std::vector<std::string>& wanted,
           bool has_alpha = false) {
  Exr exr;
  exr.channels = channels;
  exr.wanted = wanted;
  exr.has_alpha = has_alpha;
  return exr;
}

struct Kind {
  const char* name;
  Exr exr;
};

const std::vector<Kind>& kinds() {
  constexpr auto kHalf = Imf::HALF, kFloat = Imf::FLOAT;
  static const std::vector<Kind> all{
      {"rgba-half", usual_exr()},
      {"rgb-float", exr_of({{"R", kFloat}, {"G", kFloat}, {"B", kFloat}}, {"R", "G", "B"})},
      {"grey-half", exr_of({{"Y"}}, {"Y"})},
      {"grey-alpha-float", exr_of({{"Y", kFloat}, {"A", kFloat}}, {"Y", "A"}, true)},
      {"mixed", exr_of({{"R", kHalf}, {"G", kHalf}, {"B", kFloat}, {"A", kHalf}},
                       {"R", "G", "B", "A"}, true)},
      {"rgb-half-z-float",
       exr_of({{"R"}, {"G"}, {"B"}, {"A"}, {"Z", kFloat}}, {"R", "G", "B", "A"}, true)}};
  return all;
}

void add_compressions(Entries& entries) {
  for (const Kind& kind : kinds()) {
    for (const Coding& coding : kCodings) {
      Exr exr = kind.exr;
      exr.compression = coding.compression;
      add(entries, fmt::format("{}-{}", kind.name, coding.name), exr);
      exr.tile_width = 16;
      exr.tile_height = 24;
      add(entries, fmt::format("{}-{}-tiles", kind.name, coding.name), exr);
    }
  }
  // More than one block of dwab.
  for (const Coding& coding : kCodings) {
    Exr exr = usual_exr();
    exr.compression = coding.compression;
    exr.width = 70;
    exr.height = 300;
    add(entries, fmt::format("high-{}", coding.name), exr);
    exr.order = Imf::DECREASING_Y;
    add(entries, fmt::format("high-{}-upwards", coding.name), exr);
  }
}

void add_tilings(Entries& entries) {
  struct Order {
    const char* name;
    Imf::LineOrder order;
  };
  for (const Order& order : {Order{"down", Imf::INCREASING_Y}, Order{"up", Imf::DECREASING_Y},
                             Order{"random", Imf::RANDOM_Y}}) {
    for (const std::uint32_t tile : {8U, 32U, 100U}) {
      Exr exr = usual_exr();
      exr.order = order.order;
      exr.tile_width = tile;
      exr.tile_height = tile / 2;
      exr.width = 75;
      exr.height = 61;
      add(entries, fmt::format("tiles-{}-{}", tile, order.name), exr);
    }
  }
  for (const Imf::LevelMode levels : {Imf::MIPMAP_LEVELS, Imf::RIPMAP_LEVELS}) {
    for (const Imf::LevelRoundingMode rounding : {Imf::ROUND_DOWN, Imf::ROUND_UP}) {
      for (const Kind& kind : {kinds()[0], kinds()[1]}) {
        Exr exr = kind.exr;
        exr.levels = levels;
        exr.rounding = rounding;
        exr.tile_width = exr.tile_height = 16;
        add(entries,
            fmt::format("{}-{}-{}", levels == Imf::MIPMAP_LEVELS ? "mip" : "rip",
                        rounding == Imf::ROUND_UP ? "up" : "down", kind.name),
            exr);
      }
    }
  }
}

void add_sizes(Entries& entries) {
  struct Size {
    std::uint32_t width, height;
  };
  for (const Size& size : {Size{1, 1}, Size{7, 5}, Size{513, 3}}) {
    for (const Kind& kind : {kinds()[0], kinds()[1]}) {
      for (const Coding& coding : {kCodings[3], kCodings[4]}) {
        Exr exr = kind.exr;
        exr.width = size.width;
        exr.height = size.height;
        exr.compression = coding.compression;
        add(entries, fmt::format("{}x{}-{}-{}", size.width, size.height, kind.name, coding.name),
            exr);
      }
    }
  }
}

void add_windows(Entries& entries) {
  Exr exr = usual_exr();
  for (const int at : {-5, 100}) {
    exr.left = at;
    exr.top = at * 2;
    exr.tile_width = exr.tile_height = 0;
    add(entries, fmt::format("window-at-{}", at), exr);
    exr.tile_width = exr.tile_height = 16;
    add(entries, fmt::format("window-at-{}-tiles", at), exr);
  }
  exr = usual_exr();
  exr.display = Imath::Box2i({-3, -3}, {50, 50});
  add(entries, "window-smaller", exr);
  exr.display = Imath::Box2i({3, 4}, {20, 20});
  add(entries, "window-larger", exr);
  exr.display = Imath::Box2i({10, 0}, {46, 28});
  add(entries, "window-beside", exr);
}

void add_names(Entries& entries) {
  constexpr auto kFloat = Imf::FLOAT;
  const auto one = [&](const char* name, const Exr& exr) {
    add(entries, std::string("names-") + name, exr);
  };
  one("words", exr_of({{"red"}, {"Green"}, {"BLUE"}}, {"red", "Green", "BLUE"}));
  one("one", exr_of({{"disp", kFloat}}, {"disp"}));
  one("z", exr_of({{"Z", kFloat}}, {"Z"}));
  one("alpha", exr_of({{"A"}}, {"A"}));
  one("xyz", exr_of({{"X", kFloat}, {"Y", kFloat}, {"Z", kFloat}}, {"X", "Y", "Z"}));
  one("uv", exr_of({{"U", kFloat}, {"V", kFloat}}, {"U", "V"}));
  one("layer", exr_of({{"diffuse.R"}, {"diffuse.G"}, {"diffuse.B"}},
                      {"diffuse.R", "diffuse.G", "diffuse.B"}));
  Exr many = exr_of({{"a"}, {"b"}, {"c"}, {"d"}, {"e"}}, {});
  many.no_rule = true;
  one("five", many);
  Exr whole = exr_of({{"R", Imf::UINT}, {"G", Imf::UINT}, {"B", Imf::UINT}}, {});
  whole.no_rule = true;
  one("uint", whole);
  one("rgb-and-uint-id",
      exr_of({{"R"}, {"G"}, {"B"}, {"A"}, {"id", Imf::UINT}}, {"R", "G", "B", "A"}, true));
  Exr coarse = exr_of({{"Y"}, {"RY", Imf::HALF, 2}, {"BY", Imf::HALF, 2}}, {});
  coarse.no_rule = true;
  coarse.width = 36;
  coarse.height = 28;
  one("subsampled", coarse);
}

}  // namespace

void add_exr(Entries& entries) {
  add_compressions(entries);
  add_tilings(entries);
  add_sizes(entries);
  add_windows(entries);
  add_names(entries);
  for (const Kind& kind : {kinds()[0], kinds()[1]}) {
    Exr exr = kind.exr;
    exr.odd_values = true;
    add(entries, fmt::format("odd-values-{}", kind.name), exr);
    exr.odd_values = false;
    exr.attributes = true;
    add(entries, fmt::format("attributes-{}", kind.name), exr);
  }
  add_exr_parts(entries);
}

}  // namespace pounce::test::corpus
