// SPDX-License-Identifier: Apache-2.0
#include "pounce/options.h"

#include <catch2/catch.hpp>

namespace pounce {

TEST_CASE("every channel has the name that glTF gives it", "[core]") {
  CHECK(std::string(channel_name(Channel::base_color)) == "baseColor");
  CHECK(std::string(channel_name(Channel::metallic_roughness)) == "metallicRoughness");
  CHECK(std::string(channel_name(Channel::occlusion)) == "occlusion");
  CHECK(std::string(channel_name(Channel::emissive)) == "emissive");
  CHECK(std::string(channel_name(Channel::confidence)) == "confidence");
  CHECK(std::string(channel_name(Channel::distance)) == "distance");
  CHECK(std::string(channel_name(Channel::normal)) == "normal");
  CHECK(std::string(channel_name(Channel::height)) == "height");
  CHECK(std::string(channel_name(Channel::position)) == "position");
  for (int i = 0; i < kChannelCount + kEvidenceCount + kShapeCount; ++i) {
    const auto channel = static_cast<Channel>(i);
    CHECK(is_evidence(channel) == (channel == Channel::confidence || channel == Channel::distance));
    CHECK(is_shape(channel) == (channel == Channel::height || channel == Channel::position ||
                                channel == Channel::vertex_color));
    CHECK(channel_from_name(channel_name(channel)) == channel);
  }
}

TEST_CASE("names of channels are exact", "[core]") {
  CHECK_FALSE(channel_from_name("basecolor").has_value());
  CHECK_FALSE(channel_from_name("baseColor ").has_value());
  CHECK_FALSE(channel_from_name("normals").has_value());
  CHECK_FALSE(channel_from_name("").has_value());
}

TEST_CASE("depths are named as the command line spells them", "[core]") {
  CHECK(depth_from_name("u8") == Depth::u8);
  CHECK(depth_from_name("u16") == Depth::u16);
  CHECK(depth_from_name("half") == Depth::half);
  CHECK(depth_from_name("float") == Depth::float32);
  CHECK_FALSE(depth_from_name("float32").has_value());
  for (const Depth depth : {Depth::u8, Depth::u16, Depth::half, Depth::float32}) {
    CHECK(depth_from_name(depth_name(depth)) == depth);
  }
}

}  // namespace pounce
