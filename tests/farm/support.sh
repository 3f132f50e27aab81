# SPDX-License-Identifier: Apache-2.0
# Sourced by the scripts here. POUNCE and POUNCE_FIXTURE are the programs under test; a script runs in an empty folder
# of its own, with a cluster of $nodes nodes.
set -euo pipefail
: "${POUNCE:?the program under test}" "${POUNCE_FIXTURE:?the maker of input}"
farm=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
work=$(mktemp -d "${TMPDIR:-/tmp}/pounce-farm-XXXXXX")
chmod 755 "$work"
trap 'bash "$farm/local-slurm.sh" stop "$work/slurm"; rm -rf "$work"' EXIT
export LC_ALL=C XDG_CACHE_HOME=$work/own-cache SLURM_CONF=$work/slurm/slurm.conf
mkdir "$work/here" && cd "$work/here"

fail() {
  printf 'FAILED: %s\n' "$*"
  local log
  for log in job*/log/*.log; do [[ ! -e $log ]] || { echo "--- $log" && tail -n 20 "$log"; }; done
  squeue 2>/dev/null || true
  exit 1
}

# udims N: N UDIM tiles over the fixture `plane`, of which the first covers N times as much of its image as the last.
udims() {
  awk -v n="$1" 'BEGIN {
    for (i = 0; i < n; ++i) {
      x0 = 0.05 + 0.9 * i / n; x1 = 0.05 + 0.9 * (i + 1) / n; s = 0.99 * sqrt((n - i) / n); u = i % 10; v = int(i / 10)
      printf "v %f 0.05 0\nv %f 0.05 0\nv %f 0.95 0\nv %f 0.95 0\n", x0, x1, x1, x0
      printf "vt %f %f\nvt %f %f\nvt %f %f\nvt %f %f\n", u, v, u + s, v, u + s, v + s, u, v + s
      k = 4 * i
      printf "f %d/%d %d/%d %d/%d %d/%d\n", k + 1, k + 1, k + 2, k + 2, k + 3, k + 3, k + 4, k + 4
    }
  }'
}

start_cluster() {
  local status=0
  bash "$farm/local-slurm.sh" start "$work/slurm" "$1" || status=$?
  [[ $status == 0 ]] || exit $status
}
cluster() { bash "$farm/local-slurm.sh" "$1" "$work/slurm" "${@:2}"; }

# submit FOLDER ARGUMENT...: without waiting.
submit() { "$POUNCE" submit slurm "$@" >submitted 2>&1 || fail "submit: $(cat submitted)"; }

# settle SECONDS: until Slurm has nothing left.
settle() {
  local try
  for ((try = 0; try < $1 * 5; ++try)); do
    [[ -n $(squeue -h 2>/dev/null || echo x) ]] || return 0
    sleep 0.2
  done
  fail "jobs are still there after $1 s"
}

# state FOLDER NAME: of the task.
state() { "$POUNCE" status "$1" --json | awk -v name="\"$2\"," '$1 == "\"task\":" { is = $2 == name } is && $1 == "\"state\":" { gsub(/[",]/, "", $2); print $2; exit }'; }

# same FOLDER: are the files there the same as those here?
same() {
  local file
  [[ -n $(ls "$1") ]] || fail "nothing in $1"
  for file in "$1"/*; do cmp "$file" "${file##*/}" || fail "other bytes in ${file##*/}"; done
}
