#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The claims of the paper (docs/paper.md) beside what this machine gives, as tables: how alike five models come out on
# themselves, the seconds of a job of its size, and its two baselines.
# Usage: tools/paper.sh [DATA]   (test data: $POUNCE_TEST_DATA, else ../shared/data; without, generated heads)
# After tools/test.sh; the baselines need pounce_bench (tools/bench.sh builds it). Takes a minute.
set -euo pipefail
cd "$(dirname "$0")/.."
pounce=$PWD/build/release/pounce fixture=$PWD/build/release/pounce-fixture
bench=$(find build/release -name pounce_bench -type f -perm -u+x | head -n 1)
[[ -x $pounce && -x $fixture ]] || { echo "build first: tools/test.sh" >&2; exit 2; }
data=${1:-${POUNCE_TEST_DATA:-$PWD/../shared/data}}
work=$(mktemp -d "${TMPDIR:-/tmp}/pounce-paper-XXXXXX")
trap 'rm -rf "$work"' EXIT
names=() files=() textures=()

# texture_of FILE.glb: the image of its first textured material, as a file of its own.
texture_of() {
  python3 - "$1" "$work/$(basename "$1")" <<'PY'
import json, struct, sys
with open(sys.argv[1], "rb") as file:
    data = file.read()
size = struct.unpack_from("<I", data, 12)[0]
gltf = json.loads(data[20:20 + size])
texture = next(m["pbrMetallicRoughness"]["baseColorTexture"]["index"] for m in gltf["materials"]
               if "baseColorTexture" in m.get("pbrMetallicRoughness", {}))
image = gltf["images"][gltf["textures"][texture]["source"]]
view = gltf["bufferViews"][image["bufferView"]]
begin = 28 + size + view.get("byteOffset", 0)
path = sys.argv[2] + (".png" if image["mimeType"].endswith("png") else ".jpg")
with open(path, "wb") as file:
    file.write(data[begin:begin + view["byteLength"]])
print(path)
PY
}

# model NAME FILE [TEXTURE]: without TEXTURE it is in FILE. No more than five.
model() {
  [[ -e $2 && (-z ${3-} || -e $3) && ${#names[@]} -lt 5 ]] || return 0
  names+=("$1") files+=("$2") textures+=("${3:-$(texture_of "$2")}")
}

# alike I METHOD OPTION...: "99.16 % (34.75 dB)" against the model's own texture, at its size
alike() {
  local i=$1 out=$work/out.png
  "$pounce" transfer --redo "${files[i]}" "${files[i]}" --source-texture "baseColor=${textures[i]}" -o "$out" --coverage \
    "$work/mask.png" --no-cache -q --method "${@:2}"
  "$pounce" compare "$out" "${textures[i]}" --mask "$work/mask.png" |
    awk '/^similarity/ { s = 100 * $2 } /^psnr/ { p = $2 == "infinite" ? "equal" : $2 " dB" }
         END { printf "%.2f %% (%s)", s, p }'
}

# seconds THREADS OPTION...: "1.40 s (1.31 CPU)" of the whole job, files and program start included; the best of five
seconds() {
  local best=
  for _ in 1 2 3 4 5; do
    rm -rf "$work"/cache/v3/results # warm is a run that has its stores, and projects
    /usr/bin/time -o "$work/time" -f '%e %U %S' "$pounce" transfer --redo "$head/head_src.glb" "$head/head_same.glb" -o "$work/out.png" \
      --size 1024 -q --threads "$@"
    best=$(printf '%s\n' "$(tail -n 1 "$work/time")" ${best:+"$best"} | sort -n | head -n 1)
  done
  awk '{ printf "%.2f s (%.2f CPU)", $1, $2 + $3 }' <<<"$best"
}

# whole NAME: what a baseline would take, from its share of the work
whole() {
  if [[ -z $bench ]]; then printf 'no pounce_bench'; return; fi
  "$bench" --benchmark_filter="^baseline_$1/" --benchmark_format=json 2>/dev/null | python3 -c '
import json, sys
print("%.0f s (extrapolated)" % json.load(sys.stdin)["benchmarks"][0]["whole_s"])' 2>/dev/null ||
    printf 'pounce_bench failed: build it again' 
}

echo "$("$pounce" --version | head -n 1), $(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | head -n 1), $(date +%F)"

head=$work/paper
"$fixture" head -o "$head" --triangles 10000 --texture 1024 --target-size 64 >/dev/null
model 'head_src' "$data/heads/head_src.glb"
model 'Lee Perry-Smith' "$data/meshes/lee_perry_smith/LeePerrySmith_plain_textured.glb"
model 'CesiumMan' "$data/meshes/cesium_man/CesiumMan.glb"
model 'spot' "$data/meshes/spot/spot.obj" "$data/meshes/spot/spot_texture.png"
model 'Duck' "$data/meshes/duck/gltf/Duck.gltf" "$data/meshes/duck/gltf/DuckCM.png"
for triangles in 2000 5000 10000 20000 40000; do
  "$fixture" head -o "$work/$triangles" --triangles $triangles --texture 1024 --target-size 64 >/dev/null
  model "generated head, $triangles triangles" "$work/$triangles/head_src.glb"
done
echo
echo '| onto itself | the paper | `gaussian` | `gaussian --densify` | `surface` |'
echo '|---|---|---|---|---|'
for i in "${!names[@]}"; do
  echo "| ${names[i]} | about 98 % | $(alike "$i" gaussian) | $(alike "$i" gaussian --densify) | $(alike "$i" surface) |"
done

echo
echo '| 10,000 triangles, 0.9 M Gaussians, 1024², whole job | the paper (i9-12900H) | `gaussian`, cold | warm | `surface`, cold | warm |'
echo '|---|---|---|---|---|---|'
for threads in 1 2; do
  row=$([[ $threads == 1 ]] && echo '1.12 s' || echo '0.68 s')
  for method in gaussian surface; do
    row+=" | $(seconds $threads --method $method --no-cache)"
    seconds $threads --method $method --cache "$work/cache" >/dev/null
    row+=" | $(seconds $threads --method $method --cache "$work/cache")"
  done
  echo "| $threads thread(s) | $row |"
done

echo
echo '| baseline, 1 thread | the paper | here, CPU |'
echo '|---|---|---|'
echo "| per-face projection | 31 s | $(whole per_face) |"
echo "| brute-force ray casting | 246 s | $(whole ray_cast) |"
