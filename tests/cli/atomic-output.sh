# SPDX-License-Identifier: Apache-2.0
# An image appears whole or not at all: after a failure and after SIGKILL the old one is untouched, and the
# same command then makes the same picture as if nothing had happened.
source "$(dirname "$0")/support.sh"
make_job
expect 0 transfer source.obj target.obj -o expected.png --size 2048 --no-cache -q
echo 'an old picture' >o.png
expect 5 transfer source.obj target.obj -o o.png --source-texture baseColor=absent.png
[[ $(cat o.png) == 'an old picture' ]] || fail 'the old picture was touched by a failure'
for pause in 0.3 0.5 0.7; do
  echo 'an old picture' >o.png
  "$POUNCE" transfer source.obj target.obj -o o.png --size 2048 -q &
  job=$!
  sleep $pause
  kill -KILL $job 2>/dev/null || true
  wait $job 2>/dev/null || true
  [[ $(cat o.png | tr -d '\0') == 'an old picture' ]] || cmp o.png expected.png ||
    fail "half a picture after SIGKILL at $pause s"
  expect 0 transfer source.obj target.obj -o o.png --size 2048 -q
  cmp o.png expected.png || fail "another picture after SIGKILL at $pause s"
done
