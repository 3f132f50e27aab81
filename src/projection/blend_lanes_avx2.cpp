// SPDX-License-Identifier: Apache-2.0
#define POUNCE_ISA_NAMESPACE avx2
#define POUNCE_ISA_NAME "avx2"
#include "projection/blend_lanes.inl"
