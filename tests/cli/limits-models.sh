# SPDX-License-Identifier: Apache-2.0
# A model that needs 100 MB and finds less: a sentence about memory (exit status 4), never one about a damaged file,
# and never half of the model.
source "$(dirname "$0")/support.sh"
make_job
awk 'BEGIN {
  n = 540000
  print "mtllib source.mtl\nusemtl skin"
  for (i = 0; i < n; ++i) printf "v %d %d 0\nvt 0.%d 0.%d\n", i % 1000, i / 1000, i % 1000, i / 1000
  for (i = 1; i < n - 1001; ++i) printf "f %d/%d %d/%d %d/%d\n", i, i, i + 1, i + 1, i + 1000, i + 1000
}' >big.obj
awk 'BEGIN {
  n = 50000
  printf "{\"asset\":{\"version\":\"2.0\"},\"buffers\":[{\"byteLength\":36,\"uri\":\"big.bin\"}],"
  printf "\"bufferViews\":[{\"buffer\":0,\"byteLength\":36}],"
  printf "\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":3,\"type\":\"VEC3\"},"
  printf "{\"bufferView\":0,\"componentType\":5126,\"count\":3,\"type\":\"VEC2\"}],"
  printf "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0,\"TEXCOORD_0\":1}}]}],\"nodes\":[{\"mesh\":0}"
  for (i = 1; i < n; ++i) printf ",{\"mesh\":0}"
  print "]}"
}' >big.gltf
printf '\0\0\0\0\0\0\0\0\0\0\0\0\0\0\200\077\0\0\0\0\0\0\0\0\0\0\0\0\0\0\200\077\0\0\0\0' >big.bin

for run in "big.obj 140 204" "big.gltf 148 260"; do
  read -r model first last <<<"$run"
  job="transfer $model target.obj -o o.png --source-texture baseColor=skin.ppm --size 16 --no-cache --memory 1GiB -q"
  # shellcheck disable=SC2086  # words on purpose
  expect 0 $job
  mv o.png whole.png
  refusals=0
  for ((mib = first; mib <= last; mib += 16)); do
    status=0
    # shellcheck disable=SC2086
    prlimit --data=$((mib << 20)) "$POUNCE" $job >"$out" 2>"$err" || status=$?
    if [[ $status == 0 ]]; then
      cmp -s o.png whole.png || fail "$model, $mib MiB: half of it was read"
      rm o.png
      continue
    fi
    refusals=$((refusals + 1))
    [[ $status == 4 || $status == 5 ]] || fail "$model, $mib MiB: exit status $status"
    [[ $(wc -l <"$err") == 1 ]] || fail "$model, $mib MiB: not one sentence"
    ! grep -q 'repair\|export' "$err" || fail "$model, $mib MiB: the file is blamed"
  done
  ((refusals > 3)) || fail "$model: the limits were no limits"
done
