// SPDX-License-Identifier: Apache-2.0
//
// Where sixteen texels lie in a view, and what its tiles show there. Included inside
// POUNCE_ISA_NAMESPACE, after lanes.inl.

inline void add_to(std::int32_t (&sums)[kLanes], const Ints& value) {
  store(sums, load(sums) + value);
}

/// From the least to the largest of the lanes that count.
struct IntRange {
  std::int32_t least = 0xFFFF, largest = 0;

  IntRange(const Ints& values, const Ints& counts, std::int32_t last) {
    alignas(64) std::int32_t low[kLanes], high[kLanes];
    const Ints within = select(values < last, values, all(last));
    store(low, select(counts, within, all(0xFFFF)));
    store(high, select(counts, within, all(0)));
    for (int lane = 0; lane < kLanes; ++lane) {
      least = std::min(least, low[lane]);
      largest = std::max(largest, high[lane]);
    }
  }
};

void place(const PlaceFrame& f, std::span<const surface::TexelPacket> packets,
           std::span<PlacePacket> places, std::span<SightPacket> sights) {
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
    if (!any(faces)) continue;
    add_to(sights[p].facing, weight);
    const Floats dx = load(packet.px) - f.middle.x, dy = load(packet.py) - f.middle.y,
                 dz = load(packet.pz) - f.middle.z;
    const auto along = [&](Vec3f axis) { return dx * axis.x + dy * axis.y + dz * axis.z; };
    const Floats x = along(f.right) + f.middle_pixel, y = along(f.down) + f.middle_pixel;
    store(out.x, x);
    store(out.y, y);
    store(out.depth, along(f.forward) * f.per_step + f.middle_depth);
    // All of a target lies inside a view, so no place is negative.
    const auto tiles = [&](const Floats& at) {
      return IntRange(to_int(at * (1.0F / kTileEdge)), faces, f.last_tile);
    };
    const IntRange tx = tiles(x), ty = tiles(y);
    out.tiles = {static_cast<std::uint16_t>(tx.least), static_cast<std::uint16_t>(tx.largest),
                 static_cast<std::uint16_t>(ty.least), static_cast<std::uint16_t>(ty.largest)};
  }
}

/// The tile's samples of one pixel for each of sixteen lanes: colours and alpha of a lane together.
struct PixelLanes {
  alignas(64) std::int64_t colours[kLanes];
  alignas(64) std::int32_t depth[kLanes];

  void set(int lane, const std::uint16_t* s) {
    static_assert(sizeof colours[0] == 4 * sizeof *s);
    std::memcpy(&colours[lane], s, sizeof colours[lane]);
    depth[lane] = s[4];
  }
  /// Red and green, or blue and alpha, of each lane.
  template <int half, int... lane>
  Ints pairs(std::integer_sequence<int, lane...>) const {
    Ints out;
    for (int p = 0; p < kParts; ++p) {
      IntRegister low, high;
      std::memcpy(&low, colours + p * kWidth, sizeof low);
      std::memcpy(&high, colours + p * kWidth + kWidth / 2, sizeof high);
      out.part[p] = __builtin_shufflevector(low, high, (2 * lane + half)...);
    }
    return out;
  }
  template <int half>
  Ints pairs() const {
    return pairs<half>(std::make_integer_sequence<int, kWidth>());
  }
  static Floats low(const Ints& pairs) { return to_float(pairs & all(0xFFFF)); }
  static Floats high(const Ints& pairs) {
    return to_float(each([](IntRegister x) { return x >> 16; }, pairs) & all(0xFFFF));
  }
};

/// The nearest whole number of one that is not negative.
inline Ints rounded(const Floats& value) { return to_int(value + 0.5F); }

inline Floats at_most(const Floats& a, float most) { return select(a < most, a, all(most)); }

void gather_packet(const SightLimits& limits, const ViewTiles& tiles, const PlacePacket& place,
                   SightPacket& sight) {
  const Floats x = load(place.x), y = load(place.y), depth = load(place.depth);
  const Ints weight = load(place.weight), low_x = to_int(x), low_y = to_int(y);
  const Ints in_x = low_x - static_cast<std::int32_t>(tiles.tile_x * kTileEdge),
             in_y = low_y - static_cast<std::int32_t>(tiles.tile_y * kTileEdge);
  Ints here = (weight > 0) & (in_x >= 0) & (in_x < kTileEdge) & (in_y >= 0) & (in_y < kTileEdge);
  if (!any(here)) return;
  // The four pixels around, and their shares.
  alignas(64) std::int32_t first[kLanes];
  store(first, select(here, (in_y + kApron) * kStoredEdge + in_x + kApron, all(0)));
  constexpr std::int32_t kOff[4] = {0, 1, kStoredEdge, kStoredEdge + 1};
  const Floats fx = x - to_float(low_x), fy = y - to_float(low_y), gx = 1.0F - fx, gy = 1.0F - fy;
  const Floats shares[4] = {gx * gy, fx * gy, gx * fy, fx * fy};

  // Is the target's surface, in some of them, about where the texel is?
  Ints on_target = all(0);
  // All of them are written before the first is read: what was just written lane by lane is slow to
  // read as a whole.
  alignas(64) std::int32_t samples[4][kLanes];
  for (int lane = 0; lane < kLanes; ++lane) {
    const std::uint16_t* const at = tiles.target + first[lane];
    for (int i = 0; i < 4; ++i) samples[i][lane] = at[kOff[i]];
  }
  for (const auto& own : samples) {
    const Ints sample = load(own);
    on_target = on_target |
                ((sample < kNoDepth) & (absolute(to_float(sample) - depth) <= limits.on_target));
  }
  here = here & on_target;
  if (!any(here)) return;

  // Colours are those of what is there: each counts by its alpha.
  Floats colours[3] = {all(0.0F), all(0.0F), all(0.0F)}, alpha = all(0.0F);
  Floats before = all(-1e30F), depths = all(0.0F), of_depths = all(0.0F);
  PixelLanes pixels[4];
  for (int lane = 0; lane < kLanes; ++lane) {
    const std::uint16_t* const at =
        tiles.scene + std::size_t{kSceneSamples} * static_cast<std::size_t>(first[lane]);
    for (int i = 0; i < 4; ++i) pixels[i].set(lane, at + kSceneSamples * kOff[i]);
  }
  for (int i = 0; i < 4; ++i) {
    const PixelLanes& pixel = pixels[i];
    const Ints red_green = pixel.pairs<0>(), blue_alpha = pixel.pairs<1>();
    const Floats share = shares[i] * pixel.high(blue_alpha);
    colours[0] = colours[0] + share * pixel.low(red_green);
    colours[1] = colours[1] + share * pixel.high(red_green);
    colours[2] = colours[2] + share * pixel.low(blue_alpha);
    alpha = alpha + share;
    const Ints is_there = load(pixel.depth) < kNoDepth;
    const Floats scene = to_float(load(pixel.depth)), nearer = depth - scene;
    before = select(is_there & (before < nearer), nearer, before);
    depths = depths + select(is_there, shares[i] * scene, all(0.0F));
    of_depths = of_depths + select(is_there, shares[i], all(0.0F));
  }
  here = here & (alpha >= kLeastSeen * kAlphaSteps);
  if (!any(here)) return;

  const Floats per_alpha = 1.0F / select(here, alpha, all(1.0F));
  for (Floats& colour : colours) colour = colour * per_alpha;
  const Ints luma = rounded(
      at_most((colours[0] + 2.0F * colours[1] + colours[2]) * (kLumaSteps / (4 * kColourSteps)),
              kLumaSteps));
  const Ints has_depth = of_depths > 0.0F;
  const Floats away = select(has_depth, depth - depths / of_depths, all(0.0F)),
               outside = away * load(place.cosine);
  const Ints whole_outside = to_int(outside + select(outside < 0.0F, all(-0.5F), all(0.5F)));
  const auto add = [&](SightPacket::Sums& sums, const Ints& counts) {
    const Ints w = select(counts, weight, all(0));
    add_to(sums.weight, w);
    for (int c = 0; c < 3; ++c) add_to(sums.colour[c], w * rounded(colours[c]));
    add_to(sums.alpha, w * rounded(at_most(alpha, kAlphaSteps)));
    add_to(sums.luma, w * luma);
    add_to(sums.luma_squares, w * luma * luma);
    add_to(sums.away, w * whole_outside);
    add_to(sums.off, w * rounded(at_most(absolute(away), 65534.0F)));
  };
  const Ints hides = here & (before > limits.hidden);
  add(sight.clear, select(hides, all(0), here));
  if (any(hides)) add(sight.hidden, hides);
}

void gather(const SightLimits& limits, const ViewTiles& tiles, std::span<const PlacePacket> places,
            std::span<SightPacket> sights) {
  for (std::size_t p = 0; p < places.size(); ++p) {
    const TileRange& range = places[p].tiles;
    if (!range.empty() && tiles.tile_x >= range.x0 && tiles.tile_x <= range.x1 &&
        tiles.tile_y >= range.y0 && tiles.tile_y <= range.y1)
      gather_packet(limits, tiles, places[p], sights[p]);
  }
}
