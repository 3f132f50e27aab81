// SPDX-License-Identifier: Apache-2.0
//
// Where sixteen texels lie in a view, and what its tiles show there. Included inside
// POUNCE_ISA_NAMESPACE, after lanes.inl.

inline void add_to(std::int32_t (&sums)[kLanes], const Ints& value) {
  store(sums, load(sums) + value);
}

/// The tiles from the least to the largest of the lanes that count, both ways: four bytes of each
/// lane, of which the least of all lanes are found at once. The largest are counted from above.
inline TileRange tiles_of(const Ints& x, const Ints& y, const Ints& counts) {
  using Bytes = unsigned char __attribute__((vector_size(4 * kWidth)));
  constexpr std::int32_t kFromAbove = static_cast<std::int32_t>(0xFF00FF00);
  const Ints both = x | each([](IntRegister tile) { return tile << 16; }, y);
  const Ints ends =
      select(counts, each([](IntRegister t) { return t - (t << 8) + kFromAbove; }, both), all(-1));
  const auto least = [](Bytes a, Bytes b) { return a < b ? a : b; };
  Bytes all_ends = reinterpret_cast<Bytes>(ends.part[0]);
  for (int p = 1; p < kParts; ++p)
    all_ends = least(all_ends, reinterpret_cast<Bytes>(ends.part[p]));
  const auto fold = [&]<int step, int... i>(std::integer_sequence<int, i...>) {
    const auto lanes = reinterpret_cast<IntRegister>(all_ends);  // with those `step` beside them
    all_ends = least(all_ends, reinterpret_cast<Bytes>(__builtin_shufflevector(
                                   lanes, lanes, ((i ^ step) % kWidth)...)));
  };
  constexpr auto kEvery = std::make_integer_sequence<int, kWidth>();
  fold.template operator()<8>(kEvery);  // nothing where a register has no more than eight
  fold.template operator()<4>(kEvery);
  fold.template operator()<2>(kEvery);
  fold.template operator()<1>(kEvery);
  const auto end = [&](int byte) { return static_cast<std::uint16_t>(all_ends[byte]); };
  const auto from_above = [&](int byte) { return static_cast<std::uint16_t>(0xFF - end(byte)); };
  return {end(0), from_above(1), end(2), from_above(3)};
}

void place(const PlaceFrame& f, std::span<const surface::TexelPacket> packets,
           std::span<PlacePacket> places, std::span<SightPacket> sights) {
  std::size_t first = 0;  // of the packets that are alike
  for (std::size_t p = 0; p < packets.size(); ++p) {
    const surface::TexelPacket& packet = packets[p];
    PlacePacket& out = places[p];
    const Floats cosine =
        all(0.0F) - (load(packet.nx) * f.forward.x + load(packet.ny) * f.forward.y +
                     load(packet.nz) * f.forward.z);
    const Ints faces = cosine >= kLeastCosine;
    const Ints weight = select(faces, to_int(cosine * cosine * kWeightSteps + 0.5F), all(0));
    store(out.cosine, cosine);
    store(out.weight, weight);
    out.tiles = {};
    if (any(faces)) {
      add_to(sights[p].facing, weight);
      const Floats dx = load(packet.px) - f.middle.x, dy = load(packet.py) - f.middle.y,
                   dz = load(packet.pz) - f.middle.z;
      const auto along = [&](Vec3f axis) { return dx * axis.x + dy * axis.y + dz * axis.z; };
      const Floats x = along(f.right) + f.middle_pixel, y = along(f.down) + f.middle_pixel;
      store(out.x, x);
      store(out.y, y);
      store(out.depth, along(f.forward) * f.per_step + f.middle_depth);
      // All of a target lies inside a view, so no place is negative.
      const auto tile = [&](const Floats& at) {
        const Ints whole = to_int(at * (1.0F / kTileEdge));
        return select(whole < f.last_tile, whole, all(f.last_tile));
      };
      out.tiles = tiles_of(tile(x), tile(y), faces);
    }
    if (p == 0 || !(out.tiles == places[first].tiles)) {
      first = p;
      out.alike = 0;
    }
    ++places[first].alike;
  }
}

/// Two samples of 16 bits each of sixteen lanes.
inline Floats low(const Ints& pairs) { return to_float(pairs & all(0xFFFF)); }
inline Floats high(const Ints& pairs) {
  using Unsigned = std::uint32_t __attribute__((vector_size(4 * kWidth)));
  const auto upper = [](IntRegister x) { return (IntRegister)((Unsigned)x >> 16); };
  return to_float(each(upper, pairs));
}

/// What a row of the tile has for each of sixteen lanes: two pixels side by side, as they lie in
/// memory, in pairs of samples.
struct RowLanes {
  static constexpr int kFirst = 4;  ///< pairs that are stored together; one more beside them
  static_assert(2 * (kFirst + 1) == 2 * kSceneSamples);
  alignas(64) std::uint32_t first[kLanes][kFirst];
  alignas(64) std::int32_t last[kLanes];

  void set(int lane, const std::uint16_t* samples) {
    std::memcpy(first[lane], samples, sizeof first[lane]);
    std::memcpy(&last[lane], samples + 2 * kFirst, sizeof last[lane]);
  }
  /// One of the first pairs of each lane.
  template <int pair, int... i>
  Ints pairs(std::integer_sequence<int, i...>) const {
    Ints out;
    for (int p = 0; p < kParts; ++p) {
      IntRegister quarters[4];
      std::memcpy(quarters, first + p * kWidth, sizeof quarters);
      const auto half = [](IntRegister a, IntRegister b) {
        return __builtin_shufflevector(a, b, (kFirst * i + pair) % (2 * kWidth)...);
      };
      out.part[p] =
          __builtin_shufflevector(half(quarters[0], quarters[1]), half(quarters[2], quarters[3]),
                                  (i < kWidth / 2 ? i : i + kWidth / 2)...);
    }
    return out;
  }
  template <int pair>
  Ints pairs() const {
    return pairs<pair>(std::make_integer_sequence<int, kWidth>());
  }
};

/// The nearest whole number of one that is not negative.
inline Ints rounded(const Floats& value) { return to_int(value + 0.5F); }

inline Floats at_most(const Floats& a, float most) { return select(a < most, a, all(most)); }

/// Sixteen texels in a tile.
struct InTile {
  Ints here;                               ///< those that lie in it and face the eye
  Floats x, y;                             ///< from the first of the four pixels around
  alignas(64) std::int32_t first[kLanes];  ///< that pixel; of the others the tile's first

  InTile(const ViewTiles& tiles, const PlacePacket& place) {
    const Floats at_x = load(place.x), at_y = load(place.y);
    const Ints low_x = to_int(at_x), low_y = to_int(at_y);
    const Ints in_x = low_x - static_cast<std::int32_t>(tiles.tile_x * kTileEdge),
               in_y = low_y - static_cast<std::int32_t>(tiles.tile_y * kTileEdge);
    here = (load(place.weight) > 0) & (in_x >= 0) & (in_x < kTileEdge) & (in_y >= 0) &
           (in_y < kTileEdge);
    x = at_x - to_float(low_x);
    y = at_y - to_float(low_y);
    store(first, select(here, (in_y + kApron) * kStoredEdge + in_x + kApron, all(0)));
  }
};

/// Is the target's surface, in some of the four pixels, about where the texel is?
inline Ints on_target(const SightLimits& limits, const ViewTiles& tiles, const Floats& depth,
                      const InTile& in) {
  Ints out = all(0);
  // All of them are written before the first is read: what was just written lane by lane is slow to
  // read as a whole.
  alignas(64) std::int32_t samples[2][kLanes];
  for (int lane = 0; lane < kLanes; ++lane) {
    for (int row = 0; row < 2; ++row)
      std::memcpy(&samples[row][lane], tiles.target + in.first[lane] + row * kStoredEdge,
                  sizeof samples[row][lane]);
  }
  for (const auto& row : samples) {
    for (const Floats& sample : {low(load(row)), high(load(row))}) {
      out = out | ((sample < static_cast<float>(kNoDepth)) &
                   (absolute(sample - depth) <= limits.on_target));
    }
  }
  return out;
}

void gather_packet(const SightLimits& limits, const ViewTiles& tiles, const PlacePacket& place,
                   SightPacket& sight) {
  const InTile in(tiles, place);
  if (!any(in.here)) return;
  const Floats depth = load(place.depth);
  const Ints weight = load(place.weight);
  Ints here = in.here & on_target(limits, tiles, depth, in);
  if (!any(here)) return;
  const Floats gx = 1.0F - in.x, gy = 1.0F - in.y;
  const Floats shares[4] = {gx * gy, in.x * gy, gx * in.y, in.x * in.y};

  // Colours are those of what is there: each counts by its alpha.
  Floats colours[3] = {all(0.0F), all(0.0F), all(0.0F)}, alpha = all(0.0F);
  constexpr float kFarBehind = -1e30F;
  Floats before = all(kFarBehind), depths = all(0.0F), of_depths = all(0.0F);
  RowLanes rows[2];
  for (int lane = 0; lane < kLanes; ++lane) {
    for (int row = 0; row < 2; ++row)
      rows[row].set(lane,
                    tiles.scene + std::size_t{kSceneSamples} *
                                      static_cast<std::size_t>(in.first[lane] + row * kStoredEdge));
  }
  const auto add_pixel = [&](const Floats& part, const Floats(&own)[5]) {
    const Floats share = part * own[3];
    for (int c = 0; c < 3; ++c) colours[c] = colours[c] + share * own[c];
    alpha = alpha + share;
    const Floats scene = own[4], nearer = depth - scene;
    const Ints is_there = scene < static_cast<float>(kNoDepth);
    const Floats there = select(is_there, nearer, all(kFarBehind));
    before = select(before < there, there, before);
    depths = depths + select(is_there, part * scene, all(0.0F));
    of_depths = of_depths + select(is_there, part, all(0.0F));
  };
  for (int row = 0; row < 2; ++row) {
    const RowLanes& own = rows[row];
    const Ints pairs[5] = {own.pairs<0>(), own.pairs<1>(), own.pairs<2>(), own.pairs<3>(),
                           load(own.last)};
    add_pixel(shares[2 * row],
              {low(pairs[0]), high(pairs[0]), low(pairs[1]), high(pairs[1]), low(pairs[2])});
    add_pixel(shares[2 * row + 1],
              {high(pairs[2]), low(pairs[3]), high(pairs[3]), low(pairs[4]), high(pairs[4])});
  }
  here = here & (alpha >= kLeastSeen * kAlphaSteps);
  if (!any(here)) return;

  const Floats per_alpha = 1.0F / select(here, alpha, all(1.0F));
  for (Floats& colour : colours) colour = colour * per_alpha;
  const Ints has_depth = of_depths > 0.0F;
  const Floats away = select(has_depth, depth - depths / of_depths, all(0.0F)),
               outside = away * load(place.cosine);
  const Ints whole_outside = to_int(outside + select(outside < 0.0F, all(-0.5F), all(0.5F)));
  const auto add = [&](SightPacket::Sums& sums, const Ints& counts) {
    const Ints w = select(counts, weight, all(0));
    add_to(sums.weight, w);
    for (int c = 0; c < 3; ++c) add_to(sums.colour[c], w * rounded(colours[c]));
    add_to(sums.alpha, w * rounded(at_most(alpha, kAlphaSteps)));
    add_to(sums.away, w * whole_outside);
    if (!limits.tells_confidence) return;
    add_to(sums.off, w * rounded(at_most(absolute(away), 65534.0F)));
    const Ints luma = rounded(
        at_most((colours[0] + 2.0F * colours[1] + colours[2]) * (kLumaSteps / (4 * kColourSteps)),
                kLumaSteps));
    add_to(sums.luma, w * luma);
    add_to(sums.luma_squares, w * luma * luma);
  };
  const Ints hides = here & (before > limits.hidden);
  add(sight.clear, select(hides, all(0), here));
  if (any(hides)) add(sight.hidden, hides);
}

inline bool meets(const TileRange& range, const ViewTiles& tiles) {
  return !range.empty() && tiles.tile_x >= range.x0 && tiles.tile_x <= range.x1 &&
         tiles.tile_y >= range.y0 && tiles.tile_y <= range.y1;
}

/// Calls `look` for each packet that may have texels in the tile until it says that it is enough.
template <class Look>
bool any_met(const ViewTiles& tiles, std::span<const PlacePacket> places, const Look& look) {
  for (std::size_t p = 0; p < places.size();) {
    const std::size_t end = p + places[p].alike;
    if (!meets(places[p].tiles, tiles)) {
      p = end;
      continue;
    }
    for (; p < end; ++p) {
      if (look(p)) return true;
    }
  }
  return false;
}

bool sees(const SightLimits& limits, const ViewTiles& tiles, std::span<const PlacePacket> places) {
  return any_met(tiles, places, [&](std::size_t p) {
    const InTile in(tiles, places[p]);
    return any(in.here & on_target(limits, tiles, load(places[p].depth), in));
  });
}

void gather(const SightLimits& limits, const ViewTiles& tiles, std::span<const PlacePacket> places,
            std::span<SightPacket> sights) {
  any_met(tiles, places, [&](std::size_t p) {
    gather_packet(limits, tiles, places[p], sights[p]);
    return false;
  });
}
