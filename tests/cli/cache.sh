# SPDX-License-Identifier: Apache-2.0
# --cache keeps tiles in its folder for the next run; --no-cache keeps nothing anywhere.
source "$(dirname "$0")/support.sh"
make_job
expect 0 transfer source.obj target.obj -o o.png --no-cache
[[ ! -e $XDG_CACHE_HOME ]] || fail '--no-cache wrote into the cache'
expect 0 transfer source.obj target.obj -o o.png --cache ../tiles --report -
grep -q '"cached": true' "$out" && fail 'cached at the first run'
[[ ! -e $XDG_CACHE_HOME ]] || fail '--cache wrote elsewhere'
packs=$(find ../tiles -name '*.pack')
[[ -n $packs ]] || fail 'no packs in the cache'
expect 0 transfer source.obj target.obj -o p.png --cache ../tiles --report -
out_has '"cached": true'
cmp o.png p.png || fail 'the cache changes the picture'
for pack in $packs; do
  expect 0 inspect "$pack"
  out_has 'every checksum matches'
  expect 0 inspect "$pack" --json
  out_has '"sound": true'
  # One flipped bit in the middle is noticed.
  at=$(($(stat -c %s "$pack") / 2))
  byte=$(od -An -tu1 -j $at -N 1 "$pack")
  printf "\\x$(printf %x $((byte ^ 1)))" | dd of="$pack" bs=1 seek=$at conv=notrunc status=none
  expect 6 inspect "$pack"
  err_has "$pack"
done
# And never believed: the picture is the same, from the source.
expect 0 transfer source.obj target.obj -o q.png --cache ../tiles
cmp o.png q.png || fail 'a damaged cache changes the picture'
