# SPDX-License-Identifier: Apache-2.0
# --progress: JSON lines for programs, plain lines off a terminal, nothing with none and -q.
source "$(dirname "$0")/support.sh"
make_job
job=(transfer source.obj target.obj --size 512)
expect 0 "${job[@]}" -o o.png --progress json
silent "$out"
[[ -s $err ]] || fail 'no progress'
grep -vqE '^\{"(stage|warning|end)":.*\}$' "$err" && fail 'a line that is no JSON object'
sed -nE 's/.*"fraction":([0-9.e-]+).*/\1/p' "$err" | sort -g -c || fail 'the fraction falls'
expect 0 "${job[@]}" -o p.png --progress plain
grep -qE '^[a-z]+: +[0-9]+ %' "$err" || fail 'no plain lines'
grep -q $'\r' "$err" && fail 'a bar off a terminal'
expect 0 "${job[@]}" -o q.png
grep -q $'\r' "$err" && fail 'a bar off a terminal'
expect 0 "${job[@]}" -o r.png --progress none
grep -qE '^[a-z]+: +[0-9]+ %' "$err" && fail 'progress in spite of none'
err_has 'wrote r.png'
expect 0 "${job[@]}" -o s.png -q
silent "$err"
expect 0 "${job[@]}" -o t.png -v
for word in 'stage ' 'memory ' 'tiles ' 'cpu s'; do err_has "$word"; done
expect 0 "${job[@]}" -o u.png --progress openjd
grep -qE '^openjd_progress: (100|[0-9]{1,2})\.[0-9]$' "$out" || fail 'no progress for openjd'
grep -vqE '^openjd_(progress|status): ' "$out" && fail 'a line that is not of openjd'
expect 5 transfer source.obj nothing.obj -o v.png --progress openjd
grep -q '^openjd_fail: ' "$out" || fail 'openjd is not told why'
