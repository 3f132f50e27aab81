// SPDX-License-Identifier: Apache-2.0
//
// Where sixteen lookups are: in which tile and where in it. Included by blend_lanes.inl, inside
// POUNCE_ISA_NAMESPACE.

/// Where along one axis.
struct Place {
  IntRegister texel, inside;
  Doubles at, rest;
};

/// All bits of the lanes whose texel is one of so many.
inline IntRegister is_inside(IntRegister texel, std::uint32_t size) {
  return (IntRegister)(texel >= 0) & (IntRegister)(texel < static_cast<std::int32_t>(size));
}

inline Place place_along(Doubles at, std::uint32_t size, std::uint32_t level_size) {
  if (size != level_size) {
    at = (at + 0.5) * static_cast<double>(level_size);
    // By a power of two products are the quotients, and take less time.
    const bool is_power = (size & (size - 1)) == 0;
    at = is_power ? at * (1.0 / size) : at / doubles(size);
    at = at - 0.5;
  }
  Place out;
  const Doubles whole = whole_below(at);
  out.at = at;
  out.texel = truncated(whole);  // of what does not fit, one that is not inside
  out.rest = at - whole;
  out.inside = is_inside(out.texel, level_size);
  return out;
}

/// Where a group's texels are in their tiles, for those of `inside`.
inline void store_places(IntRegister inside, IntRegister column, IntRegister row, std::size_t first,
                         PlacesLanes& out) {
  constexpr std::int32_t kShift = 6, kWithin = mesh::kBlockEdge - 1;
  static_assert(mesh::kBlockEdge == 1 << kShift);
  constexpr std::int32_t kFirst = store::kApron - 1;  // of the four, in the tile
  column &= inside;
  row &= inside;
  store_register(out.tile.data() + first, ((row >> kShift) << 16) | (column >> kShift));
  store_register(out.offset.data() + first,
                 ((row & kWithin) + kFirst) * store::kColourTileEdge + (column & kWithin) + kFirst);
}

void place(const LookupsLanes& set, const LookedUp& in, const Vec2Lanes& middles, int a, int b,
           unsigned lanes, PlacesLanes& out) {
  out.active = out.outside = 0;
  for (std::size_t first = 0; first < kLanes; first += kGroup) {
    const IntRegister count_a = load_ints(set.count_a.data() + first),
                      count_b = load_ints(set.count_b.data() + first);
    const IntRegister active =
        lanes_of(lanes >> first) & (IntRegister)(count_a > a) & (IntRegister)(count_b > b);
    const Doubles i = static_cast<double>(a) - 0.5 * (doubles_of(count_a) - 1.0),
                  j = static_cast<double>(b) - 0.5 * (doubles_of(count_b) - 1.0);
    const auto along = [&](const Sixteen<double>& middle, const Sixteen<double>& step_a,
                           const Sixteen<double>& step_b) {
      return load(middle.data() + first) +
             (i * load(step_a.data() + first) + j * load(step_b.data() + first));
    };
    const Place x =
        place_along(along(middles.x, set.step_ax, set.step_bx), in.width, in.level_width);
    const Place y =
        place_along(along(middles.y, set.step_ay, set.step_by), in.height, in.level_height);
    const IntRegister inside = active & x.inside & y.inside;
    store(out.x.data() + first, x.at);
    store(out.y.data() + first, y.at);
    store(out.rest_x.data() + first, x.rest);
    store(out.rest_y.data() + first, y.rest);
    store_places(inside, x.texel, y.texel, first, out);
    const unsigned active_bits = bits_of_group(active);
    store(out.share.data() + first, only(mask_of(active_bits), load(set.share.data() + first)));
    out.active |= active_bits << first;
    out.outside |= bits_of_group(active & ~inside) << first;
  }
}

/// As placed() of a hit's coordinates.
void place_hits(const HitPacket& hit, const LookedUp& in, unsigned lanes, PlacesLanes& out) {
  out.active = lanes;
  out.outside = 0;
  for (std::size_t first = 0; first < kLanes; first += kGroup) {
    const IntRegister active = lanes_of(lanes >> first);
    const auto along = [&](const std::int32_t(&base)[kLanes], const float(&frac)[kLanes],
                           std::uint32_t size) {
      const Doubles beyond = only(mask_of(lanes >> first), doubles_at(frac + first));
      const Doubles whole = whole_below(beyond);
      Place at;
      at.texel = (load_ints(base + first) & active) + truncated(whole);
      at.rest = beyond - whole;
      at.inside = is_inside(at.texel, size);
      return at;
    };
    const Place x = along(hit.base_x, hit.frac_x, in.width),
                y = along(hit.base_y, hit.frac_y, in.height);
    const IntRegister inside = active & x.inside & y.inside;
    store(out.rest_x.data() + first, x.rest);
    store(out.rest_y.data() + first, y.rest);
    store_places(inside, x.texel, y.texel, first, out);
    store(out.share.data() + first, only(mask_of(lanes >> first), doubles(1)));
    out.outside |= bits_of_group(active & ~inside) << first;
  }
}
