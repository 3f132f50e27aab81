# SPDX-License-Identifier: Apache-2.0
# A splat scene is recognised by its content, read as a source by inspect and transfer, and refused by name as a target. One that
# pounce does not read is named, and the cure is said.
source "$(dirname "$0")/support.sh"
make_job
# A Gaussian of sigma 0.1 at the origin: opaque, grey, not turned.
printf '\0\0\0\0\0\0\0\0\0\0\0\0\315\314\314\75\315\314\314\75\315\314\314\75\200\200\200\377\377\200\200\200' >points.splat
# The same in SPZ 2, not in gzip: header; mean, opacity, colour, sigma, rotation.
{
  printf 'NGSP\2\0\0\0\1\0\0\0\0\14\0\0'
  printf '\0\0\0\0\0\0\0\0\0\377\200\200\200\173\173\173\200\200\200'
} >two.bin
gzip -c two.bin >two.gz
mkdir sog streamed
echo '{"version":2,"means":{},"scales":{},"quats":{},"sh0":{}}' >sog/meta.json
echo '{"lodLevels":2,"tree":{}}' >streamed/lod-meta.json
echo '{}' >room.lcc
cat >splats.gltf <<'END'
{"asset":{"version":"2.0"},"nodes":[{"mesh":0}],"meshes":[{"primitives":[{"mode":0,"attributes":{"POSITION":0},
"extensions":{"KHR_gaussian_splatting":{"kernel":"ellipse","colorSpace":"srgb_rec709_display"}}}]}],
"accessors":[{"componentType":5126,"count":1,"type":"VEC3"}],
"extensionsUsed":["KHR_gaussian_splatting"],"extensionsRequired":["KHR_gaussian_splatting"]}
END

# read FILE FORMAT: what inspect calls it; it is a source.
read_as() {
  expect 0 inspect "$1"
  silent "$err"
  out_has "format     $2" 'gaussians  1, 1 usable'
  expect 0 transfer "$1" target.obj -o o.png -q --max-distance 10
}
read_as points.splat '.splat'
read_as two.bin 'SPZ v2'
read_as two.gz 'SPZ v2'
expect 0 inspect two.gz
out_has 'note       SPZ does not define its axes'

# no_target FILE FORMAT: but a mesh, it is named.
no_target() {
  for command in "transfer source.obj $1 -o o.png" "maps $1 -o <CHANNEL>.exr"; do
    expect 3 $command
    silent "$out"
    err_has "$1: a Gaussian splat scene in $2" 'but a mesh' 'a scene comes first'
  done
}
no_target points.splat '.splat'
no_target two.bin 'SPZ v2'
no_target two.gz 'SPZ v1 to v3'
no_target sog 'SOG v2 (a folder)'
no_target sog/meta.json 'SOG v2 (its meta.json)'
no_target splats.gltf 'glTF (KHR_gaussian_splatting)'

# What is damaged is told by its place.
expect 3 inspect sog
err_has 'sog: the SOG' 'has no codebook of 256 numbers in "scales"'
expect 3 transfer splats.gltf target.obj -o o.png
err_has 'splats.gltf: mesh 0 primitive 0 POSITION' 'has no buffer view or is sparse'
head -c 34 two.bin >short.spz
expect 3 inspect short.spz
err_has 'short.spz: the header states 1 Gaussians'

# What is not read is named, with the cure.
for scene in 'streamed streamed SOG (levels of detail)' 'room.lcc LCC'; do
  file=${scene%% *}
  for command in "inspect $file" "transfer $file target.obj -o o.png"; do
    expect 3 $command
    silent "$out"
    err_has "$file: a Gaussian splat scene in ${scene#* }" "for example with splat-transform $file ${file%.*}.ply"
  done
done

# A PLY is read whatever its name, and is no target.
"$POUNCE_FIXTURE" splats -o scene.ply --count 500 >"$out"
cp scene.ply scene.bin
expect 0 transfer scene.bin target.obj -o o.png -q
for name in scene.ply scene.bin; do
  expect 3 transfer target.obj $name -o o.png
  err_has "$name: a Gaussian splat scene in 3DGS PLY, but a mesh"
  err_has 'a scene comes first'
done
expect 3 maps scene.ply -o '<CHANNEL>.exr'
err_has 'but a mesh'
# What only has the ending of one is refused as before.
mkdir empty
expect 5 inspect empty
err_has 'empty: is a folder'
