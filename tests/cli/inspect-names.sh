# SPDX-License-Identifier: Apache-2.0
# inspect lists what a mesh can be selected by, its UDIM tiles, and every texture; transfer says in one line what it
# does not transfer, and in one what factors it applies.
source "$(dirname "$0")/support.sh"
check_json() { ! command -v python3 >/dev/null || python3 - "$out"; } # a script on the standard input
image skin.ppm 4 4 200 100 50
cat >model.mtl <<'END'
newmtl skin
Kd 0.5 1 1
map_Kd skin.ppm
map_Bump -bm 0.5 bumps.png
norm skin.ppm
newmtl eyes
map_Kd skin.ppm
map_Ks shine.png
map_Bump skin.ppm
END
cat >model.obj <<'END'
mtllib model.mtl
v 0 0 0
v 1 0 0
v 1 1 0
vt 0.1 0.1
vt 0.9 0.1
vt 0.9 0.9
vt 1.1 0.1
vt 1.9 0.1
vt 1.9 0.9
vt 2.1 1.1
vt 2.9 1.1
vt 2.9 1.9
o head
usemtl skin
f 1/1 2/2 3/3
f 1/4 2/5 3/6
o ball
usemtl eyes
f 1/7 2/8 3/9
END
expect 0 inspect model.obj
for text in 'part       "head", 2 triangles' 'part       "ball", 1 triangles' 'UDIM 1001, 1002, 1013' '"skin", 2 triangles' \
  'map_Bump (not transferred):' 'map_Ks (not transferred):' 'normal:' 'bumps.png' 'shine.png' \
  'problem: ' '4 x 4, 3 channels'; do
  out_has "$text"
done
expect 0 inspect model.obj --json
check_json <<'END' || fail 'the JSON lacks something'
import json, sys
mesh = json.load(open(sys.argv[1]))
assert mesh["parts"] == [{"names": ["head"], "triangles": 2}, {"names": ["ball"], "triangles": 1}], mesh["parts"]
assert mesh["uv_sets"][0]["udims"] == [1001, 1002, 1013]
skin, eyes = mesh["materials"]
assert [t["channel"] for t in skin["textures"]] == ["baseColor", "normal"]
assert [t["slot"] for t in skin["other_textures"]] == ["map_Bump"]
assert skin["textures"][1]["width"] == 4 and "problem" in skin["other_textures"][0]
assert [t["slot"] for t in eyes["other_textures"]] == ["map_Ks", "map_Bump"]
END

quad target
expect 0 transfer model.obj target.obj -o o.png --size 8
err_has 'note: model.obj: not transferred: map_Bump (bumps.png, skin.ppm), map_Ks (shine.png), normal (skin.ppm)'
err_has 'model.obj: material factors multiplied into the images (--factors ignore disables this): baseColor (1 material)'
[[ $(grep -cE 'material factors|not transferred' "$err") == 2 ]] || fail 'more than a line per kind'
# What is not selected is not missed.
expect 0 transfer model.obj target.obj -o o.png --size 8 --source-material eyes
err_has 'not transferred: map_Bump (skin.ppm), map_Ks (shine.png)'
! grep -q 'normal' "$err" || fail 'a texture of a material that takes no part'
! grep -q 'material factors' "$err" || fail 'a factor of a material that takes no part'
# glTF: a normal map, a texture of an extension, vertex colours; a model output keeps factors.
cat >m.gltf <<'END'
{"asset":{"version":"2.0"},"nodes":[{"mesh":0,"name":"body"}],"meshes":[{"name":"shape","primitives":[{"material":0,
"attributes":{"POSITION":0,"TEXCOORD_0":1,"COLOR_0":0}}]}],
"accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"},{"bufferView":1,"componentType":5126,"count":3,"type":"VEC2"}],
"bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":24}],
"buffers":[{"byteLength":60,"uri":"data:;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAACAPwAAgD8AAAAAAAAAAAAAAAAAAIA/AAAAAAAAgD8AAIA/"}],
"images":[{"uri":"skin.ppm"}],"textures":[{"source":0}],"extensionsUsed":["KHR_materials_clearcoat"],
"materials":[{"name":"paint","pbrMetallicRoughness":{"baseColorFactor":[1,1,0.5,1],"baseColorTexture":{"index":0},
"metallicRoughnessTexture":{"index":0}},"normalTexture":{"index":0},"extensions":{"KHR_materials_clearcoat":{"clearcoatFactor":1,"clearcoatTexture":{"index":0}}}}]}
END
expect 0 inspect m.gltf
for text in 'part       "body", "shape", 1 triangles' 'normal:' 'colours    per vertex' \
  'KHR_materials_clearcoat.clearcoatTexture (not transferred):'; do
  out_has "$text"
done
expect 0 transfer m.gltf target.obj -o o.png --size 8
coat='KHR_materials_clearcoat.clearcoatTexture (skin.ppm)'
err_has "m.gltf: not transferred: $coat, metallicRoughness (skin.ppm), normal (skin.ppm)"
! grep -q 'not transferred.*vertex colours' "$err" || fail 'colours of vertices that are transferred are missed'
err_has 'm.gltf: its vertex colours are multiplied into baseColor'
err_has 'm.gltf: material factors multiplied'
# A channel is missed where nobody chose, whatever the output.
expect 0 transfer m.gltf target.obj -o o.png --size 8 --channels baseColor --report r.json
err_has "not transferred: $coat"
[[ $(tr -d '\n ' <r.json) == *'"notes":["m.gltf:nottransferred:'* ]] || fail 'no note in the report'
expect 0 transfer m.gltf target.obj -o o.png --size 8 --channels baseColor --factors ignore
err_has "not transferred: $coat, vertex colours"
expect 0 transfer m.gltf target.obj -o o.png --size 8 --plan
err_has 'not transferred: '
expect 0 transfer m.gltf m.gltf -o o.glb --size 8
err_has "not transferred: $coat"
err_has 'm.gltf: its vertex colours stay in the model'
! grep -q 'material factors' "$err" || fail 'a model holds factors'

# A hundred materials, and names without end, are one line of a few hundred letters.
for m in $(seq 100); do
  printf 'newmtl m%s\nmap_Kd skin.ppm\nmap_Bump %0200d.png\n' "$m" "$m" >&3
  printf 'usemtl m%s\nf 1/1 2/2 3/3\n' "$m"
done >faces 3>many.mtl
{ echo 'mtllib many.mtl'; grep '^v' model.obj; cat faces; } >many.obj
expect 0 transfer many.obj target.obj -o o.png --size 8
err_has '... and 97 more)'
(($(grep 'not transferred' "$err" | wc -c) < 400)) || fail 'a line too long'
