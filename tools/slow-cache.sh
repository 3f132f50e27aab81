#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# One tile cache under stress: eight processes on it, one of them killed, one more that evicts with a limit of
# 1.2 jobs; then, as root, a full disk and a read-only one. Minutes; the short siblings are tests/cli/cache-*.sh.
# Usage: tools/slow-cache.sh [ROUNDS]   (default 3; POUNCE and POUNCE_FIXTURE name other programs)
set -euo pipefail
cd "$(dirname "$0")/.."
pounce=${POUNCE:-$PWD/build/release/pounce} fixture=${POUNCE_FIXTURE:-$PWD/build/release/pounce-fixture}
[[ -x $pounce && -x $fixture ]] || { echo "build first: tools/test.sh" >&2; exit 2; }
work=$(mktemp -d "${TMPDIR:-/tmp}/pounce-cache-XXXXXX")
mounted=
finish() { [[ -z $mounted ]] || umount "$work/disk"; rm -rf "$work"; }
trap finish EXIT

failures=0
check() {  # check WHAT CONDITION...
  local what=$1
  shift
  if "$@"; then echo "ok      $what"; else echo "FAILED  $what"; failures=$((failures + 1)); fi
}
is_sound() { "$pounce" cache verify --cache "$1" >"$work/verdict" || { cat "$work/verdict"; return 1; }; }
field() { sed -n "s/.*\"$1\": \([0-9]*\).*/\1/p" "$2" | head -n1; }
transfer() {  # transfer SOURCE OUTPUT OPTION...
  "$pounce" transfer --redo "$work/$1/head_src.glb" "$work/$1/head_same.glb" -o "$2" --size 512 --threads 1 "${@:3}"
}
# Room of all files, in pages, as docs/cache.md counts it.
room() { { find "$1" -type f -printf '%s\n' 2>/dev/null || true; } | awk '{ sum += int(($1 + 4095) / 4096) * 4096 } END { print sum + 0 }'; }

for skin in a b; do
  size=1024
  [[ $skin == a ]] || size=1280
  "$fixture" head -o "$work/$skin" --texture $size --target-size 64 >/dev/null
  transfer $skin "$work/$skin.png" --no-cache 2>/dev/null
done
transfer a "$work/x.png" --cache "$work/one" 2>/dev/null
job_bytes=$(room "$work/one")
limit=$((job_bytes * 12 / 10))
echo "one job takes $((job_bytes >> 10)) KiB of cache, the limit is $((limit >> 10)) KiB"

for round in $(seq "${1:-3}"); do
  # Cold, without a limit: nothing twice.
  rm -rf "$work/cold"
  for i in $(seq 8); do
    transfer a "$work/cold$i.png" --cache "$work/cold" --report "$work/cold$i.json" 2>/dev/null &
  done
  wait
  decoded=0 same=0
  for i in $(seq 8); do
    decoded=$((decoded + $(field images_decoded "$work/cold$i.json")))
    cmp -s "$work/cold$i.png" "$work/a.png" && same=$((same + 1))
  done
  check "round $round: eight on one cold cache, $same the same, $decoded image decoded" test "$same $decoded" = "8 1"

  # With a limit of 1.2 jobs: seven of them, one killed, and one with another source that evicts.
  rm -rf "$work/tight"
  pids=()
  for i in $(seq 8); do
    transfer a "$work/t$i.png" --cache "$work/tight" --cache-limit $limit 2>"$work/t$i.log" &
    pids+=($!)
  done
  for i in 1 2 3; do transfer b "$work/u.png" --cache "$work/tight" --cache-limit $limit 2>/dev/null; done &
  evictor=$!
  echo 0 >"$work/most"
  (
    most=0
    while kill -0 $$ 2>/dev/null && [[ ! -e $work/stop ]]; do
      now=$(room "$work/tight")
      ((now <= most)) || { most=$now; echo $most >"$work/most"; }
      sleep 0.01
    done
  ) &
  watcher=$!
  sleep 0.$((RANDOM % 8 + 1))
  kill -9 "${pids[3]}" 2>/dev/null || true
  same=0
  for i in $(seq 8); do
    [[ $i == 4 ]] || { wait "${pids[$((i - 1))]}" && cmp -s "$work/t$i.png" "$work/a.png" && same=$((same + 1)); } || true
  done
  wait $evictor || true
  touch "$work/stop"
  wait $watcher || true
  rm "$work/stop"
  check "round $round: seven beside a killed one and an evicting one, $same the same" test $same = 7
  check "round $round: the evicting one's picture" cmp -s "$work/u.png" "$work/b.png"
  check "round $round: at most $(($(cat "$work/most") >> 10)) KiB seen" test "$(cat "$work/most")" -le $limit
  "$pounce" cache prune --cache "$work/tight" >/dev/null  # what the killed one left
  check "round $round: no leftovers" test -z "$(ls "$work/tight/v3/tmp" "$work/tight/v3/locks" | grep -v :)"
  taken=$("$pounce" cache info --json --cache "$work/tight" | sed -n 's/.*"taken": \([0-9]*\).*/\1/p')
  folders=$(find "$work/tight/v3" -mindepth 1 -type d | wc -l)
  check "round $round: reported is real" test "$taken" -eq $(($(room "$work/tight") + folders * 4096))
  check "round $round: every pack is sound" is_sound "$work/tight"
done

mkdir "$work/disk"
if mount -t tmpfs -o size=$((job_bytes / 2)) none "$work/disk" 2>/dev/null; then
  mounted=yes
  status=0
  transfer a "$work/full.png" --cache "$work/disk/cache" --cache-limit none --temp "$work" 2>"$work/log" || status=$?
  check "a full disk: status $status" test $status -eq 75 -o $status -eq 0
  check "a full disk leaves a sound cache" is_sound "$work/disk/cache"
  check "a full disk with the default limit" transfer a "$work/full.png" --cache "$work/disk/cache" --temp "$work" 2>/dev/null
  check "a full disk: the same picture" cmp -s "$work/full.png" "$work/a.png"
  # Full of other people's files, and a limit that knows nothing of it.
  rm -rf "$work/disk/cache"
  head -c $((job_bytes / 3)) /dev/zero >"$work/disk/others"
  check "a disk that others fill" transfer a "$work/full.png" --cache "$work/disk/cache" --cache-limit 1GiB --temp "$work" 2>"$work/log"
  check "a disk that others fill: the same picture" cmp -s "$work/full.png" "$work/a.png"
  check "a disk that others fill: said once" test "$(grep -c 'free disk space' "$work/log")" = 1
  umount "$work/disk"
  mount -t tmpfs -o size=64m none "$work/disk"
  transfer a "$work/x.png" --cache "$work/disk/cache" --cache-limit none 2>/dev/null
  mount -o remount,ro "$work/disk"
  transfer a "$work/ro.png" --cache "$work/disk/cache" --report "$work/ro.json" 2>"$work/log"
  check "a read-only cache is read" test "$(field images_decoded "$work/ro.json")" = 0
  transfer b "$work/ro.png" --cache "$work/disk/cache" 2>"$work/log"
  check "a read-only cache does not stop another job" cmp -s "$work/ro.png" "$work/b.png"
  check "and that is said once" test "$(grep -c 'not writable' "$work/log")" = 1
  # A cache that users share: nobody uses, and removes, what root made.
  transfer a "$work/x.png" --cache "$work/shared" 2>/dev/null
  chmod 755 "$work" && find "$work/shared" -type d -exec chmod 777 {} + && mkdir -m 777 "$work/nobody"
  as_nobody() { setpriv --reuid=65534 --regid=65534 --clear-groups "$pounce" "$@"; }
  check "another user's packs" as_nobody transfer "$work/b/head_src.glb" "$work/b/head_same.glb" -o "$work/nobody/o.png" \
    --size 512 --cache "$work/shared" --cache-limit $limit 2>"$work/log"
  check "another user's packs: the same picture" cmp -s "$work/nobody/o.png" "$work/b.png"
  check "another user's packs made room" test "$(room "$work/shared")" -le $limit
else
  echo "SKIPPED: a full disk and a read-only one need root"
fi
echo "$failures failed"
[[ $failures -eq 0 ]]
