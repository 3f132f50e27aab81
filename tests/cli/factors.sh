# SPDX-License-Identifier: Apache-2.0
# Images show what materials make of their textures: --factors apply|ignore. Figures by hand: sRGB 200, 100, 50 are 0.5776,
# 0.1274, 0.0319 in linear light, half of them 146.3, 71.4, 33.9.
source "$(dirname "$0")/support.sh"
refused '--factors: got "keep"' transfer a.glb b.glb -o o.png --factors keep
refused '--factors applies only to images' transfer a.glb b.glb -o o.glb --factors ignore
# same FILE R G B: every texel of it is that; a difference of one step in a channel would show.
same() {
  image wanted.ppm 16 16 "${@:2}"
  expect 0 compare "$1" wanted.ppm
  grep -qiE 'infinite' "$out" || fail "$1 is not ${*:2}"
}

make_job
run() { expect 0 transfer source.obj target.obj -o "$@" --size 16; }
run plain.png
! grep -q 'factors' "$err" || fail 'a note of no factor'
same plain.png 200 100 50
printf 'newmtl skin\nKd 0.5 0.5 0.5\nmap_Kd skin.ppm\n' >source.mtl
run half.png --report r.json
err_has 'note: source.obj: material factors multiplied into the images (--factors ignore disables this): baseColor (1 material)'
same half.png 146 71 34
grep -q 'material factors multiplied' r.json || fail 'no note in the report'
run ignored.png --factors ignore --report r.json
err_has 'material factors not multiplied into the images: baseColor (1 material)'
same ignored.png 200 100 50
grep -q '"factors": "ignore"' r.json || fail 'no option in the report'
run none.png --plan
err_has 'material factors multiplied into the images'
run gaussian.png --method gaussian
same gaussian.png 146 71 34
run gaussian.png --method gaussian --factors ignore # another store
same gaussian.png 200 100 50
# A channel whose factor is 1 keeps its bytes; black and invisible textures are not meant.
printf 'newmtl skin\nKd 0.5 1 1\nmap_Kd skin.ppm\n' >source.mtl
run red.png
same red.png 146 100 50
printf 'newmtl skin\nKd 0 0 0\nd 0\nmap_Kd skin.ppm\n' >source.mtl
run black.png
same black.png 200 100 50
# An opacity makes an alpha where the format has one.
printf 'newmtl skin\nd 0.5\nmap_Kd skin.ppm\n' >source.mtl
run alpha.png
! grep -q 'opacity' "$err" || fail 'an opacity that PNG has room for'
expect 0 inspect alpha.png
out_has 'with alpha'
run alpha.exr
expect 0 inspect alpha.exr
out_has 'with alpha'
run alpha.jpg
err_has "baseColor: the materials' opacity is left out: alpha.jpg: JPEG does not support alpha"
expect 0 inspect source.obj
out_has 'baseColor 1 1 1 0.5'

# glTF: roughness 0.5 (green), metallic 0.2 (blue), occlusion strength 0.4 (red: 1 + s (v - 1)), emissive.
cat >m.gltf <<'JSON'
{"asset":{"version":"2.0"},"nodes":[{"mesh":0}],"meshes":[{"primitives":[{"material":0,
"attributes":{"POSITION":0,"TEXCOORD_0":1}}]}],
"accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"},{"bufferView":1,"componentType":5126,"count":3,"type":"VEC2"}],
"bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":24}],
"buffers":[{"byteLength":60,"uri":"data:;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAACAPwAAgD8AAAAAAAAAAAAAAAAAAIA/AAAAAAAAgD8AAIA/"}],
"images":[{"uri":"skin.ppm"}],"textures":[{"source":0}],"extensionsUsed":["KHR_materials_emissive_strength"],
"materials":[{"pbrMetallicRoughness":{"baseColorTexture":{"index":0},"roughnessFactor":0.5,"metallicFactor":0.2,
"metallicRoughnessTexture":{"index":0}},"occlusionTexture":{"index":0,"strength":0.4},"emissiveTexture":{"index":0},
"emissiveFactor":[0.25,0.5,1],"extensions":{"KHR_materials_emissive_strength":{"emissiveStrength":2}}}]}
JSON
expect 0 transfer m.gltf m.gltf -o '<CHANNEL>.png' --size 16 --padding 16
err_has 'emissive (1 material), metallicRoughness (1), occlusion (1)'
same baseColor.png 200 100 50
same metallicRoughness.png 200 50 10
same occlusion.png 233 100 50 # 255 + 0.4 (200 - 255)
same emissive.png 146 100 71         # 0.5, 1 and 2 times
sed -i 's/"emissiveStrength":2/"emissiveStrength":20/' m.gltf
expect 0 transfer m.gltf m.gltf -o '<CHANNEL>.png' --size 16 --channels emissive --report r.json
! grep -q '"clipped": 0,' r.json || fail 'clipping was not counted'
expect 0 inspect m.gltf
out_has 'roughness 0.5, metallic 0.2, occlusion_strength 0.4, emissive 0.25 0.5 1, emissive_strength 20'
expect 0 transfer m.gltf m.gltf -o o.glb --size 8
! grep -q 'material factors' "$err" || fail 'a model has factors in its material'

# The model's material has the factors, its images are as they were; a transfer from it shows both.
expect 0 transfer m.gltf m.gltf -o model.glb --size 16 --padding 16
of_model() { expect 0 transfer model.glb m.gltf -o "$1" --size 16 --padding 16 "${@:2}"; }
of_model 'own.<CHANNEL>.png' --factors ignore
for channel in baseColor metallicRoughness occlusion emissive; do same own.$channel.png 200 100 50; done
of_model 'shown.<CHANNEL>.png'
same shown.baseColor.png 200 100 50
same shown.metallicRoughness.png 200 50 10
same shown.occlusion.png 233 100 50
# Factors that a single material cannot have are multiplied into the images: of halves, and of one that is no texture.
halves() { # RIGHT: the right half's material
  printf 'newmtl left\nKd 0.5 0.5 0.5\nmap_Kd skin.ppm\nnewmtl right\n%s\n' "$1" >halves.mtl
  expect 0 transfer halves.obj m.gltf -o halves.png --size 16 --padding 16
  expect 0 transfer halves.obj m.gltf -o model.glb --size 16 --padding 16
}
printf 'mtllib halves.mtl\nv 0 0 0\nv .5 0 0\nv .5 1 0\nv 0 1 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n' >halves.obj
printf 'usemtl left\nf 1/1 2/2 3/3 4/4\nusemtl right\nf 2/1 5/2 6/3 3/4\n' >>halves.obj
for right in 'Kd 1 1 1\nmap_Kd skin.ppm' 'Kd 1 0 0'; do
  halves "$(printf '%b' "$right")"
  err_has 'note: halves.obj: its materials have different baseColor factors'
  of_model back.png --factors ignore
  same_picture back.png halves.png || fail 'the images of a model lack what its material cannot say'
  of_model back.png
  same_picture back.png halves.png || fail 'a factor counts twice'
done
halves "$(printf 'Kd 0.5 0.5 0.5\nmap_Kd skin.ppm')"
of_model back.png --factors ignore
same back.png 200 100 50
of_model back.png
same back.png 146 71 34

# Which of materials' factors and vertices' colours: half the material, and vertices of half the light (188 in sRGB).
quad source skin.ppm
sed -i 's/^v .*/& 0.7354 0.7354 0.7354/' source.obj
printf 'newmtl skin\nKd 0.5 0.5 0.5\nmap_Kd skin.ppm\n' >source.mtl
for how in apply/both vertices/half factors/half textures/plain ignore/plain; do
  run which.png --factors "${how%/*}"
  case $how in
    */both) same which.png 106 50 22 ;;
    */half) same which.png 146 71 34 ;;
    *) same which.png 200 100 50 ;;
  esac
done
expect 0 transfer source.obj m.gltf -o model.glb --size 16
expect 0 transfer source.obj m.gltf -o bare.glb --size 16 --factors factors
of_model back.png --factors textures
same back.png 146 71 34
expect 0 transfer bare.glb m.gltf -o back.png --size 16 --padding 16 --factors textures
same back.png 200 100 50
expect 2 transfer source.obj m.gltf -o model.glb --factors vertices
err_has '--factors factors'
# Black everywhere says nothing (Open3D writes it).
sed -i 's/0.7354 0.7354 0.7354/0 0 0/' source.obj
run black.png --report r.json
err_has 'note: source.obj: its vertex colours are ignored because all are black'
same black.png 146 71 34
grep -q 'because all are black' r.json || fail 'no note in the report'
expect 3 transfer source.obj target.obj -o o.exr --size 16 --bake vertexColor
err_has 'all black'
expect 0 gaussians source.obj -o o.ply
err_has 'because all are black'
sed -i '0,/0 0 0$/s/0 0 0$/0 0 0.5/' source.obj # one that is not counts
run dark.png
! grep -q 'because all are black' "$err" || fail 'a vertex has a colour'
