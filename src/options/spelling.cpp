// SPDX-License-Identifier: Apache-2.0
//
// Which known word a misspelt one probably means: the one with the fewest edits between them, if
// these are few for its length. An edit inserts, removes or replaces a letter, or exchanges two
// neighbours (Damerau's distance, by the usual table of which three rows are needed at a time).
//
// A wrong proposal is worse than none, since it sends its reader the wrong way. Hence the limit,
// which grows with the length of the word: a short one is near to everything.
#include <fmt/format.h>

#include <algorithm>
#include <numeric>

#include "options/parse.h"
#include "pounce/option_table.h"

namespace pounce {
namespace {

constexpr std::size_t kLettersPerEdit = 3;  // "basecolour" has two edits; unrelated words have more
constexpr std::size_t kClearBeginning = 5;  // letters that mean a name by its beginning: --max-dist

std::size_t edits_between(const std::string& a, const std::string& b) {
  // row[j] counts the edits between the first i letters of `a` and the first j of `b`; `last` and
  // `before` are the rows of i - 1 and i - 2.
  std::vector<std::size_t> before, last(b.size() + 1), row(b.size() + 1);
  std::iota(last.begin(), last.end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t replaced = last[j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1);
      row[j] = std::min({replaced, last[j] + 1, row[j - 1] + 1});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
        row[j] = std::min(row[j], before[j - 2] + 1);
    }
    before = last;
    last = row;
  }
  return last.back();
}

}  // namespace

std::string did_you_mean(const std::string& word, const std::vector<std::string>& known) {
  std::string best;
  std::size_t least = std::max<std::size_t>(1, word.size() / kLettersPerEdit) + 1;
  for (const std::string& name : known) {
    // A beginning is one edit, however much is missing: whoever types half of a name knows which
    // one.
    const bool begins = word.size() >= kClearBeginning && name.starts_with(word);
    const std::size_t edits =
        begins ? 1 : edits_between(options::lower(word), options::lower(name));
    // Of equals the first, in the order of the table: it must be the same one every time.
    if (edits >= least) continue;
    least = edits;
    best = name;
  }
  return best.empty() ? "" : fmt::format("; did you mean {}?", best);
}

}  // namespace pounce
