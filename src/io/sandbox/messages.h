// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "io/codec/row_decoder.h"

namespace pounce::io {

// What a job and the process that decodes for it say to each other: a length and so many bytes of
// CBOR (RFC 8949), over a socket. Descriptors go beside the first byte. Neither side trusts the
// other: whatever does not have the expected form throws std::exception.

/// The longest message: the note in a hit map's header is the largest part of one.
inline constexpr std::uint32_t kMostMessageBytes = 16 << 20;

using Message = nlohmann::json;

/// Throws std::runtime_error if the other side is gone.
void send_message(int socket, const Message& message, const std::vector<int>& descriptors = {});
/// Nothing: the other side closed the socket. `descriptors`: what came with it, the caller's to
/// close.
std::optional<Message> receive_message(int socket, std::vector<int>& descriptors);

Message to_message(const ImageInfo& info);
ImageInfo info_from(const Message& message);
Message to_message(const WantedChannels& wanted);
WantedChannels wanted_from(const Message& message);

}  // namespace pounce::io
