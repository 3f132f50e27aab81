# SPDX-License-Identifier: Apache-2.0
# Distances that pile up at --max-distance are a warning that names it; a larger one ends it.
source "$(dirname "$0")/support.sh"
make_job
# A tilted target whose distances grow up to the limit.
printf 'v 0 0 0\nv 1 0 0.5\nv 1 1 0.5\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n' >tilted.obj
expect 0 transfer source.obj tilted.obj -o o.png --max-distance 0.5 --report r.json
err_has 'farthest quarter of --max-distance'
grep -q '"distances": \[' r.json || fail 'no histogram'
expect 0 transfer source.obj tilted.obj -o o.png --max-distance 100%
! grep -q 'farthest quarter' "$err" || fail 'a warning where there is room'
expect 0 transfer source.obj target.obj -o o.png
! grep -q 'warning' "$err" || fail 'a warning without a reason'
