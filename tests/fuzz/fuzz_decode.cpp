// SPDX-License-Identifier: Apache-2.0
//
// Images as a job reads them, in this process, from the first bytes to the last row, and what of an
// EXR can be named beside that. With the preset fuzz-decoders the libraries that decode them are
// instrumented. With fuzz they are this system's: what these do beyond their blocks is seen where
// it meets instrumented code. What they hand out of memory that nobody wrote is seen with both, as
// two readings of one image differ that find other bytes in new memory.
#include <array>
#include <cstring>
#include <random>

#include "fuzz/fuzz_image.h"
#include "fuzz/image_pieces.h"
#include "io/image/read.h"

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t max_size);

namespace pounce::fuzz {
namespace {

/// What new memory is filled with. Larger blocks come from the system, and calloc() relies on it.
class NewMemory {
 public:
  static void fill_with(int byte) {
    static const bool installed = __sanitizer_install_malloc_and_free_hooks(
                                      [](const volatile void* at, std::size_t size) {
                                        constexpr std::size_t kMostBytes = 64 << 10;
                                        if (byte_ >= 0 && size <= kMostBytes)
                                          std::memset(const_cast<void*>(at), byte_, size);
                                      },
                                      [](const volatile void*) {}) != 0;
    require(installed, "new memory can be filled");
    byte_ = byte;
  }

 private:
  static inline std::atomic<int> byte_{-1};
};

/// How a reading ended: with all texels, or with an error.
struct Reading {
  std::string error;
  std::vector<std::byte> texels;
  std::vector<std::string> left_out;
  bool operator==(const Reading& other) const {
    return error == other.error && (!error.empty() || texels == other.texels);
  }
};

void require_within(std::uint64_t most_bytes, const char* what) {
  const std::uint64_t taken = PeakMemory::bytes();
  if (taken > most_bytes)
    std::fprintf(stderr, "%llu bytes, not %llu\n", static_cast<unsigned long long>(taken),
                 static_cast<unsigned long long>(most_bytes));
  require(taken <= most_bytes, what);
}

/// Of an image of that many bytes, what its headers may take.
std::uint64_t most_header_bytes(std::size_t file_bytes) { return (4U << 20) + 4 * file_bytes; }

Reading read(const mesh::ImageRef& image, std::uint32_t strip, int new_memory) {
  // Images above are read in no time that fuzzing has.
  constexpr std::uint64_t kMostTexelBytes = 4 << 20, kMostDecoderBytes = 64 << 20;
  Reading reading;
  NewMemory::fill_with(new_memory);
  try {
    PeakMemory::start();
    io::ImageReader reader(image, {{}, Sandbox::off});
    const io::ImageInfo& info = reader.info();
    // OpenEXR makes room for blocks when it opens a file, and touches it when it reads.
    require_within(info.decoder_bytes + most_header_bytes(image.bytes->size()),
                   "opening an image takes no more than it announces");
    require(info.width > 0 && info.height > 0 && info.channels >= 1 && info.channels <= 4,
            "an image has texels");
    require(info.names.size() == info.channels, "channels have names");
    reading.left_out = info.left_out;
    const std::uint64_t texel_bytes = std::uint64_t{reader.row_bytes()} * info.height;
    if (texel_bytes <= kMostTexelBytes && info.decoder_bytes <= kMostDecoderBytes) {
      reading.texels.resize(texel_bytes);
      PeakMemory::start();
      for (std::uint32_t row = 0; row < info.height; row += strip) {
        reader.read_rows(std::min(strip, info.height - row),
                         reading.texels.data() + row * reader.row_bytes());
      }
      require_within(info.decoder_bytes, "a decoder takes what was announced");
    }
  } catch (const Error& e) {
    require(e.kind() == ErrorKind::input, e.what());
    reading.error = e.what();
    require(!reading.error.empty(), "an error says what is wrong");
  }
  NewMemory::fill_with(-1);
  return reading;
}

/// Reads it twice, in other strips. Returns the names of the channels that it has beside.
std::vector<std::string> read_alike(const mesh::ImageRef& image) {
  const Reading first = read(image, 68, 0x5A), second = read(image, 3, 0xA7);
  if (first.error != second.error && !first.error.empty() && !second.error.empty())
    return {};  // which names the rows that were asked for
  if (!(first == second))
    std::fprintf(stderr, "%s | %s\n", first.error.c_str(), second.error.c_str());
  require(first == second, "an image has the same texels in every reading");
  return first.left_out;
}

}  // namespace
}  // namespace pounce::fuzz

/// Changes what is inside of one piece of the file, so that the others are reached.
extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size,
                                               std::size_t max_size, unsigned int seed) {
  using namespace pounce::fuzz;
  std::minstd_rand random(seed);
  const std::vector<Range> pieces = pieces_of(data, size);
  if (pieces.empty() || random() % 4 == 0) {
    size = LLVMFuzzerMutate(data, size, max_size);
  } else {
    Range piece = pieces[random() % pieces.size()];
    constexpr std::size_t kWindow = 24;
    if (piece.size > kWindow && random() % 2 == 0) {
      piece.begin += random() % (piece.size - kWindow);
      piece.size = kWindow;
    }
    std::vector<std::uint8_t> changed(data + piece.begin, data + piece.begin + piece.size);
    const std::size_t kept = LLVMFuzzerMutate(changed.data(), changed.size(), changed.size());
    std::memcpy(data + piece.begin, changed.data(), kept);
  }
  if (random() % 16 > 0) mend_checksums(data, size);
  return size;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace pounce;
  std::vector<std::byte> bytes(size);
  if (size > 0) std::memcpy(bytes.data(), data, size);
  // Radiance pictures are read by a module that is not linked, with libraries of its own.
  if (fuzz::text_of(data, size).starts_with("#?")) return 0;
  mesh::ImageRef image = fuzz::in_memory(std::move(bytes), "image");
  image.path.clear();
  const std::vector<std::string> others = fuzz::read_alike(image);
  for (const std::size_t i : {std::size_t{0}, others.size() - 1}) {
    if (i >= others.size()) break;
    image.channels = others[i];
    fuzz::read_alike(image);
  }
  return 0;
}
