# SPDX-License-Identifier: Apache-2.0
# gaussians writes a textured mesh or a splat scene as PLY, SPZ or glTF, whole or not at all.
source "$(dirname "$0")/support.sh"
refused 'SOURCE' gaussians
refused '--output' gaussians source.obj
refused 'written as .ply, .spz or .glb' gaussians source.obj -o scene.splat
refused '--count' gaussians source.obj -o scene.ply --count 0
refused '--sigma' gaussians source.obj -o scene.ply --sigma 9
refused '--sharpen' gaussians source.obj -o scene.ply --sharpen -1
refused 'expected baseColor=PATH' gaussians source.obj -o scene.ply --source-texture occlusion=a.png
make_job
expect 0 gaussians source.obj -o scene.ply --progress none
silent "$out"
err_has '256 Gaussians'
only_files scene.ply skin.ppm source.mtl source.obj target.obj
head -c 100 scene.ply | grep -qa 'element vertex 256' || fail 'the header does not count 256 rows'
# 256 rows of 68 bytes after the header.
bytes=$(wc -c <scene.ply)
header=$(grep -ab -m1 end_header scene.ply | cut -d: -f1)
((bytes == header + 11 + 256 * 68)) || fail "the file has $bytes bytes"
# The image is not read a second time, and the bytes are the same.
expect 0 gaussians source.obj -o again.ply --report - -q --threads 1 --memory 64MiB
out_has '"images_decoded": 0'
out_has '"gaussians": 256'
cmp scene.ply again.ply || fail 'another number of threads, other bytes'
# A source without a texture, and a texture from the command line.
expect 3 gaussians target.obj -o none.ply
err_has 'no material has a baseColor texture'
expect 0 gaussians target.obj -o given.ply --source-texture baseColor=skin.ppm -q
cmp scene.ply given.ply || fail 'the same texture from the command line gives other bytes'
# A mesh and a scene in every format, and each of them is a source again.
for format in ply spz glb; do
  expect 0 gaussians source.obj -o mesh.$format -q
  expect 0 inspect mesh.$format
  out_has 'gaussians  256, 256 usable'
  expect 0 transfer mesh.$format target.obj -o from.png -q
  expect 0 gaussians scene.ply -o some.$format --count 100 --progress none
  err_has '100 Gaussians'
  expect 0 inspect some.$format
  out_has 'gaussians  100, 100 usable'
done
expect 0 gaussians scene.ply -o turned.glb --progress none
err_has 'is assumed to have the axes of trained scenes (right, down, forward)'
err_has '--source-axes x,y,z'
# How a glTF lies is said wherever it is read, unless the user says it.
expect 0 inspect turned.glb
out_has "note       its axes are assumed to be glTF's (left, up, forward); --source-axes=-x,-y,z"
expect 0 transfer turned.glb target.obj -o from.png --progress none
err_has "its axes are assumed to be glTF's"
expect 0 transfer turned.glb target.obj -o from.png --progress none --source-axes=-x,-y,z
! grep -qF "glTF's" "$err" || fail 'what the user said is assumed'
# What is about the other kind of source.
for option in '--min-opacity 0.5' '--count 5'; do
  expect 2 gaussians source.obj -o o.ply $option
  err_has 'applies only to splat scenes; source.obj is a mesh'
done
expect 2 gaussians scene.ply -o o.ply --sharpen 1
err_has '--sharpen applies only to meshes; scene.ply is a splat scene'
# Nothing is left, or the source is damaged: what was there stays.
cp some.spz before.spz
expect 3 gaussians scene.ply -o some.spz --box 50,50,50,60,60,60
err_has 'all of its 256 Gaussians are left out (256 outside of --box)'
head -c 3000 scene.ply >cut.ply
expect 3 gaussians cut.ply -o some.spz
cmp some.spz before.spz || fail 'a job that failed changed its output'
rm -f mesh.* some.* before.spz turned.glb from.png cut.ply
# What a transfer leaves out of a scene is left out here, and the summary says so: SPZ could not hold what is far away.
"$POUNCE_FIXTURE" splats -o broken.ply --count 5000 --broken 2 >/dev/null
expect 0 gaussians broken.ply -o clean.spz --progress none
err_has '4,990 Gaussians'
err_has '10 Gaussians left out: '
for words in '2 far from the rest of the scene' '2 not finite' '2 transparent'; do err_has "$words"; done
expect 0 inspect clean.spz
out_has 'gaussians  4990, 4990 usable'
expect 0 gaussians broken.ply -o clean.spz --progress none --count 90 --report r.json
err_has '4,910 Gaussians left out: 4,900 beyond --count, '
grep -q '"far": 2' r.json || fail 'the report does not count what is far away'
rm broken* clean.spz r.json
# More than 4 GiB of glTF is refused before anything is read. The file is a hole.
{
  printf 'ply\nformat binary_little_endian 1.0\nelement vertex 80000000\n'
  for name in x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3; do
    printf 'property float %s\n' $name
  done
  printf 'end_header\n'
} >huge.ply
truncate -s $(($(wc -c <huge.ply) + 80000000 * 56)) huge.ply
expect 3 gaussians huge.ply -o huge.glb
err_has 'a .glb is limited to 4 GiB, which is 76695551 Gaussians of this kind; write a .ply or .spz'
expect 3 gaussians huge.ply -o huge.glb --count 79000000
err_has 'fewer with --count'
rm huge.ply
# A file that holds nothing is no mesh that an option does not fit.
: >empty.glb
expect 3 gaussians empty.glb -o some.ply --count 5
err_has 'empty.glb: the file is empty'
rm empty.glb
# A limit on file sizes is a full disk: nothing is left.
(ulimit -f 8 && expect 5 gaussians source.obj -o limited.ply --no-cache) || exit 1
[[ ! -e limited.ply ]] || fail 'a part of the file was left'
expect 5 gaussians source.obj -o source.obj/scene.ply
err_has 'source.obj is not a folder'
# The least memory that is named works, also when even the mesh does not fit.
"$POUNCE_FIXTURE" head -o head --triangles 20000 --texture 256 >/dev/null
expect 4 gaussians head/head_src.glb -o head.ply --memory 1MiB --no-cache
least=$(grep -o -- '--memory [0-9]*MiB$' "$err" | cut -d' ' -f2)
expect 0 gaussians head/head_src.glb -o head.ply --memory "$least" --no-cache -q
