# SPDX-License-Identifier: Apache-2.0
# Small whole jobs that together touch every feature, for programs that were built with sanitizers: POUNCE and
# POUNCE_FIXTURE. Any report of a sanitizer, or another exit status than is expected, ends it with 1.
# tools/sanitize.sh builds and runs it.
set -euo pipefail
: "${POUNCE:?the program under test}" "${POUNCE_FIXTURE:?the maker of input}"
work=$(mktemp -d "${TMPDIR:-/tmp}/pounce-sanitize-XXXXXX")
trap 'rm -rf "$work"' EXIT
cd "$work"
export LC_ALL=C XDG_CACHE_HOME=$work/default
export ASAN_OPTIONS=exitcode=99:detect_leaks=1:strict_string_checks=1:detect_stack_use_after_return=1
export UBSAN_OPTIONS=print_stacktrace=1
export TSAN_OPTIONS=exitcode=99

jobs=0
# job STATUS ARGUMENT...
job() {
  local wanted=$1 status=0
  shift
  jobs=$((jobs + 1))
  # Again, with a warm cache and other threads: outputs of this very job are not to be skipped.
  if [[ $1 == transfer || $1 == apply ]] && [[ " $* " != *" --skip-existing "* ]]; then set -- "$1" --redo "${@:2}"; fi
  timeout 300 "$POUNCE" "$@" >out.txt 2>err.txt || status=$?
  if [[ $status != "$wanted" ]] || grep -qE 'Sanitizer|runtime error:' out.txt err.txt; then
    printf 'FAILED with %s, not %s: pounce %s\n' "$status" "$wanted" "$*"
    head -c 6000 err.txt
    exit 1
  fi
}
fixture() { "$POUNCE_FIXTURE" "$@" >/dev/null; }
text() { printf '%s\n' "${@:2}" >"$1"; }

fixture head -o head --triangles 1500 --texture 96 --target-size 64
fixture channels -o channels
fixture splats -o splats/scene.ply --count 6000 --broken 3 --target-size 64 --sh-degree 1
source=head/head_src.glb target=head/head_same.glb
text tiles.obj 'v 0 0 0' 'v 2 0 0' 'v 2 1 0' 'v 0 1 0' 'vt 0 0' 'vt 2 0' 'vt 2 1' 'vt 0 1' 'f 1/1 2/2 3/3 4/4'
text plane.obj 'mtllib plane.mtl' 'usemtl skin' 'v 0 0 0' 'v 2 0 0' 'v 2 1 0' 'v 0 1 0' 'vt 0 0' 'vt 1 0' \
  'vt 1 1' 'vt 0 1' 'o one' 'f 1/1 2/2 3/3' 'o two' 'f 1/1 3/3 4/4'
text plane.mtl 'newmtl skin' 'map_Kd skin.ppm'
{ printf 'P6\n8 8\n255\n' && head -c 192 /dev/zero | tr '\0' 'p'; } >skin.ppm

# Meshes: the cache cold, warm, too small; threads and search; every format and depth.
job 0 transfer $source $target -o a.png --size 96 --cache cold --coverage covered.png --report report.json
job 0 transfer $source $target -o a.png --size 96 --cache cold --progress json
job 0 transfer $source $target -o b.png --size 96 --cache small --cache-limit 200KiB
job 0 transfer $source $target -o b.png --size 64 --cache small --cache-limit 200KiB
job 0 transfer $source $target -o c.png --size 96 --threads 7 --max-distance 50% --max-angle 60 --padding 3
job 0 transfer $source $target -o d.jpg --size 70x50 --no-cache
job 0 transfer $source $target -o e.png --depth u16 --size 64 --no-cache
job 0 transfer $source $target -o f.exr --depth half --size 64 --no-cache
job 0 transfer $source $target -o g.tif --depth float --size 64 --no-cache
job 0 transfer $source $target -o g.tx --size 90x70 --no-cache
job 0 transfer $source $target -o g.exr --size 90x70 --mipmap --tile-size 32 --exr-compression piz --drop-alpha --no-cache
job 0 transfer $source $target -o g.tif --size 90x70 --tile-size 16 --onto g.tx --no-cache
job 0 transfer $source $target -o h.exr --source-texture baseColor=f.exr --size 64 --no-cache
job 0 transfer $source $target -o i.tif --source-texture baseColor=g.tif --size 64 --no-cache
job 0 transfer $source $target -o i.png --source-texture baseColor=e.png --filter sharp --size 90 --no-cache
job 0 transfer $source $target -o i.png --size 6 --cache cold --threads 3 # a level in place of the image
job 0 transfer $source $target -o j.png --plan
job 0 transfer $source $target -o j.exr --output-colorspace acescg --size 64 --no-cache
job 0 transfer $source $target -o j.png --source-texture baseColor=j.exr --output-colorspace display-p3 --size 64 --no-cache
job 0 transfer $source $target -o j.jpg --source-texture baseColor=j.png --size 64 --no-cache
job 0 transfer $source $target -o j.exr --source-texture baseColor=j.jpg --size 64 --no-cache
cat >config.ocio <<'CONFIG'
ocio_profile_version: 2
search_path: .
roles: {default: ap0, aces_interchange: ap0}
file_rules: [!<Rule> {name: Default, colorspace: default}]
displays: {d: [!<View> {name: v, colorspace: ap0}]}
colorspaces:
  - !<ColorSpace> {name: ap0}
  - !<ColorSpace> {name: film, to_scene_reference: !<BuiltinTransform> {style: "ACEScct_to_ACES2065-1"}}
CONFIG
job 0 transfer $source $target -o j.exr --ocio config.ocio --source-colorspace film --output-colorspace acescg --size 64 --no-cache
job 0 transfer $source $target -o j.png --ocio config.ocio --output-colorspace film --method gaussian --size 64 --no-cache
job 3 transfer $source $target -o j.png --ocio plane.obj --output-colorspace film
# Normal maps, and maps of the shape.
job 0 transfer $source $target -o 'y_<CHANNEL>.exr' --bake normal,height,position --size 64 --no-cache
job 0 transfer $source $target -o z.png --bake normal --output-normal-y down --size 64 --no-cache
job 0 transfer $source $target -o z2.png --source-texture normal=z.png --channels normal --normal-y down --no-cache
job 0 transfer $source $target -o z.glb --source-texture normal=z2.png --size 64 --no-cache
# Colours of vertices.
awk '/^v /{print $0, NR % 3 / 2, NR % 5 / 4, NR % 2; next} {print}' plane.obj >coloured.obj
job 0 transfer coloured.obj $target -o 'x_<CHANNEL>.exr' --bake vertexColor --channels baseColor --size 64 --no-cache
job 0 transfer coloured.obj plane.obj -o x.png --method gaussian --size 64
job 0 gaussians coloured.obj -o x.spz
# Models, channels, texture sets, selection, painting over, several targets.
job 0 transfer $source $target -o k.glb --size 64
job 0 transfer $source $target -o l.gltf --size 64
job 0 transfer channels/channels_src.glb channels/channels_target.glb -o 'm_<CHANNEL>.png' --channels all --size 64
job 0 transfer plane.obj tiles.obj -o 'n.<UDIM>.tif' --size 70
job 0 transfer tiles.obj plane.obj -o o.png --source-texture 'baseColor=n.<UDIM>.tif' --size 64
job 0 transfer plane.obj plane.obj -o p.png --source-mesh one --target-material 'sk*' --source-axes x,y,z
job 0 transfer $source $target -o q.png --onto a.png --mask covered.png
job 0 transfer $source $target -o hit.png --size 70 --map hit.exr --source-texture baseColor=g.tif
job 0 apply hit.exr --source-texture baseColor=g.tif -o applied.png --no-cache --threads 3
job 0 apply hit.exr --source-texture gloss=g.tif -o applied.tif --cache cold --skip-existing
job 0 transfer tiles.obj tiles.obj -o 'hit.<UDIM>.png' --size 40 --map 'hit.<UDIM>.exr' --source-texture 'baseColor=n.<UDIM>.tif'
job 0 apply 'hit.<UDIM>.exr' --source-texture 'baseColor=n.<UDIM>.tif' -o 'applied.<UDIM>.png' --onto 'hit.<UDIM>.png' --no-cache
head -c 9000 hit.exr >cut.exr
job 3 apply cut.exr --source-texture baseColor=g.tif -o applied.png --no-cache
job 0 transfer $source $target head/head_other.glb -o 'r_<TARGET>.png' --size 64
job 0 transfer $source $target -o a.png --size 96 --skip-existing
# A format that must be allowed, a file name for one channel, maps of a set by one tile's name, factors of one kind,
# alpha in a model, scans at map coordinates, targets that do not fit.
{ printf '\0\0\2\0\0\0\0\0\0\0\0\0\10\0\10\0\30\40' && head -c 192 /dev/zero | tr '\0' 'q'; } >skin.tga
job 3 transfer plane.obj $target -o x.png --source-texture baseColor=skin.tga --size 64
job 0 transfer plane.obj $target -o x.png --source-texture baseColor=skin.tga --allow-format tga --size 64 --no-cache
job 0 transfer $source $target -o 'y_<CHANNEL>.png' --bake normal,height --output-for 'height=y_<CHANNEL>.exr' --size 64 --no-cache
job 0 transfer tiles.obj plane.obj -o o.png --source-texture baseColor=n.1001.tif --size 64 --no-cache
job 0 transfer $source $target -o q.png --factors textures --size 64 --no-cache
job 0 transfer splats/scene.ply splats/scene_target.glb -o q.glb --alpha --size 64 --no-cache
awk '/^v /{printf "v %.4f %.4f %s\n", $2 + 448250, $3 + 5411900, $4; next} {print}' plane.obj >map.obj
job 0 transfer map.obj map.obj -o q.png --size 64 --no-cache
awk '/^v /{printf "v %s %s %s\n", $2 * 100, $3 * 100, $4 * 100; next} {print}' plane.obj >large.obj
job 0 transfer plane.obj large.obj -o q.png --size 64 --no-cache
# Splats; the other commands.
job 0 transfer splats/scene.ply splats/scene_target.glb -o s.png --size 64 --cache cold
job 0 transfer splats/scene.ply splats/scene_target.glb -o t.exr --size 64 --cache cold --threads 3
job 0 transfer splats/scene.ply splats/scene_target.glb -o w.png --size 64 --cache cold --rays 3 --alpha
job 0 transfer splats/scene.ply splats/scene_target.glb -o around.png --size 64 --cache cold --look around --views 7 --threads 3
job 0 transfer splats/scene.ply splats/scene_target.glb -o 'around_<CHANNEL>.exr' --size 96 --cache cold --look around --views 7 --alpha --channels baseColor,confidence,distance
job 0 transfer splats/scene.ply splats/scene_target.glb -o 't_<CHANNEL>.tif' --size 64 --channels baseColor,confidence,distance
job 0 transfer splats/scene.ply $target -o w.png --size 64 --source-axes=-y,z,-x --min-confidence 0
job 0 gaussians $source -o u.ply
job 0 gaussians $source -o u.spz --sigma 0.25 --sharpen 1
job 0 gaussians splats/scene.ply -o u.glb --count 1000 --min-opacity 0.1
job 0 gaussians u.glb -o u.ply --box -9,-9,-9,9,9,9
job 3 gaussians splats/scene.ply -o u.ply --box 50,50,50,60,60,60
job 0 proxy splats/scene.ply -o proxy.glb --cells 48 --triangles 1000 --size 256
job 0 transfer splats/scene.ply proxy.glb -o proxy.png --size 128 --look around
fixture splats --points -o cloud.ply --count 4000 --target-size 64
job 0 transfer cloud.ply cloud_target.glb -o cloud.png --size 128
job 0 proxy cloud.ply -o proxy.glb --cells 32 --triangles 500
job 0 mesh splats/scene.ply -o mesh.glb --cells 32 --triangles 500 --size 128 --views 6 --look around
job 0 mesh $source -o lod.glb --triangles 200 --size 128
job 0 mesh $source -o lod.glb --triangles 200 --size 128 --udims 12
job 0 mesh $source -o lod.glb --triangles 200 --size 128 --keep-uvs
job 0 mesh $source -o lod.glb --detail 1% --size 128 --keep-uvs
job 0 proxy splats/scene.ply -o room.glb --cells 32 --triangles 500 --inside middle
job 0 maps $target -o 'v_<CHANNEL>.exr' --size 70
for file in $source plane.obj splats/scene.ply a.png; do job 0 inspect "$file"; done
job 0 compare a.png c.png
job 0 cache verify --cache cold
job 0 cache prune --cache cold --to 4096
# What must fail, and how.
job 2 transfer $source $target -o a.png --size 0
job 5 transfer absent.glb $target -o a.png
job 4 transfer $source $target -o a.png --memory 1MiB
job 5 transfer $source $target -o skin.ppm/out.png --size 64
head -c 3000 $source >cut.glb
job 3 transfer cut.glb $target -o a.png

# The odd files, as sources and as targets: none may make a sanitizer speak, whatever pounce thinks of them.
any_status() {
  local status=0
  # libpng leaves a damaged file by longjmp, over the head of a string of OpenImageIO's: not ours to free.
  local -x ASAN_OPTIONS=$ASAN_OPTIONS:detect_leaks=0
  timeout 300 "$POUNCE" "$@" >out.txt 2>err.txt || status=$?
  jobs=$((jobs + 1))
  if ((status >= 99)) || grep -qE 'Sanitizer|runtime error:' out.txt err.txt; then
    printf 'FAILED with %s: pounce %s\n' "$status" "$*"
    head -c 6000 err.txt
    exit 1
  fi
}
if [[ ${1-short} == full ]]; then
  fixture odd -o odd
  for file in odd/*; do
    any_status inspect "$file"
    any_status transfer "$file" $target -o odd.png --size 64 --no-cache
    any_status transfer $source "$file" -o odd.png --size 64 --no-cache
    any_status transfer $source "$file" -o odd.glb --size 64 --no-cache
  done
fi
echo "sanitize: $jobs jobs, no report"
