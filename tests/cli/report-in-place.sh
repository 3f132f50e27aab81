# SPDX-License-Identifier: Apache-2.0
# A report to a pipe, a device or a link is written into it; a rename would replace the thing itself.
source "$(dirname "$0")/support.sh"
make_job
job=(transfer source.obj target.obj -o o.png --no-cache -q)
mkfifo pipe
cat pipe >"$out" &
reader=$!
"$POUNCE" "${job[@]}" --report pipe
wait "$reader"
out_has '"covered": 256'
[[ -p pipe ]] || fail 'the pipe was replaced by a file'
: >kept.json
ln -s kept.json link.json
expect 0 "${job[@]}" --report link.json
[[ -L link.json ]] || fail 'the link was replaced by a file'
grep -qF '"covered": 256' kept.json || fail 'the report is not in the file that the link names'
if [[ -c /dev/full ]]; then
  ln -s /dev/full full.json  # a link: should this test fail, the device survives
  expect 75 "${job[@]}" --report full.json
  err_has 'No space left'
  [[ -L full.json ]] || fail 'the link was removed'
fi
