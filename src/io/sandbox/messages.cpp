// SPDX-License-Identifier: Apache-2.0
#include "io/sandbox/messages.h"

#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <stdexcept>

namespace pounce::io {
namespace {

constexpr std::size_t kMostDescriptors = 4;

void send_all(int socket, const std::uint8_t* bytes, std::size_t count) {
  while (count > 0) {
    const ssize_t sent = ::send(socket, bytes, count, MSG_NOSIGNAL);
    if (sent < 0 && errno == EINTR) continue;
    if (sent <= 0) throw std::runtime_error("the other side of the socket is gone");
    bytes += sent;
    count -= static_cast<std::size_t>(sent);
  }
}

/// False at the end, before the first byte.
bool receive_all(int socket, std::uint8_t* bytes, std::size_t count) {
  for (std::size_t done = 0; done < count;) {
    const ssize_t got = ::recv(socket, bytes + done, count - done, 0);
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0 && done == 0) return false;
    if (got <= 0) throw std::runtime_error("the other side of the socket is gone");
    done += static_cast<std::size_t>(got);
  }
  return true;
}

/// The length of a message, with the descriptors.
bool receive_length(int socket, std::uint32_t& length, std::vector<int>& descriptors) {
  alignas(cmsghdr) std::array<char, CMSG_SPACE(kMostDescriptors * sizeof(int))> control{};
  iovec data{&length, sizeof length};
  msghdr header{};
  header.msg_iov = &data;
  header.msg_iovlen = 1;
  header.msg_control = control.data();
  header.msg_controllen = control.size();
  ssize_t got = 0;
  do {
    got = ::recvmsg(socket, &header, MSG_CMSG_CLOEXEC);
  } while (got < 0 && errno == EINTR);
  if (got <= 0) return false;
  for (cmsghdr* at = CMSG_FIRSTHDR(&header); at != nullptr; at = CMSG_NXTHDR(&header, at)) {
    if (at->cmsg_level != SOL_SOCKET || at->cmsg_type != SCM_RIGHTS) continue;
    const std::size_t count = (at->cmsg_len - CMSG_LEN(0)) / sizeof(int);
    for (std::size_t i = 0; i < count; ++i) {
      int descriptor = -1;
      std::memcpy(&descriptor, CMSG_DATA(at) + i * sizeof(int), sizeof descriptor);
      descriptors.push_back(descriptor);
    }
  }
  const auto had = static_cast<std::size_t>(got);
  return had == sizeof length ||
         receive_all(socket, reinterpret_cast<std::uint8_t*>(&length) + had, sizeof length - had);
}

}  // namespace

void send_message(int socket, const Message& message, const std::vector<int>& descriptors) {
  const std::vector<std::uint8_t> bytes = Message::to_cbor(message);
  if (bytes.size() > kMostMessageBytes) throw std::runtime_error("a message is too long");
  std::uint32_t length = static_cast<std::uint32_t>(bytes.size());
  alignas(cmsghdr) std::array<char, CMSG_SPACE(kMostDescriptors * sizeof(int))> control{};
  iovec data{&length, sizeof length};
  msghdr header{};
  header.msg_iov = &data;
  header.msg_iovlen = 1;
  if (!descriptors.empty()) {
    header.msg_control = control.data();
    header.msg_controllen = CMSG_SPACE(descriptors.size() * sizeof(int));
    cmsghdr* const rights = CMSG_FIRSTHDR(&header);
    rights->cmsg_level = SOL_SOCKET;
    rights->cmsg_type = SCM_RIGHTS;
    rights->cmsg_len = CMSG_LEN(descriptors.size() * sizeof(int));
    std::memcpy(CMSG_DATA(rights), descriptors.data(), descriptors.size() * sizeof(int));
  }
  ssize_t sent = 0;
  do {
    sent = ::sendmsg(socket, &header, MSG_NOSIGNAL);
  } while (sent < 0 && errno == EINTR);
  if (sent != static_cast<ssize_t>(sizeof length))
    throw std::runtime_error("the other side of the socket is gone");
  send_all(socket, bytes.data(), bytes.size());
}

std::optional<Message> receive_message(int socket, std::vector<int>& descriptors) {
  std::uint32_t length = 0;
  if (!receive_length(socket, length, descriptors)) return std::nullopt;
  if (length > kMostMessageBytes) throw std::runtime_error("a message is too long");
  std::vector<std::uint8_t> bytes(length);
  if (!receive_all(socket, bytes.data(), bytes.size())) return std::nullopt;
  return Message::from_cbor(bytes);
}

Message to_message(const ImageInfo& info) {
  Message out = {{"width", info.width},
                 {"height", info.height},
                 {"channels", info.channels},
                 {"depth", static_cast<int>(info.depth)},
                 {"linear", info.linear},
                 {"has_alpha", info.has_alpha},
                 {"premultiplied", info.premultiplied},
                 {"names", info.names},
                 {"left_out", info.left_out},
                 {"tile_width", info.tile_width},
                 {"tile_height", info.tile_height},
                 {"levels", info.levels},
                 {"decoder_bytes", info.decoder_bytes},
                 {"hits_note", info.hits_note},
                 {"colour_problem", info.colours.problem}};
  if (info.colours.linear) out["colour_linear"] = *info.colours.linear;
  if (info.colours.primaries) out["primaries"] = *info.colours.primaries;
  return out;
}

ImageInfo info_from(const Message& message) {
  ImageInfo info;
  message.at("width").get_to(info.width);
  message.at("height").get_to(info.height);
  message.at("channels").get_to(info.channels);
  const int depth = message.at("depth").get<int>();
  if (depth < 0 || depth > static_cast<int>(Depth::float32) || info.channels == 0)
    throw std::runtime_error("a message says what cannot be");
  info.depth = static_cast<Depth>(depth);
  message.at("linear").get_to(info.linear);
  message.at("has_alpha").get_to(info.has_alpha);
  message.at("premultiplied").get_to(info.premultiplied);
  message.at("names").get_to(info.names);
  message.at("left_out").get_to(info.left_out);
  message.at("tile_width").get_to(info.tile_width);
  message.at("tile_height").get_to(info.tile_height);
  message.at("levels").get_to(info.levels);
  message.at("decoder_bytes").get_to(info.decoder_bytes);
  message.at("hits_note").get_to(info.hits_note);
  message.at("colour_problem").get_to(info.colours.problem);
  if (message.contains("colour_linear"))
    info.colours.linear = message.at("colour_linear").get<bool>();
  if (message.contains("primaries"))
    info.colours.primaries = message.at("primaries").get<Chromaticities>();
  return info;
}

Message to_message(const WantedChannels& wanted) {
  return {{"named", wanted.named}, {"data", wanted.data}};
}

WantedChannels wanted_from(const Message& message) {
  return {message.at("named").get<std::string>(),
          message.at("data").get<std::vector<std::string>>()};
}

}  // namespace pounce::io
