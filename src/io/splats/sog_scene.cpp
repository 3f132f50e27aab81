// SPDX-License-Identifier: Apache-2.0
//
// SOG: a Gaussian is a pixel, its attributes are images, lossless WebP, and meta.json says what the
// bytes of a pixel mean. They come in a folder or stored in a ZIP.
//
//   means_l, means_u   16 bits per coordinate, low and high byte, of a signed logarithm
//   scales, sh0        indices into codebooks of 256 floats (version 2), or steps of a range (1);
//                      the alpha of sh0 is the opacity
//   quats              the three smaller components, and in alpha which one is left out
//   shN                a palette of harmonics (an image, too), and the entry of each Gaussian
//
// An image decodes from its first pixel on, so prepare() writes the pixels of all of them into one
// scratch file, column by column, row of the image by row; decode() then reads any range. One image
// decodes at a time, in the constant memory of Vp8lDecoder; only the palette is kept (up to 3 MiB),
// since Gaussians name its entries in any order. Nobody checked meta.json: it is measured before it
// is parsed, values are looked up with their types, and the files it names must lie beside it.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <vector>

#include "core/input_file.h"
#include "core/portable_math.h"
#include "io/files/asset_file.h"
#include "io/json/untrusted.h"
#include "io/problems.h"
#include "io/splats/batch.h"
#include "io/splats/unpack.h"
#include "io/splats/vp8l.h"

namespace pounce::io {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kMostMetaBytes = 1 << 20;  // real ones have 20 kB
constexpr int kMostMetaDepth = 16;
constexpr std::uint64_t kPixelBytes = 4;
constexpr std::uint64_t kPaletteColumns = 64, kMostPaletteEntries = 1 << 16;
constexpr std::array<std::uint32_t, 4> kLobes = store::kLobesOfDegree;

/// What a byte of a channel means.
using Codebook = std::array<float, 256>;

/// Even steps from the least value of a channel to its largest: what bytes mean where the file has
/// no codebook. A table, so that both versions decode alike.
Codebook even_steps(double low, double high) {
  Codebook book;
  for (std::size_t b = 0; b < book.size(); ++b)
    book[b] = static_cast<float>(low + (high - low) * static_cast<double>(b) / 255);
  return book;
}

/// w, x, y, z of three components and, in alpha, which one was left out; other alphas mean nothing
/// is known.
std::array<float, 4> rotation_of(const std::byte* rgba) {
  constexpr float kSqrtHalf = 0.70710678F;
  const auto tag = std::to_integer<unsigned>(rgba[3]);
  if (tag < 252) return {1, 0, 0, 0};
  std::array<float, 3> rest;
  for (std::size_t k = 0; k < 3; ++k) rest[k] = (byte_at(rgba + k) / 255 * 2 - 1) * kSqrtHalf;
  return with_largest(tag - 252, rest);
}

class SogScene : public BatchScene {
 public:
  /// Reads meta.json and the headers of the images. Throws Error(input) where they are damaged or
  /// do not belong together.
  SogScene(const std::string& path, const Axes& axes);

  void prepare(const ScratchFolder& folder, const std::function<void()>& poll) override;
  std::uint64_t prepare_bytes() const override;
  std::uint64_t unpacked_bytes() const override;
  void decode(std::uint64_t first, std::uint64_t count, std::uint32_t lobes, SplatBatch& batch,
              const Take& take) const override;
  std::uint64_t decode_bytes() const override;

 private:
  enum Column : std::size_t { kMeansLow, kMeansHigh, kScales, kQuats, kSh0, kLabels };
  static constexpr std::size_t kColumns = 6;
  struct Image {
    std::shared_ptr<ReadFile> file;
    std::string name;
    Vp8lHeader header;
  };
  using Json = nlohmann::json;

  [[noreturn]] void fail(const std::string& what) const;
  Json open_meta(const std::string& path);
  Image open_image(const std::string& name) const;
  void read_meta(const Json& meta);
  void read_version_1(const Json& meta);
  void read_version_2(const Json& meta);
  void read_palette(const Json& meta);
  const Json& object(const Json& parent, const char* key) const;
  std::string file_name(const Json& part, const std::string& place, std::size_t index) const;
  std::vector<double> numbers(const Json& part, const std::string& place, const char* key,
                              std::size_t count) const;
  Codebook codebook(const Json& part, const std::string& place, float nothing) const;
  void unpack(const Image& image, const ScratchFolder& folder, const std::function<void()>& poll);
  void unpack_palette(const ScratchFolder& folder, const std::function<void()>& poll);
  void decode_row(const std::array<const std::byte*, kColumns>& row, std::size_t i,
                  std::uint32_t lobes, SplatBatch& batch) const;

  std::string path_, folder_;          ///< the folder; "" = in the archive
  std::shared_ptr<ReadFile> archive_;  ///< null = files in a folder
  std::vector<StoredEntry> entries_;   ///< beside meta.json in the archive
  std::string meta_name_;

  unsigned version_ = 2;
  std::array<Image, kColumns> images_;
  Image centroids_;
  std::array<double, 3> means_low_{}, means_span_{};
  std::array<Codebook, 3> scales_{}, colours_{};  ///< by channel
  Codebook alphas_{}, harmonics_{};
  bool has_palette_ = false;
  std::uint32_t lobes_ = 0;
  std::uint64_t palette_entries_ = 0;
  PageVector<std::uint8_t> palette_;  ///< entry by entry, 3 * lobes_ indices of harmonics_ each
  std::unique_ptr<WriteFile> scratch_;
  std::unique_ptr<ReadFile> unpacked_;
};

void SogScene::fail(const std::string& what) const {
  refuse(path_, "the SOG's {} {}; export it again", meta_name_, what);
}

SogScene::SogScene(const std::string& path, const Axes& axes) : BatchScene(axes), path_(path) {
  const Json meta = open_meta(path);
  read_meta(meta);
  info_.format =
      fmt::format("SOG v{} ({})", version_, archive_ != nullptr ? "bundled" : "a folder");
}

// A folder, a bundle, or the path of a meta.json itself. Only where it lies is different; images
// are then found beside it (open_image()).
SogScene::Json SogScene::open_meta(const std::string& path) {
  std::shared_ptr<ReadFile> file;
  std::uint64_t at = 0, bytes = 0;
  std::error_code ignored;
  if (fs::is_directory(path, ignored)) {
    folder_ = path;
    meta_name_ = "meta.json";
    info_.files = {(fs::path(path) / meta_name_).string()};
    file = open_input(info_.files[0]);
    bytes = file->size_bytes();
  } else {
    info_.files = {path};
    file = open_input(path);
    if (is_zip(*file)) {
      archive_ = file;
      // Some archivers put everything into a folder.
      for (const StoredEntry& entry : read_stored_zip(*file, path)) {
        if (meta_name_.empty() && fs::path(entry.name).filename() == "meta.json") {
          meta_name_ = entry.name;
          at = entry.at;
          bytes = entry.bytes;
        }
        entries_.push_back(entry);
      }
      if (meta_name_.empty()) refuse(path, "a ZIP archive without meta.json, so it is not a SOG");
    } else {
      folder_ = fs::path(path).parent_path().string();
      meta_name_ = fs::path(path).filename().string();
      bytes = file->size_bytes();
    }
  }
  if (bytes > kMostMetaBytes)
    fail(fmt::format("has {} bytes, which is too large for a scene", bytes));
  if (json_size(*file, at, bytes).depth > kMostMetaDepth) fail("is nested too deeply for a scene");
  std::string text(bytes, '\0');
  file->read(at, std::as_writable_bytes(std::span(text)));
  Json meta = Json::parse(text, nullptr, false);
  if (!meta.is_object()) fail("is not a JSON object");
  return meta;
}

// Only the header is read here, so that a scene of damaged or lossy images is refused before a job
// begins.
SogScene::Image SogScene::open_image(const std::string& name) const {
  Image image;
  // The name comes from the file: it shall lead nowhere else.
  if (name.empty() || name.size() > 255 || name.find_first_of("/\\") != std::string::npos ||
      name == "..") {
    fail("refers to an image in another folder");
  }
  std::uint64_t at = 0, bytes = 0;
  if (archive_ != nullptr) {
    const std::string wanted = (fs::path(meta_name_).parent_path() / name).string();
    const auto entry = std::find_if(entries_.begin(), entries_.end(),
                                    [&](const StoredEntry& e) { return e.name == wanted; });
    if (entry == entries_.end()) fail(fmt::format("refers to \"{}\", which is missing", name));
    image.file = archive_;
    image.name = fmt::format("{}: {}", path_, name);
    at = entry->at;
    bytes = entry->bytes;
  } else {
    image.name = (fs::path(folder_) / name).string();
    const std::string meta = (fs::path(folder_) / meta_name_).string();
    std::error_code ignored;
    if (!fs::is_regular_file(image.name, ignored) || !AssetFolder(meta, false).holds(image.name))
      fail(fmt::format("refers to \"{}\", which is missing", name));
    image.file = open_input(image.name);
    bytes = image.file->size_bytes();
  }
  image.header = read_vp8l_header(*image.file, at, bytes, image.name);
  return image;
}

const SogScene::Json& SogScene::object(const Json& parent, const char* key) const {
  const auto found = parent.find(key);
  if (found == parent.end() || !found->is_object()) fail(fmt::format("has no object \"{}\"", key));
  return *found;
}

std::string SogScene::file_name(const Json& part, const std::string& place,
                                std::size_t index) const {
  const auto files = part.find("files");
  if (files == part.end() || !files->is_array() || files->size() <= index ||
      !(*files)[index].is_string()) {
    fail(fmt::format("has no file {} in \"{}\"", index, place));
  }
  return (*files)[index].get<std::string>();
}

// A list of at least `count` numbers. Where one is wanted, a number alone will do as well: the
// bounds of a palette need no list.
std::vector<double> SogScene::numbers(const Json& part, const std::string& place, const char* key,
                                      std::size_t count) const {
  const auto found = part.find(key);
  std::vector<double> values;
  if (found != part.end() && found->is_array() && found->size() >= count) {
    for (std::size_t k = 0; k < count && (*found)[k].is_number(); ++k)
      values.push_back((*found)[k].get<double>());
  } else if (found != part.end() && found->is_number() && count == 1) {
    values.push_back(found->get<double>());
  }
  if (values.size() != count)
    fail(fmt::format("has no {} numbers \"{}\" in \"{}\"", count, key, place));
  return values;
}

/// JSON has no infinities, so a writer's become null. A first entry of null alone is the step
/// before the second; any other is `nothing`.
Codebook SogScene::codebook(const Json& part, const std::string& place, float nothing) const {
  const auto found = part.find("codebook");
  if (found == part.end() || !found->is_array() || found->size() != 256)
    fail(fmt::format("has no codebook of 256 numbers in \"{}\"", place));
  Codebook book;
  for (std::size_t k = 0; k < book.size(); ++k) {
    const Json& value = (*found)[k];
    if (!value.is_number() && !value.is_null())
      fail(fmt::format("has a codebook with entries that are not numbers in \"{}\"", place));
    book[k] = value.is_null() ? nothing : value.get<float>();
  }
  if ((*found)[0].is_null() && !(*found)[1].is_null())
    book[0] = book[1] + (book[1] - book[255]) / 255;
  return book;
}

void SogScene::read_meta(const Json& meta) {
  const auto version = meta.find("version");
  if (version != meta.end() && *version != 2) {
    refuse(path_,
           "SOG version {}; only versions 1 and 2 are supported: convert it, for example with "
           "splat-transform",
           version->is_number() ? version->dump() : "of an unknown kind");
  }
  // The first version did not state itself yet; whatever states none is read as that.
  version_ = version == meta.end() ? 1 : 2;
  version_ == 1 ? read_version_1(meta) : read_version_2(meta);
  const auto means = object(meta, "means");
  const auto low = numbers(means, "means", "mins", 3), high = numbers(means, "means", "maxs", 3);
  for (std::size_t k = 0; k < 3; ++k) {
    means_low_[k] = low[k];
    // Writers divide by the span, and take 1 where it is nothing.
    means_span_[k] = high[k] == low[k] ? 1 : high[k] - low[k];
  }
  images_[kMeansLow] = open_image(file_name(means, "means", 0));
  images_[kMeansHigh] = open_image(file_name(means, "means", 1));
  images_[kScales] = open_image(file_name(object(meta, "scales"), "scales", 0));
  images_[kQuats] = open_image(file_name(object(meta, "quats"), "quats", 0));
  images_[kSh0] = open_image(file_name(object(meta, "sh0"), "sh0", 0));
  if (meta.contains("shN")) read_palette(object(meta, "shN"));
  for (std::size_t k = 0; k < (has_palette_ ? kColumns : kColumns - 1); ++k) {
    const Image& image = images_[k];
    // The count says how much scratch is written, and no image can be unpacked to more pixels than
    // it has.
    const std::uint64_t pixels = std::uint64_t{image.header.width} * image.header.height;
    if (pixels < info_.splats) {
      fail(fmt::format("states {} Gaussians, but {} has {} pixels", info_.splats, image.name,
                       pixels));
    }
    if (archive_ == nullptr) info_.files.push_back(image.name);
  }
  if (archive_ == nullptr && has_palette_) info_.files.push_back(centroids_.name);
}

// Bytes are indices into a codebook of what the encoder found most often.
void SogScene::read_version_2(const Json& meta) {
  const auto count = meta.find("count");
  if (count == meta.end() || !count->is_number_unsigned() || *count == 0)
    fail("has no count of Gaussians");
  info_.splats = count->get<std::uint64_t>();
  constexpr float kNoSize = -std::numeric_limits<float>::infinity();
  scales_.fill(codebook(object(meta, "scales"), "scales", kNoSize));
  colours_.fill(codebook(object(meta, "sh0"), "sh0", 0));
  for (std::size_t b = 0; b < alphas_.size(); ++b) alphas_[b] = static_cast<float>(b) / 255;
  const auto model = meta.find("model");
  if (model != meta.end() && *model == "antialiased") info_.model = store::SplatModel::antialiased;
  if (model != meta.end() && *model == "2dgs") info_.model = store::SplatModel::flat;
}

void SogScene::read_version_1(const Json& meta) {
  const Json& means = object(meta, "means");
  const auto shape = means.find("shape");
  if (shape == means.end() || !shape->is_array() || shape->empty() ||
      !(*shape)[0].is_number_unsigned() || (*shape)[0] == 0) {
    fail("has no count of Gaussians (means.shape)");
  }
  info_.splats = (*shape)[0].get<std::uint64_t>();
  const auto steps = [&](const char* key, std::size_t channels, std::size_t channel) {
    const auto low = numbers(object(meta, key), key, "mins", channels);
    const auto high = numbers(object(meta, key), key, "maxs", channels);
    return even_steps(low[channel], high[channel]);
  };
  for (std::size_t k = 0; k < 3; ++k) {
    scales_[k] = steps("scales", 3, k);
    colours_[k] = steps("sh0", 4, k);
  }
  for (std::size_t b = 0; const float logit : steps("sh0", 4, 3))
    alphas_[b++] = static_cast<float>(1 / (1 + exp_same(-static_cast<double>(logit))));
  alphas_[0] = 0;  // encoders keep no colour under an alpha of 0
}

// The image of centroids has 64 entries in a row, each as wide as the coefficients of one channel:
// in version 1 its width is all that says the degree.
void SogScene::read_palette(const Json& part) {
  centroids_ = open_image(file_name(part, "shN", 0));
  images_[kLabels] = open_image(file_name(part, "shN", 1));
  std::uint64_t bands = 0, entries = kMostPaletteEntries;
  if (version_ == 2) {
    harmonics_ = codebook(part, "shN", 0);
    const auto stored = part.find("bands"), count = part.find("count");
    if (stored == part.end() || !stored->is_number_unsigned() || count == part.end() ||
        !count->is_number_unsigned()) {
      fail("has no bands and count in \"shN\"");
    }
    bands = stored->get<std::uint64_t>();
    entries = std::min(entries, count->get<std::uint64_t>());
  } else {
    harmonics_ = even_steps(numbers(part, "shN", "mins", 1)[0], numbers(part, "shN", "maxs", 1)[0]);
    for (std::uint64_t degree = 1; degree < kLobes.size(); ++degree)
      if (centroids_.header.width == kPaletteColumns * kLobes[degree]) bands = degree;
  }
  if (bands < 1 || bands > 3) fail("has spherical harmonics of an unknown degree in \"shN\"");
  lobes_ = kLobes[bands];
  if (centroids_.header.width != kPaletteColumns * lobes_) {
    fail(fmt::format("needs a palette of degree {}, {} pixels wide, but {} has {}", bands,
                     kPaletteColumns * lobes_, centroids_.name, centroids_.header.width));
  }
  palette_entries_ = std::min(entries, kPaletteColumns * centroids_.header.height);
  info_.sh_degree = static_cast<std::uint32_t>(bands);
  has_palette_ = true;
}

std::uint64_t SogScene::prepare_bytes() const {
  constexpr std::uint64_t kWidest = 16384;
  return round_to_pages(Vp8lDecoder::kMostBytes) + kWidest * kPixelBytes +
         round_to_pages(palette_entries_ * 3 * lobes_);
}

std::uint64_t SogScene::unpacked_bytes() const {
  // The columns, and beside them the blocks of one decoder, which are less than its image. Images
  // are decoded one after the other, so only the largest counts.
  std::uint64_t largest = 0;
  const auto look = [&](const Image& image) {
    largest = std::max(largest, std::uint64_t{image.header.width} * image.header.height);
  };
  for (const Image& image : images_) look(image);
  if (has_palette_) look(centroids_);
  return (kColumns * info_.splats + largest) * kPixelBytes;
}

void SogScene::prepare(const ScratchFolder& folder, const std::function<void()>& poll) {
  scratch_ = folder.create();
  for (std::size_t k = 0; k < (has_palette_ ? kColumns : kColumns - 1); ++k)
    unpack(images_[k], folder, poll);
  unpacked_ = scratch_->reader();
  if (has_palette_) unpack_palette(folder, poll);
}

/// Appends the pixels that belong to Gaussians.
void SogScene::unpack(const Image& image, const ScratchFolder& folder,
                      const std::function<void()>& poll) {
  const auto blocks = folder.create();
  Vp8lDecoder decoder(*image.file, image.header, image.name, *blocks);
  PageVector<std::uint8_t> row(image.header.width * kPixelBytes);
  for (std::uint64_t left = info_.splats; left > 0;) {
    decoder.read_row(row);
    const std::uint64_t pixels = std::min<std::uint64_t>(left, image.header.width);
    scratch_->append(std::as_bytes(std::span(row)).first(pixels * kPixelBytes));
    left -= pixels;
    poll();
  }
}

/// Entry n has its coefficients side by side: 64 entries in a row of the image.
void SogScene::unpack_palette(const ScratchFolder& folder, const std::function<void()>& poll) {
  const auto blocks = folder.create();
  Vp8lDecoder decoder(*centroids_.file, centroids_.header, centroids_.name, *blocks);
  PageVector<std::uint8_t> row(centroids_.header.width * kPixelBytes);
  palette_.resize(palette_entries_ * 3 * lobes_);
  for (std::uint64_t first = 0; first < palette_entries_; first += kPaletteColumns) {
    decoder.read_row(row);
    const std::uint64_t entries = std::min(kPaletteColumns, palette_entries_ - first);
    for (std::uint64_t k = 0; k < entries * lobes_; ++k) {
      for (std::uint64_t c = 0; c < 3; ++c)
        palette_[3 * (first * lobes_ + k) + c] = row[kPixelBytes * k + c];
    }
    poll();
  }
}

// The palette is counted here, though it is kept from prepare() on: who reads leases it.
std::uint64_t SogScene::decode_bytes() const {
  return round_to_pages(kColumns * kPieceRows * kPixelBytes) +
         round_to_pages(palette_entries_ * 3 * lobes_);
}

void SogScene::decode(std::uint64_t first, std::uint64_t count, std::uint32_t lobes,
                      SplatBatch& batch, const Take& take) const {
  const std::size_t columns = has_palette_ && lobes > 0 ? kColumns : kColumns - 1;
  const std::uint64_t most = std::min(count, kPieceRows) * kPixelBytes;
  PageVector<std::byte> raw(kColumns * most);
  for (const std::uint64_t end = first + count; first < end;) {
    const std::uint64_t rows = std::min(end - first, kPieceRows);
    for (std::size_t k = 0; k < columns; ++k) {
      unpacked_->read((k * info_.splats + first) * kPixelBytes,
                      std::span(raw).subspan(k * most, rows * kPixelBytes));
    }
    for_batches(rows, [&](std::uint64_t begin, std::size_t n) {
      for (std::size_t i = 0; i < n; ++i) {
        std::array<const std::byte*, kColumns> row{};
        for (std::size_t k = 0; k < columns; ++k)
          row[k] = &raw[k * most + (begin + i) * kPixelBytes];
        decode_row(row, i, lobes, batch);
      }
      for (std::size_t k = 0; k < 3; ++k) {
        exponential(batch.sigma[k], n);
        colour_of_dc(batch.colour[k], n);
      }
      take(n);
    });
    first += rows;
  }
}

// A pixel of each image makes a Gaussian; scales and colours are left as the codebook has them and
// converted for the whole batch.
void SogScene::decode_row(const std::array<const std::byte*, kColumns>& row, std::size_t i,
                          std::uint32_t lobes, SplatBatch& batch) const {
  const auto index = [&](std::size_t column, std::size_t channel) {
    return std::to_integer<std::size_t>(row[column][channel]);
  };
  for (std::size_t k = 0; k < 3; ++k) {
    const auto stored = static_cast<double>(index(kMeansLow, k) | index(kMeansHigh, k) << 8);
    const double t = means_low_[k] + means_span_[k] * stored / 65535;
    const double size = exp_same(std::abs(t)) - 1;  // means are stored as logarithms
    batch.mean[k][i] = static_cast<float>(t < 0 ? -size : size);
    batch.sigma[k][i] = scales_[k][index(kScales, k)];
    batch.colour[k][i] = colours_[k][index(kSh0, k)];
  }
  batch.alpha[i] = alphas_[index(kSh0, 3)];
  const auto q = rotation_of(row[kQuats]);
  for (std::size_t k = 0; k < 4; ++k) batch.rotation[k][i] = q[k];
  const std::size_t harmonics = 3 * std::min(lobes, lobes_);
  if (harmonics == 0) return;
  // A label beyond the palette shows no harmonics: one bad pixel is no reason to refuse a scene.
  const std::size_t entry = index(kLabels, 0) | index(kLabels, 1) << 8;
  const std::uint8_t* const indices =
      entry < palette_entries_ ? &palette_[entry * 3 * lobes_] : nullptr;
  for (std::size_t k = 0; k < harmonics; ++k)
    batch.sh[k][i] = indices == nullptr ? 0 : harmonics_[indices[k]];
}

}  // namespace

std::unique_ptr<SplatScene> open_sog(const std::string& path, const Axes& axes) {
  return std::make_unique<SogScene>(path, axes);
}

}  // namespace pounce::io
