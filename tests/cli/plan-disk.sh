# SPDX-License-Identifier: Apache-2.0
# --plan forecasts the disk that a job takes: bounds that a real run stays within, in the summary and the report.
source "$(dirname "$0")/support.sh"
head -c 786432 /dev/urandom >noise.raw # what no encoder makes smaller
{ printf 'P6\n512 512\n255\n' && cat noise.raw; } >skin.ppm
quad source skin.ppm
quad target
quad other
number() { tr -d ' \n' <"$1" | sed -nE "s/.*$2.*/\1/p"; }
# holds NAME ARGUMENT...: the job takes no more than its plan says, of scratch, cache and outputs.
tight=8 # times what was taken, and some megabytes for what compresses well
holds() {
  local name=$1 real most
  shift
  rm -rf "$XDG_CACHE_HOME"
  expect 0 transfer "$@" --plan --report plan.json
  grep -qE '^outputs +at most [0-9.]+ [KMG]iB$' "$out" || fail "$name: no outputs in the plan"
  grep -qE '^(scratch disk|cache) +at most [0-9.]+ [KMG]iB$' "$out" || fail "$name: no disk in the plan"
  expect 0 transfer "$@" --report run.json
  real=$(number run.json '"temp_peak":([0-9]+)') most=$(number plan.json '"disk_most":\{"scratch":([0-9]+)')
  ((real > 0 && real <= most && most < tight * real + 8000000)) || fail "$name: scratch $real, at most $most"
  real=$(number run.json '"bytes":[^}]*"outputs":([0-9]+)\}') most=$(number plan.json '"disk_most":[^}]*"outputs":([0-9]+)')
  ((real > 0 && real <= most && most < 3 * real + 2000000)) || fail "$name: outputs $real, at most $most"
  real=0 most=$(number plan.json '"disk_most":[^}]*"cache":([0-9]+)')
  [[ ! -e $XDG_CACHE_HOME ]] || real=$(find "$XDG_CACHE_HOME" -name '*.pack' -printf '%s\n' | awk '{ s += $1 } END { print s + 0 }')
  ((real <= most && most < tight * real + 8000000)) || fail "$name: cache $real, at most $most"
  cache_real=$real cache_most=$most
  # Not so the limit of scratch files, which goes by what is free.
  [[ $(number run.json '"disk_most":(\{.*),"scratch_limit"') == "$(number plan.json '"disk_most":(\{.*),"scratch_limit"')" ]] ||
    fail "$name: run and plan disagree"
}
holds png source.obj target.obj -o o.png
holds no-cache source.obj target.obj -o o.png --no-cache
holds coarse source.obj target.obj -o o.png --size 100
{ printf 'P6\n4096 64\n255\n' && cat noise.raw; } >thin.ppm # levels of one row of tiles: half the image, a quarter ...
holds thin source.obj target.obj -o o.png --size 512x8 --source-texture baseColor=thin.ppm
((cache_most < 2 * cache_real)) || fail "thin: half of $cache_most would do for $cache_real"
holds afar source.obj target.obj -o o.png --size 64x4 --source-texture baseColor=thin.ppm # a level in its place
holds depth source.obj target.obj -o o.exr --depth float --coverage mask.exr
holds tif source.obj target.obj -o o.tif --depth u16 --size 700x300
holds tx source.obj target.obj -o o.tx
holds levels source.obj target.obj -o o.exr --mipmap --exr-compression none --coverage mask.tx
holds jpg source.obj target.obj -o o.jpg
holds targets source.obj target.obj other.obj -o '<TARGET>.png' --no-cache
holds limit source.obj target.obj -o o.png --cache-limit 100KB
"$POUNCE_FIXTURE" one-texel -o one >"$out"
holds model one/one_texel_src.glb one/one_texel_target.glb -o m.glb --size 256
"$POUNCE_FIXTURE" splats -o s.ply --count 20000 --target-size 64 >"$out"
# Whether --look auto draws views is not known before the scene is sorted: its forecast has room for them,
# and for results along normals.
holds splats s.ply s_target.glb -o s.png --look normal
normal=$cache_most # its results among it
holds splats-no-cache s.ply s_target.glb -o s.png --no-cache --look normal
holds views s.ply s_target.glb -o s.png --look around
most=$cache_most
holds views-no-cache s.ply s_target.glb -o s.png --no-cache --look around
expect 0 transfer s.ply s_target.glb -o s.png --plan --report plan.json
auto=$(number plan.json '"disk_most":[^}]*"cache":([0-9]+)')
((auto > most && auto > normal && auto < most + normal)) || fail 'the forecast of --look auto has no room for both'
"$POUNCE_FIXTURE" plane -o p.obj --triangles 2000 --texture 128 --uv-tiles 4 >"$out"
holds udim p.obj p.obj -o 'u.<UDIM>.png' --source-texture 'baseColor=p.<UDIM>.png' --size 200
# Scenes that are unpacked, some of them next to nothing on disk: the forecast knows what they become.
expect 0 gaussians s.ply -o s.spz
holds spz s.spz s_target.glb -o s.png --look normal
holds spz-no-cache s.spz s_target.glb -o s.png --no-cache --look normal
if [[ -d ${POUNCE_TEST_DATA:=$POUNCE_SOURCE_DIR/../shared/data} ]]; then
  holds sog "$POUNCE_TEST_DATA/splats/playbot_lod3_sog/meta.json" s_target.glb -o s.png --size 128 --min-confidence 0 --look normal
else
  echo 'SKIPPED: needs test data'
fi
