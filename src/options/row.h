// SPDX-License-Identifier: Apache-2.0
//
// A row of the table of options: everything there is to say about one option, once. The command
// line, its help, the man page, shell completion, docs/options.md, refusals, the report, the hash
// of a job and job files are all printed from rows; adding an option is adding a row
// (CONTRIBUTING.md).
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "options/parse.h"
#include "options/table.h"
#include "pounce/option_table.h"

namespace pounce::options {

/// The method that an option applies to. Elsewhere it is refused, unless it has its default.
enum class Only : std::uint8_t { any_method, surface, gaussian };

/// How an option counts in the hash of a job (docs/decisions/029-job-hash.md).
enum class Hashed : std::uint8_t {
  as_text,    ///< by its name and values
  otherwise,  ///< it changes no byte, or what it comes to is hashed: a file's content, a size
};

/// The part of a row that is written by hand.
struct Spec {
  std::string name = {};   ///< OptionInfo::name, likewise below
  std::string value = {};  ///< empty: a switch
  std::string group = {};
  std::string help = {};
  std::string default_text = {};  ///< default: `usual`
  std::string usual = {};         ///< default: the default of the member, if it is a plain value
  char letter = 0;
  Source source = Source::any;
  Only method = Only::any_method;
  std::vector<std::string> formats = {};  ///< one output at least has one of these; empty: any
  Hashed hashed = Hashed::as_text;
  bool is_operand = false;
  bool is_required = false;
  std::string excludes = {};
};

using Texts = std::vector<std::string>;

template <class Options>
struct Row {
  OptionInfo info;
  Source source = Source::any;
  Only method = Only::any_method;
  std::vector<std::string> formats;
  Hashed hashed = Hashed::as_text;
  std::function<void(Options&, const std::string& option, const std::string& text)> set;
  std::function<Texts(const Options&)> get;  ///< empty: the default
  bool is_checked = false;  ///< values that no parser has seen are legal if their texts are
};

/// How values of one type are read and printed. `Value` is what a text becomes, `Element` what is
/// printed: the same, or the elements of a list.
template <class Value, class Element = Value>
struct Codec {
  std::function<Value(const std::string& option, const std::string& text)> parse;
  std::function<std::string(const Element&)> print;
  std::string range = {};
  bool is_checked = false;
};

/// Reaches a member through nested structs: path(&TransferOptions::image, &ImageOptions::size).
template <class First, class... Rest>
auto path(First first, Rest... rest) {
  return [=](auto& options) -> auto& {
    if constexpr (sizeof...(rest) == 0) {
      return options.*first;
    } else {
      return path(rest...)(options.*first);
    }
  };
}

/// A row with what to do in its own words. `get` may give the texts of the default.
template <class Options>
Row<Options> custom_row(Spec spec, OptionValues values,
                        std::function<void(Options&, const std::string&, const std::string&)> set,
                        std::function<Texts(const Options&)> get) {
  Row<Options> row;
  row.info = {std::move(spec.name),  spec.letter,          std::move(spec.value),
              std::move(spec.group), std::move(spec.help), {},
              spec.default_text,     spec.usual,           values,
              spec.is_operand,       spec.is_required,     std::move(spec.excludes)};
  if (row.info.default_text.empty()) row.info.default_text = row.info.usual;
  row.source = spec.source;
  row.method = spec.method;
  row.formats = std::move(spec.formats);
  row.hashed = spec.hashed;
  row.set = std::move(set);
  Texts unset = get(Options{});
  row.get = [get = std::move(get), usual = std::move(spec.usual),
             unset = std::move(unset)](const Options& options) {
    Texts texts = get(options);
    return texts == unset || texts == Texts{usual} ? Texts{} : texts;
  };
  return row;
}

template <class T>
inline constexpr bool is_optional = false;
template <class T>
inline constexpr bool is_optional<std::optional<T>> = true;
template <class T>
inline constexpr bool is_vector = false;
template <class T>
inline constexpr bool is_vector<std::vector<T>> = true;

/// The row of a member that `codec` reads and prints. A vector takes a list where the codec parses
/// lists, else a value each time.
template <class Options, class Path, class Value, class Element>
Row<Options> row(Spec spec, Path member, Codec<Value, Element> codec) {
  using Member = std::remove_cvref_t<decltype(member(std::declval<Options&>()))>;
  constexpr bool is_list = is_vector<Value>;
  constexpr bool is_several = is_vector<Member> && !is_list;
  constexpr bool has_own_default = !is_vector<Member> && !is_optional<Member>;
  if constexpr (has_own_default) {
    const Options unset;
    if (spec.usual.empty() && spec.default_text.empty()) spec.usual = codec.print(member(unset));
  }
  auto set = [member, parse = codec.parse](Options& options, const std::string& option,
                                           const std::string& text) {
    if constexpr (is_several) {
      member(options).push_back(parse(option, text));
    } else {
      member(options) = parse(option, text);
    }
  };
  auto get = [member, print = codec.print](const Options& options) -> Texts {
    const auto& value = member(options);
    Texts texts;
    if constexpr (is_vector<Member>) {
      for (const auto& element : value) texts.push_back(print(element));
    } else if constexpr (is_optional<Member>) {
      if (value) texts.push_back(print(*value));
    } else {
      texts.push_back(print(value));
    }
    std::erase(texts, "");
    return texts;
  };
  Row<Options> row = custom_row<Options>(std::move(spec),
                                         is_several ? OptionValues::several
                                         : is_list  ? OptionValues::list
                                                    : OptionValues::one,
                                         set, get);
  row.info.range = codec.range;
  row.is_checked = codec.is_checked;
  return row;
}

/// The row of a switch that makes `member` the opposite of its default.
template <class Options, class Path>
Row<Options> switch_row(Spec spec, Path member) {
  const Options defaults;
  const bool unset = member(defaults);
  return custom_row<Options>(
      std::move(spec), OptionValues::none,
      [member, unset](Options& options, const std::string& option, const std::string& text) {
        member(options) = parse_switch(option, text) != unset;
      },
      [member, unset](const Options& options) {
        return member(options) == unset ? Texts{} : Texts{"true"};
      });
}

/// The table of a command, in the order of its help.
template <class Options>
const std::vector<Row<Options>>& rows_of();
template <>
const std::vector<Row<TransferOptions>>& rows_of<TransferOptions>();
template <>
const std::vector<Row<MapsOptions>>& rows_of<MapsOptions>();
template <>
const std::vector<Row<GaussiansOptions>>& rows_of<GaussiansOptions>();
template <>
const std::vector<Row<ProxyOptions>>& rows_of<ProxyOptions>();
template <>
const std::vector<Row<TexturedMeshOptions>>& rows_of<TexturedMeshOptions>();

/// Those of a transfer that apply to a hit map, in the words of `pounce apply`.
std::vector<OptionInfo> apply_infos();

}  // namespace pounce::options
