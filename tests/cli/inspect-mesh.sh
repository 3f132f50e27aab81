# SPDX-License-Identifier: Apache-2.0
# inspect says what a mesh holds, and which of its images are missing, without failing for them.
source "$(dirname "$0")/support.sh"
make_job
expect 0 inspect source.obj
silent "$err"
for text in 'triangles  2' 'vertices   4' '0 0 0  to  1 1 0' 'u 0 to 1' '"skin", 2 triangles' 'skin.ppm' \
  '16 x 16, 3 channels, u8' 'wrap repeat'; do
  out_has "$text"
done
expect 0 inspect source.obj --json
for text in '"type": "mesh"' '"triangles": 2' '"channel": "baseColor"' '"width": 16' '"uv_set": 0'; do
  out_has "$text"
done
rm skin.ppm
expect 0 inspect source.obj
out_has 'problem:'
quad_without_uvs bare
expect 0 inspect bare.obj
out_has 'uv sets    none'
"$POUNCE_FIXTURE" one-texel -o one >"$out"
expect 0 inspect one/one_texel_src.glb
out_has '1 x 1, 3 channels, u8, srgb, png'

# A normal map's scale counts; data has no colour space, whatever its image says.
image flat.ppm 4 4 128 128 255
quad bumpy skin.ppm
image skin.ppm 16 16 200 100 50
printf 'map_Ke skin.ppm\nnorm -bm 0.5 flat.ppm\n' >>bumpy.mtl
expect 0 inspect bumpy.obj
out_has 'normal_scale 0.5'
out_has '4 x 4, 3 channels, u8, pnm'
[[ $(grep -c 'u8, srgb, pnm' "$out") == 2 ]] || fail 'the spaces of baseColor and emissive'
"$POUNCE_FIXTURE" channels -o channels >"$out"
expect 0 inspect channels/channels_src.glb
! grep -q 'normal_scale' "$out" || fail 'a scale of 1'
for map in metallicRoughness occlusion; do
  grep -A1 "$map:" "$out" | tail -1 | grep -qE 'u8, (png|jpeg)' || fail "the space of $map"
done
grep -A1 'baseColor:' "$out" | tail -1 | grep -q 'srgb' || fail 'the space of baseColor'
