# SPDX-License-Identifier: Apache-2.0
# A splat scene under a small --memory: the same bytes, and few batches, since of each block of Gaussians only what the texels may meet is
# kept.
source "$(dirname "$0")/support.sh"
"$POUNCE_FIXTURE" splats -o scene.ply --count 150000 --target-size 256 >/dev/null
runs() { tr -d ' \n' <r.json | grep -o "\"name\":\"$1\",\"runs\":[0-9]*" | grep -o '[0-9]*$'; }
for size in 256 512; do
  job=(transfer scene.ply scene_target.glb --size $size --no-cache --threads 1 --report r.json)
  expect 0 "${job[@]}" -o ample.png --memory 1GiB
  expect 0 "${job[@]}" -o small.png --memory 16MiB
  cmp ample.png small.png || fail 'memory shows in the bytes'
  # A batch of 16 MiB is a block or so: 51 of whole blocks a piece, in two passes.
  pieces=$(runs blend) batches=$(runs hit)
  ((batches <= 30 * pieces)) || fail "$batches batches for $pieces pieces"
done
((pieces > 8)) || fail "not in pieces: $pieces"
