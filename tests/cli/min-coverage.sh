# SPDX-License-Identifier: Apache-2.0
# --min-coverage: a target that finds too little ends the job with status 1; its outputs are there.
source "$(dirname "$0")/support.sh"
make_job
# Half of this target lies beyond the source's edge, a quarter within its reach.
sed -E 's/^v 1 /v 4 /' target.obj >wide.obj
expect 1 transfer source.obj wide.obj -o low.png --min-coverage 90 --report low.json
err_has 'wide.obj: '
err_has 'less than --min-coverage'
err_has 'wrote low.png'
[[ -s low.png ]] || fail 'no output'
grep -q '"enough": false' low.json || fail 'the report does not say which target'
grep -q '"failure": null' low.json || fail 'low coverage is no error'
expect 0 transfer source.obj wide.obj -o low.png --min-coverage 20
expect 0 transfer source.obj target.obj -o o.png --min-coverage 100
# Each target is judged alone.
expect 1 transfer source.obj target.obj wide.obj -o '<TARGET>.png' --min-coverage 90 --report both.json -q
err_has 'wide.obj: '
! grep -q 'target.obj: ' "$err" || fail 'a target that has enough is named'
cp both.json "$out"
out_has '"enough": true'
out_has '"enough": false'
# What is kept is not judged.
expect 0 transfer source.obj target.obj -o o.png --min-coverage 100 --skip-existing
expect 1 transfer source.obj wide.obj -o low.png --min-coverage 90 --progress json
[[ $(tail -n 1 "$err") == '{"end":"done","exit_status":1}' ]] || fail 'the last line does not say it'
rm -rf ./*
rejected --min-coverage -1 101 much
