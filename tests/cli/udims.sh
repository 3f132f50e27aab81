# SPDX-License-Identifier: Apache-2.0
# A mesh that is made may lie in several UDIM tiles: as many materials, one texture each, and nothing that overlaps.
source "$(dirname "$0")/support.sh"
number() { tr -d ' \n' <"$1" | sed -nE "s/.*$2.*/\1/p"; }
refused '--udims' proxy s.ply -o s.glb --udims 0
refused '--udims' proxy s.ply -o s.glb --udims 101
refused 'excludes --udims' proxy s.glb -o l.glb --keep-uvs --udims 2
"$POUNCE_FIXTURE" splats -o s.ply --shape sphere --count 40000 --floaters 0.005 --target-size 256 >"$out"
expect 0 proxy s.ply -o s.glb --cells 48 --triangles 2000 --size 128 --udims 12 --threads 1
err_has 'of the 12 tiles'
expect 0 inspect s.glb
out_has 'UDIM 1001-1012'
for udim in 1001 1010 1011 1012; do out_has "material   \"$udim\""; done
expect 0 proxy s.ply -o again.glb --cells 48 --triangles 2000 --size 128 --udims 12 --threads 3 --memory 64MiB --no-cache
cmp s.glb again.glb || fail 'other bytes with other threads and memory'
# An image for each tile, of which charts fill more than half and share no texel.
expect 0 transfer s.ply s.glb -o 's.<UDIM>.png' --size 128 --report t.json
for udim in 1001 1002 1003 1004 1005 1006 1007 1008 1009 1010 1011 1012; do [[ -e s.$udim.png ]] || fail "no s.$udim.png"; done
texels=$(number t.json '"target":\{"texels":([0-9]+)') empty=$(number t.json '"target":[^}]*"empty":([0-9]+)')
((texels * 2 > 12 * 128 * 128)) || fail "$texels texels in 12 tiles"
((empty * 100 < texels)) || fail "$empty of $texels texels are empty"
[[ $(number t.json '"target":[^}]*"overlapping":([0-9]+)') == 0 ]] || fail 'charts overlap'
# As a model: the same, and what it looks like is what the scene shows.
expect 0 mesh s.ply -o m.gltf --cells 64 --triangles 3000 --size 128 --udims 12
for udim in 1001 1012; do [[ -e m.$udim.baseColor.png ]] || fail "no m.$udim.baseColor.png"; done
expect 0 transfer m.gltf s_target.glb -o back.png --size 256
expect 0 compare back.png s_target.truth.png --min-psnr 28
# And a lighter model.
expect 0 mesh m.gltf -o l.glb --triangles 600 --size 128 --udims 2 --channels baseColor
expect 0 inspect l.glb
out_has 'UDIM 1001, 1002'
