// SPDX-License-Identifier: Apache-2.0
//
// exp of sixteen lanes, the same bits on every machine. Included inside POUNCE_ISA_NAMESPACE, after
// lanes.inl.

/// exp(-x) for 0 <= x <= 4.5 to within 1e-6 of itself: a polynomial for exp(-x / 8), then its
/// eighth power. Multiplications and additions alone, so every machine agrees.
[[gnu::always_inline]] inline Floats exp_of_minus(const Floats& x) {
  const Floats y = x * 0.125F;  // <= 0.5625, where the polynomial is good to 5e-8
  Floats e = 0.040447037667F - 0.0063081225380F * y;
  e = e * y - 0.16631916165F;
  e = e * y + 0.49995476007F;
  e = e * y - 0.99999785423F;
  e = e * y + 1.0F;
  e = e * e;
  e = e * e;
  return e * e;
}

/// The same for 0 <= x <= 18; from there on it stays.
[[gnu::always_inline]] inline Floats exp_of_minus_far(const Floats& x) {
  const Floats e = exp_of_minus(select(x < 18.0F, x, all(18.0F)) * 0.25F);
  const Floats square = e * e;
  return square * square;
}
