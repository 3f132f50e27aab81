# SPDX-License-Identifier: Apache-2.0
# --alpha: of splat scenes, into what holds alpha; nothing else of the picture changes.
source "$(dirname "$0")/support.sh"
make_job
expect 2 transfer source.obj target.obj -o o.png --alpha
err_has '--alpha applies only to splat scenes; source.obj is a mesh'
"$POUNCE_FIXTURE" splats -o scene.ply --count 20000 --target-size 128 >/dev/null
job=(transfer scene.ply scene_target.glb --size 128 --no-cache)
expect 2 "${job[@]}" -o o.jpg --alpha
err_has 'JPEG does not support alpha; choose .png, .tif or .exr'
expect 0 "${job[@]}" -o plain.png --coverage mask.png
expect 2 "${job[@]}" -o o.png --onto plain.png --alpha
err_has '--alpha: plain.png has no alpha channel'
[[ ! -e o.png && ! -e o.jpg ]] || fail 'an image was made'
expect 0 "${job[@]}" -o alpha.png --alpha --report r.json
tr -d ' \n' <r.json | grep -qF '"alpha":"true"' || fail 'the report does not tell of it'
expect 0 inspect plain.png
out_has '3 channels'
expect 0 inspect alpha.png
out_has '4 channels'

# In a model the material shows it, which viewers else would not.
mode() { grep -ao '"alphaMode":"[A-Z]*"' "$1" || echo none; }
modes() { [[ $(mode "$1") == "$2" ]] || fail "$1: alphaMode is $(mode "$1"), not $2"; }
expect 0 "${job[@]}" -o opaque.glb
modes opaque.glb none
expect 0 "${job[@]}" -o veiled.glb --alpha
modes veiled.glb '"alphaMode":"BLEND"'
# Of meshes: an image whose alpha is 1, 0 or 1, or between.
triangles() { # EXTRA: a square with a material that says so
  printf '{"asset":{"version":"2.0"},"nodes":[{"mesh":0}],"scenes":[{"nodes":[0]}],"scene":0,"meshes":[{"primitives":[{"material":0,
"attributes":{"POSITION":0,"TEXCOORD_0":1},"indices":2}]}],
"accessors":[{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"},{"bufferView":1,"componentType":5126,"count":4,"type":"VEC2"},
{"bufferView":2,"componentType":5121,"count":6,"type":"SCALAR"}],
"bufferViews":[{"buffer":0,"byteLength":48},{"buffer":0,"byteOffset":48,"byteLength":32},{"buffer":0,"byteOffset":80,"byteLength":6}],
"buffers":[{"byteLength":88,"uri":"square.bin"}],"images":[{"uri":"%s"}],"textures":[{"source":0}],
"materials":[{%s"pbrMetallicRoughness":{"baseColorTexture":{"index":0}}}]}' "$1" "${2-}"
}
one() { printf '\0\0\200\077'; }
nil() { printf '\0\0\0\0'; }
{
  nil; nil; nil; one; nil; nil; one; one; nil; nil; one; nil
  nil; one; one; one; one; nil; nil; nil
  printf '\0\1\2\0\2\3\0\0'
} >square.bin
# rgba NAME A B: a Targa of 2 x 1 texels with these alphas; pounce makes a PNG of it.
rgba() { { printf '\0\0\2\0\0\0\0\0\0\0\0\0\2\0\1\0\40\50' && samples 50 100 200 "$2" 50 100 200 "$3"; } >"$1"; }
rgba full.tga 255 255
rgba holes.tga 0 255
rgba veils.tga 128 255
for image in full holes veils; do triangles $image.tga '"alphaMode":"MASK",' >$image.gltf; done
triangles veils.tga >ignored.gltf
triangles veils.tga '"alphaMode":"BLEND",' >blends.gltf
triangles veils.tga >target.gltf
made() { expect 0 transfer "$1" "${3-target.gltf}" -o made.glb --size 2x1 --padding 0 --allow-format tga && modes made.glb "$2"; }
made full.gltf none
made holes.gltf '"alphaMode":"MASK"'
made veils.gltf '"alphaMode":"BLEND"'
made blends.gltf '"alphaMode":"BLEND"'
made ignored.gltf none # an opaque source's alpha means nothing
made holes.gltf '"alphaMode":"BLEND"' blends.gltf # what the target says already stays
made veils.gltf '"alphaMode":"MASK"' holes.gltf
expect 0 transfer ignored.gltf target.gltf -o made.glb --size 2x1 --padding 0 --allow-format tga --source-texture baseColor=holes.tga
modes made.glb '"alphaMode":"MASK"'
expect 0 transfer veils.gltf target.gltf -o made.glb --size 2x1 --padding 0 --allow-format tga --drop-alpha
modes made.glb none
# An OBJ's opacity is the material's.
quad glass
printf 'newmtl skin\nd 0.5\nmap_Kd skin.ppm\n' >source.mtl
expect 0 transfer source.obj target.gltf -o made.glb --size 16
modes made.glb '"alphaMode":"BLEND"'
