// SPDX-License-Identifier: Apache-2.0
//
// XXH3: keys of the cache and checksums of every stored block. Not against forgery: who may write
// to the cache may write anything anyway. 128 bits for keys, which must not collide by chance among
// all that a studio ever stores; 64 for checksums, which only have to notice damage.
#include "core/hash.h"

#include <fmt/format.h>

// The only file that sees xxHash: inlined here, so that the library links nothing for it.
#define XXH_INLINE_ALL
#include <xxhash.h>

namespace pounce {

std::string to_hex(const Hash128& hash) { return fmt::format("{:016x}{:016x}", hash.hi, hash.lo); }

std::uint64_t checksum(std::span<const std::byte> bytes) noexcept {
  return XXH3_64bits(bytes.data(), bytes.size());
}

struct Hasher::State {
  XXH3_state_t xxh;
};

Hasher::Hasher() : state_(std::make_unique<State>()) { XXH3_128bits_reset(&state_->xxh); }
Hasher::~Hasher() = default;

void Hasher::add(std::span<const std::byte> bytes) {
  if (!bytes.empty()) XXH3_128bits_update(&state_->xxh, bytes.data(), bytes.size());
}

// The length first: "ab" and "c" must not give the key of "a" and "bc".
void Hasher::add(std::string_view text) {
  add(static_cast<std::uint64_t>(text.size()));
  add(std::as_bytes(std::span(text.data(), text.size())));
}

Hash128 Hasher::digest() const {
  const XXH128_hash_t hash = XXH3_128bits_digest(&state_->xxh);
  return {hash.high64, hash.low64};
}

}  // namespace pounce
