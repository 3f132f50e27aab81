# SPDX-License-Identifier: Apache-2.0
# Sets that are killed between their images: what the same job has painted over in place is not painted again, what it
# has made is skipped, maps too.
skips=made
source "$(dirname "$0")/support.sh"
left() { find . -name '.pounce-*.resume' -o -name '.*.tmp' | sort; }

# A set that is painted over in place is painted once, wherever it is killed: each image says whether it is. Twice under
# a soft mask would be another picture.
"$POUNCE_FIXTURE" plane -o tiles.obj --triangles 2000 --uv-tiles 3 --texture 256 >/dev/null
line=(transfer tiles.obj tiles.obj --source-texture 'baseColor=tiles.<UDIM>.png' --threads 1 --no-cache)
expect 0 "${line[@]}" -o 'below.<UDIM>.png' --size 1024 --filter tent
{ printf 'P5\n1024 1024\n255\n' && head -c $((1024 * 1024)) /dev/zero | tr '\0' '\140'; } >soft.pgm
line+=(-o 'w.<UDIM>.png' --onto 'w.<UDIM>.png' --mask soft.pgm --coverage 'm.<UDIM>.png')
begin() {
  for udim in 1001 1002 1003; do
    cp below.$udim.png w.$udim.png
    rm -f m.$udim.png
  done
}
once() {
  for udim in 1001 1002 1003; do
    cmp w.$udim.png once.$udim.png || fail "w.$udim.png: $1"
    cmp m.$udim.png once.m.$udim.png || fail "m.$udim.png: $1"
  done
}
begin
expect 0 "${line[@]}"
for udim in 1001 1002 1003; do
  cp w.$udim.png once.$udim.png
  cp m.$udim.png once.m.$udim.png
done
kills=0
for fraction in 0.3 0.65 0.9; do
  begin
  kill_job $fraction "${line[@]}"
  expect 0 "${line[@]}"
  once "painted twice after a kill at $fraction"
  [[ -z $(left) ]] || fail "left beside a set: $(left)"
done
((kills >= 2)) || fail "only $kills of 3 kills met a job at work"
expect 0 "${line[@]}" --plan
out_has 'would skip    w.1003.png'
expect 0 "${line[@]}" --min-coverage 1 --report r.json # counts all again, and paints nothing
once 'painted twice with --min-coverage'
[[ $(grep -c '"state": "kept"' r.json) == 3 ]] || fail 'the report says that something was painted'
err_has 'skipped 3 files'
rm m.1002.png
expect 0 "${line[@]}"
once 'painted twice where its mask was missing'
expect 0 "${line[@]}" --redo
! cmp -s w.1001.png once.1001.png || fail '--redo did not paint again'

# Maps are images that this job made, too.
maps=(maps tiles.obj -o 'x.<CHANNEL>.<UDIM>.exr' --size 64 --no-cache)
expect 0 "${maps[@]}"
sums=$(md5sum x.*)
rm x.normal.1002.exr
expect 0 "${maps[@]}" --report r.json
err_has 'skipped 8 files'
grep -q '"state": "kept"' r.json || fail 'the report does not say what was skipped'
md5sum -c --quiet <<<"$sums" || fail 'other maps the second time'
before=$(stat -c %i x.mask.1001.exr)
expect 0 "${maps[@]}"
err_has 'skipped 9 files'
[[ $(stat -c %i x.mask.1001.exr) == "$before" ]] || fail 'a map was made again'
expect 0 "${maps[@]}" --redo
[[ $(stat -c %i x.mask.1001.exr) != "$before" ]] || fail '--redo made no map again'
