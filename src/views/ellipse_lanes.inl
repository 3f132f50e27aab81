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

/// What is needed of sixteen shapes, lane by lane: of those that count. All are written before the
/// first is read: what was just written in parts is slow to read as a whole.
struct ShapeLanes {
  alignas(64) float axis[3][3][kLanes] = {}, variance[3][kLanes] = {}, alpha[kLanes] = {};

  ShapeLanes(const gaussian::SplatShape* shapes, unsigned counts) {
    for (; counts != 0; counts &= counts - 1) {
      const int lane = std::countr_zero(counts);
      const gaussian::SplatShape& g = shapes[lane];
      for (int k = 0; k < 3; ++k) {
        for (int c = 0; c < 3; ++c) axis[k][c][lane] = g.axis[k][c];
        variance[k][lane] = g.variance[k];
      }
      alpha[lane] = g.alpha;
    }
  }
};

/// Writes the ellipses of those of sixteen that the tile shows, one after the other: all but their
/// order and colour, and their means' depths in pixels. Returns which: a bit each.
unsigned show(const gaussian::SplatSet& set, std::size_t first, unsigned met, const TileView& view,
              Ellipse* out) {
  const ShapeLanes shapes(&set.shapes[first], met);
  const auto& level = set.levels[0];
  const Floats mx = load(&level.centre[0][first]) - view.bounds.middle.x,
               my = load(&level.centre[1][first]) - view.bounds.middle.y,
               mz = load(&level.centre[2][first]) - view.bounds.middle.z;
  const auto along = [&](Vec3f axis) { return axis.x * mx + axis.y * my + axis.z * mz; };
  const float per_pixel = view.per_pixel, square = per_pixel * per_pixel;
  const auto covariance = [&](std::size_t c) { return load(&set.covariance[c][first]) * square; };
  const Floats sxx = covariance(0), sxy = covariance(1), sxz = covariance(2), syy = covariance(3),
               syz = covariance(4), szz = covariance(5);
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
    const Floats cosine = view.forward.x * load(shapes.axis[k][0]) +
                          view.forward.y * load(shapes.axis[k][1]) +
                          view.forward.z * load(shapes.axis[k][2]);
    squares[k] = cosine * cosine;
    variances[k] = load(shapes.variance[k]) * square;
  }
  const auto det = [&](float f) {
    const Floats g0 = variances[0] + f, g1 = variances[1] + f, g2 = variances[2] + f;
    return squares[0] * (g1 * g2) + squares[1] * (g0 * g2) + squares[2] * (g0 * g1);
  };
  const float footprint = view.footprint;
  const Floats whole = det(footprint), fine = det(view.fine);
  Floats opacity = load(shapes.alpha);
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
