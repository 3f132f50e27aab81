# SPDX-License-Identifier: Apache-2.0
# A file that a model names and that nobody may look at, or whose name no file can have, matters only where it is
# needed. A model output goes without it, with a warning.
source "$(dirname "$0")/support.sh"
make_job
chmod 755 "$work"
chmod 777 .

# gltf FILE IMAGE-URI [BUFFER-URI]: a triangle with a normal map.
gltf() {
  printf '{"asset":{"version":"2.0"},"buffers":[{"uri":"mesh.bin","byteLength":60}%s],
"bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":24}],
"accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"},{"bufferView":1,"componentType":5126,"count":3,"type":"VEC2"}],
"images":[{"uri":"%s"}],"textures":[{"source":0}],"materials":[{"name":"skin","normalTexture":{"index":0}}],
"meshes":[{"primitives":[{"attributes":{"POSITION":0,"TEXCOORD_0":1},"material":0}]}]}' \
    "${3+,{\"uri\":\"$3\",\"byteLength\":8\}}" "$2" >"$1"
}
# Floats 0 and 1 are 00000000 and 0000803f.
bytes() { for word in "$@"; do if ((word)); then printf '\0\0\200\077'; else printf '\0\0\0\0'; fi; done; }
bytes 0 0 0 1 0 0 0 1 0 0 0 1 0 0 1 >mesh.bin
long=$(printf '%%20%05000d' 0)
mkdir private sub
cp skin.ppm 'private/a b.ppm'
cp skin.ppm closed.ppm
chmod 700 private
chmod 0 closed.ppm

as=()
if [[ $(id -u) == 0 ]] && command -v setpriv >/dev/null &&
  setpriv --reuid 65534 --clear-groups "$POUNCE" --version >/dev/null 2>&1; then
  as=(setpriv --reuid 65534 --clear-groups)
elif [[ $(id -u) != 0 ]]; then
  chmod 0 private
fi
others=("$long")
if [[ ${#as[@]} -gt 0 || $(id -u) != 0 ]]; then
  others+=('private/a%20b.ppm' 'private/ab.ppm' closed.ppm)
else
  echo "SKIPPED: files of others (needs setpriv, or not to be root)"
fi
# run STATUS ARGUMENT...: as somebody who may not read everything.
run() {
  local wanted=$1 got=0
  shift
  "${as[@]}" "$POUNCE" "$@" >"$out" 2>"$err" || got=$?
  [[ $got == "$wanted" ]] || fail "exit status $got, not $wanted: pounce $*"
}

for uri in "${others[@]}"; do
  # Only geometry and UVs are needed.
  gltf m.gltf "$uri"
  run 0 transfer source.obj m.gltf -o o.png --size 16 --no-cache
  run 0 inspect m.gltf
  for output in o.glb o.gltf; do
    run 0 transfer source.obj m.gltf -o $output --size 16 --no-cache
    err_has "; $output still refers to it"
    [[ $uri != closed.ppm ]] || err_has 'its image closed.ppm cannot be read (Permission denied)'
  done
  # A buffer that no accessor lies in.
  gltf m.gltf skin.ppm "$uri"
  run 0 transfer source.obj m.gltf -o o.png --size 16 --no-cache
  # One that is needed.
  sed -i "s,mesh.bin,$uri," m.gltf
  run 5 transfer source.obj m.gltf -o o.png --size 16 --no-cache
  err_has 'buffer 0 cannot be read'
  rm -f o.*
done
chmod 700 private
