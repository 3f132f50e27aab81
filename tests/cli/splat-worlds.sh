# SPDX-License-Identifier: Apache-2.0
# Generated scenes against their truth: what hides, floats or veils does not show, with the target on the surface or 1 % of
# its diagonal beside it.
source "$(dirname "$0")/support.sh"
scene() { # scene BOUND OFFSET OPTION...
  "$POUNCE_FIXTURE" splats -o s.ply --shape sphere --seed 5 --target-size 512 --target-offset "$2" "${@:3}" >/dev/null
  expect 0 transfer s.ply s_target.glb -o s.png --size 512 --no-cache
  expect 0 compare s.png s_target.truth.png --min-psnr "$1"
}
for offset in 0 1 -1; do
  scene 39.5 $offset
  scene 36 $offset --interior 0.6
  scene 33.5 $offset --haze 0.4
  scene 39 $offset --floaters 0.1
  scene 34 $offset --interior 0.35 --floaters 0.1 --haze 0.1 --noise 1
done
