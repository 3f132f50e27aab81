# SPDX-License-Identifier: Apache-2.0
# A failed job writes its report, with the error; JSON progress ends with a line that says how it ended.
source "$(dirname "$0")/support.sh"
make_job
last() { tail -n 1 "$err"; }
report_has() { grep -qF -- "$1" r.json || { cp r.json "$out"; fail "the report lacks: $1"; }; }
# failed STATUS KIND ARGUMENT...
failed() {
  local status=$1 kind=$2
  shift 2
  rm -f r.json
  expect "$status" "$@" --report r.json
  err_has 'pounce: error: '
  report_has "\"kind\": \"$kind\""
  report_has "\"exit_status\": $status"
  report_has "\"command\": \"$1\""
  report_has '"inputs": ['
  expect "$status" "$@" --progress json
  [[ $(last) == '{"end":"failed","exit_status":'$status',"kind":"'$kind'","message":"'* ]] || fail 'the last line'
  ! grep -q '^pounce: error' "$err" || fail 'text among JSON lines'
}
failed 3 input transfer source.obj broken.obj -o o.png --no-cache --source-texture baseColor=source.mtl
failed 2 usage transfer source.obj target.obj -o o.png --mask skin.ppm
failed 4 budget transfer source.obj target.obj -o o.png --memory 4096
failed 2 usage maps target.obj -o '<CHANNEL>.jpg'
failed 2 usage gaussians scene.ply -o o.ply
failed 4 budget gaussians source.obj -o o.ply --memory 4096
# What was written before is in it.
quad_without_uvs bare
failed 3 input transfer source.obj target.obj bare.obj -o '<TARGET>.png'
# On the standard output, too.
expect 2 maps target.obj -o '<CHANNEL>.jpg' --report -
out_has '"kind": "usage"'
# A report that cannot be written does not hide the error.
expect 2 maps target.obj -o '<CHANNEL>.jpg' --report /dev/full
err_has 'pounce: warning: /dev/full'
err_has 'need a float format'
expect 0 transfer source.obj target.obj -o o.png --progress json
[[ $(last) == '{"end":"done","exit_status":0}' ]] || fail 'the last line of a job that is done'
expect 0 transfer source.obj target.obj -o o.png --report r.json -q
report_has '"failure": null'
