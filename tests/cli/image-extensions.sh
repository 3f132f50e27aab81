# SPDX-License-Identifier: Apache-2.0
# Images in formats that pounce does not read stop neither a target, whose geometry alone is needed, nor a source whose
# channel does not use them. A model output carries them over as they are.
source "$(dirname "$0")/support.sh"
make_job
image plain.ppm 4 4 9 8 7
printf '\253KTX 20\273\r\n\032\npixels' >glow.ktx2
# gltf NAME TEXTURES: a textured triangle; texture 1 is a KTX2 image, texture 0 as given.
gltf() {
  cat >"$1.gltf" <<END
{"asset":{"version":"2.0"},"nodes":[{"mesh":0}],"meshes":[{"primitives":[{"material":0,"attributes":{"POSITION":0,"TEXCOORD_0":1}}]}],
"accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"},{"bufferView":1,"componentType":5126,"count":3,"type":"VEC2"}],
"bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":24}],
"buffers":[{"byteLength":60,"uri":"data:;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAACAPwAAgD8AAAAAAAAAAAAAAAAAAIA/AAAAAAAAgD8AAIA/"}],
"images":[{"uri":"plain.ppm"},{"uri":"glow.ktx2","mimeType":"image/ktx2"}],
"textures":[$2,{"extensions":{"KHR_texture_basisu":{"source":1}}}],
"extensionsUsed":["KHR_texture_basisu"],"extensionsRequired":["KHR_texture_basisu"],
"materials":[{"name":"skin","pbrMetallicRoughness":{"baseColorTexture":{"index":0}},"emissiveTexture":{"index":1},"emissiveFactor":[1,1,1]}]}
END
}
gltf half '{"source":0}'
gltf whole '{"extensions":{"KHR_texture_basisu":{"source":1}}}'

# As a target: an image, and a model that still has what it had.
for target in half whole; do
  expect 0 transfer source.obj $target.gltf -o $target.png -q
  expect 0 transfer source.obj $target.gltf -o out.glb -q
  grep -qaF "$(printf 'KTX 20\273')" out.glb || fail 'the KTX2 image is gone'
  grep -qaF '"mimeType":"image/ktx2"' out.glb || fail 'the KTX2 image has lost its type'
  grep -qaF '"extensionsRequired":["KHR_texture_basisu"]' out.glb || fail 'its extension is not required any more'
  expect 0 transfer source.obj $target.gltf -o out.gltf -q
  cmp out.image1.ktx2 glow.ktx2 || fail 'the KTX2 image has changed'
  expect 0 transfer out.glb target.obj -o back.png --size 16 --coverage found.png -q
  expect 0 compare back.png skin.ppm --mask found.png --min-psnr 40
  rm -- out*
done
# As a source: the channel that is needed decides.
expect 0 transfer half.gltf target.obj -o o.png
expect 3 transfer whole.gltf target.obj -o o.png
err_has 'uses the extension KHR_texture_basisu, which pounce does not support'
expect 0 transfer half.gltf target.obj -o 'o.<CHANNEL>.png'
err_has 'emissive is left out'
expect 0 inspect whole.gltf
out_has 'problem: '
# What is replaced goes, and the extension with it: a viewer shall not ask for what nothing needs.
sed 's/"emissiveTexture":{"index":1},//; s/,{"extensions":{"KHR_texture_basisu":{"source":1}}}\],/],/' whole.gltf >single.gltf
expect 0 transfer source.obj single.gltf -o out.glb -q
! grep -qa 'KHR_texture_basisu\|KTX 20' out.glb || fail 'the replaced image or its extension is still there'
