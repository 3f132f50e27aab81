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
failed 2 usage gaussians source.obj -o o.stl
failed 4 budget gaussians source.obj -o o.ply --memory 4096
# What was done before is in it: the second page's JPEG is larger than a file may be, its results are not.
"$POUNCE_FIXTURE" plane -o p.obj --triangles 400 --uv-tiles 2 >"$out"
{ printf 'P6\n256 256\n255\n' && head -c 196608 /dev/zero; } >noise.1001.ppm
head -c 768 /dev/urandom >block.raw # repeated: little for zstd, much for JPEG
for ((row = 0; row < 16; ++row)); do
  tail -c +$((row * 48 + 1)) block.raw | head -c 48 >row.raw
  for ((times = 0; times < 16; ++times)); do cat row.raw; done
done >rows.raw
{ printf 'P6\n256 256\n255\n' && for ((times = 0; times < 16; ++times)); do cat rows.raw; done; } >noise.1002.ppm
job=(transfer p.obj p.obj --source-texture 'baseColor=noise.<UDIM>.ppm' --report r.json)
flat() { tr -d ' \n' <r.json; }
flat_has() { [[ $(flat) == *"$1"* ]] || { cp r.json "$out"; fail "the report lacks: $1"; }; }
(ulimit -f 64 && expect 5 "${job[@]}" -o 'p.<UDIM>.jpg') || exit 1
[[ -s p.1001.jpg && ! -e p.1002.jpg ]] || fail 'the wrong images'
flat_has '"kind":"storage"'
flat_has '"outputs":["p.1001.jpg"]'
flat_has '"udims":[1001]'
flat_has '"path":"p.1001.jpg","channel":"baseColor","material":"default","udim":1001,"width":256,"height":256,"state":"written","texels":65536,"covered":65536,'
flat_has '"path":"p.1002.jpg","channel":"baseColor","material":"default","udim":1002,"width":256,"height":256,"state":"notwritten","texels":65536,"covered":65536,'
flat_has '"target":{"texels":131072,"covered":131072,'
flat_has '"name":"baseColor","images":1,"texels":131072,'
flat_has "\"outputs\":$(stat -c %s p.1001.jpg)}"
# With a bar to reach, a job that did not get that far has not reached it.
(ulimit -f 64 && expect 5 "${job[@]}" -o 'p.<UDIM>.jpg' --min-coverage 50) || exit 1
flat_has '"enough":false'
# Of a model, images are there when the model is. Its stores are in the cache, it is larger than they and its images.
"$POUNCE_FIXTURE" plane -o m.glb --triangles 6000 --texture 16 >"$out"
expect 0 transfer m.glb m.glb -o o.glb --report r.json
flat_has '"udim":null,"width":16,"height":16,"state":"written",'
rm o.glb
(ulimit -f 64 && expect 5 transfer m.glb m.glb -o o.glb --report r.json) || exit 1
flat_has '"udim":null,"width":16,"height":16,"state":"notwritten",'
flat_has '"name":"baseColor","images":0,'
flat_has '"outputs":[]'
# A target that cannot be used is found in the plan, before anything is written.
quad_without_uvs bare
failed 3 input transfer source.obj target.obj bare.obj -o '<TARGET>.png'
flat_has '"outputs":[]'
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

# Where it is the report that cannot be written, the last line says so, too.
mkdir folder
touch file
for report in /dev/full folder file/r.json; do
  status=5
  [[ $report != /dev/full ]] || status=75
  expect $status transfer source.obj target.obj -o o.png --report "$report" --progress json
  [[ $(last) == '{"end":"failed","exit_status":'$status',"kind":"storage","message":"'* ]] || fail "the last line: $report"
  ! grep -v '^{' "$err" || fail 'text among JSON lines'
  expect $status transfer source.obj target.obj -o o.png --report "$report"
  [[ $(grep -c '^pounce: ' "$err") == 1 ]] || fail 'not said once'
done
expect 2 maps target.obj -o '<CHANNEL>.jpg' --report /dev/full --progress json
[[ $(last) == '{"end":"failed","exit_status":2,'* ]] || fail 'the last line with two errors'
grep -q '^{"warning":"/dev/full' "$err" || fail 'no warning of the report'
got=0
"$POUNCE" transfer source.obj target.obj -o o.png --plan --progress json >/dev/full 2>"$err" || got=$?
[[ $got == 75 && $(last) == '{"end":"failed","exit_status":75,'* ]] || fail "a plan that cannot be written: $got"
# What was noticed until then is said before the error, unless --quiet.
rm source.mtl
expect 3 transfer source.obj target.obj -o o.png
grep -q '^pounce: warning: source.obj: material file source.mtl cannot be read' "$err" || fail 'no warnings of a failed job'
expect 3 transfer source.obj target.obj -o o.png -q
! grep -q 'warning' "$err" || fail 'warnings of a quiet job'
