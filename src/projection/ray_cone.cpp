// SPDX-License-Identifier: Apache-2.0
#include "projection/ray_cone.h"

#include <numbers>

namespace pounce::projection {
namespace {

struct Turn {
  double cosine = 1, sine = 0;
};

/// Share k / count of a whole turn, by the series of sine and cosine: the C library's own differ
/// from machine to machine. Good to 1e-14.
Turn turn(int k, int count) {
  const double angle = 2 * std::numbers::pi * (2 * k > count ? k - count : k) / count;
  Turn out;
  double term = 1;
  for (int i = 1; i < 32; i += 2) {
    term *= angle / i;
    out.sine += term;
    term *= -angle / (i + 1);
    out.cosine += term;
  }
  return out;
}

}  // namespace

surface::TexelPacket tilted(const surface::TexelPacket& packet, int k, int count) {
  const Turn at = turn(k, count);
  const double across = kConeSine * at.cosine, up = kConeSine * at.sine;
  surface::TexelPacket out = packet;
  for (int lane = 0; lane < surface::kLanes; ++lane) {
    if (packet.texel[lane] == surface::kNoTexel) continue;
    const double x = packet.nx[lane], y = packet.ny[lane], z = packet.nz[lane];
    // Two directions across the normal (Duff et al. 2017).
    const double sign = z < 0 ? -1 : 1;
    const double a = -1 / (sign + z), b = x * y * a;
    out.nx[lane] = static_cast<float>(kConeCosine * x + across * (1 + sign * x * x * a) + up * b);
    out.ny[lane] =
        static_cast<float>(kConeCosine * y + across * sign * b + up * (sign + y * y * a));
    out.nz[lane] = static_cast<float>(kConeCosine * z - across * sign * x - up * y);
  }
  return out;
}

}  // namespace pounce::projection
