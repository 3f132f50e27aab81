// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <string>

#include "corpus.h"

namespace pounce::test::corpus {

/// What became of an image.
struct Verdict {
  std::string name;
  std::string what;  ///< one of kVerdicts
  std::string hash;  ///< of the samples; "-" where none were read
  std::string info;
  std::string note;  ///< why it was refused, what differs
};

struct Kind {
  const char *name, *meaning;
  bool bad;
};
inline constexpr std::array<Kind, 8> kVerdicts{
    {{"equal", "the true samples, and OpenImageIO's", false},
     {"truth", "the true samples; OpenImageIO reads none, or others for a known reason", false},
     {"odd", "the true samples; OpenImageIO's differ, and nobody knows why", true},
     {"as-oiio", "OpenImageIO's samples; nothing says what is true", false},
     {"refused", "the reader says why it does not read it", false},
     {"unexplained", "nothing says what is true, and OpenImageIO differs", true},
     {"DEFECT", "not the true samples, strips that differ, a crash", true},
     {"NOT MADE", "its library did not write it", true}}};

/// Writes the image, if it is one that is made, reads it in several ways, each in a process of its
/// own, and compares.
Verdict judge(const Entry& entry, const std::string& folder, std::uint64_t seed, Sandbox sandbox);

}  // namespace pounce::test::corpus
