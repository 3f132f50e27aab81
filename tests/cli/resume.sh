# SPDX-License-Identifier: Apache-2.0
# A job that is killed goes on where it was: the same command, the same bytes, nothing left beside the image. What is
# cheap to make again (a job of a second) leaves nothing at all.
skips=made
source "$(dirname "$0")/support.sh"
"$POUNCE_FIXTURE" plane -o plane.glb --triangles 2000 --texture 512 >/dev/null
left() { find . -name '.pounce-*.resume' | sort; }
# Results are kept a second after their step has begun: on a machine that is quick or busy that may be behind the
# fraction asked for.
is_ripe() { [[ -n $(left) ]]; }
# Long enough for that, however fast the machine.
for size in 5120 6656 8192 12288; do
  line=(transfer plane.glb plane.glb --size $size --filter cubic --threads 1 --cache cache --coverage m.png)
  began=${EPOCHREALTIME/./}
  expect 0 "${line[@]}" -o quiet.png
  ((${EPOCHREALTIME/./} - began < 4000000)) || break
done
mv m.png quiet.m.png
[[ -z $(left) ]] || fail "a job that ended left $(left)"

for fraction in 0.5 0.93; do
  rm -f o.png m.png
  kill_job $fraction "${line[@]}" -o o.png --redo
  [[ -n $(left) ]] || fail "nothing was kept of a job that was killed at $fraction"
  file=$(left)
  cp "$file" kept
  expect 0 "${line[@]}" -o o.png --report report.json
  err_has 'went on from an earlier run'
  cmp o.png quiet.png || fail "other bytes after a kill at $fraction"
  cmp m.png quiet.m.png || fail "another mask after a kill at $fraction"
  [[ -z $(left) ]] || fail "what was gone on with is still there: $(left)"
done
# As if it had died when its images were there and its file was not yet removed.
mv kept "$file"
expect 0 "${line[@]}" -o o.png
err_has 'skipped 2 files'
[[ -z $(left) ]] || fail "what is done is still there: $(left)"
[[ $kills == 2 ]] || fail "only $kills of 2 kills met a job at work"

# Asked to stop, it keeps what it has, too, and says how to go on.
rm -f o.png
env --default-signal=INT "$POUNCE" "${line[@]}" -o o.png --redo --progress json 2>"$err" >"$out" &
pid=$!
for wait in $(seq 400); do
  [[ -n $(left) ]] && break
  sleep 0.05
done
kill -TERM $pid
status=0
wait $pid || status=$?
[[ $status == 143 ]] || fail "status $status after SIGTERM"
err_has 'run the same command again'
[[ -n $(left) ]] || fail 'nothing was kept of a job that was stopped'

expect 0 "${line[@]}" -o o.png --plan --report plan.json
out_has 'half done     o.png: '
grep -q '"left_s"' plan.json || fail 'the report does not say what is left'

# What another job wants is not gone on with; nor is what somebody changed.
expect 0 "${line[@]}" -o p.png --padding 3
err_lacks 'went on from an earlier run'
file=$(left)
[[ -n $file ]] || fail 'another job took what was kept'
printf 'x' | dd of="$file" bs=1 seek=100000 conv=notrunc status=none
expect 0 "${line[@]}" -o o.png
cmp o.png quiet.png || fail 'a changed byte became part of the image'
[[ -z $(left) ]] || fail "a damaged pack is still there: $(left)"

# The second time there is nothing to do, but for --redo; a changed source is another job.
expect 0 "${line[@]}" -o o.png
err_has 'skipped 2 files (up to date); --redo makes them again'
expect 0 "${line[@]}" -o o.png --plan
out_has 'would skip    o.png'
before=$(stat -c %i o.png)
expect 0 "${line[@]}" -o o.png --redo
[[ $(stat -c %i o.png) != "$before" ]] || fail '--redo made nothing'
cmp o.png quiet.png || fail 'other bytes with --redo'
echo 'somebody painted this' >o.png
expect 0 "${line[@]}" -o o.png
cmp o.png quiet.png || fail 'a file that says nothing of its job was skipped'
expect 2 transfer a.glb b.glb -o o.png --redo --skip-existing
err_has '--redo'

rm -f o.png m.png
kill_job 0.5 "${line[@]}" -o o.png --redo
[[ -n $(left) ]] || fail 'nothing was kept'
file=$(left)
cp "$file" kept

# What is larger than this job may take is made again, and takes what it needs.
head -c 400000000 /dev/zero >>"$file"
expect 0 "${line[@]}" -o o.png --max-temp 300MB
err_lacks 'went on from an earlier run'
cmp o.png quiet.png || fail 'other bytes after too large a file'
[[ -z $(left) ]] || fail 'it is still there'

# What nobody goes on with is removed with what dead processes left in the cache.
rm o.png m.png
mv kept "$file"
expect 0 cache prune --cache cache
out_has 'removed 1 half-done image beside outputs'
[[ -z $(left) ]] || fail 'it is still there'
expect 0 cache prune --cache cache
! grep -q 'half-done' "$out" || fail 'removed twice'
