# SPDX-License-Identifier: Apache-2.0
# --skip-existing: what this same job made stays, all else is made. Times count only where no job is said.
skips=made
source "$(dirname "$0")/support.sh"
refused '--skip-existing cannot distinguish' transfer a.obj b.obj -o o.png --onto o.png --skip-existing
"$POUNCE_FIXTURE" plane -o s.obj --triangles 400 --uv-tiles 3 --texture 16 >/dev/null
"$POUNCE_FIXTURE" plane -o t.obj --triangles 400 --uv-tiles 3 >/dev/null
touch -d '2020-01-01' s.* t.*
job=(transfer s.obj t.obj -o 't.<UDIM>.png' --source-texture 'baseColor=s.<UDIM>.png' --size 32 --skip-existing --no-cache)
expect 0 "${job[@]}"
err_has 'wrote t.1003.png'
sum() { cat "$@" | md5sum; }
first=$(sum t.100?.png)
expect 0 "${job[@]}" --report r.json
err_has 'skipped 3 files (up to date)'
! grep -q wrote "$err" || fail 'something was written again'
grep -q '"outputs": \[\]' r.json || fail 'outputs'
grep -q '"images_decoded": 0' r.json || fail 'images_decoded'
rm t.1002.png
expect 0 "${job[@]}" --report r.json
err_has 'wrote t.1002.png'
err_has 'skipped 2'
[[ $(sum t.100?.png) == "$first" ]] || fail 'other bytes'
touch s.* t.obj # younger than the outputs, but the same
expect 0 "${job[@]}" --threads 1 --memory 64MiB
err_has 'skipped 3'
! grep -q 'no job is recorded' "$err" || fail 'a warning of what is recorded'
expect 0 "${job[@]}" --plan
! grep -q 'would write.*t.1001.png' "$out" || fail 'a plan to write what is kept'

# Another option, another content of an input: made again, though the outputs are younger.
expect 0 "${job[@]}" --padding 2
! grep -q skipped "$err" || fail 'an output with other padding was kept'
err_has 'wrote t.1001.png'
cp s.1001.png s.1002.png
touch -d '2020-01-01' s.1002.png
expect 0 "${job[@]}" --padding 2
! grep -q skipped "$err" || fail 'an output of other inputs was kept'

# Without a record of its job: the times say.
"$POUNCE_FIXTURE" plane -o u.obj --triangles 400 --uv-tiles 3 --texture 32 >/dev/null
cp u.1001.png t.1001.png # painted by somebody
touch -d '2020-01-01' s.* t.obj
painted=$(sum t.1001.png)
expect 0 "${job[@]}" --padding 2
err_has 'skipped 3'
err_has 't.1001.png: skipped because newer than all inputs; no job is recorded there'
[[ $(sum t.1001.png) == "$painted" ]] || fail 'painted work is lost'
touch -d '2019-01-01' t.1001.png
expect 0 "${job[@]}" --padding 2
err_has 'wrote t.1001.png'
err_has 'skipped 2'

# What is no whole image of its format is made again, however young; a folder is in the way, as always.
expect 0 "${job[@]}" --padding 2
whole=$(sum t.100?.png)
"$POUNCE_FIXTURE" plane -o u.obj --triangles 400 --texture 32 >/dev/null
head -c -1 u.png >cut.png # painted by somebody, and copied until the disk was full
head -c 600 t.1002.png >head.png # its own, with the header whole
expect 0 transfer u.obj u.obj -o exr.exr --size 8 --no-cache
for bad in /dev/null cut.png head.png exr.exr; do
  cat "$bad" >t.1002.png
  expect 0 "${job[@]}" --padding 2
  err_has 'wrote t.1002.png'
  err_has 'skipped 2'
  [[ $(sum t.100?.png) == "$whole" ]] || fail "$bad: other bytes"
done
rm t.1002.png
mkdir t.1002.png
expect 5 "${job[@]}" --padding 2
err_has 't.1002.png: is a folder'
