# SPDX-License-Identifier: Apache-2.0
# Sourced by every script here. POUNCE and POUNCE_FIXTURE are the programs under test. A script runs in an
# empty folder of its own and ends with the first thing that is not as expected.
set -euo pipefail
: "${POUNCE:?the program under test}" "${POUNCE_FIXTURE:?the maker of input}"

work=$(mktemp -d "${TMPDIR:-/tmp}/pounce-cli-XXXXXX")
trap 'rm -rf "$work"' EXIT
export XDG_CACHE_HOME=$work/cache LC_ALL=C

# Scripts run one job several times, with other threads, limits and caches, and compare: so here each makes its outputs
# again. What users get, outputs of this very job skipped, is for scripts that say `skips=made` before they read this.
program=$POUNCE  # itself
if [[ ${skips-} != made ]]; then
  mkdir "$work/bin"
  POUNCE=$work/bin/pounce
  cat >"$POUNCE" <<END
#!/bin/bash
if [[ \${1-} =~ ^(transfer|apply|maps|mesh)\$ ]] && [[ " \$* " != *" --skip-existing "* && " \$* " != *" --redo "* ]]; then
  exec "$program" "\$1" --redo "\${@:2}"
fi
exec "$program" "\$@"
END
  chmod 755 "$POUNCE" "$work" "$work/bin"
fi
mkdir "$work/here"
cd "$work/here"
out=$work/stdout
err=$work/stderr
: >"$out" >"$err"

fail() {
  printf 'FAILED: %s\n--- standard output\n%s\n--- standard error\n%s\n' "$*" "$(head -c 4000 "$out")" \
    "$(head -c 4000 "$err")"
  exit 1
}

# expect STATUS ARGUMENT...: runs pounce, keeps what it says in $out and $err.
expect() {
  local wanted=$1 got=0
  shift
  "$POUNCE" "$@" >"$out" 2>"$err" || got=$?
  [[ $got == "$wanted" ]] || fail "exit status $got, not $wanted: pounce $*"
}

# as_nobody COMMAND...: runs it as another user who may look into this folder, output in $out and $err; fails where that
# is not to be had. For root alone, whom no permission stops.
as_nobody() {
  command -v setpriv >/dev/null || return 1
  chmod 755 "$work"
  setpriv --reuid 65534 --regid 65534 --clear-groups "$@" >"$out" 2>"$err"
}

# kill_job FRACTION ARGUMENT...: runs pounce and kills it (SIGKILL) once its progress is beyond FRACTION of the job and
# what the script waits for besides, by an is_ripe of its own, is there.
# $kills counts those that met a job at work: it had said so much and no end, and died of the signal. A script
# checks that enough did; a job that was done before proves nothing.
kills=0
is_ripe() { :; }
kill_job() {
  local fraction=$1 said=$work/said job status=0
  shift
  : >"$said"
  "$POUNCE" "$@" --progress json >"$out" 2>"$said" &
  job=$!
  is_beyond() {
    awk -F '"fraction":' -v least="$fraction" 'NF > 1 && $2 + 0 > least { found = 1 } END { exit !found }' "$said"
  }
  until { is_beyond && is_ripe; } || ! kill -0 $job 2>/dev/null; do sleep 0.01; done
  kill -KILL $job 2>/dev/null || true
  { wait $job || status=$?; } 2>/dev/null
  if [[ $status == 137 ]] && is_beyond && ! grep -q '^{"end"' "$said"; then kills=$((kills + 1)); fi
}

out_has() { grep -qF -- "$1" "$out" || fail "the standard output lacks: $1"; }
err_has() { grep -qF -- "$1" "$err" || fail "the standard error output lacks: $1"; }
err_lacks() { ! grep -qF -- "$1" "$err" || fail "the standard error output has: $1"; }
silent() { [[ ! -s $1 ]] || fail "$(basename "$1") should be empty"; }

# refused WORDS ARGUMENT...: a usage error that says WORDS, points at the help and writes nothing.
refused() {
  local words=$1
  shift
  expect 2 "$@"
  silent "$out"
  err_has "$words"
  err_has "--help'"
  [[ -z $(ls -A) ]] || fail "files were made: $(ls -A)"
}

# rejected OPTION VALUE...: transfer refuses each value of the option and names both.
rejected() {
  local option=$1 value
  shift
  for value in "$@"; do
    refused "$option: got \"$value\"" transfer a.glb b.glb -o o.png "$option" "$value"
  done
}

# same_picture A B: have these the same texels? Files of other options say other jobs.
# misused WORDS ARGUMENT...: the same where files are there already.
misused() {
  expect 2 "${@:2}"
  err_has "$1"
}
same_picture() { "$POUNCE" compare "$1" "$2" --min-psnr 1000 >/dev/null 2>&1; }  # leaves what the job said

only_files() { [[ $(ls -A | tr '\n' ' ') == "$* " ]] || fail "the folder holds: $(ls -A | tr '\n' ' ')"; }

# quad NAME [TEXTURE]: a unit square as NAME.obj with UVs 0..1, optionally with a baseColor texture.
quad() {
  {
    [[ -z ${2-} ]] || printf 'mtllib %s.mtl\nusemtl skin\n' "$1"
    printf 'v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n'
  } >"$1.obj"
  [[ -z ${2-} ]] || printf 'newmtl skin\nmap_Kd %s\n' "$2" >"$1.mtl"
}

# quad_without_uvs NAME
quad_without_uvs() { printf 'v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n' >"$1.obj"; }

# samples VALUE...: bytes with these values.
samples() { printf "$(printf '\\%03o' "$@")"; }

# image PATH WIDTH HEIGHT RGB...: a PPM of these samples, the last texel repeated to the end.
image() {
  local path=$1 texels=$(($2 * $3)) values=("${@:4}")
  while ((${#values[@]} < 3 * texels)); do values+=("${values[@]: -3}"); done
  { printf 'P6\n%d %d\n255\n' "$2" "$3" && samples "${values[@]}"; } >"$path"
}

# mask PATH WIDTH HEIGHT VALUE...: a PGM of these samples.
mask() { { printf 'P5\n%d %d\n255\n' "$2" "$3" && samples "${@:4}"; } >"$1"; }

# A textured square and a target for it.
make_job() {
  image skin.ppm 16 16 200 100 50
  quad source skin.ppm
  quad target
}
