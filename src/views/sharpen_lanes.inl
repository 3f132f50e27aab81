// SPDX-License-Identifier: Apache-2.0
// Part of view_kernels.inl: pixels away from what is around them.

void sharpen(const PixelRows& pixels, const Sharpening& how, PixelRows& out) {
  // Of a ring's radius, in ten thousandths: 2^(-1/2).
  const int slant = (how.reach * 7071 + 5000) / 10000;
  const int pairs[4][2] = {{how.reach, 0}, {0, how.reach}, {slant, slant}, {slant, -slant}};
  const float share = how.amount / 4;
  for (int y = 0; y < kStoredEdge; ++y) {
    for (int x = 0; x < PixelRows::kEnd - PixelRows::kFirst; x += kLanes) {
      const std::size_t at = PixelRows::at(x, y);
      const Floats depth = load(pixels.depth + at);
      const Floats colour[3] = {load(pixels.colour[0] + at), load(pixels.colour[1] + at),
                                load(pixels.colour[2] + at)};
      Floats off[3] = {all(0.0F), all(0.0F), all(0.0F)};
      for (const auto& [dx, dy] : pairs) {
        const int low = std::min(y - dy, y + dy), high = std::max(y - dy, y + dy);
        if (low < 0 || high >= kStoredEdge) continue;
        const std::size_t a = PixelRows::at(x - dx, y - dy), b = PixelRows::at(x + dx, y + dy);
        // Both ways: what is infinite is near nothing, itself included.
        const auto is_near = [&](const Floats& other) {
          return (other - depth <= how.most_apart) & (depth - other <= how.most_apart);
        };
        const Ints both = is_near(load(pixels.depth + a)) & is_near(load(pixels.depth + b));
        for (int c = 0; c < 3; ++c) {
          const Floats around = (load(pixels.colour[c] + a) + load(pixels.colour[c] + b)) * 0.5F;
          off[c] = off[c] + select(both, colour[c] - around, all(0.0F));
        }
      }
      for (int c = 0; c < 3; ++c) {
        const Floats moved = colour[c] + off[c] * share;
        const Floats above = select(moved > 0.0F, moved, all(0.0F));
        constexpr float kMost = gaussian::kLargestSplatColour;
        store(out.colour[c] + at, select(above < kMost, above, all(kMost)));
      }
    }
  }
}
