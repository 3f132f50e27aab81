// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace pounce {

/// The sRGB transfer function (IEC 61966-2-1) and its inverse by +, *, / and sqrt alone, so that
/// every machine agrees.
double srgb_to_linear(double coded) noexcept;
double linear_to_srgb(double linear) noexcept;

}  // namespace pounce
