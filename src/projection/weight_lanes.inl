// SPDX-License-Identifier: Apache-2.0
//
// Weights of sixteen lookups, and how they are kept for the images that are looked up there.
// Included by blend_lanes.inl, inside POUNCE_ISA_NAMESPACE.

using Four = std::array<IntRegister, 4>;

/// Of a row of four: as keys() in blend.cpp, where weights are scaled when they are made; since
/// kOne is a power of two, no bit differs where they are made that large.
inline Four keys_of(double a, const Doubles& u) {
  const Doubles rest = 1.0 - u;
  const auto step = [](const Doubles& w) { return truncated(w + (kOne + 0.5)) - kOne; };
  const Doubles au = a * kOne * u;
  const IntRegister before = step(au * rest * rest), after = step(au * u * rest);
  const Doubles x = greater(u, rest);
  const IntRegister nearer =
      step(((a + 2) * kOne * x - (a + 3) * kOne) * x * x + static_cast<double>(kOne));
  const IntRegister other = kOne - before - nearer - after;
  const IntRegister left_is_near = lanes_of_less(u, doubles(0.5));  // and gets what is left over
  return {before, left_is_near ? other : nearer, left_is_near ? nearer : other, after};
}

/// What the sum takes of the moves of the two in the middle.
struct Moves {
  IntRegister first, second;
};

/// As sharpen_wide(), along one axis.
inline Moves sharpen(IntRegister by, const Doubles& place, Four& weights) {
  const Doubles all = doubles_of(by);
  constexpr double kSteeper = 3;
  const Doubles share = kSteeper * all * place * (1.0 - place) * (1.0 - 2.0 * place);
  const IntRegister step = truncated(share + with_sign_of(share, 0.5));
  weights[0] -= step;
  weights[1] += 3 * step;
  weights[2] -= 3 * step;
  weights[3] += step;
  const IntRegister second = truncated(all * place + 0.5);
  return {by - second, second};
}

/// Of a group from lane `first` on: written there, and read again for each image.
using FourLanes = std::array<Sixteen<std::int32_t>, 4>;
using MovesLanes = std::array<Sixteen<std::int32_t>, 2>;

inline void store_four(const Four& weights, std::size_t first, FourLanes& out) {
  for (std::size_t i = 0; i < 4; ++i) store_register(out[i].data() + first, weights[i]);
}
inline Four load_four(const FourLanes& weights, std::size_t first) {
  return {load_ints(weights[0].data() + first), load_ints(weights[1].data() + first),
          load_ints(weights[2].data() + first), load_ints(weights[3].data() + first)};
}
inline void store_moves(const Moves& moves, std::size_t first, MovesLanes& out) {
  store_register(out[0].data() + first, moves.first);
  store_register(out[1].data() + first, moves.second);
}
inline Moves load_moves(const MovesLanes& moves, std::size_t first) {
  return {load_ints(moves[0].data() + first), load_ints(moves[1].data() + first)};
}

/// As tent() in blend.cpp.
inline Four tent_of(const Doubles& u, const Doubles& v) {
  const auto step = [](const Doubles& w) { return truncated(w * static_cast<double>(kOne) + 0.5); };
  return {step((1.0 - u) * (1.0 - v)), step(u * (1.0 - v)), step((1.0 - u) * v), step(u * v)};
}

/// Along one axis of the image.
inline void weigh_along(double keys, const Sixteen<double>& rest, const Sixteen<std::int32_t>* by,
                        std::size_t first, FourLanes& out, MovesLanes& moves) {
  const Doubles place = load(rest.data() + first);
  Four weights = keys_of(keys, place);
  if (by != nullptr)
    store_moves(sharpen(load_ints(by->data() + first), place, weights), first, moves);
  store_four(weights, first, out);
}

void weigh(const PlacesLanes& places, double keys, const SharpeningLanes& sharpening,
           WeightsLanes& out) {
  out.is_tent = keys == kTent;
  out.is_sharp_across = !out.is_tent && sharpening.across != nullptr;
  out.is_sharp_down = !out.is_tent && sharpening.down != nullptr;
  for (std::size_t first = 0; first < kLanes; first += kGroup) {
    if (out.is_tent) {
      store_four(tent_of(load(places.rest_x.data() + first), load(places.rest_y.data() + first)),
                 first, out.across);
      continue;
    }
    weigh_along(keys, places.rest_x, sharpening.across, first, out.across, out.move_across);
    weigh_along(keys, places.rest_y, sharpening.down, first, out.down, out.move_down);
  }
}

/// call.template operator()<kAcross, kDown>(): along which axes lanes are sharpened.
template <class Call>
inline void for_sharpening(const WeightsLanes& weights, const Call& call) {
  if (weights.is_sharp_across && weights.is_sharp_down) {
    call.template operator()<true, true>();
  } else if (weights.is_sharp_across) {
    call.template operator()<true, false>();
  } else if (weights.is_sharp_down) {
    call.template operator()<false, true>();
  } else {
    call.template operator()<false, false>();
  }
}
