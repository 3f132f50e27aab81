// SPDX-License-Identifier: Apache-2.0
//
// Bytes before and after zstd, which finds repeated bytes and knows nothing of numbers. Two filters
// help it: delta turns neighbours that are alike into small numbers, and shuffle puts bytes of
// equal weight side by side, so that their upper bytes become long runs of zeros. What is left for
// zstd is so simple that its lowest level is within 2 to 4 % of level 3.
//
// Every texel that is read goes through the inverses, so they are written as loops that compilers
// turn into vector code: fixed widths, no aliasing, no branches inside.
//
// Frames come from files that others may have written. Before zstd is let at one, it must say how
// long its content is and be exactly one frame; what comes out must be exactly what was announced.
//
// The frames of zstd have no checksum of their own, since chunks have one, and no content is
// trusted to be small: sizes come from an index that was checked.
//
// Scratch data of small jobs never reaches a disk: compressing it would cost more than all else
// that a store does. It goes into frames of blocks as they are (RFC 8878, 3.1.1), which zstd
// unpacks like any other. There filters help nobody: what would pass them need not, and then its
// frame states its size in eight bytes. zstd itself takes as few as the size needs, so no other
// frame does.
#include "store/pack/codec.h"

#include <fmt/format.h>
#include <zstd.h>
#include <zstd_errors.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <functional>
#include <new>

#include "core/page_pool.h"
#include "pounce/error.h"

namespace pounce::store {
namespace {

// 128 KiB, the size of a zstd block: columns of a 64x64 block are shorter, and a context stays
// below 1 MiB however large the chunk is.
constexpr int kWindowLog = 17;

void check_zstd(std::size_t code, const char* what) {
  if (ZSTD_getErrorCode(code) == ZSTD_error_memory_allocation) throw std::bad_alloc();
  if (ZSTD_isError(code)) {
    throw Error(ErrorKind::internal,
                fmt::format("zstd: cannot {}: {} (please report)", what, ZSTD_getErrorName(code)));
  }
}

[[noreturn]] void damaged(const std::string& what) {
  throw Error(
      ErrorKind::damaged_store,
      fmt::format("a compressed block is damaged: {}; delete the store or run with --no-cache",
                  what));
}

// The three below are asked by code of ours: what they find is a mistake here, not in a file.
void check_elements(std::size_t from, std::size_t to, std::size_t element_bytes) {
  if (element_bytes == 0 || from != to || from % element_bytes != 0) {
    throw Error(ErrorKind::internal,
                fmt::format("byte shuffle of {} bytes into {}, {} per element (please report)",
                            from, to, element_bytes));
  }
}

/// Calls visit.operator()<T>() for the unsigned type of that many bytes.
template <class Visitor>
void with_unsigned(std::size_t element_bytes, const Visitor& visit) {
  switch (element_bytes) {
    case 1:
      return visit.template operator()<std::uint8_t>();
    case 2:
      return visit.template operator()<std::uint16_t>();
    case 4:
      return visit.template operator()<std::uint32_t>();
    default:
      throw Error(ErrorKind::internal,
                  fmt::format("delta of {}-byte elements (please report)", element_bytes));
  }
}

void check_delta(std::size_t bytes, std::size_t element_bytes, std::size_t stride) {
  if (stride == 0) throw Error(ErrorKind::internal, "delta with a stride of 0 (please report)");
  check_elements(bytes, bytes, element_bytes);
}

// Elements per step of the vector loops: 256 bytes of the widest type. The copies in and out tell
// the compiler that nothing overlaps, and cost nothing once the loops are vectors.
constexpr std::size_t kStep = 64;

template <class T, class Operation>
void combine(std::byte* to, const std::byte* from, std::size_t count, Operation operation) {
  std::array<T, kStep> a, b;
  std::memcpy(a.data(), to, count * sizeof(T));
  std::memcpy(b.data(), from, count * sizeof(T));
  for (std::size_t i = 0; i < count; ++i) a[i] = static_cast<T>(operation(a[i], b[i]));
  std::memcpy(to, a.data(), count * sizeof(T));
}

template <class T>
void delta_of(std::span<std::byte> elements, std::size_t stride) {
  // From the end, so that every difference is taken to an element that is still as it was.
  std::size_t end = elements.size() / sizeof(T);
  while (end > stride) {
    const std::size_t n = std::min(kStep, end - stride);
    end -= n;
    combine<T>(&elements[end * sizeof(T)], &elements[(end - stride) * sizeof(T)], n,
               std::minus<>());
  }
}

template <class T>
void undelta_of(std::span<std::byte> elements, std::size_t stride) {
  const std::size_t count = elements.size() / sizeof(T);
  if (stride < kStep / 4) {
    // Short strides are running sums, one per lane; the sum in a register spares a trip through
    // memory.
    for (std::size_t lane = 0; lane < std::min(stride, count); ++lane) {
      T sum = 0;
      for (std::size_t i = lane; i < count; i += stride) {
        T value;
        std::memcpy(&value, &elements[i * sizeof(T)], sizeof(T));
        sum = static_cast<T>(sum + value);
        std::memcpy(&elements[i * sizeof(T)], &sum, sizeof(T));
      }
    }
    return;
  }
  const std::size_t step = std::min(stride, kStep);  // below this the elements added are final
  for (std::size_t begin = stride; begin < count; begin += step) {
    combine<T>(&elements[begin * sizeof(T)], &elements[(begin - stride) * sizeof(T)],
               std::min(step, count - begin), std::plus<>());
  }
}

/// Shuffle through integers of the element's size, which compilers turn into vector code.
template <class T>
void shuffle_of(const std::byte* __restrict elements, std::size_t count,
                std::byte* __restrict planes) {
  for (std::size_t k = 0; k < sizeof(T); ++k) {
    for (std::size_t i = 0; i < count; ++i) {
      T value;
      std::memcpy(&value, elements + i * sizeof(T), sizeof(T));
      planes[k * count + i] = static_cast<std::byte>(value >> (8 * k));
    }
  }
}

// Every block that is read goes through one of these: the two widths that stores use, written out.
/// Two planes become two bytes of each element; the next begins `stride` bytes behind.
inline void unshuffle2(const std::byte* __restrict planes, std::size_t count,
                       std::byte* __restrict elements, std::size_t stride) {
  for (std::size_t i = 0; i < count; ++i) {
    const auto value = static_cast<std::uint16_t>(
        std::to_integer<unsigned>(planes[i]) | std::to_integer<unsigned>(planes[count + i]) << 8);
    std::memcpy(elements + i * stride, &value, sizeof value);
  }
}

void unshuffle4(const std::byte* __restrict planes, std::size_t count,
                std::byte* __restrict elements) {
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint32_t value = std::to_integer<std::uint32_t>(planes[i]) |
                                std::to_integer<std::uint32_t>(planes[count + i]) << 8 |
                                std::to_integer<std::uint32_t>(planes[2 * count + i]) << 16 |
                                std::to_integer<std::uint32_t>(planes[3 * count + i]) << 24;
    std::memcpy(elements + i * sizeof value, &value, sizeof value);
  }
}

/// The logarithm to base 2 in steps of 2^-16, rounded down; v > 0.
std::uint32_t log2_steps(std::uint32_t v) {
  // Digit by digit, in integers: the estimate decides how a block is stored
  // (surface/block_maker.cpp), and logarithms of a C library may differ in the last bit.
  const auto whole = static_cast<std::uint32_t>(std::bit_width(v)) - 1;
  std::uint64_t x = std::uint64_t{v}
                    << (31 - whole);  // 1 <= x / 2^31 < 2; squaring doubles its log
  std::uint32_t steps = whole << 16;
  for (std::uint32_t bit = 1U << 15; bit != 0; bit >>= 1) {
    x = x * x >> 31;
    if (x >> 32 == 0) continue;
    x >>= 1;
    steps |= bit;
  }
  return steps;
}

}  // namespace

std::uint64_t estimated_bytes(std::span<const std::byte> raw) {
  constexpr std::size_t kChunk = 1024;
  static const auto information = [] {  // c log2 c
    std::array<std::uint64_t, kChunk + 1> table{};
    for (std::uint32_t c = 1; c <= kChunk; ++c) table[c] = std::uint64_t{c} * log2_steps(c);
    return table;
  }();
  // The entropy of n bytes of which c are of one value: n log2 n - sum of c log2 c, in bits.
  std::uint64_t steps = 0;
  for (; !raw.empty(); raw = raw.subspan(std::min(kChunk, raw.size()))) {
    const auto chunk = raw.first(std::min(kChunk, raw.size()));
    // Four counters of each value: equal bytes in a row would wait for each other.
    std::array<std::array<std::uint16_t, 256>, 4> counts{};
    for (std::size_t i = 0; i < chunk.size(); ++i)
      ++counts[i % 4][std::to_integer<std::size_t>(chunk[i])];
    steps += information[chunk.size()];
    for (std::size_t v = 0; v < 256; ++v)
      steps -= information[counts[0][v] + counts[1][v] + counts[2][v] + counts[3][v]];
  }
  return steps >> 19;  // 2^16 steps to a bit
}

namespace {

/// False: so much is not left.
bool take(PlainRoom& room, std::uint64_t bytes) {
  std::uint64_t left = room.load(std::memory_order_relaxed);
  while (left >= bytes) {
    if (room.compare_exchange_weak(left, left - bytes, std::memory_order_relaxed)) return true;
  }
  return false;
}

template <std::size_t bytes>
void put(std::uint64_t value, std::vector<std::byte>& to) {
  const auto* const from = reinterpret_cast<const std::byte*>(&value);
  to.insert(to.end(), from, from + bytes);
}

// The fifth byte of a frame: one segment, and how many bytes state its size.
constexpr std::byte kSizeIn4Bytes{0xA0}, kSizeIn8Bytes{0xE0};

/// A frame of the bytes as they are: a header that states their number, blocks with a header each.
template <class Size>
void make_plain_frame(std::span<const std::byte> raw, std::byte descriptor,
                      std::vector<std::byte>& stored) {
  constexpr std::uint32_t kMagic = 0xFD2FB528, kLastBlock = 1;
  constexpr std::size_t kMostInBlock = std::size_t{1} << kWindowLog;
  constexpr std::size_t kFrameHeader = 5 + sizeof(Size), kBlockHeader = 3;
  const std::size_t blocks =
      std::max<std::size_t>((raw.size() + kMostInBlock - 1) / kMostInBlock, 1);
  stored.clear();
  stored.reserve(kFrameHeader + blocks * kBlockHeader + raw.size());
  put<4>(kMagic, stored);
  stored.push_back(descriptor);
  put<sizeof(Size)>(raw.size(), stored);
  for (std::size_t b = 0; b < blocks; ++b) {
    const auto block =
        raw.subspan(b * kMostInBlock).first(std::min(kMostInBlock, raw.size() - b * kMostInBlock));
    put<kBlockHeader>(block.size() << 3 | (b + 1 == blocks ? kLastBlock : 0), stored);
    stored.insert(stored.end(), block.begin(), block.end());
  }
}

}  // namespace

struct Compressor::Contexts {
  ZSTD_CCtx* compress = nullptr;
  ZSTD_DCtx* decompress = nullptr;

  Contexts() : compress(ZSTD_createCCtx()), decompress(ZSTD_createDCtx()) {
    if (compress == nullptr || decompress == nullptr) {
      free();
      throw std::bad_alloc();
    }
    // Chunks carry an XXH3 of ours, which is checked before the frame is looked at.
    check_zstd(ZSTD_CCtx_setParameter(compress, ZSTD_c_checksumFlag, 0), "disable checksums");
    check_zstd(ZSTD_CCtx_setParameter(compress, ZSTD_c_compressionLevel, kZstdLevel), "set level");
    check_zstd(ZSTD_CCtx_setParameter(compress, ZSTD_c_windowLog, kWindowLog), "set the window");
  }
  ~Contexts() { free(); }
  Contexts(const Contexts&) = delete;
  Contexts& operator=(const Contexts&) = delete;

  void free() {
    ZSTD_freeCCtx(compress);
    ZSTD_freeDCtx(decompress);
  }
};

Compressor::Compressor() : contexts_(std::make_unique<Contexts>()) {}
Compressor::~Compressor() = default;
Compressor::Compressor(Compressor&&) noexcept = default;

void Compressor::compress(std::span<const std::byte> raw, std::vector<std::byte>& stored, int level,
                          PlainRoom* room) {
  if (room != nullptr && take(*room, raw.size()))
    return make_plain_frame<std::uint32_t>(raw, kSizeIn4Bytes, stored);
  check_zstd(ZSTD_CCtx_setParameter(contexts_->compress, ZSTD_c_compressionLevel, level),
             "set the level");
  // Whatever the bytes are they fit: no second try with a larger buffer.
  stored.resize(ZSTD_compressBound(raw.size()));
  const std::size_t size =
      ZSTD_compress2(contexts_->compress, stored.data(), stored.size(), raw.data(), raw.size());
  check_zstd(size, "compress a block");
  stored.resize(size);
  if (is_as_is(stored))
    throw Error(ErrorKind::internal, "zstd states a size in eight bytes (please report)");
}

bool Compressor::keep_as_is(std::span<const std::byte> raw, std::vector<std::byte>& stored,
                            PlainRoom* room) {
  if (room == nullptr || !take(*room, raw.size())) return false;
  make_plain_frame<std::uint64_t>(raw, kSizeIn8Bytes, stored);
  return true;
}

bool is_as_is(std::span<const std::byte> frame) {
  return frame.size() > 4 && frame[4] == kSizeIn8Bytes;
}

void Compressor::decompress(std::span<const std::byte> stored, std::span<std::byte> raw) {
  const unsigned long long content = ZSTD_getFrameContentSize(stored.data(), stored.size());
  if (content == ZSTD_CONTENTSIZE_ERROR || content == ZSTD_CONTENTSIZE_UNKNOWN) {
    damaged("it is not a zstd frame with a stated size");
  }
  if (content != raw.size()) {
    damaged(fmt::format("its frame holds {} bytes, expected {}", content, raw.size()));
  }
  // Exactly one frame: zstd would silently go on into a second one or skip foreign ones.
  const std::size_t frame = ZSTD_findFrameCompressedSize(stored.data(), stored.size());
  if (ZSTD_isError(frame) || frame != stored.size()) damaged("its frame has the wrong length");
  const std::size_t size = ZSTD_decompressDCtx(contexts_->decompress, raw.data(), raw.size(),
                                               stored.data(), stored.size());
  // Too little memory is no damage: the pack must not be thrown away for it.
  if (ZSTD_getErrorCode(size) == ZSTD_error_memory_allocation) throw std::bad_alloc();
  if (ZSTD_isError(size)) damaged(ZSTD_getErrorName(size));
  if (size != raw.size())
    damaged(fmt::format("only {} of {} bytes were decompressed", size, raw.size()));
}

std::uint64_t Compressor::context_bytes() {
  // Measured once: a context for compressing grows up to what a chunk of more than a window asks
  // for, whatever is in it; one for decompressing stays as it is. Buffers of the pool, since memory
  // that is touched for the first time is most of what this costs.
  static const std::uint64_t measured = [] {
    const Contexts contexts;
    const PageVector<std::byte> raw((std::size_t{1} << kWindowLog) + 1);
    UnsetPageVector<std::byte> stored(ZSTD_compressBound(raw.size()));
    check_zstd(
        ZSTD_compress2(contexts.compress, stored.data(), stored.size(), raw.data(), raw.size()),
        "measure a context");
    return std::uint64_t{ZSTD_sizeof_CCtx(contexts.compress)} +
           std::uint64_t{ZSTD_sizeof_DCtx(contexts.decompress)};
  }();
  return measured;
}

void shuffle(std::span<const std::byte> elements, std::size_t element_bytes,
             std::span<std::byte> planes) {
  check_elements(elements.size(), planes.size(), element_bytes);
  const std::size_t count = elements.size() / element_bytes;
  if (element_bytes == 2) return shuffle_of<std::uint16_t>(elements.data(), count, planes.data());
  if (element_bytes == 4) return shuffle_of<std::uint32_t>(elements.data(), count, planes.data());
  for (std::size_t k = 0; k < element_bytes; ++k) {
    for (std::size_t i = 0; i < count; ++i) planes[k * count + i] = elements[i * element_bytes + k];
  }
}

void unshuffle(std::span<const std::byte> planes, std::size_t element_bytes,
               std::span<std::byte> elements) {
  check_elements(planes.size(), elements.size(), element_bytes);
  const std::size_t count = elements.size() / element_bytes;
  if (element_bytes == 2) return unshuffle2(planes.data(), count, elements.data(), 2);
  if (element_bytes == 4) return unshuffle4(planes.data(), count, elements.data());
  std::size_t k = 0;
  for (; k + 1 < element_bytes; k += 2)  // two planes at once: half as many stores
    unshuffle2(planes.data() + k * count, count, elements.data() + k, element_bytes);
  for (std::size_t i = 0; k < element_bytes && i < count; ++i)
    elements[i * element_bytes + k] = planes[k * count + i];
}

void delta(std::span<std::byte> elements, std::size_t element_bytes, std::size_t stride) {
  check_delta(elements.size(), element_bytes, stride);
  with_unsigned(element_bytes, [&]<class T>() { delta_of<T>(elements, stride); });
}

void undelta(std::span<std::byte> elements, std::size_t element_bytes, std::size_t stride) {
  check_delta(elements.size(), element_bytes, stride);
  with_unsigned(element_bytes, [&]<class T>() { undelta_of<T>(elements, stride); });
}

}  // namespace pounce::store
