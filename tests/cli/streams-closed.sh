# SPDX-License-Identifier: Apache-2.0
# Closed standard streams change nothing in the files that are written: no file gets their numbers.
source "$(dirname "$0")/support.sh"
make_job
expect 0 transfer source.obj target.obj -o open.png --cache open --progress plain -v
"$POUNCE" transfer source.obj target.obj -o closed.png --cache closed --progress plain -v <&- >&- 2>&- ||
  fail "exit status $? with all streams closed"
cmp open.png closed.png || fail 'another picture with all streams closed'
# What was stored meanwhile is sound: a second run trusts it and makes the same picture.
expect 0 transfer source.obj target.obj -o again.png --cache closed
cmp open.png again.png || fail 'another picture from the store made with all streams closed'
status=0
"$POUNCE" transfer source.obj target.obj -o o.png --no-cache --report - >&- 2>"$err" || status=$?
[[ $status == 5 ]] || fail "exit status $status, not 5: a report into a closed output"
err_has 'standard output'
if [[ -w /dev/full ]]; then
  "$POUNCE" transfer source.obj target.obj -o log.png --no-cache --progress json 2>/dev/full ||
    fail "exit status $? with progress into a full disk"
  cmp open.png log.png || fail 'another picture with progress into a full disk'
fi
