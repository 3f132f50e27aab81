# SPDX-License-Identifier: Apache-2.0
# A source in layers that lie closer together than it does to the target: some texels show the wrong one, which is said.
source "$(dirname "$0")/support.sh"
# A square at z = 0, a second layer of it 0.01 above, and targets on the first one, between them and below them.
square() { # Z FIRST
  printf 'v 0 0 %s\nv 1 0 %s\nv 1 1 %s\nv 0 1 %s\n' "$1" "$1" "$1" "$1"
  printf 'f %d/1/1 %d/2/1 %d/3/1\nf %d/1/1 %d/3/1 %d/4/1\n' "$2" $(($2 + 1)) $(($2 + 2)) "$2" $(($2 + 2)) $(($2 + 3))
}
make_job
head=$(grep -E '^(mtllib|usemtl)' source.obj)
uvs=$'vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 1'
{ echo "$head"; echo "$uvs"; square 0 1; } >one.obj
{ echo "$head"; echo "$uvs"; square 0 1; square 0.01 5; } >two.obj
{ echo "$uvs"; square 0 1; } >on.obj
{ echo "$uvs"; square 0.004 1; } >between.obj
value() { tr -d ' \n' <r.json | sed -nE "s/.*\"$1\":([0-9.e-]+|null).*/\1/p"; }
expect 0 transfer two.obj on.obj -o a.png --size 16 --report r.json
! grep -q 'another layer' "$err" || fail 'a warning where the target lies on a layer'
[[ $(value mean_distance) == 0.0 && $(value close_layers) == 0.0 ]] || fail "not on it: $(value mean_distance)"
expect 0 transfer one.obj between.obj -o a.png --size 16 --report r.json
! grep -q 'another layer' "$err" || fail 'a warning of one layer'
awk "BEGIN { exit !($(value mean_distance) > 0.00399 && $(value mean_distance) < 0.00401) }" || fail "$(value mean_distance) is not 0.004"
# 0.004 away of 0.01: a texel that strays as far again still finds its own layer. 0.006 away it may not.
expect 0 transfer two.obj between.obj -o a.png --size 16 --report r.json
! grep -q 'another layer' "$err" || fail 'a warning where the layers are far enough apart'
{ echo "$uvs"; square -0.006 1; } >below.obj
expect 0 transfer two.obj below.obj -o a.png --size 16 --report r.json
err_has "below.obj: 100.0 % of the source's surface has another layer within 0.012, and this target is 0.006 from the source"
err_has '(--source-mesh'
[[ $(value close_layers) == 1.0 ]] || fail "close_layers $(value close_layers)"
# Of the layers each by itself nothing is to be said.
expect 0 transfer one.obj below.obj -o a.png --size 16
! grep -q 'another layer' "$err" || fail 'a warning of one layer'
