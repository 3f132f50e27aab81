# SPDX-License-Identifier: Apache-2.0
# The bytes of a broad set of jobs, as recorded in recorded.sha256: a change that was not meant shows here first.
#
#   bash recorded.sh [check [own | data]]  runs every job and compares; what differs is named, job by job. "data" is the
#                                  jobs of the test data alone (ends with 77 where it is absent), "own" all others
#   bash recorded.sh record [JOB]  writes recorded.sha256 anew, all of it or the jobs that match a pattern
#   bash recorded.sh keep DIR      runs every job and leaves inputs and outputs in DIR, to look at or to compare
#
# POUNCE and POUNCE_FIXTURE are the programs. Inputs come from this script (the same on every machine), from the
# fixture program (floating point of the C library: where they are other bytes, their jobs are skipped) and from the
# test data ($POUNCE_TEST_DATA, else ../shared/data beside the repository; skipped where that is absent).
# Record only what a change was meant to alter, and say in its commit which jobs and why.
set -euo pipefail
: "${POUNCE:?the program under test}" "${POUNCE_FIXTURE:?the maker of input}"
here=$(cd "$(dirname "$0")" && pwd)
recorded=$here/recorded.sha256
mode=${1:-check}
part=
[[ $mode != check ]] || part=${2-}
data=${POUNCE_TEST_DATA:-$here/../../../shared/data}

if [[ $mode == keep ]]; then
  mkdir -p "${2:?folder}"
  work=$(cd "$2" && pwd)
else
  work=$(mktemp -d "${TMPDIR:-/tmp}/pounce-recorded-XXXXXX")
  trap 'rm -rf "$work"' EXIT
fi
export XDG_CACHE_HOME=$work/cache LC_ALL=C
mkdir -p "$work/in" "$work/out"
cd "$work/in"
seen=$work/seen
: >"$seen"
failed=0 jobs=0 skipped=0

# job NAME ARGUMENT...: runs pounce in a folder of its own, OUT in the arguments; takes the hashes of what it left there.
job() {
  local name=$1 out=$work/out/$1 argument arguments=()
  shift
  if [[ $mode == record && -n ${pattern-} && $name != $pattern ]]; then return 0; fi
  mkdir -p "$out"
  for argument in "$@"; do arguments+=("${argument//OUT/$out}"); done
  if ! "$POUNCE" "${arguments[@]}" >"$work/said" 2>&1; then
    printf 'FAILED: %s: pounce %s\n%s\n' "$name" "${arguments[*]}" "$(head -c 2000 "$work/said")"
    failed=$((failed + 1))
    return 0
  fi
  jobs=$((jobs + 1))
  local file
  while IFS= read -r file; do
    printf '%s  %s\n' "$(sha256sum "$out/$file" | cut -d' ' -f1)" "$name/$file" >>"$seen"
  done < <(cd "$out" && find . -type f -printf '%P\n' | sort)
  [[ $mode == keep ]] || rm -rf "$out"
}

# transfer NAME SOURCE TARGET OUTPUT ARGUMENT...
transfer() { job "$1" transfer "$2" "$3" -o "OUT/$4" --no-cache --threads 2 "${@:5}"; }

samples() { printf "$(printf '\\%03o' "$@")"; }

# A 16x12 picture whose samples all differ, as PPM; and a mask as PGM.
picture() {
  local i values=()
  for ((i = 0; i < 16 * 12; ++i)); do values+=($((i * 37 % 256)) $((i * 101 % 256)) $((255 - i))); done
  { printf 'P6\n16 12\n255\n' && samples "${values[@]}"; } >"$1"
}
grey() {
  local i values=()
  for ((i = 0; i < 20 * 20; ++i)); do values+=($((i * 13 % 256))); done
  { printf 'P5\n20 20\n255\n' && samples "${values[@]}"; } >"$1"
}

plain_jobs() {
  picture skin.ppm
  grey mask.pgm
  printf 'newmtl skin\nmap_Kd skin.ppm\nnewmtl plain\nKd 0.2 0.4 0.6\n' >roof.mtl
  # A bent sheet of two materials with a fold, and a target with other triangles that fills four UDIM tiles.
  printf '%s\n' 'mtllib roof.mtl' 'v 0 0 0' 'v 1 0 0.25' 'v 2 0 0' 'v 0 1 0' 'v 1 1 0.25' 'v 2 1 0' 'v 2.5 0.5 0' \
    'vt 0 0' 'vt 0.4 0' 'vt 0.9 0' 'vt 0 1' 'vt 0.4 1' 'vt 0.9 1' 'vt 1 0.5' 'usemtl skin' 'f 1/1 2/2 5/5 4/4' \
    'f 2/2 3/3 6/6 5/5' 'usemtl plain' 'f 3/3 7/7 6/6' >roof.obj
  printf '%s\n' 'v 0 0 0.01' 'v 0.7 0 0.2' 'v 2 0 0.01' 'v 0 1 0.01' 'v 1.2 1 0.2' 'v 2 1 0.01' 'v 2.4 0.5 0' \
    'vt 0.03 0.02' 'vt 0.8 0.05' 'vt 1.9 0.1' 'vt 0.1 1.8' 'vt 1.1 1.7' 'vt 1.95 1.9' 'vt 1.97 0.9' \
    'f 1/1 2/2 5/5 4/4' 'f 2/2 3/3 6/6 5/5' 'f 3/3 7/7 6/6' >target.obj
  local depth
  for depth in u8.png u16.png u8.tif u16.tif float.tif half.exr float.exr u8.jpg; do
    transfer "plain-${depth/./-}" roof.obj roof.obj "out.${depth#*.}" --size 96x64 --depth "${depth%%.*}"
  done
  transfer plain-tx roof.obj roof.obj out.tx --size 96x64
  transfer plain-tiles roof.obj roof.obj out.tif --size 96x64 --tile-size 32 --depth float
  transfer plain-levels roof.obj target.obj out.exr --size 90x70 --depth half --mipmap --exr-compression piz
  transfer plain-udim roof.obj target.obj 'out.<UDIM>.png' --size 64 --coverage 'OUT/mask.<UDIM>.png'
  transfer plain-uvtile roof.obj target.obj 'out_<UVTILE>.tif' --size 48 --tiles 1002,1011
  transfer plain-wrapped roof.obj target.obj out.png --size 80 --padding 0
  transfer plain-materials roof.obj roof.obj 'out.<MATERIAL>.png' --size 64
  transfer plain-selection roof.obj target.obj out.png --size 64 --source-material skin --max-angle 60
  transfer plain-distance roof.obj target.obj out.png --size 64 --max-distance 0.005 --coverage OUT/mask.png
  transfer plain-texture roof.obj target.obj out.png --size 64 --source-texture baseColor=mask.pgm
  transfer plain-axes roof.obj target.obj out.png --size 64 --target-axes=-y,x,z --source-axes=-y,x,z
  transfer plain-onto roof.obj target.obj out.png --onto mask.pgm
  transfer plain-mask roof.obj target.obj out.png --onto mask.pgm --mask mask.pgm
  transfer plain-mask-exr roof.obj target.obj out.exr --onto mask.pgm --mask mask.pgm --depth half
  transfer plain-least roof.obj target.obj out.png --size 512 --memory 64MiB
  transfer plain-as-gaussians roof.obj target.obj out.png --size 64 --method gaussian --sigma 0.7 --coverage OUT/mask.png
  transfer plain-as-gaussians-dense roof.obj target.obj 'out.<UDIM>.png' --size 64 --method gaussian --densify
  job plain-maps maps target.obj -o 'OUT/<CHANNEL>.exr' --size 96
  job plain-maps-udim maps target.obj -o 'OUT/<CHANNEL>.<UDIM>.exr' --size 32
  job plain-gaussians gaussians roof.obj -o OUT/out.ply
  job plain-gaussians-glb gaussians roof.obj -o OUT/out.glb --sigma 0.25 --sharpen 1
}

# Fixtures of the program itself; where this machine's C library gives other inputs, nothing can be said of outputs.
made_jobs() {
  "$POUNCE_FIXTURE" head -o head --triangles 3000 --texture 256 --target-size 64 --format both >/dev/null
  "$POUNCE_FIXTURE" head -o float --triangles 3000 --texture 128 --target-size 64 --texture-format exr >/dev/null
  "$POUNCE_FIXTURE" shell -o shell --texture 128 >/dev/null
  "$POUNCE_FIXTURE" channels -o channels >/dev/null
  "$POUNCE_FIXTURE" splats -o sphere.ply --shape sphere --count 20000 --target-size 64 >/dev/null
  "$POUNCE_FIXTURE" splats -o broken.ply --shape sphere --count 8000 --sh-degree 2 --broken 5 >/dev/null
  "$POUNCE_FIXTURE" plane -o plane.obj --triangles 400 --uv-tiles 4 --texture 64 >/dev/null
  "$POUNCE_FIXTURE" sphere -o dense.glb --triangles 60000 --texture 128 >/dev/null
  local inputs
  inputs=$(find head float shell channels sphere* broken.ply plane* dense.glb -type f | sort | xargs sha256sum | sha256sum | cut -d' ' -f1)
  if [[ $mode == check ]] && ! grep -q "^$inputs  made-inputs$" "$recorded"; then
    echo "SKIPPED: the fixture program makes other input bytes on this machine"
    skipped=$((skipped + 1))
    sed -E '/^[0-9a-f]{64}  made-/!d' "$recorded" >>"$seen"
    return 0
  fi
  printf '%s  made-inputs\n' "$inputs" >>"$seen"
  transfer made-head-self head/head_src.glb head/head_src.glb out.png --coverage OUT/mask.png
  transfer made-head-same head/head_src.glb head/head_same.glb out.png --size 512
  transfer made-head-tent head/head_src.glb head/head_other.glb out.png --size 300x200 --filter tent
  transfer made-head-sharp head/head_src.glb head/head_other.glb out.png --size 300x200 --filter sharp
  transfer made-head-other head/head_src.glb head/head_other.glb out.png --size 300x200
  transfer made-head-obj head/head_src.obj head/head_other.obj out.tif --size 256
  transfer made-head-big head/head_src.glb head/head_other.glb out.png --size 2048 --memory 64MiB
  transfer made-head-exr float/head_src.glb float/head_other.glb out.exr --size 256 --source-texture baseColor=float/head_src.exr
  transfer made-head-exr-u16 float/head_src.glb float/head_other.glb out.png --depth u16 --size 256 --source-texture baseColor=float/head_src.exr
  transfer made-head-model head/head_src.glb head/head_other.glb out.glb --size 128
  transfer made-head-model-gltf head/head_src.glb head/head_other.glb out.gltf --size 128
  transfer made-as-gaussians head/head_src.glb head/head_other.glb out.png --size 256 --method gaussian
  transfer made-as-gaussians-exr float/head_src.glb float/head_other.glb out.exr --size 256 --method gaussian \
    --source-texture baseColor=float/head_src.exr
  transfer made-shell shell/shell_src.glb shell/shell_target.glb out.png
  transfer made-channels channels/channels_src.glb channels/channels_target.glb '<CHANNEL>.png'
  transfer made-channels-exr channels/channels_src.glb channels/channels_target.glb '<CHANNEL>.exr' --size 128
  transfer made-channels-model channels/channels_src.glb channels/channels_target.glb out.glb --size 128
  transfer made-splats sphere.ply sphere_target.glb out.png --size 256 --coverage OUT/mask.png
  transfer made-splats-evidence sphere.ply sphere_target.glb '<CHANNEL>.exr' --size 128 --channels baseColor,confidence,distance
  transfer made-splats-u16 sphere.ply dense.glb out.png --size 128 --depth u16
  transfer made-splats-rays sphere.ply sphere_target.glb out.png --size 128 --rays 3 --alpha --coverage OUT/mask.png
  transfer made-splats-broken broken.ply sphere_target.glb out.png --size 128
  transfer made-splats-model sphere.ply dense.glb out.glb --size 128
  transfer made-plane-udim plane.obj plane.obj 'out.<UDIM>.png' --size 128 --source-texture 'baseColor=plane.<UDIM>.png'
  transfer made-plane-as-gaussians plane.obj plane.obj 'out.<UDIM>.png' --size 128 --method gaussian \
    --source-texture 'baseColor=plane.<UDIM>.png'
  transfer made-dense dense.glb dense.glb out.png --size 128
  transfer made-dense-onto dense.glb sphere_target.glb out.png --onto head/head_same.truth.png
  job made-maps maps head/head_other.glb -o 'OUT/<CHANNEL>.exr' --size 256
  job made-mesh mesh sphere.ply -o OUT/out.glb --cells 48 --triangles 1000 --size 256
  job made-level-of-detail proxy head/head_src.glb -o OUT/out.glb --triangles 600 --size 256
  job made-gaussians gaussians head/head_src.glb -o OUT/out.ply
  job made-gaussians-spz gaussians head/head_src.glb -o OUT/out.spz --sigma 0.25 --sharpen 1
}

data_jobs() {
  if [[ ! -d $data/meshes ]]; then
    echo "SKIPPED: needs test data (set POUNCE_TEST_DATA)"
    [[ $part != data ]] || exit 77
    skipped=$((skipped + 1))
    sed -E '/^[0-9a-f]{64}  data-/!d' "$recorded" >>"$seen"
    return 0
  fi
  local m=$data/meshes u=$data/udim s=$data/splats h=$data/heads bottle
  bottle=$m/water_bottle/SpecGlossVsMetalRough.gltf
  transfer data-head-self "$h/head_src.glb" "$h/head_src.glb" out.png
  transfer data-head-same "$h/head_src.glb" "$h/head_dst_same.glb" out.png --size 512
  transfer data-head-same-tent "$h/head_src.glb" "$h/head_dst_same.glb" out.png --size 512 --filter tent
  transfer data-head-udim "$h/head_src.glb" "$h/head_dst_udim4.obj" 'out.<UDIM>.png' --size 128
  transfer data-spot "$m/spot/spot.obj" "$m/spot_glb/cow.glb" out.png --size 512 --max-distance 20%
  transfer data-spot-self "$m/spot/spot.obj" "$m/spot/spot.obj" out.png --size 512
  transfer data-cesium-self "$m/cesium_man/CesiumMan.glb" "$m/cesium_man/CesiumMan.glb" out.png --size 512
  transfer data-cesium-model "$m/cesium_man/CesiumMan.glb" "$m/cesium_man/CesiumMan.glb" out.glb --size 128
  transfer data-lee "$m/lee_perry_smith/LeePerrySmith_plain_textured.glb" "$m/lee_perry_smith/LeePerrySmith_plain_textured.glb" out.png --size 512
  transfer data-duck "$m/duck/gltf/Duck.gltf" "$m/duck/gltf/Duck.gltf" out.png --size 256
  transfer data-multi-uv "$m/multi_uv/MultiUVTest.gltf" "$m/multi_uv/MultiUVTest.gltf" '<CHANNEL>.png' --size 256
  transfer data-transform "$m/TextureTransformTest/TextureTransformTest.gltf" "$m/TextureTransformTest/TextureTransformTest.gltf" out.png --size 256
  transfer data-settings "$m/TextureSettingsTest/TextureSettingsTest.gltf" "$m/TextureSettingsTest/TextureSettingsTest.gltf" out.png --size 256
  transfer data-bottle "$bottle" "$bottle" '<MATERIAL>.<CHANNEL>.png' --size 128
  transfer data-bottle-model "$bottle" "$bottle" out.gltf --size 64
  transfer data-cube "$u/materialx_cube/cube.obj" "$u/materialx_cube/cube.obj" 'out.<UDIM>.png' --size 128 \
    --source-texture "baseColor=$u/materialx_cube/grid.<UDIM>.png"
  transfer data-plane "$u/openusd_plane/usdUdims.obj" "$u/openusd_plane/usdUdims.obj" 'out.<UDIM>.jpg' --size 64 \
    --source-texture "baseColor=$u/openusd_plane/texture_<UDIM>.jpg"
  transfer data-playbot "$s/playbot_lod3_converted/playbot_lod3.ply" "$m/playbot_proxy/playbot_proxy.glb" out.png --size 512
  transfer data-noisy-sphere "$s/noisy_sphere/scene.ply" "$s/noisy_sphere/sphere.obj" out.png --size 256
  job data-maps maps "$m/cesium_man/CesiumMan.glb" -o 'OUT/<CHANNEL>.exr' --size 256
  job data-gaussians gaussians "$m/cesium_man/CesiumMan.glb" -o OUT/out.ply
  for format in ply spz glb; do
    job data-scene-gaussians-$format gaussians "$s/playbot_lod3_converted/playbot_lod3.ply" -o OUT/out.$format --count 20000
  done
}

[[ $mode != record ]] || pattern=${2-}
[[ $part == data ]] || { plain_jobs && made_jobs; }
[[ $part == own ]] || data_jobs
# expected: the recorded hashes of the part that ran.
expected() {
  case $part in
    data) grep '  data-' "$recorded" ;;
    own) grep -v '  data-' "$recorded" ;;
    *) cat "$recorded" ;;
  esac
}

case $mode in
  check)
    # The old hash comes first, then what was seen.
    if ! diff <(expected | sort -k2) <(sort -k2 "$seen") >"$work/differences"; then
      echo "FAILED: these outputs have other bytes than recorded (< recorded, > now); was that meant?"
      grep '^[<>]' "$work/differences" | sort -k3
      failed=$((failed + 1))
    fi
    ;;
  record)
    if [[ -n $pattern ]]; then
      while read -r hash name; do
        [[ ${name%%/*} == $pattern ]] || printf '%s  %s\n' "$hash" "$name"
      done <"$recorded" >"$work/kept"
      grep -v '  made-inputs$' "$seen" | cat - "$work/kept" >"$work/all"
    else
      cp "$seen" "$work/all"
    fi
    sort -k2 -u "$work/all" >"$recorded"
    ;;
esac
echo "$jobs jobs, $(wc -l <"$seen") hashes, $failed failed, $skipped groups skipped"
((failed == 0))
