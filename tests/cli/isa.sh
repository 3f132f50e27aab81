# SPDX-License-Identifier: Apache-2.0
# POUNCE_ISA: the same bytes by every instruction set that this processor has, which the report names; others are
# refused before anything is made.
source "$(dirname "$0")/support.sh"
make_job
said_by() { POUNCE_ISA=$1 expect 0 transfer source.obj target.obj -o said.png --no-cache --report - -q; }
sets=(sse2)
has() { grep -qw "$1" /proc/cpuinfo; }
! has avx2 || ! has fma || sets+=(avx2)
! has avx512bw || sets+=(avx512)
for set in "${sets[@]}"; do
  said_by "$set"
  out_has "\"isa\": \"$set\","
  POUNCE_ISA=$set expect 0 transfer source.obj target.obj -o said.png --no-cache -v
  err_has "kernels  $set"
done
said_by ''
out_has "\"isa\": \"${sets[-1]}\","
rm said.png

for value in avx SSE2 neon 'sse2 ' avx9; do
  export POUNCE_ISA=$value
  for job in 'transfer source.obj target.obj -o new/o.png' 'transfer source.obj target.obj -o new/o.png --plan' \
    'maps target.obj -o new/<CHANNEL>.exr' 'gaussians source.obj -o new/o.ply' 'mesh source.obj -o new/o.glb'; do
    misused "POUNCE_ISA: got \"$value\"; this processor can run $(printf '%s, ' "${sets[@]}" | sed 's/, $//')" \
      $job -q
    [[ ! -e new ]] || fail "$job: files were made"
  done
done
if [[ ${#sets[@]} -lt 3 ]]; then POUNCE_ISA=avx512 expect 2 transfer source.obj target.obj -o o.png; fi
unset POUNCE_ISA

"$POUNCE_FIXTURE" head -o head --triangles 2000 --texture 200 --target-size 64 >/dev/null
"$POUNCE_FIXTURE" channels -o channels >/dev/null
"$POUNCE_FIXTURE" splats -o scene.ply --count 5000 --target-size 64 >/dev/null
# same NAME ARGUMENT...: each set's files, in a folder of its own, are the first one's.
same() {
  for set in "${sets[@]}"; do
    mkdir -p "$1/$set"
    (cd "$1/$set" && POUNCE_ISA=$set expect 0 "${@:2}" --no-cache -q) || exit 1
    diff -r "$1/sse2" "$1/$set" >/dev/null || fail "$1: $set and sse2 make other bytes"
  done
}
head=(transfer ../../head/head_src.glb ../../head/head_other.glb -o o.png)
scene=(transfer ../../scene.ply ../../scene_target.glb -o o.png --size 96)
same cubic "${head[@]}" --size 150
same magnified "${head[@]}" --size 500
same tent "${head[@]}" --size 300 --filter tent
same gaussian "${head[@]}" --size 200 --method gaussian
same bakes transfer ../../head/head_src.glb ../../head/head_other.glb -o '<CHANNEL>.exr' --size 150 --bake normal,height
same channels transfer ../../channels/channels_src.glb ../../channels/channels_target.glb -o '<CHANNEL>.png'
same along-normals "${scene[@]}" --look normal
same around "${scene[@]}" --look around --views 8
same rays "${scene[@]}" --look normal --rays 4
