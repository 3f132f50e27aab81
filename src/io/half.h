// SPDX-License-Identifier: Apache-2.0
#pragma once

// Convert by arithmetic: the table would have to be linked from libImath for two small loops.
#ifndef IMATH_HALF_NO_LOOKUP_TABLE
#define IMATH_HALF_NO_LOOKUP_TABLE
#endif
#include <OpenImageIO/half.h>
