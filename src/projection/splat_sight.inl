// SPDX-License-Identifier: Apache-2.0
//
// Which Gaussians the rays of a bundle may meet: by their spheres, then by their ellipses. Included
// by splat_kernels.inl, inside POUNCE_ISA_NAMESPACE.

/// RayBundle::may_meet for sixteen spheres: a bit each.
unsigned meet(const float* x, const float* y, const float* z, const float* radius,
              const RayBundle& bundle, float height) {
  const Vec3f o = bundle.origin, d = bundle.direction;
  const Floats reach = (load(radius) + (bundle.offset + height * bundle.spread)) * 1.00001F;
  const Floats vx = load(x) - o.x, vy = load(y) - o.y, vz = load(z) - o.z;
  const Floats cx = vy * d.z - vz * d.y, cy = vz * d.x - vx * d.z, cz = vx * d.y - vy * d.x;
  const Floats along = absolute(vx * d.x + vy * d.y + vz * d.z);
  return bits((cx * cx + cy * cy + cz * cz <= reach * reach) & (along <= height + reach));
}

unsigned meet(const gaussian::SplatSpheres& spheres, std::size_t i, const RayBundle& bundle,
              float height) {
  const unsigned found = meet(&spheres.centre[0][i], &spheres.centre[1][i], &spheres.centre[2][i],
                              &spheres.radius[i], bundle, height);
  const std::size_t left = spheres.count - i;
  return left < kLanes ? found & ((1U << left) - 1) : found;
}

/// A bundle that looks at ellipses: every ray lies in a cone around its first, so what it meets of
/// a Gaussian lies in the ellipse that the Gaussian has across that first ray, grown by the cone.
/// The sum of an ellipse of the matrix A and a disc of radius r is within that of (1 + b) A + (1 +
/// 1 / b) r^2 I for any b > 0.
class EllipseSight {
 public:
  /// `bundle` without footprints.
  EllipseSight(const RayBundle& bundle, float height, float footprint)
      : bundle_(bundle), height_(height), footprint_(footprint) {
    const Vec3f d = bundle.direction;
    const Vec3f helper = std::abs(d.x) < 0.6F ? Vec3f{1, 0, 0} : Vec3f{0, 1, 0};
    u_ = cross(d, helper);
    const float square = dot(u_, u_);
    sees_all_ = !(square > 0.25F);  // no direction
    u_ = u_ * (1 / std::sqrt(sees_all_ ? 1 : square));
    v_ = cross(d, u_);
    per_depth_ = 1 / std::max(1 - bundle.spread, 0.01F);
    set(u_, u_, uu_);
    set(u_, v_, uv_);
    set(v_, v_, vv_);
  }

  /// May it meet these sixteen? A bit each; `covariance(c)` is where their components are.
  template <class Covariance>
  unsigned meet(const float* x, const float* y, const float* z, const float* radius,
                const Covariance& covariance) const {
    if (sees_all_) return 0xFFFF;
    const Vec3f o = bundle_.origin, d = bundle_.direction;
    const Floats vx = load(x) - o.x, vy = load(y) - o.y, vz = load(z) - o.z;
    const auto along = [&](Vec3f a) { return vx * a.x + vy * a.y + vz * a.z; };
    // How far along its ray one of the bundle can be where it meets the Gaussian.
    const Floats depth = (absolute(along(d)) + (load(radius) + bundle_.offset)) * per_depth_;
    const Floats a = along(u_), b = along(v_);
    Floats xx = all(footprint_), xy = all(0.0F), yy = all(footprint_);
    for (std::size_t c = 0; c < 6; ++c) {
      const Floats s = load(covariance(c));
      xx = xx + s * uu_[c];
      xy = xy + s * uv_[c];
      yy = yy + s * vv_[c];
    }
    const Floats r =
        (bundle_.offset + select(depth < height_, depth, all(height_)) * bundle_.spread) * 1.0001F;
    const Floats size = square_root((xx + yy) * (0.5F * kSquaredCutOff)) + 1e-30F;
    const Floats grown = (1.0F + r / size) * kSquaredCutOff, disc = r * (r + size);
    xx = grown * xx + disc;
    xy = grown * xy;
    yy = grown * yy + disc;
    const Floats aa = a * a * yy, bb = b * b * xx, det = xx * yy;
    // Rounding may not keep any out.
    return bits(aa + bb - 2.0F * a * b * xy <= (det - xy * xy) * 1.001F + (aa + bb + det) * 1e-6F);
  }

 private:
  static constexpr float kSquaredCutOff = gaussian::kSplatCutOff * gaussian::kSplatCutOff;
  /// The weights of a covariance's six components in a' S b.
  static void set(Vec3f a, Vec3f b, float* weights) {
    const float w[6] = {a.x * b.x, a.x * b.y + a.y * b.x, a.x * b.z + a.z * b.x,
                        a.y * b.y, a.y * b.z + a.z * b.y, a.z * b.z};
    std::copy_n(w, 6, weights);
  }

  RayBundle bundle_;
  float height_, footprint_;
  Vec3f u_, v_;  ///< across the direction
  float uu_[6], uv_[6], vv_[6];
  float per_depth_ = 1;
  bool sees_all_ = false;
};

void gather(const gaussian::SplatSet& set, const RayBundle& bundle, float height, float footprint,
            SplatCandidates& out) {
  RayBundle spheres = bundle;
  spheres.offset += gaussian::kSplatCutOff * std::sqrt(footprint) * 1.0001F;
  const EllipseSight sight(bundle, height, footprint);
  const auto& level = set.levels[0];
  for (std::size_t i = 0; i < set.levels[2].count; i += kLanes) {
    for (unsigned a = meet(set.levels[2], i, spheres, height); a != 0; a &= a - 1) {
      const std::size_t j = (i + static_cast<std::size_t>(std::countr_zero(a))) * kLanes;
      for (unsigned b = meet(set.levels[1], j, spheres, height); b != 0; b &= b - 1) {
        const std::size_t k = (j + static_cast<std::size_t>(std::countr_zero(b))) * kLanes;
        unsigned c = meet(level, k, spheres, height);
        if (c == 0) continue;
        c &= sight.meet(&level.centre[0][k], &level.centre[1][k], &level.centre[2][k],
                        &level.radius[k], [&](std::size_t at) { return &set.covariance[at][k]; });
        for (; c != 0; c &= c - 1) out.add(set, k + static_cast<std::size_t>(std::countr_zero(c)));
      }
    }
  }
}
