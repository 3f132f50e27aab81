// SPDX-License-Identifier: Apache-2.0
#include "corpus_judge.h"

#include <OpenImageIO/imageio.h>
#include <fmt/format.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <span>

#include "core/colour_space.h"
#include "core/hash.h"
#include "io/codec/colour_tags.h"
#include "io/codec/sample.h"
#include "io/image/read.h"
#include "pounce/error.h"
#include "unit/io/image_files.h"

namespace pounce::test::corpus {

std::vector<std::byte> display_p3_profile() {
  return io::make_icc(*colour_space_from_name("display-p3"));
}

namespace {

/// What a process handed over: its texts, and a picture if there is one.
struct Answer {
  enum class Kind : char { picture, nothing, refused, failed } kind = Kind::failed;
  std::string text, names, hash;
  Picture picture;
};

void put(std::string& out, const std::string& text) {
  const std::size_t size = text.size();
  out.append(reinterpret_cast<const char*>(&size), sizeof size);
  out += text;
}

std::string take(std::string& in) {
  std::size_t size = 0;
  std::memcpy(&size, in.data(), sizeof size);
  std::string text = in.substr(sizeof size, size);
  in.erase(0, sizeof size + size);
  return text;
}

std::string packed_answer(const Answer& answer) {
  std::string out(1, static_cast<char>(answer.kind));
  const Picture& p = answer.picture;
  out += fmt::format("{} {} {} {} {}\n", p.width, p.height, p.channels, static_cast<int>(p.depth),
                     p.has_alpha ? 1 : 0);
  for (const std::string& text : {answer.text, answer.names, answer.hash}) put(out, text);
  out.append(reinterpret_cast<const char*>(p.samples.data()), p.samples.size());
  return out;
}

Answer unpacked(std::string in) {
  Answer answer;
  answer.kind = static_cast<Answer::Kind>(in[0]);
  Picture& p = answer.picture;
  int depth = 0, alpha = 0;
  std::sscanf(in.c_str() + 1, "%u %u %u %d %d", &p.width, &p.height, &p.channels, &depth, &alpha);
  p.depth = static_cast<Depth>(depth);
  p.has_alpha = alpha != 0;
  in.erase(0, in.find('\n') + 1);
  answer.text = take(in);
  answer.names = take(in);
  answer.hash = take(in);
  p.samples.resize(in.size());
  if (!in.empty()) std::memcpy(p.samples.data(), in.data(), in.size());
  return answer;
}

[[noreturn]] void answer_and_end(int pipe, const std::function<Answer()>& work) {
  alarm(120);
  Answer answer;
  try {
    answer = work();
  } catch (const Error& e) {
    answer.kind = e.kind() == ErrorKind::input ? Answer::Kind::refused : Answer::Kind::failed;
    answer.text = e.what();
  } catch (const std::exception& e) {
    answer.text = e.what();
  }
  const std::string bytes = packed_answer(answer);
  for (std::size_t done = 0; done < bytes.size();) {
    const ssize_t some = write(pipe, bytes.data() + done, bytes.size() - done);
    if (some <= 0) _exit(3);
    done += static_cast<std::size_t>(some);
  }
  _exit(0);
}

/// A decoder that crashes is an answer, too.
Answer in_process(const std::function<Answer()>& work) {
  std::array<int, 2> ends;
  if (pipe(ends.data()) != 0) return {Answer::Kind::failed, "no pipe", "", "", {}};
  std::fflush(stdout);
  const pid_t child = fork();
  if (child == 0) answer_and_end(ends[1], work);
  close(ends[1]);
  std::string bytes;
  std::array<char, 65536> piece;
  for (ssize_t got; (got = read(ends[0], piece.data(), piece.size())) > 0;)
    bytes.append(piece.data(), static_cast<std::size_t>(got));
  close(ends[0]);
  int status = 0;
  waitpid(child, &status, 0);
  if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return unpacked(std::move(bytes));
  return {Answer::Kind::failed, fmt::format("crashed, status {}", status), "", "", {}};
}

std::string joined(const std::vector<std::string>& names) {
  std::string out;
  for (const std::string& name : names) out += (out.empty() ? "" : ",") + name;
  return out.empty() ? "-" : out;
}

std::string hash_of(std::span<const std::byte> bytes) {
  Hasher hasher;
  hasher.add(bytes);
  return to_hex(hasher.digest()).substr(0, 12);
}

/// What a file says of its colours, as a few digits.
std::string tags_hash(const io::ColourTags& tags) {
  if (!tags.linear && !tags.primaries && tags.problem.empty()) return "";
  Hasher hasher;
  hasher.add(tags.linear ? *tags.linear ? 2 : 1 : 0);
  for (const float value : tags.primaries.value_or(Chromaticities{})) hasher.add(value);
  hasher.add(tags.problem);
  return " colours:" + to_hex(hasher.digest()).substr(0, 6);
}

std::string info_text(const io::ImageInfo& info) {
  std::string out = fmt::format("{}x{} {} {} {} {} {}", info.width, info.height, info.channels,
                                depth_name(info.depth), info.has_alpha ? "alpha" : "-",
                                joined(info.names), info.format);
  const bool floats = info.depth == Depth::half || info.depth == Depth::float32;
  if (info.linear != floats) out += info.linear ? " linear" : " not linear";
  if (info.premultiplied) out += " pm";
  if (info.tile_width > 0) out += fmt::format(" tiles:{}x{}", info.tile_width, info.tile_height);
  if (info.levels > 1) out += fmt::format(" levels:{}", info.levels);
  if (!info.left_out.empty()) out += " without:" + joined(info.left_out);
  return out + tags_hash(info.colours);
}

std::vector<std::byte> rows_of(io::ImageReader& reader, std::uint32_t strip) {
  const std::uint32_t height = reader.info().height;
  std::vector<std::byte> samples(reader.row_bytes() * height);
  for (std::uint32_t y = 0; y < height;) {
    const std::uint32_t rows = std::min(strip, height - y);
    reader.read_rows(rows, samples.data() + y * reader.row_bytes());
    y += rows;
  }
  return samples;
}

/// Other ways to ask an EXR for its channels: what they are, and these ones as data.
std::string other_doors(const mesh::ImageRef& image, const io::ImageInfo& info,
                        const std::vector<std::byte>& kept, const ImageTrust& trust) {
  if (info.format != "openexr") return "";
  std::string out;
  const std::vector<std::string> all = io::ImageReader::exr_channels(image.path, trust);
  const std::string names = joined(all);
  if (all != info.names) out += " all:" + hash_of(std::as_bytes(std::span(names))).substr(0, 6);
  if (info.depth != Depth::float32 || !image.channels.empty()) return out;
  try {
    io::ImageReader reader(image.path, info.names, trust);
    const std::vector<std::byte> rows = rows_of(reader, 7);
    return out + (rows == kept ? " data" : " data differ");
  } catch (const Error&) {
    return out;  // not all are floats, or it is compressed with a loss
  }
}

Answer read(const mesh::ImageRef& image, const ImageTrust& trust) {
  io::ImageReader reader(image, trust);
  Answer answer;
  answer.picture.samples = rows_of(reader, UINT32_MAX);
  const io::ImageInfo info = reader.info();
  answer.kind = Answer::Kind::picture;
  answer.picture.width = info.width;
  answer.picture.height = info.height;
  answer.picture.channels = info.channels;
  answer.picture.depth = info.depth;
  answer.picture.has_alpha = info.has_alpha;
  answer.names = joined(info.names);
  answer.text = info_text(info);
  answer.hash = hash_of(answer.picture.samples);
  std::string failure;
  mesh::ImageRef held = in_memory(read_file(image.path));
  held.channels = image.channels;
  for (const std::uint32_t strip : {1U, 3U, 64U}) {
    io::ImageReader again(strip == 3 ? held : image, trust);
    if (rows_of(again, strip) != answer.picture.samples)
      failure = fmt::format("strips of {} rows differ", strip);
    if (info_text(again.info()) != answer.text)
      failure = fmt::format("with strips of {} rows it says: {}", strip, info_text(again.info()));
  }
  std::vector<std::byte> kept = answer.picture.samples;
  if (info.premultiplied) {
    io::ImageReader keeping(image, trust);
    keeping.keep_premultiplied();
    kept = rows_of(keeping, 5);
    answer.hash += "+" + hash_of(kept).substr(0, 6);
    std::vector<std::byte> samples = kept;
    io::divide_by_alpha(info.depth, info.channels, std::size_t{info.width} * info.height,
                        samples.data());
    if (samples != answer.picture.samples) failure = "premultiplied samples differ";
  }
  const std::string doors = other_doors(image, info, kept, trust);
  if (doors.ends_with("differ")) failure = "its channels as data differ";
  answer.text += doors;
  if (!failure.empty()) return {Answer::Kind::failed, failure, "", "", {}};
  return answer;
}

/// The places of these channels; all of them if the file has other names.
std::vector<std::size_t> places_of(const std::vector<std::string>& names,
                                   const std::string& wanted) {
  std::vector<std::size_t> places;
  for (std::size_t begin = 0; begin < wanted.size();) {
    const std::size_t end = std::min(wanted.find(',', begin), wanted.size());
    const auto at = std::find(names.begin(), names.end(), wanted.substr(begin, end - begin));
    if (at != names.end()) places.push_back(static_cast<std::size_t>(at - names.begin()));
    begin = end + 1;
  }
  const auto count = static_cast<std::size_t>(std::count(wanted.begin(), wanted.end(), ',') + 1);
  if (!places.empty() && places.size() == count) return places;
  places.resize(names.size());
  for (std::size_t i = 0; i < places.size(); ++i) places[i] = i;
  return places;
}

std::optional<Depth> depth_of(OIIO::TypeDesc type) {
  if (type == OIIO::TypeDesc::UINT8) return Depth::u8;
  if (type == OIIO::TypeDesc::UINT16) return Depth::u16;
  if (type == OIIO::TypeDesc::HALF) return Depth::half;
  if (type == OIIO::TypeDesc::FLOAT) return Depth::float32;
  return std::nullopt;
}

/// The deepest of these channels' types.
OIIO::TypeDesc type_of(const OIIO::ImageSpec& spec, const std::vector<std::size_t>& places) {
  OIIO::TypeDesc type = spec.channelformat(static_cast<int>(places[0]));
  for (const std::size_t place : places) {
    const OIIO::TypeDesc other = spec.channelformat(static_cast<int>(place));
    if (other != OIIO::TypeDesc::HALF) type = other;
  }
  return type;
}

/// OpenImageIO hands out the data window: the display window of it, 0 where it has nothing.
void show_display_window(const OIIO::ImageSpec& spec, Picture& picture) {
  const Picture data = std::move(picture);
  const std::size_t texel = io::sample_bytes(data.depth) * data.channels;
  picture = {static_cast<std::uint32_t>(spec.full_width),
             static_cast<std::uint32_t>(spec.full_height),
             data.channels,
             data.depth,
             data.has_alpha,
             {}};
  picture.samples.resize(texel * picture.width * picture.height);
  for (int y = std::max(spec.y, spec.full_y);
       y < std::min(spec.y + spec.height, spec.full_y + spec.full_height); ++y) {
    for (int x = std::max(spec.x, spec.full_x);
         x < std::min(spec.x + spec.width, spec.full_x + spec.full_width); ++x) {
      const auto from =
          static_cast<std::size_t>(y - spec.y) * data.width + static_cast<std::size_t>(x - spec.x);
      const auto to = static_cast<std::size_t>(y - spec.full_y) * picture.width +
                      static_cast<std::size_t>(x - spec.full_x);
      std::memcpy(&picture.samples[to * texel], &data.samples[from * texel], texel);
    }
  }
}

/// OpenImageIO's samples, with colours divided by alpha where it says that they are multiplied.
Answer by_oiio(const std::string& path, const std::string& wanted, int part) {
  OIIO::attribute("exr_threads", -1);
  OIIO::attribute("threads", 1);
  OIIO::attribute("oiio:print_uncaught_errors", 0);
  OIIO::ImageSpec config;
  config.attribute("oiio:UnassociatedAlpha", 1);
  std::freopen("/dev/null", "w", stderr);  // it crashes with words
  Answer answer{Answer::Kind::refused, "", "", "", {}};
  auto input = OIIO::ImageInput::open(path, &config);
  if (!input) return {Answer::Kind::refused, OIIO::geterror(), "", "", {}};
  const OIIO::ImageSpec spec = input->spec(part, 0);
  if (spec.deep || spec.nchannels < 1) return {Answer::Kind::refused, "deep", "", "", {}};
  const std::vector<std::size_t> places = places_of(spec.channelnames, wanted);
  const OIIO::TypeDesc type = type_of(spec, places);
  const auto depth = depth_of(type);
  if (!depth) return {Answer::Kind::refused, std::string("samples of ") + type.c_str(), "", "", {}};
  const std::size_t size = type.size(), all = static_cast<std::size_t>(spec.nchannels);
  const std::size_t texels =
      static_cast<std::size_t>(spec.width) * static_cast<std::size_t>(spec.height);
  std::vector<std::byte> samples(texels * all * size);
  if (!input->read_image(part, 0, 0, spec.nchannels, type, samples.data()) || input->has_error())
    return {Answer::Kind::refused, input->geterror(), "", "", {}};
  Picture& out = answer.picture;
  for (std::size_t i = 0; i < texels; ++i) {
    for (const std::size_t place : places) {
      const std::byte* const sample = samples.data() + (i * all + place) * size;
      out.samples.insert(out.samples.end(), sample, sample + size);
    }
  }
  out.width = static_cast<std::uint32_t>(spec.width);
  out.height = static_cast<std::uint32_t>(spec.height);
  out.channels = static_cast<std::uint32_t>(places.size());
  out.depth = *depth;
  out.has_alpha = spec.alpha_channel >= 0 &&
                  static_cast<std::size_t>(spec.alpha_channel) == places.back() &&
                  places.size() > 1;
  if (out.has_alpha && spec.get_int_attribute("oiio:UnassociatedAlpha") == 0)
    io::divide_by_alpha(out.depth, out.channels, texels, out.samples.data());
  if (std::string_view(input->format_name()) == "openexr") show_display_window(spec, out);
  answer.kind = Answer::Kind::picture;
  return answer;
}

std::string size_text(const Picture& picture) {
  return fmt::format("{}x{}x{} {}", picture.width, picture.height, picture.channels,
                     depth_name(picture.depth));
}

/// "" or the first difference: `a` and `b` are whose pictures these are.
std::string difference(const Picture& a, const Picture& b) {
  if (size_text(a) != size_text(b)) return fmt::format("{} not {}", size_text(a), size_text(b));
  if (a.samples == b.samples) return "";
  const std::size_t size = io::sample_bytes(a.depth);
  std::size_t count = 0, first = a.samples.size();
  for (std::size_t i = 0; i < a.samples.size(); i += size) {
    if (std::memcmp(&a.samples[i], &b.samples[i], size) == 0) continue;
    if (count++ == 0) first = i;
  }
  std::array<double, 2> values{};
  io::samples_to_double(a.depth, 1, &a.samples[first], &values[0]);
  io::samples_to_double(b.depth, 1, &b.samples[first], &values[1]);
  const double scale = a.depth == Depth::u8 ? 255 : a.depth == Depth::u16 ? 65535 : 1;
  const std::size_t texel = first / size / a.channels;
  return fmt::format("{} of {} samples, the first at {},{} channel {}: {:g} not {:g}", count,
                     a.samples.size() / size, texel % a.width, texel / a.width,
                     first / size % a.channels, values[0] * scale, values[1] * scale);
}

/// In one line, without the file's name.
std::string message(std::string text, const std::string& path) {
  for (std::size_t at; (at = text.find(path)) != std::string::npos;) text.erase(at, path.size());
  if (text.starts_with(": ")) text.erase(0, 2);
  for (char& c : text) c = c == '\n' || c == '\t' ? ' ' : c;
  return text;
}

/// What OpenImageIO makes of it, beside what it should be.
std::string beside(const Answer& oiio, const Picture& picture) {
  if (oiio.kind != Answer::Kind::picture) return "it says: " + oiio.text;
  return difference(oiio.picture, picture);
}

/// Where OpenImageIO 2.4 is known to be wrong.
struct Reason {
  const char *start, *inside, *why;
};
constexpr std::array<Reason, 9> kReasons{
    {{"tiff-rgb", "-unsaid", "takes a fourth sample for alpha that the file says nothing of"},
     {"tiff-white-u16", "", "does not invert white-is-zero of 16 bits"},
     {"tiff-cmyk-u", "", "multiplies inks out in floats, and small ones without scaling"},
     {"tiff-jpeg-cmyk", "", "makes too little room for tiles of inks"},
     {"pnm-", "", "scales in floats and cuts off what is below one"},
     {"webp-", "", "multiplies by alpha in eight bits"},
     {"files/", ".webp", "multiplies by alpha in eight bits"},
     {"files/", ".ppm", "scales in floats and cuts off what is below one"},
     {"bmp-4", "", "takes colours for multiplied by alpha"}}};

std::string reason_of(const std::string& name) {
  for (const Reason& reason : kReasons) {
    if (name.starts_with(reason.start) && name.find(reason.inside) != std::string::npos)
      return reason.why;
  }
  return "";
}

void compare(const Answer& ours, const Answer& oiio, const std::optional<Picture>& truth,
             Verdict& verdict) {
  const std::string from_oiio = beside(oiio, ours.picture);
  if (!truth) {
    const std::string reason = oiio.kind == Answer::Kind::failed ? reason_of(verdict.name) : "";
    verdict.what = from_oiio.empty() || !reason.empty() ? "as-oiio" : "unexplained";
    if (!from_oiio.empty())
      verdict.note = "OpenImageIO " + (reason.empty() ? "" : reason) + ": " + from_oiio;
    return;
  }
  std::string wrong = difference(ours.picture, *truth);
  if (wrong.empty() && ours.picture.has_alpha != truth->has_alpha)
    wrong = ours.picture.has_alpha ? "alpha where there is none" : "no alpha";
  verdict.what = !wrong.empty() ? "DEFECT" : from_oiio.empty() ? "equal" : "truth";
  verdict.note = wrong;
  if (!wrong.empty())
    verdict.note += from_oiio.empty() ? " (as OpenImageIO)" : " (OpenImageIO: " + from_oiio + ")";
  if (!wrong.empty() || from_oiio.empty()) return;
  const std::string reason = reason_of(verdict.name);
  verdict.note = "OpenImageIO " + (reason.empty() ? ": " : reason + ": ") + from_oiio;
  if (reason.empty() && oiio.kind == Answer::Kind::picture) verdict.what = "odd";
}

/// Of an image that is refused: does OpenImageIO read it?
std::string oiio_beside(const Answer& oiio, const std::optional<Picture>& truth) {
  if (oiio.kind == Answer::Kind::failed) return "OpenImageIO " + oiio.text;
  if (oiio.kind == Answer::Kind::refused) return "OpenImageIO refuses it";
  if (!truth) return "OpenImageIO reads it";
  const std::string wrong = difference(oiio.picture, *truth);
  return wrong.empty() ? "OpenImageIO reads it right" : "OpenImageIO reads it wrong: " + wrong;
}

std::uint64_t seed_of(const std::string& file, std::uint64_t seed) {
  return checksum(std::as_bytes(std::span(file))) ^ seed;
}

}  // namespace

Verdict judge(const Entry& entry, const std::string& folder, std::uint64_t seed, Sandbox sandbox) {
  Verdict verdict{entry.name, "", "-", "-", ""};
  const std::string path = folder + "/" + entry.file;
  std::optional<Picture> truth;
  if (entry.make) {
    const Answer made = in_process([&] {
      Random random(seed_of(entry.file, seed));
      const auto picture = entry.make(path, random);
      return picture ? Answer{Answer::Kind::picture, "", "", "", *picture}
                     : Answer{Answer::Kind::nothing, "", "", "", {}};
    });
    if (made.kind == Answer::Kind::failed) {
      verdict.what = "NOT MADE";
      verdict.note = message(made.text, path);
      return verdict;
    }
    if (made.kind == Answer::Kind::picture) truth = made.picture;
  } else if (path.ends_with(".webp") || path.ends_with(".ppm")) {
    const Answer known = in_process([&] {
      return Answer{Answer::Kind::picture, "", "", "",
                    path.ends_with(".webp") ? read_webp(path) : read_ppm(path)};
    });
    if (known.kind == Answer::Kind::picture) truth = known.picture;
  }
  mesh::ImageRef image = at_path(path);
  image.channels = entry.channels;
  const Answer ours = in_process([&] {
    return read(image, {{ImageFormat::bmp, ImageFormat::tga}, sandbox});
  });
  const Answer oiio = in_process([&] { return by_oiio(path, ours.names, entry.part); });
  if (ours.kind == Answer::Kind::picture) {
    verdict.hash = ours.hash;
    verdict.info = ours.text;
    // Most names begin with the format.
    const std::string format = entry.name.substr(0, entry.name.find('-'));
    if (const std::size_t at = verdict.info.find(" " + format);
        entry.make && at != std::string::npos)
      verdict.info.erase(at, format.size() + 1);
    compare(ours, oiio, truth, verdict);
  } else {
    verdict.what = ours.kind == Answer::Kind::refused ? "refused" : "DEFECT";
    verdict.note = message(ours.text, path) + " [" + message(oiio_beside(oiio, truth), path) + "]";
  }
  verdict.note = message(verdict.note, path);
  return verdict;
}

}  // namespace pounce::test::corpus
