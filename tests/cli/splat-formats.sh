# SPDX-License-Identifier: Apache-2.0
# A splat scene that pounce does not read is recognised by its content, named, and the cure is said: by inspect, as a
# source and as a target. So is a scene that is read, where a mesh is wanted.
source "$(dirname "$0")/support.sh"
make_job
printf 'NGSP\4\0\0\0\0\0\0\0' >four.bin
printf '\037\213\10\0\0\0\0\0' >three.spz
head -c 64 /dev/zero >points.splat
head -c 64 /dev/zero >points.ksplat
mkdir sog sog1
echo '{"version":2,"means":{},"scales":{},"quats":{},"sh0":{}}' >sog/meta.json
echo '{"means":{},"scales":{},"quats":{},"sh0":{}}' >sog1/meta.json
printf 'PK\3\4.....means_l.webp.....quats.webp.....meta.json' >bundle
cat >splats.gltf <<'END'
{"asset":{"version":"2.0"},"nodes":[{"mesh":0}],"meshes":[{"primitives":[{"mode":0,"attributes":{"POSITION":0},
"extensions":{"KHR_gaussian_splatting":{"kernel":"ellipse","colorSpace":"srgb_rec709_display"}}}]}],
"accessors":[{"componentType":5126,"count":1,"type":"VEC3"}],
"extensionsUsed":["KHR_gaussian_splatting"],"extensionsRequired":["KHR_gaussian_splatting"]}
END

# named FILE NAME: what inspect and transfer call it.
named() {
  local file=$1 name=$2
  for command in "inspect $file" "transfer $file target.obj -o o.png" "transfer source.obj $file -o o.png" \
    "transfer target.obj $file -o o.png"; do
    expect 3 $command
    silent "$out"
    err_has "$file: a Gaussian splat scene in $name"
  done
}
named four.bin 'SPZ v4'
named three.spz 'SPZ v1 to v3'
named points.splat '.splat'
named points.ksplat '.ksplat'
named sog 'SOG v2 (a folder)'
named sog1/ 'SOG v1 (a folder)'
named sog/meta.json 'SOG v2 (its meta.json)'
named bundle 'SOG (bundled)'
named splats.gltf 'glTF (KHR_gaussian_splatting)'
expect 3 inspect four.bin
err_has 'convert it, for example with splat-transform four.bin four.ply'
expect 3 inspect sog1/
err_has 'splat-transform sog1/ sog1.ply'

# A PLY is read whatever its name, and is no target.
"$POUNCE_FIXTURE" splats -o scene.ply --count 500 >"$out"
cp scene.ply scene.bin
expect 0 transfer scene.bin target.obj -o o.png -q
for name in scene.ply scene.bin; do
  expect 3 transfer target.obj $name -o o.png
  err_has "$name: a Gaussian splat scene in 3DGS PLY, where a mesh is wanted"
  err_has 'a scene comes first'
done
expect 3 maps scene.ply -o '<CHANNEL>.exr'
err_has 'where a mesh is wanted'
# What only has the ending of one is refused as before.
mkdir empty
expect 3 inspect empty
err_has 'empty: is a folder'
