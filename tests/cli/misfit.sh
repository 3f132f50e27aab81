# SPDX-License-Identifier: Apache-2.0
# A mesh that is shifted, turned, scaled, stored with other axes or inside out is a warning that says what would bring it
# to its source; one that fits is none.
source "$(dirname "$0")/support.sh"
"$POUNCE_FIXTURE" head -o h --texture 128 --target-size 64 --triangles 4000 --format both >"$out"
transfer() { expect 0 transfer h/head_src.glb "$1" -o o.png --size 64 --report r.json "${@:2}"; }
# moved NAME PROGRAM: the head with its vertices changed by awk, without its normals.
moved() {
  awk "function put(x, y, z) { printf \"v %.9g %.9g %.9g\\n\", x, y, z } /^v /{$2; next} /^vn /{next}
    /^f /{gsub(\"/[0-9]+ \", \" \"); sub(\"/[0-9]+\$\", \"\")} 1" h/head_same.obj >"$1.obj"
}
none() {
  ! grep -qE 'of its surface coincides|its normals point' "$err" || fail 'a warning without a reason'
  grep -q '"fit": 1.0' r.json || fail "the fit: $(grep fit r.json)"
}
transfer h/head_same.glb
none
transfer h/head_other.glb
none
moved plain 'put($2, $3, $4)'
transfer plain.obj
none

moved shifted 'put($2 + 0.05, $3, $4)'
transfer shifted.obj
err_has 'of its surface coincides with the source'
err_has 'would if the target were moved by (-0.05 '
moved turned 'put($2 * 0.984808 + $4 * 0.173648, $3, $4 * 0.984808 - $2 * 0.173648)'
transfer turned.obj
grep -qE 'rotated by (9\.[7-9]|10\.[0-3]) degrees' "$err" || fail 'the turn is not named'
moved large 'put(100 * $2, 100 * $3, 100 * $4)'
transfer large.obj
err_has 'scaled by 0.01 (it is 100 times'
moved z_up 'put($2, -$4, $3)'
transfer z_up.obj
err_has "with --target-axes x,z,-y"
transfer z_up.obj --target-axes x,z,-y
none
# What was given counts: the whole of it is named (the head is the same on its left and right).
transfer z_up.obj --target-axes y,z,x
grep -qE -- '--target-axes -?x,z,-y' "$err" || fail 'the axes that were given do not count'

# Inside out: the corners of each triangle the other way round.
moved inward 'put($2, $3, $4)'
awk '/^f /{t = $3; $3 = $4; $4 = t} 1' inward.obj >out.obj
transfer out.obj
err_has 'its normals point opposite to the source'"'"'s where the two coincide, and those of the target point inward'
err_has 'flip the normals of the target'
