// SPDX-License-Identifier: Apache-2.0
//
// What somebody would write in a day in place of pounce: Embree's nearest hit along each texel's
// normal, both ways, sixteen texels at once, and a lookup there. Everything in memory, one thread,
// OBJ and PNG in, PNG out. For `tools/bench.sh table` alone: nothing of pounce is linked but the
// definition of its footprints, where these are asked for.
//
//   pounce_embree SOURCE.obj SOURCE.png TARGET.obj OUTPUT.png SIZE [tent|cubic|footprint]
//
// Prints its CPU milliseconds by step, and the covered texels, as JSON.
#include <embree3/rtcore.h>
#include <png.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <iterator>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

#include "projection/footprint.h"

namespace {

using pounce::Vec2d;
using pounce::Vec3f;
constexpr int kLanes = 16;

double cpu_ms() {
  timespec t{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) * 1e3 + static_cast<double>(t.tv_nsec) * 1e-6;
}

struct Image {
  std::uint32_t width = 0, height = 0;
  std::vector<std::uint8_t> rgb;
};

Image read_png(const char* path) {
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  if (!png_image_begin_read_from_file(&png, path)) throw std::runtime_error(path);
  png.format = PNG_FORMAT_RGB;
  Image image{png.width, png.height, {}};
  image.rgb.resize(PNG_IMAGE_SIZE(png));
  if (!png_image_finish_read(&png, nullptr, image.rgb.data(), 0, nullptr))
    throw std::runtime_error(path);
  return image;
}

void write_png(const char* path, const std::vector<std::uint8_t>& rgba, std::uint32_t size) {
  FILE* file = std::fopen(path, "wb");
  if (file == nullptr) throw std::runtime_error(path);
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
  png_infop info = png_create_info_struct(png);
  png_init_io(png, file);
  png_set_compression_level(png, 2);
  png_set_filter(png, 0, PNG_FILTER_UP);
  png_set_IHDR(png, info, size, size, 8, PNG_COLOR_TYPE_RGBA, PNG_INTERLACE_NONE,
               PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  png_write_info(png, info);
  for (std::uint32_t y = 0; y < size; ++y)
    png_write_row(png, rgba.data() + std::size_t{4} * size * y);
  png_write_end(png, nullptr);
  png_destroy_write_struct(&png, &info);
  std::fclose(file);
}

struct Mesh {
  std::vector<Vec3f> positions, normals;
  std::vector<float> uvs;  // u and v (downwards) of each vertex
  std::vector<std::array<std::uint32_t, 3>> triangles;
};

/// Of triangles alone, with v/vt/vn or v/vt; normals are those of the faces around a vertex.
Mesh read_obj(const char* path) {
  std::ifstream file(path, std::ios::binary);
  std::string text{std::istreambuf_iterator<char>(file), {}};
  if (text.empty()) throw std::runtime_error(path);
  std::vector<Vec3f> v;
  std::vector<std::array<float, 2>> vt;
  Mesh mesh;
  std::map<std::pair<long, long>, std::uint32_t> seen;
  std::vector<std::uint32_t> place;  // of each vertex: its v
  const char* at = text.c_str();
  const auto number = [&at] {
    char* end = nullptr;
    const float value = std::strtof(at, &end);
    at = end;
    return value;
  };
  while (*at != 0) {
    if (at[0] == 'v' && at[1] == ' ') {
      ++at;
      const float x = number(), y = number(), z = number();
      v.push_back({x, y, z});
    } else if (at[0] == 'v' && at[1] == 't') {
      at += 2;
      const float s = number(), t = number();
      vt.push_back({s, 1 - t});
    } else if (at[0] == 'f') {
      ++at;
      std::array<std::uint32_t, 3> corners{};
      for (std::uint32_t& corner : corners) {
        char* end = nullptr;
        const long p = std::strtol(at, &end, 10) - 1, t = std::strtol(end + 1, &end, 10) - 1;
        while (*end == '/' || (*end >= '0' && *end <= '9')) ++end;
        at = end;
        const auto [found, is_new] =
            seen.try_emplace({p, t}, static_cast<std::uint32_t>(mesh.positions.size()));
        if (is_new) {
          mesh.positions.push_back(v[static_cast<std::size_t>(p)]);
          place.push_back(static_cast<std::uint32_t>(p));
          mesh.uvs.push_back(vt[static_cast<std::size_t>(t)][0]);
          mesh.uvs.push_back(vt[static_cast<std::size_t>(t)][1]);
        }
        corner = found->second;
      }
      mesh.triangles.push_back(corners);
    }
    while (*at != 0 && *at != '\n') ++at;
    if (*at == '\n') ++at;
  }
  std::vector<Vec3f> sums(v.size());
  for (const auto& t : mesh.triangles) {
    const Vec3f a = mesh.positions[t[0]], b = mesh.positions[t[1]], c = mesh.positions[t[2]];
    const Vec3f n = cross(b - a, c - a);
    for (const std::uint32_t k : t) sums[place[k]] = sums[place[k]] + n;
  }
  for (const std::uint32_t p : place) {
    const float far = length(sums[p]);
    mesh.normals.push_back(far > 0 ? sums[p] * (1 / far) : Vec3f{0, 0, 1});
  }
  return mesh;
}

using Four = float __attribute__((vector_size(16)));
using FourBytes = std::uint8_t __attribute__((vector_size(4)));

/// Keys' weights (a = -1/2) of the four texels around.
std::array<float, 4> cubic(float u) {
  const float r = 1 - u;
  return {-0.5F * u * r * r, ((1.5F * u - 2.5F) * u) * u + 1, ((1.5F * r - 2.5F) * r) * r + 1,
          -0.5F * u * u * r};
}

/// An image with two texels around it that repeat its border, four bytes each.
class Lookup {
 public:
  explicit Lookup(const Image& image)
      : width_(image.width), height_(image.height), stride_(image.width + 2 * kAround) {
    texels_.resize(stride_ * (height_ + 2 * kAround));
    for (std::size_t y = 0; y < height_ + 2 * kAround; ++y) {
      for (std::size_t x = 0; x < stride_; ++x) {
        const std::uint8_t* from =
            &image.rgb[3 * (inside(y, height_) * width_ + inside(x, width_))];
        texels_[y * stride_ + x] = FourBytes{from[0], from[1], from[2], 255};
      }
    }
  }

  Four tent(double x, double y) const {
    const Place at = place(x, y);
    const std::array<float, 2> wx{1 - at.u, at.u}, wy{1 - at.v, at.v};
    Four sum{};
    for (std::size_t j = 0; j < 2; ++j) {
      for (std::size_t i = 0; i < 2; ++i)
        sum += __builtin_convertvector(at.texel[j * stride_ + i], Four) * (wx[i] * wy[j]);
    }
    return sum;
  }
  Four wide(double x, double y) const {
    const Place at = place(x, y);
    const auto wx = cubic(at.u), wy = cubic(at.v);
    const FourBytes* row = at.texel - stride_ - 1;
    Four sum{};
    for (std::size_t j = 0; j < 4; ++j, row += stride_) {
      Four own{};
      for (std::size_t i = 0; i < 4; ++i) own += __builtin_convertvector(row[i], Four) * wx[i];
      sum += own * wy[j];
    }
    return sum;
  }

 private:
  static constexpr std::size_t kAround = 2;
  struct Place {
    const FourBytes* texel;  // the upper left one of the four around
    float u, v;
  };
  static std::size_t inside(std::size_t at, std::size_t size) {
    return std::min(at < kAround ? 0 : at - kAround, size - 1);
  }
  Place place(double x, double y) const {
    x = std::clamp(x, -1.0, static_cast<double>(width_) - 1e-6);
    y = std::clamp(y, -1.0, static_cast<double>(height_) - 1e-6);
    const double fx = std::floor(x), fy = std::floor(y);
    const auto column = static_cast<std::size_t>(fx + kAround),
               row = static_cast<std::size_t>(fy + kAround);
    return {&texels_[row * stride_ + column], static_cast<float>(x - fx),
            static_cast<float>(y - fy)};
  }

  const std::size_t width_, height_, stride_;
  std::vector<FourBytes> texels_;
};

/// Sixteen texels on their way.
struct Packet {
  int count = 0;
  std::array<std::uint32_t, kLanes> texel{};
  std::array<Vec3f, kLanes> position{}, normal{};
  std::array<Vec3f, kLanes> along_x{}, along_y{};  // the texel's axes in space
};

class Transfer {
 public:
  Transfer(const Mesh& source, const Image& image, const Mesh& target, std::uint32_t size,
           const std::string& filter)
      : source_(source),
        target_(target),
        image_(image),
        size_(size),
        is_tent_(filter == "tent"),
        is_cubic_(filter == "cubic"),
        look_(image) {
    rgba_.resize(std::size_t{4} * size * size);
    device_ = rtcNewDevice("threads=1");
    scene_ = rtcNewScene(device_);
    RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
    auto* v = static_cast<float*>(rtcSetNewGeometryBuffer(
        geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, source.positions.size()));
    std::copy_n(&source.positions[0].x, 3 * source.positions.size(), v);
    auto* i = static_cast<unsigned*>(rtcSetNewGeometryBuffer(
        geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, source.triangles.size()));
    std::copy_n(source.triangles[0].data(), 3 * source.triangles.size(), i);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene_, geometry);
    rtcReleaseGeometry(geometry);
    rtcCommitScene(scene_);
    Vec3f lo = target.positions[0], hi = lo;
    for (const Vec3f& p : target.positions) {
      lo = {std::min(lo.x, p.x), std::min(lo.y, p.y), std::min(lo.z, p.z)};
      hi = {std::max(hi.x, p.x), std::max(hi.y, p.y), std::max(hi.z, p.z)};
    }
    reach_ = 0.03F * length(hi - lo);
  }
  Transfer(const Transfer&) = delete;
  Transfer& operator=(const Transfer&) = delete;
  ~Transfer() {
    rtcReleaseScene(scene_);
    rtcReleaseDevice(device_);
  }

  /// Goes through the target's triangles; returns how many texels found something.
  std::uint64_t run() {
    for (const auto& t : target_.triangles) raster(t);
    flush();
    return covered_;
  }
  const std::vector<std::uint8_t>& rgba() const { return rgba_; }

 private:
  void raster(const std::array<std::uint32_t, 3>& t) {
    std::array<double, 3> x{}, y{};
    for (std::size_t k = 0; k < 3; ++k) {
      x[k] = static_cast<double>(target_.uvs[2 * t[k]]) * size_ - 0.5;
      y[k] = static_cast<double>(target_.uvs[2 * t[k] + 1]) * size_ - 0.5;
    }
    const double area = (x[1] - x[0]) * (y[2] - y[0]) - (y[1] - y[0]) * (x[2] - x[0]);
    if (area == 0) return;
    const auto weight = [&](std::size_t k, double px, double py) {
      const std::size_t a = (k + 1) % 3, b = (k + 2) % 3;
      return ((x[a] - px) * (y[b] - py) - (y[a] - py) * (x[b] - px)) / area;
    };
    const auto low = [](const std::array<double, 3>& at) {
      return std::max(0.0, std::ceil(std::min({at[0], at[1], at[2]})));
    };
    const auto high = [this](const std::array<double, 3>& at) {
      return std::min(size_ - 1.0, std::floor(std::max({at[0], at[1], at[2]})));
    };
    // The triangle's texel axes in space, for footprints.
    const Vec3f e1 = target_.positions[t[1]] - target_.positions[t[0]],
                e2 = target_.positions[t[2]] - target_.positions[t[0]];
    const auto axis = [&](double s1, double s2) {
      return e1 * static_cast<float>(s1 / area) + e2 * static_cast<float>(s2 / area);
    };
    const Vec3f along_x = axis(y[2] - y[0], -(y[1] - y[0])),
                along_y = axis(-(x[2] - x[0]), x[1] - x[0]);
    for (double py = low(y); py <= high(y); ++py) {
      for (double px = low(x); px <= high(x); ++px) {
        const double w0 = weight(0, px, py), w1 = weight(1, px, py), w2 = 1 - w0 - w1;
        if (w0 < 0 || w1 < 0 || w2 < 0) continue;
        const auto mix = [&](const std::vector<Vec3f>& of) {
          return of[t[0]] * static_cast<float>(w0) + of[t[1]] * static_cast<float>(w1) +
                 of[t[2]] * static_cast<float>(w2);
        };
        const auto lane = static_cast<std::size_t>(packet_.count++);
        packet_.texel[lane] =
            static_cast<std::uint32_t>(py) * size_ + static_cast<std::uint32_t>(px);
        packet_.along_x[lane] = along_x;
        packet_.along_y[lane] = along_y;
        packet_.position[lane] = mix(target_.positions);
        const Vec3f n = mix(target_.normals);
        packet_.normal[lane] = n * (1 / length(n));
        if (packet_.count == kLanes) flush();
      }
    }
  }

  void flush() {
    if (packet_.count == 0) return;
    alignas(64) RTCRayHit16 there, back;
    alignas(64) int valid[kLanes];
    for (std::size_t k = 0; k < kLanes; ++k) {
      valid[k] = static_cast<int>(k) < packet_.count ? -1 : 0;
      const Vec3f p = packet_.position[k], n = packet_.normal[k];
      for (RTCRayHit16* ray : {&there, &back}) {
        const float sign = ray == &there ? 1.0F : -1.0F;
        ray->ray.org_x[k] = p.x, ray->ray.org_y[k] = p.y, ray->ray.org_z[k] = p.z;
        ray->ray.dir_x[k] = sign * n.x, ray->ray.dir_y[k] = sign * n.y;
        ray->ray.dir_z[k] = sign * n.z;
        ray->ray.tnear[k] = 0, ray->ray.tfar[k] = reach_, ray->ray.time[k] = 0;
        ray->ray.mask[k] = ~0U, ray->ray.flags[k] = 0;
        ray->hit.geomID[k] = RTC_INVALID_GEOMETRY_ID;
      }
    }
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
    rtcIntersect16(valid, scene_, &context, &there);
    // Behind it only what is nearer.
    for (std::size_t k = 0; k < kLanes; ++k) back.ray.tfar[k] = there.ray.tfar[k];
    rtcIntersect16(valid, scene_, &context, &back);
    for (std::size_t k = 0; k < static_cast<std::size_t>(packet_.count); ++k) {
      const RTCRayHit16& best = back.hit.geomID[k] != RTC_INVALID_GEOMETRY_ID ? back : there;
      if (best.hit.geomID[k] == RTC_INVALID_GEOMETRY_ID) continue;
      shade(k, best.hit.primID[k], best.hit.u[k], best.hit.v[k]);
    }
    packet_.count = 0;
  }

  void shade(std::size_t lane, std::uint32_t triangle, float u, float v) {
    const auto& t = source_.triangles[triangle];
    const auto uv = [&](std::size_t k) {
      return Vec2d{static_cast<double>(source_.uvs[2 * t[k]]) * image_.width - 0.5,
                   static_cast<double>(source_.uvs[2 * t[k] + 1]) * image_.height - 0.5};
    };
    const Vec2d a = uv(0), b = uv(1), c = uv(2);
    const Vec2d at = a * (1.0 - static_cast<double>(u) - static_cast<double>(v)) +
                     b * static_cast<double>(u) + c * static_cast<double>(v);
    const Four colour = is_tent_    ? look_.tent(at.x, at.y)
                        : is_cubic_ ? look_.wide(at.x, at.y)
                                    : mean(lane, t, a, b, c, at);
    std::uint8_t* out = &rgba_[std::size_t{4} * packet_.texel[lane]];
    for (std::size_t k = 0; k < 3; ++k)
      out[k] = static_cast<std::uint8_t>(std::clamp(colour[k] + 0.5F, 0.0F, 255.0F));
    out[3] = 255;
    ++covered_;
  }

  /// The mean of cubic lookups over what the texel covers, in the image itself.
  Four mean(std::size_t lane, const std::array<std::uint32_t, 3>& t, Vec2d a, Vec2d b, Vec2d c,
            Vec2d at) const {
    const Vec3f e1 = source_.positions[t[1]] - source_.positions[t[0]],
                e2 = source_.positions[t[2]] - source_.positions[t[0]];
    const float d11 = dot(e1, e1), d12 = dot(e1, e2), d22 = dot(e2, e2),
                det = d11 * d22 - d12 * d12;
    const Vec3f g1 = (e1 * d22 - e2 * d12) * (1 / det), g2 = (e2 * d11 - e1 * d12) * (1 / det);
    const auto along = [&](double first, double second) {
      return g1 * static_cast<float>(first) + g2 * static_cast<float>(second);
    };
    const pounce::projection::TexelGradients gradients{along(b.x - a.x, c.x - a.x),
                                                       along(b.y - a.y, c.y - a.y)};
    const auto footprint =
        pounce::projection::footprint_of(gradients, packet_.along_x[lane], packet_.along_y[lane]);
    const auto lookups = pounce::projection::lookups_of(footprint, 0).sets[0];
    Four sum{};
    const Vec2d first = at - lookups.step_a * ((lookups.count_a - 1) / 2.0) -
                        lookups.step_b * ((lookups.count_b - 1) / 2.0);
    for (int i = 0; i < lookups.count_a; ++i) {
      for (int k = 0; k < lookups.count_b; ++k) {
        const Vec2d p = first + lookups.step_a * double(i) + lookups.step_b * double(k);
        sum += look_.wide(p.x, p.y);
      }
    }
    return sum / static_cast<float>(lookups.count_a * lookups.count_b);
  }

  const Mesh &source_, &target_;
  const Image& image_;
  const std::uint32_t size_;
  const bool is_tent_, is_cubic_;
  const Lookup look_;
  RTCDevice device_ = nullptr;
  RTCScene scene_ = nullptr;
  float reach_ = 0;
  Packet packet_;
  std::vector<std::uint8_t> rgba_;
  std::uint64_t covered_ = 0;
};

}  // namespace

int main(int argc, char** argv) try {
  if (argc < 6) {
    std::fputs(
        "usage: pounce_embree SOURCE.obj SOURCE.png TARGET.obj OUTPUT.png SIZE "
        "[tent|cubic|footprint]\n",
        stderr);
    return 2;
  }
  const auto size = static_cast<std::uint32_t>(std::strtoul(argv[5], nullptr, 10));
  const double begin = cpu_ms();
  const Mesh source = read_obj(argv[1]), target = read_obj(argv[3]);
  const double read = cpu_ms();
  const Image image = read_png(argv[2]);
  const double decoded = cpu_ms();
  Transfer transfer(source, image, target, size, argc > 6 ? argv[6] : "tent");
  const double built = cpu_ms();
  const std::uint64_t covered = transfer.run();
  const double done = cpu_ms();
  write_png(argv[4], transfer.rgba(), size);
  const double written = cpu_ms();
  std::printf(
      "{\"read\":%.1f,\"decode\":%.1f,\"build\":%.1f,\"transfer\":%.1f,\"encode\":%.1f,"
      "\"covered\":%llu}\n",
      read - begin, decoded - read, built - decoded, done - built, written - done,
      static_cast<unsigned long long>(covered));
  return 0;
} catch (const std::exception& e) {
  std::fprintf(stderr, "pounce_embree: %s\n", e.what());
  return 1;
}
