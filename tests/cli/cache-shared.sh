# SPDX-License-Identifier: Apache-2.0
# Several processes, one cold cache: one makes each pack, the others wait; a killed one is replaced; --no-wait
# ends with 75; a waiter can be interrupted.
source "$(dirname "$0")/support.sh"
"$POUNCE_FIXTURE" head -o in --triangles 2000 --texture 1024 --target-size 64 >/dev/null
job() { "$POUNCE" transfer in/head_src.glb in/head_same.glb -o "$1.png" --size 256 --cache cache "${@:2}"; }
expect 0 transfer in/head_src.glb in/head_same.glb -o expected.png --size 256 --no-cache

for i in 1 2 3; do job $i --report $i.json 2>$i.log & done
# Not through job(): the shell in between would be killed, and the program go on.
"$POUNCE" transfer in/head_src.glb in/head_same.glb -o victim.png --size 256 --cache cache --progress json \
  2>victim.log & victim=$!
for _ in $(seq 500); do [[ -s victim.log ]] && break; sleep 0.01; done
kill -9 $victim 2>/dev/null || true
status=0
{ wait $victim || status=$?; } 2>/dev/null
[[ $status == 137 && -s victim.log ]] || fail "the victim was not killed at its work: status $status"
wait
decoded=0
for i in 1 2 3; do
  cmp $i.png expected.png || fail "process $i made another picture"
  decoded=$((decoded + $(sed -n 's/.*"images_decoded": \([0-9]*\).*/\1/p' $i.json)))
done
[[ $decoded -le 1 ]] || fail "the image was decoded $decoded times"

# The lock of a pack that somebody makes, held by hand. Its name is the pack's.
pack=$(ls -S cache/v3/colour/*.pack | head -n 1) # the image, not a level of it
key=$(basename "$pack" .pack)
rm "$pack"
exec 8>"cache/v3/locks/colour-$key"
echo 4711 >&8
flock -x 8
expect 75 transfer in/head_src.glb in/head_same.glb -o o.png --size 256 --cache cache --no-wait
err_has 'process 4711'
err_has "$key"
[[ ! -e o.png ]] || fail 'an image in spite of status 75'
env --default-signal=INT "$POUNCE" transfer in/head_src.glb in/head_same.glb -o o.png --size 256 --cache cache \
  --progress json 2>"$err" 8>&- & waiter=$!
for wait in $(seq 200); do grep -q 'waiting for process 4711' "$err" && break; sleep 0.05; done
err_has 'waiting for process 4711'
kill -INT $waiter
status=0
wait $waiter || status=$?
[[ $status == 130 ]] || fail "an interrupted waiter ended with $status"
# Another waits, and goes on when the lock is gone.
: >"$err"
job o --report o.json --progress json 2>"$err" 8>&- & waiter=$!
for wait in $(seq 200); do grep -q 'waiting for process 4711' "$err" && break; sleep 0.05; done
exec 8>&-
wait $waiter || fail 'the waiter did not go on'
cmp o.png expected.png || fail 'the waiter made another picture'
grep -q '"name": "wait"' o.json || fail 'the report does not tell of the wait'
