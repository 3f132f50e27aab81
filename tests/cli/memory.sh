# SPDX-License-Identifier: Apache-2.0
# Too small a --memory is exit 4 and names the least that works; that least then works, as does --plan's.
source "$(dirname "$0")/support.sh"
make_job
expect 4 transfer source.obj target.obj -o o.png --memory 1MiB
least=$(sed -nE 's/.*needs at least ([0-9.]+ ?[KMG]?i?B), for .*/\1/p' "$err")
[[ -n $least ]] || fail 'the message does not name the least that works'
[[ ! -e o.png ]] || fail 'an image was written'
expect 0 transfer source.obj target.obj -o o.png --memory "$least"
expect 0 transfer source.obj target.obj -o p.png --memory 512MiB
cmp o.png p.png || fail 'the budget changes the picture'
expect 0 transfer source.obj target.obj -o q.png --plan
plan=$(sed -n 's/^least memory .*(\([0-9]*\) bytes)$/\1/p' "$out")
[[ $plan -gt 1048576 ]] || fail 'the plan names no least'
expect 0 transfer source.obj target.obj -o q.png --memory "$plan"
cmp o.png q.png || fail 'the budget changes the picture'
