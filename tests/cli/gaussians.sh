# SPDX-License-Identifier: Apache-2.0
# gaussians writes a textured mesh as a 3DGS PLY, whole or not at all.
source "$(dirname "$0")/support.sh"
refused 'SOURCE' gaussians
refused '--output' gaussians source.obj
refused 'name it so' gaussians source.obj -o scene.spz
refused 'has them already' gaussians scene.ply -o other.ply
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
