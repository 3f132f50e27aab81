# SPDX-License-Identifier: Apache-2.0
# What colours are: taken from files, from the user, converted as OpenColorIO does it, and not asked of glTF's images.
source "$(dirname "$0")/support.sh"
refused '--output-colorspace rec2020: unknown colour space; choose srgb, lin_rec709' \
  transfer a.glb b.glb -o o.png --output-colorspace rec2020
refused '--source-colorspace nope: unknown colour space' \
  transfer a.glb b.glb -o o.png --source-colorspace nope
refused 'occlusion is data and is never converted' \
  transfer a.glb b.glb -o o.png --source-colorspace occlusion=srgb
refused 'specified twice for baseColor' transfer a.glb b.glb -o o.png --source-colorspace baseColor=srgb \
  --source-colorspace baseColor=acescg
refused 'EXR is linear; choose lin_rec709' transfer a.glb b.glb -o o.exr --output-colorspace srgb
refused 'glTF textures are always srgb' transfer a.glb b.glb -o o.glb --output-colorspace acescg
refused 'an image that is painted over keeps its own' transfer a.glb b.glb -o o.png --onto old.png \
  --output-colorspace srgb

"$POUNCE_FIXTURE" plane -o s.obj --triangles 200 --texture 64 >/dev/null
"$POUNCE_FIXTURE" plane -o t.obj --triangles 200 >/dev/null
run() { expect 0 transfer s.obj t.obj --no-cache "$@"; }

# An ACEScg image, made of sRGB colours by the program itself and read back by OpenColorIO.
run -o wide.exr --output-colorspace acescg --depth half
err_has 'baseColor is converted from srgb to acescg'
expect 0 inspect wide.exr
out_has 'acescg'
run -o back.png --source-texture baseColor=wide.exr --depth u16
err_has 'baseColor is converted from acescg to srgb'
if command -v oiiotool >/dev/null; then
  cat >config.ocio <<'CONFIG'
ocio_profile_version: 2
search_path: ""
roles: {default: raw, scene_linear: lin709}
file_rules:
  - !<Rule> {name: Default, colorspace: default}
displays:
  d:
    - !<View> {name: v, colorspace: raw}
colorspaces:
  - !<ColorSpace>
    name: raw
    isdata: true
  - !<ColorSpace>
    name: lin709
  - !<ColorSpace>
    name: srgb
    from_scene_reference: !<ExponentWithLinearTransform> {gamma: 2.4, offset: 0.055, direction: inverse}
  - !<ColorSpace>
    name: acescg
    to_scene_reference: !<GroupTransform>
      children:
        - !<BuiltinTransform> {style: "ACEScg_to_ACES2065-1"}
        - !<BuiltinTransform> {style: "UTILITY - ACES-AP0_to_CIE-XYZ-D65_BFD"}
        - !<MatrixTransform> {matrix: [3.2409699419, -1.5373831776, -0.4986107603, 0, -0.9692436363, 1.8759675015, 0.0415550574, 0, 0.0556300797, -0.203976959, 1.0569715142, 0, 0, 0, 0, 1]}
CONFIG
  oiiotool --colorconfig config.ocio wide.exr --colorconvert acescg srgb --clamp:min=0:max=1 -d uint16 -o ocio.png
  expect 0 compare back.png ocio.png
  error=$(sed -n 's/^largest error *\([0-9.]*\).*/\1/p' "$out")
  awk -v e="$error" 'BEGIN { exit !(e <= 0.00005) }' || fail "off from OpenColorIO by $error"
else
  echo 'SKIPPED: needs oiiotool'
fi
# There and back, at 8 bits, is where it began.
run -o back.png --source-texture baseColor=wide.exr --depth u8
expect 0 compare back.png s.png --min-psnr 55

# A Display P3 image keeps its numbers and says what it is; the same numbers in a glTF are sRGB.
run -o p3.png --source-colorspace display-p3
expect 0 inspect p3.png
out_has 'display-p3'
expect 0 compare p3.png s.png
out_has 'infinite'
base64=$(base64 -w0 p3.png)
"$POUNCE_FIXTURE" plane -o m.glb --triangles 200 --texture 64 >/dev/null
expect 0 transfer m.glb t.obj -o own.png --no-cache --source-texture baseColor=p3.png
expect 0 inspect own.png
out_has 'display-p3'
# Into a model it becomes sRGB, since that is what glTF's textures are.
expect 0 transfer m.glb m.glb -o new.glb --no-cache --source-texture baseColor=p3.png
err_has 'note: baseColor is converted from display-p3 to srgb'
expect 0 transfer new.glb t.obj -o of-model.png --no-cache
expect 0 transfer m.glb t.obj -o of-image.png --no-cache --source-texture baseColor=p3.png --output-colorspace srgb
same_picture of-model.png of-image.png || fail 'the colours of a model are not sRGB'
# sRGB in floats, which readers take for linear light where a file says nothing.
run -o coded.tif --depth float
expect 0 inspect coded.tif
out_has 'float, srgb'
run -o back.png --source-texture baseColor=coded.tif --depth u8
same_picture back.png s.png || fail 'sRGB in floats came back as something else'
# The .glb's own image, with a profile put into it: its length and those that hold it change, so a .gltf with a data URI.
cat >g.gltf <<GLTF
{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],
"meshes":[{"primitives":[{"attributes":{"POSITION":0,"TEXCOORD_0":1},"material":0}]}],
"materials":[{"pbrMetallicRoughness":{"baseColorTexture":{"index":0}}}],"textures":[{"source":0}],
"images":[{"uri":"data:image/png;base64,$base64"}],
"accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]},
{"bufferView":1,"componentType":5126,"count":3,"type":"VEC2"}],
"bufferViews":[{"buffer":0,"byteOffset":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":24}],
"buffers":[{"byteLength":60,"uri":"data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAAAAAAAAAAAAIA/AAAAAAAAAAAAAIA/"}]}
GLTF
expect 0 transfer g.gltf g.gltf -o plain.png --no-cache
expect 0 inspect plain.png
out_has 'srgb'

# Integers of linear light are kept as such where that is asked for.
run -o linear.png --output-colorspace linear --depth u16
expect 0 inspect linear.png
out_has 'lin_rec709'
expect 0 transfer s.obj t.obj --no-cache -o coded.png --source-texture baseColor=linear.png
expect 0 compare coded.png s.png --min-psnr 60

# The paper's method, a splat scene and a file of Gaussians see the same colours.
run -o gaussian.exr --method gaussian --source-texture baseColor=wide.exr --output-colorspace lin_rec709
run -o linear.exr --depth half
run -o usual.exr --method gaussian --source-texture baseColor=linear.exr
expect 0 compare gaussian.exr usual.exr --min-psnr 55
expect 0 gaussians s.obj -o wide.ply --source-texture baseColor=wide.exr --no-cache
err_has 'baseColor is converted from acescg'
expect 0 gaussians s.obj -o usual.ply --no-cache
expect 0 transfer wide.ply t.obj -o wide-splats.exr --no-cache --output-colorspace acescg --size 64
err_has 'baseColor is converted from srgb to acescg'
expect 0 transfer usual.ply t.obj -o splats.exr --no-cache --size 64
expect 0 transfer s.obj t.obj -o a.exr --source-texture baseColor=wide-splats.exr --output-colorspace lin_rec709 --no-cache
expect 0 compare a.exr splats.exr --min-psnr 50
expect 0 transfer usual.ply t.obj -o p3.png --no-cache --output-colorspace display-p3 --size 64
err_has 'baseColor is converted from srgb to display-p3'
expect 0 transfer usual.ply t.obj -o splats.png --no-cache --size 64
! grep -q 'is converted' "$err" || fail 'a conversion that is none'
expect 2 transfer usual.ply t.obj -o o.png --source-colorspace srgb --no-cache
err_has '--source-colorspace applies only to meshes; usual.ply is a splat scene'
