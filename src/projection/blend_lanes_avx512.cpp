// SPDX-License-Identifier: Apache-2.0
#define POUNCE_ISA_NAMESPACE avx512
#define POUNCE_ISA_NAME "avx512"
#include "projection/blend_lanes.inl"
