# SPDX-License-Identifier: Apache-2.0
# --allow-format: BMP and Targa are read where they are allowed by name alone, through every door; the content says what
# they are, not the name.
source "$(dirname "$0")/support.sh"
make_job
# 2 x 2 texels of 200, 100, 50 as Targa, which has no mark at its start.
{ printf '\0\0\2\0\0\0\0\0\0\0\0\0\2\0\2\0\30\40' && samples 50 100 200 50 100 200 50 100 200 50 100 200; } >skin.tga
cp skin.tga called.png
quad tga skin.tga
quad called called.png
image grey.ppm 4 4 9 9 9
expect 0 transfer source.obj target.obj -o truth.png --size 4

refuses() {
  local name=$1
  shift
  expect 3 "$@"
  err_has "$name: Targa images are read only with --allow-format tga; add it if you trust the file, or convert it: oiiotool $name -o ${name%.*}.png"
  [[ ! -e o.png && ! -e o.ply ]] || fail "an output was written"
}
# door NAME ARGUMENT...: refused as it is, fine where it is allowed, as are other names beside it.
door() {
  refuses "$@"
  shift
  expect 3 "$@" --allow-format bmp
  expect 0 "$@" --allow-format tga
  rm -f o.png o.ply
  expect 0 "$@" --allow-format bmp --allow-format tga
  rm -f o.ply
  [[ ! -e o.png ]] || { same_picture o.png truth.png || fail "another picture"; }
  rm -f o.png
  expect 0 "$@" --allow-format bmp,tga
  rm -f o.png o.ply
}
door skin.tga transfer tga.obj target.obj -o o.png --size 4
door called.png transfer called.obj target.obj -o o.png --size 4
door skin.tga transfer source.obj target.obj -o o.png --size 4 --source-texture baseColor=skin.tga
door skin.tga gaussians tga.obj -o o.ply
expect 0 transfer source.obj target.obj -o o2.png --size 2
for option in --onto --mask; do
  arguments=(transfer source.obj target.obj -o o.png --onto o2.png)
  [[ $option == --mask ]] && arguments+=(--mask skin.tga) || arguments[-1]=skin.tga
  refuses skin.tga "${arguments[@]}"
  expect 0 "${arguments[@]}" --allow-format tga
  rm o.png
done
expect 3 compare skin.tga skin.tga
expect 0 compare skin.tga o2.png --mask skin.tga --allow-format tga
out_has 'infinite (equal)'
expect 3 inspect called.png
err_has '--allow-format tga'
expect 0 inspect called.png --allow-format tga
out_has '2 x 2, 3 channels, u8'
expect 0 inspect tga.obj
out_has 'problem: skin.tga: Targa images are read only with'
expect 0 inspect tga.obj --allow-format tga
out_has '2 x 2'
# A file that is no Targa does not become one by its name.
printf 'no picture, and long enough for a header' >text.tga
expect 3 inspect text.tga --allow-format tga
err_has 'not an image in a supported format'

# Within a model that says it were PNG.
expect 0 transfer source.obj target.obj -o model.png --size 2
python3 - <<'END'
import base64, struct
p = struct.pack("<20f", 0,0,0, 1,0,0, 1,1,0, 0,1,0, 0,1, 1,1, 1,0, 0,0) + struct.pack("<6H", 0,1,2, 0,2,3)
uri = lambda kind, data: "data:%s;base64,%s" % (kind, base64.b64encode(data).decode())
open("model.gltf", "w").write("""{"asset":{"version":"2.0"},"buffers":[{"uri":"%s","byteLength":%d}],
"bufferViews":[{"buffer":0,"byteLength":48},{"buffer":0,"byteOffset":48,"byteLength":32},{"buffer":0,"byteOffset":80,"byteLength":12}],
"accessors":[{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"},{"bufferView":1,"componentType":5126,"count":4,"type":"VEC2"},
{"bufferView":2,"componentType":5123,"count":6,"type":"SCALAR"}],"images":[{"uri":"%s"}],"textures":[{"source":0}],
"materials":[{"pbrMetallicRoughness":{"baseColorTexture":{"index":0}}}],
"meshes":[{"primitives":[{"attributes":{"POSITION":0,"TEXCOORD_0":1},"indices":2,"material":0}]}],
"nodes":[{"mesh":0}],"scenes":[{"nodes":[0]}],"scene":0}""" % (uri("application/octet-stream", p), len(p),
    uri("image/png", open("skin.tga", "rb").read())))
END
expect 3 transfer model.gltf target.obj -o o.png
err_has 'Targa images are read only with --allow-format tga; add it if you trust the file, or convert it to PNG'
expect 0 transfer model.gltf target.obj -o o.png --size 4 --allow-format tga --report r.json
same_picture o.png truth.png || fail "another picture of the embedded Targa"
grep -q '"allow-format"' r.json || fail "the report does not name the option"

# The option changes no byte, so the job's hash is the same.
expect 0 transfer source.obj target.obj -o a.png
expect 0 transfer source.obj target.obj -o b.png --allow-format tga
cmp a.png b.png || fail "--allow-format changed the output"

rm -rf ./*
refused 'got "targa", expected bmp or tga' transfer a.glb b.glb -o o.png --allow-format targa
refused 'not supported; did you mean tga?' transfer a.glb b.glb -o o.png --allow-format tgaa
refused 'got "psd"' inspect a.png --allow-format tga,psd
refused 'got ""' compare a.png b.png --allow-format ''
