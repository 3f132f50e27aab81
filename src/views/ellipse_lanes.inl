// SPDX-License-Identifier: Apache-2.0
//
// What sixteen Gaussians look like from a view. Included inside POUNCE_ISA_NAMESPACE, after
// lanes.inl.
//
// Of a Gaussian (mean m, covariance S) a view along w, with u to the right and v down, shows the
// ellipse of the covariance M = (u v)' S (u v) + f I, with f the footprint of a pixel. By the
// Gaussian's axes a_k and variances s_k, with g_k = s_k + f,
//
//   det M = (a_0 . w)^2 g_1 g_2 + (a_1 . w)^2 g_0 g_2 + (a_2 . w)^2 g_0 g_1
//
// where nothing cancels, however thin it is (as in projection/splat_kernels.inl).

/// At most 0.05 above the logarithm of numbers from 1 on: of their exponent, and two tangents of
/// the logarithm for what is left.
inline Floats log_bound(const Floats& x) {
  constexpr std::int32_t kMantissa = 0x7FFFFF, kOne = 0x3F800000;
  const Ints raw = bits_of(x);
  const Floats m =
      each([](IntRegister b) { return (FloatRegister)b; }, (raw & all(kMantissa)) | all(kOne)) -
      1.0F;
  const Floats exponent = to_float(each([](IntRegister b) { return b >> 23; }, raw) - 127);
  constexpr float kLog2 = 0.69314722F, kLog15 = 0.40546513F;
  const Floats upper = (m - 0.5F) / 1.5F + kLog15;
  return exponent * kLog2 + select(upper < m, upper, m);
}

/// Sixteen Gaussians' axes and variances along them, the largest first; of equal ones the first
/// comes first. An axis may point either way.
struct AxisLanes {
  Floats axis[3][3], variance[3];

  AxisLanes(const gaussian::SplatColumns& set, std::size_t first) {
    const Floats w = load(&set.rotation[0][first]), x = load(&set.rotation[1][first]),
                 y = load(&set.rotation[2][first]), z = load(&set.rotation[3][first]);
    // rotation_columns()
    const Floats columns[3][3] = {
        {1.0F - 2.0F * (y * y + z * z), 2.0F * (x * y + w * z), 2.0F * (x * z - w * y)},
        {2.0F * (x * y - w * z), 1.0F - 2.0F * (x * x + z * z), 2.0F * (y * z + w * x)},
        {2.0F * (x * z + w * y), 2.0F * (y * z - w * x), 1.0F - 2.0F * (x * x + y * y)}};
    Floats sigma[3];
    for (std::size_t k = 0; k < 3; ++k) {
      sigma[k] = load(&set.sigma[k][first]);
      for (int c = 0; c < 3; ++c) axis[k][c] = columns[k][c];
    }
    const auto sort = [&](int a, int b) {
      const Ints swaps = sigma[b] > sigma[a];
      const auto swap = [&](Floats& p, Floats& q) {
        const Floats old = p;
        p = select(swaps, q, old);
        q = select(swaps, old, q);
      };
      swap(sigma[a], sigma[b]);
      for (int c = 0; c < 3; ++c) swap(axis[a][c], axis[b][c]);
    };
    sort(0, 1);
    sort(1, 2);
    sort(0, 1);
    for (int k = 0; k < 3; ++k) variance[k] = sigma[k] * sigma[k];
  }
  /// In space.
  Floats covariance(int a, int b) const {
    Floats sum = all(0.0F);
    for (int k = 0; k < 3; ++k) sum = sum + axis[k][a] * axis[k][b] * variance[k];
    return sum;
  }
};

/// Writes the ellipses of those of sixteen that the tile shows, one after the other: all but their
/// order and colour, and their means' depths in pixels. Returns which: a bit each.
unsigned show(const gaussian::SplatColumns& set, std::size_t first, unsigned met,
              const TileView& view, Ellipse* out) {
  const AxisLanes axes(set, first);
  const auto& level = set.levels[0];
  const Floats mx = load(&level.centre[0][first]) - view.bounds.middle.x,
               my = load(&level.centre[1][first]) - view.bounds.middle.y,
               mz = load(&level.centre[2][first]) - view.bounds.middle.z;
  const auto along = [&](Vec3f axis) { return axis.x * mx + axis.y * my + axis.z * mz; };
  const float per_pixel = view.per_pixel, square = per_pixel * per_pixel;
  const auto covariance = [&](int a, int b) { return axes.covariance(a, b) * square; };
  const Floats sxx = covariance(0, 0), sxy = covariance(0, 1), sxz = covariance(0, 2),
               syy = covariance(1, 1), syz = covariance(1, 2), szz = covariance(2, 2);
  struct Column {
    Floats x, y, z;
  };
  const auto times = [&](Vec3f v) {
    return Column{sxx * v.x + sxy * v.y + sxz * v.z, sxy * v.x + syy * v.y + syz * v.z,
                  sxz * v.x + syz * v.y + szz * v.z};
  };
  const auto dot = [](Vec3f a, const Column& b) { return a.x * b.x + a.y * b.y + a.z * b.z; };
  const Column su = times(view.right), sv = times(view.down);
  const Floats uu = dot(view.right, su), uv = dot(view.right, sv), vv = dot(view.down, sv);
  Floats squares[3], variances[3];
  for (int k = 0; k < 3; ++k) {
    const Floats cosine = view.forward.x * axes.axis[k][0] + view.forward.y * axes.axis[k][1] +
                          view.forward.z * axes.axis[k][2];
    squares[k] = cosine * cosine;
    variances[k] = axes.variance[k] * square;
  }
  const auto det = [&](float f) {
    const Floats g0 = variances[0] + f, g1 = variances[1] + f, g2 = variances[2] + f;
    return squares[0] * (g1 * g2) + squares[1] * (g0 * g2) + squares[2] * (g0 * g1);
  };
  const float footprint = view.footprint;
  const Floats whole = det(footprint), fine = det(view.fine);
  Floats opacity = load(&set.alpha[first]);
  if (view.antialiased) opacity = opacity * square_root(det(0) / fine);
  if (footprint > view.fine) opacity = opacity * square_root(fine / whole);  // its integral stays
  Ints ok = opacity >= kLeastAlpha;
  // Beyond that its alpha falls below the least.
  constexpr float kMostCutOff = gaussian::kSplatCutOff * gaussian::kSplatCutOff;
  const Floats faint = 2.0F * log_bound(opacity / kLeastAlpha) + 0.001F;
  const Floats cut_off = select(faint < kMostCutOff, faint, all(kMostCutOff));
  const Floats x = along(view.right) * per_pixel + view.bounds.first_x,
               y = along(view.down) * per_pixel + view.bounds.first_y;
  const Floats reach_x = square_root((uu + footprint) * cut_off),
               reach_y = square_root((vv + footprint) * cut_off);
  constexpr float kLast = kStoredEdge - 1;
  ok = ok & (x + reach_x >= 0.0F) & (x - reach_x <= kLast) & (y + reach_y >= 0.0F) &
       (y - reach_y <= kLast);
  const Floats xx = (vv + footprint) / whole, xy = (0.0F - uv) / whole,
               yy = (uu + footprint) / whole;
  // So large that floats do not hold its shape: nothing is known of where it is.
  constexpr float kLargest = std::numeric_limits<float>::max();
  const auto is_finite = [&](const Floats& value) { return absolute(value) <= kLargest; };
  ok = ok & is_finite(whole) & is_finite(1.0F / xx) & is_finite(1.0F / yy);
  const Floats wu = dot(view.forward, su), wv = dot(view.forward, sv);
  const Floats depth = along(view.forward) * per_pixel;
  const Floats lean_x = (wu * xx + wv * xy) * view.depth_per_pixel,
               lean_y = (wu * xy + wv * yy) * view.depth_per_pixel;
  const unsigned shown = bits(ok) & met;
  const auto set_all = [&](float Ellipse::*member, const Floats& values) {
    alignas(64) float own[kLanes];
    store(own, values);
    Ellipse* at = out;
    for (unsigned left = shown; left != 0; left &= left - 1)
      (at++)->*member = own[std::countr_zero(left)];
  };
  set_all(&Ellipse::x, x);
  set_all(&Ellipse::y, y);
  set_all(&Ellipse::xx, xx);
  set_all(&Ellipse::xy, xy);
  set_all(&Ellipse::yy, yy);
  set_all(&Ellipse::opacity, opacity);
  set_all(&Ellipse::cut_off, cut_off);
  set_all(&Ellipse::depth, depth);
  set_all(&Ellipse::lean_x, lean_x);
  set_all(&Ellipse::lean_y, lean_y);
  set_all(&Ellipse::reach_x, reach_x);
  set_all(&Ellipse::reach_y, reach_y);
  return shown;
}

/// Half floats of sixteen lanes, finite; of the last `left` lanes there is no more.
inline Floats load_halves(const std::uint16_t* at, std::size_t left) {
  std::uint16_t halves[kLanes] = {};
  if (left >= kLanes)
    std::memcpy(halves, at, sizeof halves);
  else
    std::copy_n(at, left, halves);
  alignas(64) std::int32_t wide[kLanes];
  for (int lane = 0; lane < kLanes; ++lane) wide[lane] = halves[lane];
  const Ints raw = load(wide);
  const auto shifted = [](const Ints& value, int by) {
    return each([by](IntRegister x) { return x << by; }, value);
  };
  const auto as_floats = [](const Ints& value) {
    return each([](IntRegister x) { return (FloatRegister)x; }, value);
  };
  // The exponent's bias is 112 less: exact, also for the smallest, whose exponent is 0.
  const Floats size = as_floats(shifted(raw & all(0x7FFF), 13)) * 0x1p112F;
  return as_floats(bits_of(size) | shifted(raw & all(0x8000), 16));
}

/// What a view with these harmonics shows of the sixteen Gaussians from `first` on.
void colour(const gaussian::SplatColumns& set, std::size_t first, std::span<const float> basis,
            float (*out)[kLanes]) {
  for (std::size_t c = 0; c < 3; ++c) {
    Floats sum = load(&set.colour[c][first]);
    for (std::size_t k = 0; k < basis.size(); ++k) {
      const std::size_t at = (3 * k + c) * set.size() + first;
      sum = sum + basis[k] * load_halves(&set.sh[at], set.sh.size() - at);
    }
    sum = select(sum < 0.0F, all(0.0F), sum);
    constexpr float kLargest = gaussian::kLargestSplatColour;
    store(out[c], select(sum < kLargest, sum, all(kLargest)));
  }
}
