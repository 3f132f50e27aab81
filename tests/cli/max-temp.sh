# SPDX-License-Identifier: Apache-2.0
# --max-temp: what scratch files may take. A job that comes to need more ends with 5 and leaves nothing; the plan says it before.
source "$(dirname "$0")/support.sh"
"$POUNCE_FIXTURE" splats -o s.ply --count 20000 --target-size 64 >"$out"
most=$(stat -c %s s.ply)
job=(transfer s.ply s_target.glb -o s.png --size 64 --no-cache)
refused() { # WORDS ARGUMENT...
  local words=$1
  shift
  expect 5 "$@"
  grep -qF "$words" "$err" || fail "without: $words"
}
expect 0 "${job[@]}" --max-temp none --report r.json
peak=$(tr -d ' \n' <r.json | sed -nE 's/.*"temp_peak":([0-9]+).*/\1/p')
((peak > 200000)) || fail "a job of $peak bytes of scratch shows nothing"
mv s.png whole.png
! grep -q 'scratch files may need' "$err" || fail "a note about no limit"

# Too little: no picture, and the message has the limit, the need and the way out.
refused "scratch files would need more than 100.0 KiB (the job needs " "${job[@]}" --max-temp 100KiB
grep -qF 'raise the limit with --max-temp, or choose a folder with more space with --temp' "$err" || fail "no cure"
grep -qF 'note: scratch files may need' "$err" || fail "not said before"
[[ $(ls -A | grep -c '\.pounce\|^s.png') == 0 ]] || fail "something was left"
# What nobody uses any more does not count: half as much again as the peak is enough, and the bytes are the same.
expect 0 "${job[@]}" --max-temp $((peak * 3 / 2)) --report r.json
cmp s.png whole.png || fail "another picture"
rm s.png
expect 0 "${job[@]}" --plan --max-temp 100KiB
grep -qE '^scratch limit +100.0 KiB$' "$out" || fail "no limit in the plan"
expect 0 "${job[@]}" --plan --report r.json
limit=$(tr -d ' \n' <r.json | sed -nE 's/.*"scratch_limit":([0-9]+).*/\1/p')
free=$(df -B1 --output=avail . | tail -n 1)
((limit == 1 << 30 || (limit > free / 11 && limit < free / 9))) || fail "default $limit of $free free bytes"

# Writers and readers of packed formats use such files, too, and a cache that keeps nothing.
refused "would need more than 10.0 KiB;" gaussians s.ply -o s.spz --max-temp 10KiB
expect 0 gaussians s.ply -o s.spz
refused "would need more than 10.0 KiB" gaussians s.spz -o again.ply --max-temp 10KiB
refused "would need more than 10.0 KiB" transfer s.ply s_target.glb -o s.png --size 64 --cache-limit 10KiB --max-temp 10KiB
"$POUNCE_FIXTURE" plane -o p.obj --triangles 2000 --texture 128 >"$out"
refused "would need more than 1.0 KiB" maps p.obj -o '<CHANNEL>.exr' --size 128 --no-cache --max-temp 1KiB
expect 2 "${job[@]}" --max-temp 0
