# SPDX-License-Identifier: Apache-2.0
# An image appears whole or not at all: after a failure and after SIGKILL the old one is untouched, and the
# same command then makes the same picture as if nothing had happened.
source "$(dirname "$0")/support.sh"
make_job
expect 0 transfer source.obj target.obj -o expected.png --size 4096 --no-cache -q
echo 'an old picture' >o.png
expect 5 transfer source.obj target.obj -o o.png --source-texture baseColor=absent.png
[[ $(cat o.png) == 'an old picture' ]] || fail 'the old picture was touched by a failure'
for fraction in 0 0.3 0.6 0.77; do
  echo 'an old picture' >o.png
  kill_job $fraction transfer source.obj target.obj -o o.png --size 4096
  [[ $(cat o.png | tr -d '\0') == 'an old picture' ]] || cmp o.png expected.png ||
    fail "half a picture after SIGKILL at $fraction"
  expect 0 transfer source.obj target.obj -o o.png --size 4096 -q
  cmp o.png expected.png || fail "another picture after SIGKILL at $fraction"
done
((kills >= 3)) || fail "only $kills of 4 kills met a job at work"
