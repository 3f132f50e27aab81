# SPDX-License-Identifier: Apache-2.0
# A pipe where a file should be is refused at once: nobody may ever write into it.
source "$(dirname "$0")/support.sh"
make_job
mkfifo pipe.obj pipe.glb pipe.ply pipe.png mask.png images.mtl

# quickly STATUS ARGUMENT...: expect, within ten seconds.
quickly() {
  local wanted=$1 got=0
  shift
  timeout 10 "$POUNCE" "$@" >"$out" 2>"$err" || got=$?
  [[ $got == "$wanted" ]] || fail "exit status $got, not $wanted: pounce $*"
}

for mesh in pipe.obj pipe.glb; do
  quickly 5 transfer "$mesh" target.obj -o o.png
  err_has "$mesh: cannot read: it is a pipe, not a file; write its contents to a file first"
  quickly 5 transfer source.obj "$mesh" -o o.png
  quickly 5 inspect "$mesh"
  quickly 5 maps "$mesh" -o 'o.<CHANNEL>.exr'
  quickly 5 gaussians "$mesh" -o o.ply
done
quickly 5 transfer pipe.ply target.obj -o o.png
err_has 'pipe.ply: cannot read: it is a pipe'
quickly 5 inspect pipe.png
got=0
timeout 10 "$POUNCE" transfer source.obj target.obj -o o.png --source-texture baseColor=pipe.png >"$out" 2>"$err" || got=$?
[[ $got == 5 ]] || fail "an image that is a pipe: $got"
err_has 'a pipe, not a file'
got=0
timeout 10 "$POUNCE" compare skin.ppm skin.ppm --mask mask.png >"$out" 2>"$err" || got=$?
[[ $got == 5 ]] || fail "a mask that is a pipe: $got"
err_has 'a pipe, not a file'

# A buffer, and a material file.
printf '%s' '{"asset":{"version":"2.0"},"buffers":[{"uri":"pipe.glb","byteLength":36}],"bufferViews":[{"buffer":0,"byteLength":36}],
"accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}],"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}]}' >buffer.gltf
quickly 5 inspect buffer.gltf
err_has 'it is a pipe, not a file'
sed 's/source.mtl/images.mtl/' source.obj >other.obj
quickly 0 inspect other.obj
out_has 'material file images.mtl cannot be read'

# Devices: what they give has no size.
quickly 5 transfer source.obj /dev/zero -o o.png
err_has '/dev/zero: cannot read: it is a device, not a file'
quickly 5 inspect /dev/stdin </dev/null
[[ ! -e o.png ]] || fail 'an image was written'

# Reports are written, not read: pipes and devices are fine there.
expect 0 transfer source.obj target.obj -o o.png --report /dev/stdout
out_has '"outputs"'
"$POUNCE" transfer source.obj target.obj -o o.png --quiet --report >(cat >report.json)
for _ in {1..100}; do [[ -s report.json ]] && break; sleep 0.05; done
grep -q '"outputs"' report.json || fail 'no report came through the pipe'
