// SPDX-License-Identifier: Apache-2.0
//
// Names of outputs with tokens in them. Other programs write tiles and frames otherwise (%04d,
// $F4, ####, {udim}, _MAPID_): whoever types one of those here would get one file of that name,
// over which each tile is written. So they are recognised, and refused with what to write instead.
//
// Two more rules. A token that is known, but means nothing at this place, is refused as well: a
// model has no tiles. And what merely looks unusual is allowed: file names may have percent signs
// and dollars, as long as no program reads them as a token.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>

#include "io/files/asset_file.h"
#include "io/model/model_writer.h"
#include "options/parse.h"
#include "pounce/option_table.h"

namespace pounce::options {
namespace {

/// The end of the run of characters from `at` on that are of a kind.
template <class Kind>
std::size_t run_end(const std::string& text, std::size_t at, Kind kind) {
  while (at < text.size() && kind(static_cast<unsigned char>(text[at]))) ++at;
  return at;
}

/// The end of a token of another program that begins here; 0 if none does. `is_tile`: it stands for
/// a tile of UV space, not for a number of any kind.
std::size_t foreign_token_end(const std::string& text, std::size_t at, bool& is_tile) {
  const auto is_digit = [](unsigned char c) { return std::isdigit(c) != 0; };
  const auto is_letter = [](unsigned char c) { return std::isalpha(c) != 0; };
  // Behind the end there is a character that is part of no token.
  const auto next = [&](std::size_t i) { return i < text.size() ? text[i] : '\0'; };
  is_tile = false;
  if (text[at] == '%') {  // %(UDIM)d, %04d; a %d alone may be a word's ("100%done")
    const std::size_t close = next(at + 1) == '(' ? text.find(')', at) : at;
    is_tile = close != at;
    if (close == std::string::npos) return 0;
    const std::size_t end = run_end(text, close + 1, is_digit);
    const bool is_number = next(end) == 'd' && (is_tile || end > close + 1);
    return is_number || (is_tile && next(end) == 's') ? end + 1 : 0;
  }
  if (text[at] == '$') {  // $F, $F4, ${F}, $UDIM
    const std::size_t begin = at + (next(at + 1) == '{' ? 2 : 1);
    const std::size_t end = run_end(text, begin, is_letter);
    const std::string name = lower(text.substr(begin, end - begin));
    is_tile = name == "udim";
    if (!is_tile && name != "f" && name != "ff") return 0;
    const std::size_t digits = run_end(text, end, is_digit);
    return begin == at + 2 && next(digits) == '}' ? digits + 1 : digits;
  }
  // A single # is common in names, two are frames.
  if (text[at] == '#') {
    const std::size_t end = run_end(text, at, [](unsigned char c) { return c == '#'; });
    return end - at > 1 ? end : 0;
  }
  // Ours in another spelling of letters is a mistake, too: tokens are case-sensitive.
  for (const std::string name : {"<udim>", "<uvtile>", "{udim}", "[udim]", "_mapid_"}) {
    const std::string found = text.substr(at, name.size());
    is_tile = lower(found) == name && found != "<UDIM>" && found != "<UVTILE>";
    if (is_tile) return at + name.size();
  }
  // A bare word between separators: skin.UDIM.png.
  const auto separates = [](char c) { return c == '.' || c == '_' || c == '-'; };
  if (at > 0 && separates(text[at - 1]) && text.compare(at, 4, "UDIM") == 0 &&
      separates(next(at + 4))) {
    is_tile = true;
    return at + 4;
  }
  return 0;
}

}  // namespace

void check_foreign_tokens(const std::string& option, const std::string& text, std::size_t at,
                          bool tiles_only) {
  // Every place may begin a token; the first one found is reported. In sources a frame number is no
  // mistake of this kind, so only tiles count there.
  for (; at < text.size(); ++at) {
    bool is_tile = false;
    const std::size_t end = foreign_token_end(text, at, is_tile);
    if (end == 0 || (tiles_only && !is_tile)) continue;
    const std::string token = text.substr(at, end - at);
    refuse_value(
        option, text,
        is_tile
            ? fmt::format("<UDIM> (1001) or <UVTILE> (u1_v1) for a tile's number, not {}", token)
            : fmt::format("no {}: pounce has no frames; a UDIM tile's number is written as <UDIM>",
                          token));
  }
}

void check_tokens(const std::string& option, const std::string& text,
                  const std::vector<std::string>& tokens) {
  for (std::size_t begin = text.find('<'); begin != std::string::npos;
       begin = text.find('<', begin + 1)) {
    // A "<" that is never closed is part of a name.
    const std::size_t end = text.find('>', begin);
    if (end == std::string::npos) break;
    const std::string token = text.substr(begin, end + 1 - begin);
    if (std::find(tokens.begin(), tokens.end(), token) == tokens.end()) {
      refuse_value(
          option, text,
          fmt::format("one of {} between < and >, not {}", fmt::join(tokens, ", "), token));
    }
  }
}

namespace {

/// Of an output. Folders may be called what they like: they are there already.
void check_file_name(const std::string& option, const std::string& text) {
  check_foreign_tokens(option, text, text.rfind('/') + 1, false);  // npos + 1 is 0
}

}  // namespace

std::string parse_image_pattern(const std::string& option, const std::string& text) {
  parse_path(option, text);
  if (io::is_model_path(text)) refuse_value(option, text, "an image (.png, .jpg, .tif, .tx, .exr)");
  check_file_name(option, text);
  check_tokens(option, text, {"<CHANNEL>", "<MATERIAL>", "<TARGET>", "<UDIM>", "<UVTILE>"});
  return text;
}

std::string parse_output(const std::string& option, const std::string& text) {
  if (!io::is_model_path(text)) return parse_image_pattern(option, text);
  parse_path(option, text);
  check_file_name(option, text);
  check_tokens(option, text, {"<TARGET>"});
  return text;
}

}  // namespace pounce::options
