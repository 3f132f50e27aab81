# SPDX-License-Identifier: Apache-2.0
# --generate: the man page, completion for three shells and docs/options.md say what the parsers know.
source "$(dirname "$0")/support.sh"
refused '--generate: got "html", expected man, bash, zsh, fish or markdown' --generate html
expect 0 --generate markdown
cmp "$out" "$POUNCE_SOURCE_DIR/docs/options.md" ||
  fail 'docs/options.md is not what the table prints: pounce --generate markdown >docs/options.md'

expect 0 --generate man
for word in '.TH POUNCE 1 ' '\-\-max\-distance' '.SH pounce cache prune' '.SH EXIT STATUS'; do out_has "$word"; done
if command -v groff >/dev/null; then
  groff -man -Tutf8 -ww "$out" >/dev/null 2>warnings || fail 'the man page is no roff'
  [[ ! -s warnings ]] || fail "the man page: $(head -3 warnings)"
  rm warnings
fi

expect 0 --generate bash
# shellcheck disable=SC1090
source "$out"
completes() { # WORDS... -- what the last of them may become, in any order
  COMP_WORDS=() COMPREPLY=()
  while [[ $1 != -- ]]; do COMP_WORDS+=("$1") && shift; done
  shift
  COMP_CWORD=$((${#COMP_WORDS[@]} - 1))
  _pounce
  [[ $(printf '%s\n' "${COMPREPLY[@]}" | sort) == $(printf '%s\n' "$@" | sort) ]] ||
    fail "${COMP_WORDS[*]}: completes to ${COMPREPLY[*]}, not $*"
}
completes pounce t -- transfer
completes pounce transfer --max- -- --max-angle --max-distance --max-scale --max-temp
completes pounce transfer --filter '' -- tent cubic sharp
completes pounce transfer --depth u -- u8 u16
completes pounce transfer --depth = h -- half
completes pounce maps --rays -- ''
completes pounce cache pr -- prune
completes pounce cache prune --o -- --older-than
mkdir here there
touch scan.glb
completes pounce transfer s -- scan.glb
completes pounce transfer --cache '' -- here there
completes pounce transfer --size '' -- ''

expect 0 --generate zsh
[[ $(head -1 "$out") == '#compdef pounce' ]] || fail 'no zsh completion'
! command -v zsh >/dev/null || zsh -n "$out" || fail 'zsh does not read its completion'
out_has "'--filter=["
expect 0 --generate fish
! command -v fish >/dev/null || fish -n "$out" || fail 'fish does not read its completion'
out_has "-l filter -x -a 'tent cubic sharp'"
