#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# How alike does a textured mesh look to the scene that it was made of? Both are drawn from 26 sides that no method uses,
# with 3x3 samples per pixel, before grey; `either` is the PSNR over the pixels where the one or the other is, `both` that
# over those where both are. Along normals, by default, from 48 sides, with seven more rays; beside these the nearest
# Gaussian's colour and plain compositing along the normal. PLAIN=yes: what the scene shows from 24 and from 48 sides by
# the plain form of that rule, too (tools/pounce-score/around.cpp). Then the same of the mesh that `pounce proxy` makes of
# the scene (20,000 triangles), with its texture by default.
# Usage: [SIZE=2048] [OPTIONS='--filter tent'] tools/score-capture.sh [SCENE TARGET]...     OPTIONS go to every transfer
set -euo pipefail
cd "$(dirname "$0")/.."
programs=$PWD/build/release work=$PWD/build/release/score-capture size=${SIZE:-2048}
for program in pounce pounce-score; do
  [[ -x $programs/$program ]] || { echo "build first: tools/test.sh" >&2; exit 2; }
done
if (($# % 2)); then
  echo "usage: tools/score-capture.sh [SCENE TARGET]..." >&2
  exit 2
fi
read -ra options <<<"${OPTIONS-}"
mkdir -p "$work"
cd "$work"

score() {  # score SCENE TARGET MODE: dc, or sh where the scene shows its harmonics
  local scene=$1 target=$2 way=(--sh dc) shown=() rule
  if [[ $3 == sh ]]; then way=(--sh mean) shown=(--sh); fi
  transfer() {  # transfer IMAGE OPTION...
    "$programs/pounce" transfer --redo "$scene" "$target" -o "$1" --size "$size" --no-cache -q "${way[@]}" "${options[@]}" \
      "${@:2}" 2>log || { cat log >&2; return 1; }
  }
  bake() {  # bake IMAGE OPTION...
    "$programs/pounce-score" bake "$scene" "$target" --maps 'maps.<CHANNEL>.exr' --rest normal.png -o "$@" "${shown[@]}" >log
  }
  printf '\n%s onto %s, %s\n' "$(basename "$scene")" "$(basename "$target")" "$3"
  "$programs/pounce" maps "$target" -o 'maps.<CHANNEL>.exr' --size "$size" -q --redo
  transfer normal.png --look normal
  transfer 'default.<CHANNEL>.png' --channels baseColor,confidence
  transfer views48.png --look around --views 48
  transfer rays7.png --look normal --rays 7
  for rule in nearest composite; do bake $rule.png --rule $rule; done
  local images=(normal default.baseColor views48 rays7 nearest composite)
  if [[ -n ${PLAIN-} ]]; then
    for rule in 24 48; do bake plain$rule.png --views $rule; done
    images+=(plain24 plain48)
  fi
  "$programs/pounce-score" views "$scene" "$target" "${images[@]/%/.png}" "${shown[@]}"
  # How far the default's confidence tells its wrong pixels from its right ones.
  "$programs/pounce-score" views "$scene" "$target" default.baseColor.png --confidence default.confidence.png "${shown[@]}" |
    tail -n 1
}

score_proxy() {  # score_proxy SCENE: what `pounce mesh --sh dc` makes, mesh and texture
  printf '\n%s onto its own proxy, dc\n' "$(basename "$1")"
  "$programs/pounce" proxy "$1" -o proxy.glb --size "$size" --no-cache -q
  "$programs/pounce" transfer --redo "$1" proxy.glb -o proxy.png --size "$size" --sh dc --no-cache -q
  "$programs/pounce-score" views "$1" proxy.glb proxy.png
}

if (($#)); then
  while (($#)); do
    scene=$(realpath "$1") target=$(realpath "$2")
    score "$scene" "$target" dc
    if "$programs/pounce" inspect "$scene" | grep -q 'harmonics of degree [1-9]'; then score "$scene" "$target" sh; fi
    score_proxy "$scene"
    shift 2
  done
  exit
fi

data=${POUNCE_TEST_DATA:-$programs/../../../shared/data}
while read -r mode scene target; do
  if [[ -e $data/$scene && -e $data/$target ]]; then
    score "$(realpath "$data/$scene")" "$(realpath "$data/$target")" "$mode"
  else
    echo "SKIPPED: $scene: needs test data (set POUNCE_TEST_DATA)"
  fi
done <<'END'
dc captures/angel.ply captures/angel_tsdf.obj
dc captures/narcissus.ply captures/narcissus_tsdf.obj
dc splats/playbot_lod3_converted/playbot_lod3.ply captures/playbot_lod3_tsdf.obj
sh splats/playbot_lod3_converted/playbot_lod3.ply captures/playbot_lod3_tsdf.obj
END
for scene in captures/angel.ply captures/narcissus.ply captures/kitchen.spz splats/playbot_lod3_converted/playbot_lod3.ply; do
  if [[ -e $data/$scene ]]; then score_proxy "$(realpath "$data/$scene")"; else echo "SKIPPED: $scene"; fi
done
