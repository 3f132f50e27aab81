// SPDX-License-Identifier: Apache-2.0
#define POUNCE_ISA_NAMESPACE sse2
#define POUNCE_ISA_NAME "sse2"
#include "projection/blend_lanes.inl"
