#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# How well do transfers of splat scenes show the scene? Real scenes are drawn front to back from all sides and compared at
# the target's texels (pounce-score table), beside plain compositing along the normals begun 1 % and 2 % of the diagonal
# outside; generated spheres are compared with the truth, with the target on the surface and 1 % beside it. Each transfer
# is scored with three further rays, too (rays3). Three minutes.
# Usage: [OPTIONS='--max-distance 2%'] tools/score-splats.sh [SCENE TARGET]...     OPTIONS go to every transfer
set -euo pipefail
cd "$(dirname "$0")/.."
programs=$PWD/build/release work=$PWD/build/release/score-splats
for program in pounce pounce-fixture pounce-score; do
  [[ -x $programs/$program ]] || { echo "build first: tools/test.sh" >&2; exit 2; }
done
if (($# % 2)); then
  echo "usage: tools/score-splats.sh [SCENE TARGET]..." >&2
  exit 2
fi
read -ra options <<<"${OPTIONS-}"
mkdir -p "$work"

transfer() {  # transfer SCENE TARGET IMAGE SIZE OPTION...
  "$programs/pounce" transfer --redo "$1" "$2" -o "$3" --size "$4" --no-cache --quiet "${options[@]}" "${@:5}" 2>"$work/log" ||
    { cat "$work/log" >&2; return 1; }
}

# Both sides without harmonics; then, of a scene that has some, both with them, for each way to choose a colour.
real() {  # real SCENE TARGET
  local mode modes=(dc) images=()
  printf '\n%s onto %s\n' "$(basename "$1")" "$(basename "$2")"
  "$programs/pounce" maps "$2" -o "$work/maps.<CHANNEL>.exr" --size 1024 --quiet
  if "$programs/pounce" inspect "$1" | grep -q 'harmonics of degree [1-9]'; then modes=(dc normal mean); fi
  for mode in "${modes[@]}"; do
    transfer "$1" "$2" "$work/pounce-$mode.png" 1024 --sh "$mode"
    transfer "$1" "$2" "$work/rays3-$mode.png" 1024 --sh "$mode" --rays 3
    images+=("pounce-$mode.png" "rays3-$mode.png")
  done
  (cd "$work" && "$programs/pounce-score" table "$1" --maps 'maps.<CHANNEL>.exr' pounce-dc.png rays3-dc.png)
  ((${#modes[@]} == 1)) && return
  echo "the same with harmonics"
  (cd "$work" && "$programs/pounce-score" table "$1" --maps 'maps.<CHANNEL>.exr' --sh "${images[@]}" |
    sed 1d)
}

sphere() {  # sphere NAME OPTION...: seed 5, the target on the surface, outside, inside, and with three rays
  local offset rays
  printf '%-16s' "$1"
  for offset in 0 1 -1 rays3; do
    rays=0
    if [[ $offset == rays3 ]]; then rays=3 offset=0; fi
    "$programs/pounce-fixture" splats -o "$work/sphere.ply" --shape sphere --seed 5 --target-size 512 \
      --target-offset "$offset" "${@:2}" >/dev/null
    transfer "$work/sphere.ply" "$work/sphere_target.glb" "$work/sphere.png" 512 --rays "$rays"
    printf ' %7s' "$("$programs/pounce" compare "$work/sphere.png" "$work/sphere_target.truth.png" |
      grep -o '[0-9.]* dB' | head -n1 | cut -d' ' -f1)"
  done
  echo
}

if (($#)); then
  while (($#)); do
    real "$(realpath "$1")" "$(realpath "$2")"
    shift 2
  done
  exit
fi

data=${POUNCE_TEST_DATA:-$PWD/../shared/data}
while read -r scene target axes; do
  if [[ -e $data/$scene && -e $data/$target ]]; then
    if [[ -n $axes ]]; then  # as it lies at its target
      "$programs/pounce" gaussians "$data/$scene" -o "$work/turned.ply" --source-axes="$axes" --quiet
      printf '\n%s, turned by %s:' "$scene" "$axes"
      real "$work/turned.ply" "$data/$target"
    else
      real "$data/$scene" "$data/$target"
    fi
  else
    echo "SKIPPED: $scene: needs test data (set POUNCE_TEST_DATA)"
  fi
done <<'END'
splats/playbot_lod3_converted/playbot_lod3.ply meshes/playbot_proxy/playbot_proxy.glb
splats/playbot_lod0_sog meshes/playbot_proxy/playbot_proxy.glb
captures/angel.ply captures/angel_proxy.glb
captures/narcissus.ply captures/narcissus_proxy.glb
captures/kitchen.spz captures/kitchen_proxy.glb x,-y,-z
END

printf '\n%-16s %7s %7s %7s %7s\n' 'PSNR in dB' there '+1 %' '-1 %' rays3
sphere sphere
sphere 'interior 0.6' --interior 0.6
sphere 'haze 0.4' --haze 0.4
sphere 'floaters 0.1' --floaters 0.1
