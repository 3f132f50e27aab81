# SPDX-License-Identifier: Apache-2.0
# --coverage writes 255 where the source was found and 0 elsewhere; padding is not coverage.
source "$(dirname "$0")/support.sh"
make_job
# A target whose UVs fill the left half of the image and whose upper half in space has no source near.
printf 'v 0 0 0\nv 1 0 0\nv 1 2 0\nv 0 2 0\nvt 0 0\nvt 0.5 0\nvt 0.5 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n' >tall.obj
expect 0 transfer source.obj tall.obj -o o.png --coverage mask.png --size 16 --padding 2 --report -
for text in '"texels": 128' '"covered": 64' '"empty": 64'; do out_has "$text"; done
# Row 0 is the top of the image: the upper half found nothing.
expected=()
for row in $(seq 0 15); do
  for column in $(seq 0 15); do expected+=($((row >= 8 && column < 8 ? 255 : 0))); done
done
mask expected.pgm 16 16 "${expected[@]}"
expect 0 compare mask.png expected.pgm
out_has 'infinite (equal)'
