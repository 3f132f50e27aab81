# SPDX-License-Identifier: Apache-2.0
# apply: new textures through a hit map are what a transfer gives, without the meshes; what a map cannot do is refused.
source "$(dirname "$0")/support.sh"
# Refused before a file is read.
refused '--source-texture is required' apply m.exr -o o.png
refused 'm.glb: is not a hit map (.exr)' apply m.glb --source-texture baseColor=t.png -o o.png
refused 'use pounce apply, without a target' transfer m.exr b.glb -o o.png
paint=(--source-texture baseColor=t.png)
refused 'no model can be written' apply m.exr "${paint[@]}" -o o.glb
refused 'a map knows no <TARGET>' apply m.exr "${paint[@]}" -o 'o.<TARGET>.png'
refused '<UDIM> or <UVTILE> must appear both' apply m.exr "${paint[@]}" -o 'o.<UDIM>.png'
refused '<UDIM> or <UVTILE> must appear both' apply 'm.<UDIM>.exr' "${paint[@]}" -o o.png
refused 'a map knows no <TARGET>' apply m.exr "${paint[@]}" -o o.png --coverage 'c.<TARGET>.png'
refused 'a map knows no <MATERIAL>' apply m.exr "${paint[@]}" -o o.png --onto 'c.<MATERIAL>.png'
refused '--padding contradicts --onto' apply m.exr "${paint[@]}" -o o.png --onto old.png --padding 4
refused 'normal cannot be painted through a map' apply m.exr --source-texture normal=n.png -o o.png
refused 'apply does not accept --max-distance' apply m.exr "${paint[@]}" -o o.png --max-distance 1
echo '{"command": "apply", "options": {"source": "m.exr", "output": "o.png", "source-texture": ["baseColor=t.png"],
  "max-distance": 1}}' >job.json
expect 2 apply --job job.json
err_has '--max-distance applies only to meshes and splat scenes; m.exr is a hit map'
expect 5 apply m.exr "${paint[@]}" -o o.png
err_has 'm.exr: cannot open'
expect 5 apply 'm.<UDIM>.exr' "${paint[@]}" -o 'o.<UDIM>.png'
err_has 'the first would be m.1001.exr'

"$POUNCE_FIXTURE" plane -o p.obj --triangles 200 --texture 32 --uv-tiles 2 >"$out"
for tile in 1001 1002; do cp "p.$tile.png" "first.$tile.png"; done
expect 0 transfer p.obj p.obj --source-texture 'baseColor=first.<UDIM>.png' --size 64 -o 'first_out.<UDIM>.png' \
  --map 'm.<UDIM>.exr'
# Another texture: the tiles change places.
cp p.1002.png new.1001.png
cp p.1001.png new.1002.png
expect 0 transfer p.obj p.obj --source-texture 'baseColor=new.<UDIM>.png' --size 64 -o 't.<UDIM>.png'
mkdir elsewhere
mv m.*.exr new.*.png elsewhere # where no mesh is
cd elsewhere
expect 0 apply 'm.<UDIM>.exr' --source-texture 'baseColor=new.<UDIM>.png' -o 'a.<UDIM>.png' --report r.json
grep -q '"command": "apply"' r.json || fail 'the report names another command'
grep -q '"m.1002.exr"' r.json || fail 'the report does not name the maps it read'
for tile in 1001 1002; do
  expect 0 compare "a.$tile.png" "../t.$tile.png"
  out_has 'infinite (equal)'
  expect 0 compare "a.$tile.png" "../first_out.$tile.png"
  ! grep -q 'infinite' "$out" || fail 'the new texture is not seen'
done
cp a.1001.png kept.png
expect 0 apply --job r.json --skip-existing --report again.json
grep -qF '"outputs": []' again.json || fail 'made again'
rm a.1001.png
expect 0 apply --job r.json --skip-existing
cmp a.1001.png kept.png || fail 'other bytes'
expect 0 apply 'm.<UDIM>.exr' --source-texture 'baseColor=new.<UDIM>.png' -o 'a.<UDIM>.png' --plan
out_has 'a.1002.png'

# With the least memory that a plan of several tiles names.
least=$(sed -nE 's/^least memory .*\(([0-9]+) bytes\)/\1/p' "$out")
[[ -n $least ]] || fail 'the plan names no least memory'
expect 0 apply 'm.<UDIM>.exr' --source-texture 'baseColor=new.<UDIM>.png' -o 'a.<UDIM>.png' --no-cache --memory "$least"
cmp a.1001.png kept.png || fail 'other bytes with the least memory'
# The one texture that is named is painted, whatever its channel; over an old image nothing is filled beside the charts.
expect 0 apply 'm.<UDIM>.exr' --source-texture 'gloss=new.<UDIM>.png' -o 'g.<UDIM>.png'
expect 0 compare g.1001.png a.1001.png
out_has 'infinite (equal)'
expect 0 apply 'm.<UDIM>.exr' --source-texture 'baseColor=new.<UDIM>.png' -o 'over.<UDIM>.png' --onto 'g.<UDIM>.png'
err_has 'nothing is filled around the charts'

# A map is an input: nothing is written over it.
expect 2 apply 'm.<UDIM>.exr' --source-texture 'baseColor=new.<UDIM>.png' -o 'm.<UDIM>.exr' --depth float
err_has 'm.1001.exr: is also an input'
# What is no map, or another one.
cp new.1001.png none.exr
expect 3 apply none.exr --source-texture baseColor=new.1001.png -o o.png
err_has 'none.exr: is not a hit map'
expect 0 transfer ../p.obj ../p.obj --source-texture baseColor=new.1001.png -o other.png --size 32 --map m.1003.exr
expect 3 apply 'm.<UDIM>.exr' --source-texture 'baseColor=new.<UDIM>.png' -o 'o.<UDIM>.png'
err_has 'm.1003.exr: is of another job than m.1001.exr'
head -c $(($(stat -c %s m.1003.exr) * 2 / 3)) m.1003.exr >cut.exr
expect 3 apply cut.exr --source-texture baseColor=new.1001.png -o o.png
[[ ! -e o.png ]] || fail 'half an image'
expect 3 apply m.1003.exr --source-texture occlusion=new.1001.png --channels baseColor -o o.png
err_has 'no material has a baseColor texture'
# Nothing was hit: said without the words of a search.
expect 0 transfer ../p.obj ../p.obj --source-texture baseColor=new.1001.png -o far.png --size 16 --map far.exr \
  --source-axes x,-y,-z --max-distance 1e-6
expect 0 apply far.exr --source-texture baseColor=new.1001.png -o o.png
err_has 'no texel of the map shows an image'
! grep -q 'max-distance\|inf' "$err" || fail 'words of a search'
rm o.png
# A map of a source without a texture knows no places.
expect 0 transfer ../p.obj ../p.obj --bake height --size 16 -o h.exr --map bare.exr
expect 3 apply bare.exr --source-texture baseColor=new.1001.png -o o.png
err_has 'has no place in the map'
