// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <webp/decode.h>
#include <webp/encode.h>
#include <webp/mux.h>

#include <cstdio>
#include <fstream>
#include <iterator>

#include "corpus.h"

namespace pounce::test::corpus {
namespace {

struct Webp {
  int width = 37, height = 29;
  bool lossless = false, alpha = false;
  float quality = 75;
  int method = 2;
  bool sharp = false, simple = false;
  int alpha_method = 1, near = 100;
  bool extended = false;  ///< with a profile and Exif
};

std::vector<std::uint8_t> picture(const Webp& webp, Random& random) {
  std::vector<std::uint8_t> out;
  for (int y = 0; y < webp.height; ++y) {
    for (int x = 0; x < webp.width; ++x) {
      out.push_back(static_cast<std::uint8_t>(255 * x / webp.width));
      out.push_back(static_cast<std::uint8_t>(255 * y / webp.height));
      out.push_back(static_cast<std::uint8_t>(random.below(60)));
      out.push_back(static_cast<std::uint8_t>(!webp.alpha        ? 255
                                              : random.one_in(4) ? 0
                                              : random.one_in(3) ? 255
                                                                 : (x * 7 + y) % 256));
    }
  }
  return out;
}

WebPConfig config_of(const Webp& webp) {
  WebPConfig config;
  WebPConfigInit(&config);
  config.lossless = webp.lossless ? 1 : 0;
  config.quality = webp.quality;
  config.method = webp.method;
  config.exact = 1;
  config.use_sharp_yuv = webp.sharp ? 1 : 0;
  config.filter_type = webp.simple ? 0 : 1;
  config.alpha_compression = webp.alpha_method;
  config.near_lossless = webp.near;
  return config;
}

std::vector<std::uint8_t> encode(const Webp& webp, const std::vector<std::uint8_t>& samples) {
  const WebPConfig config = config_of(webp);
  WebPPicture image;
  WebPPictureInit(&image);
  image.use_argb = webp.lossless ? 1 : 0;
  image.width = webp.width;
  image.height = webp.height;
  if (webp.alpha)
    WebPPictureImportRGBA(&image, samples.data(), webp.width * 4);
  else
    WebPPictureImportRGBX(&image, samples.data(), webp.width * 4);
  WebPMemoryWriter memory;
  WebPMemoryWriterInit(&memory);
  image.writer = WebPMemoryWrite;
  image.custom_ptr = &memory;
  if (WebPEncode(&config, &image) == 0) throw std::runtime_error("libwebp cannot encode it");
  std::vector<std::uint8_t> out(memory.mem, memory.mem + memory.size);
  WebPMemoryWriterClear(&memory);
  WebPPictureFree(&image);
  return out;
}

std::vector<std::uint8_t> extended(const std::vector<std::uint8_t>& plain) {
  const std::vector<std::byte> icc = display_p3_profile();
  const std::string exif = "II*\0\10\0\0\0\0\0";
  const WebPData image{plain.data(), plain.size()};
  const WebPData profile{reinterpret_cast<const std::uint8_t*>(icc.data()), icc.size()};
  const WebPData more{reinterpret_cast<const std::uint8_t*>(exif.data()), exif.size()};
  WebPMux* const mux = WebPMuxCreate(&image, 1);
  WebPMuxSetChunk(mux, "ICCP", &profile, 1);
  WebPMuxSetChunk(mux, "EXIF", &more, 1);
  WebPData data;
  WebPMuxAssemble(mux, &data);
  std::vector<std::uint8_t> out(data.bytes, data.bytes + data.size);
  WebPDataClear(&data);
  WebPMuxDelete(mux);
  return out;
}

void save(const std::string& path, const std::uint8_t* bytes, std::size_t count) {
  FILE* const file = std::fopen(path.c_str(), "wb");
  std::fwrite(bytes, 1, count, file);
  std::fclose(file);
}

/// What a lossless one must hold are the samples; of the others, what libwebp makes of it.
Picture expected(const Webp& webp, const std::vector<std::uint8_t>& file,
                 const std::vector<std::uint8_t>& samples) {
  WebPBitstreamFeatures said;  // alpha that is 255 everywhere is left out
  WebPGetFeatures(file.data(), file.size(), &said);
  const bool alpha = said.has_alpha != 0;
  Picture out{static_cast<std::uint32_t>(webp.width),
              static_cast<std::uint32_t>(webp.height),
              alpha ? 4U : 3U,
              Depth::u8,
              alpha,
              {}};
  int width = 0, height = 0;
  std::uint8_t* const decoded = WebPDecodeRGBA(file.data(), file.size(), &width, &height);
  const std::uint8_t* const from = webp.lossless && webp.near == 100 ? samples.data() : decoded;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (i % 4 < out.channels) append(out.samples, from[i]);
  }
  WebPFree(decoded);
  return out;
}

void add(Entries& entries, const std::string& name, const Webp& webp) {
  corpus::add(entries, "webp-" + name + ".webp", [webp](const std::string& path, Random& random) {
    const std::vector<std::uint8_t> samples = picture(webp, random);
    std::vector<std::uint8_t> file = encode(webp, samples);
    if (webp.extended) file = extended(file);
    save(path, file.data(), file.size());
    return std::optional(expected(webp, file, samples));
  });
}

/// The first frame is read.
std::optional<Picture> write_animation(const std::string& path, Random& random) {
  WebPAnimEncoderOptions options;
  WebPAnimEncoderOptionsInit(&options);
  const Webp webp{20, 14, true, true};
  WebPAnimEncoder* const encoder = WebPAnimEncoderNew(webp.width, webp.height, &options);
  const WebPConfig config = config_of(webp);
  Picture first{20, 14, 4, Depth::u8, true, {}};
  for (int frame = 0; frame < 3; ++frame) {
    const std::vector<std::uint8_t> samples = picture(webp, random);
    for (std::size_t i = 0; frame == 0 && i < samples.size(); ++i)
      append(first.samples, samples[i]);
    WebPPicture image;
    WebPPictureInit(&image);
    image.use_argb = 1;
    image.width = webp.width;
    image.height = webp.height;
    WebPPictureImportRGBA(&image, samples.data(), webp.width * 4);
    WebPAnimEncoderAdd(encoder, &image, frame * 40, &config);
    WebPPictureFree(&image);
  }
  WebPAnimEncoderAdd(encoder, nullptr, 120, nullptr);
  WebPData data;
  WebPDataInit(&data);
  WebPAnimEncoderAssemble(encoder, &data);
  save(path, data.bytes, data.size);
  WebPDataClear(&data);
  WebPAnimEncoderDelete(encoder);
  return first;
}

}  // namespace

Picture read_webp(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  const auto* const data = reinterpret_cast<const std::uint8_t*>(bytes.data());
  WebPBitstreamFeatures said;
  if (WebPGetFeatures(data, bytes.size(), &said) != VP8_STATUS_OK)
    throw std::runtime_error(path + ": libwebp cannot read it");
  const bool alpha = said.has_alpha != 0;
  Picture out{static_cast<std::uint32_t>(said.width),
              static_cast<std::uint32_t>(said.height),
              alpha ? 4U : 3U,
              Depth::u8,
              alpha,
              {}};
  int width = 0, height = 0;
  std::uint8_t* const decoded = alpha ? WebPDecodeRGBA(data, bytes.size(), &width, &height)
                                      : WebPDecodeRGB(data, bytes.size(), &width, &height);
  if (decoded == nullptr) throw std::runtime_error(path + ": libwebp cannot read it");
  const auto* const from = reinterpret_cast<const std::byte*>(decoded);
  out.samples.assign(from, from + std::size_t{out.width} * out.height * out.channels);
  WebPFree(decoded);
  return out;
}

void add_webp(Entries& entries) {
  struct Size {
    int width, height;
  };
  for (const bool lossless : {false, true}) {
    for (const bool alpha : {false, true}) {
      for (const Size& size : {Size{1, 1}, Size{37, 29}, Size{513, 3}, Size{64, 64}}) {
        for (const bool extra : {false, true}) {
          Webp webp{size.width, size.height, lossless, alpha};
          webp.extended = extra;
          add(entries,
              fmt::format("{}{}-{}x{}{}", lossless ? "lossless" : "lossy", alpha ? "-alpha" : "",
                          size.width, size.height, extra ? "-extended" : ""),
              webp);
        }
      }
    }
  }
  for (const int method : {0, 4, 6}) {
    add(entries, fmt::format("lossless-method-{}", method), {90, 70, true, false, 75, method});
    add(entries, fmt::format("lossy-method-{}", method), {90, 70, false, false, 75, method});
  }
  add(entries, "lossy-large", {301, 203});
  add(entries, "lossless-large", {301, 203, true});
  add(entries, "lossy-quality-0", {90, 70, false, false, 0});
  add(entries, "lossy-quality-100", {90, 70, false, false, 100});
  add(entries, "lossy-sharp", {90, 70, false, false, 80, 2, true});
  add(entries, "lossy-simple", {90, 70, false, false, 40, 2, false, true});
  add(entries, "lossy-raw-alpha", {90, 70, false, true, 80, 2, false, false, 0});
  add(entries, "near-lossless", {90, 70, true, false, 80, 2, false, false, 1, 40});
  corpus::add(entries, "webp-animated.webp", write_animation);
}

}  // namespace pounce::test::corpus
