# SPDX-License-Identifier: Apache-2.0
# --skip-existing: what is younger than all its inputs stays, all else is made.
source "$(dirname "$0")/support.sh"
refused '--skip-existing cannot tell' transfer a.obj b.obj -o o.png --onto o.png --skip-existing
"$POUNCE_FIXTURE" plane -o s.obj --triangles 400 --uv-tiles 3 --texture 16 >/dev/null
"$POUNCE_FIXTURE" plane -o t.obj --triangles 400 --uv-tiles 3 >/dev/null
touch -d '2020-01-01' s.* t.*
job=(transfer s.obj t.obj -o 't.<UDIM>.png' --source-texture 'baseColor=s.<UDIM>.png' --size 32 --skip-existing --no-cache)
expect 0 "${job[@]}"
err_has 'wrote t.1003.png'
sum() { cat "$@" | md5sum; }
first=$(sum t.100?.png)
expect 0 "${job[@]}" --report r.json
err_has 'kept 3 that are younger'
! grep -q wrote "$err" || fail 'something was written again'
grep -q '"outputs": \[\]' r.json || fail 'outputs'
grep -q '"images_decoded": 0' r.json || fail 'images_decoded'
rm t.1002.png
touch t.1001.png
expect 0 "${job[@]}" --report r.json
err_has 'wrote t.1002.png'
err_has 'kept 2'
[[ $(sum t.100?.png) == "$first" ]] || fail 'other bytes'
touch s.1002.png # an input that is younger than all of them
expect 0 "${job[@]}"
err_has 'wrote t.1001.png'
! grep -q kept "$err" || fail 'an old output was kept'
