// SPDX-License-Identifier: Apache-2.0
// As cmake/precompiled.h, for the tests.
#pragma once

#include <catch2/catch.hpp>
#include <fstream>
#include <random>

#include "../../cmake/precompiled.h"
