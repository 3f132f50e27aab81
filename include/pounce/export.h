// SPDX-License-Identifier: Apache-2.0
#pragma once

/// What a shared libpounce shows to others; all else in it is hidden.
#if defined(__GNUC__)
#define POUNCE_API __attribute__((visibility("default")))
#else
#define POUNCE_API
#endif
