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
# Every channel is judged, also one of another size, and one that is made alone.
image glow.ppm 8 8 9 9 9
echo 'map_Ke glow.ppm' >>source.mtl
sed -E 's/^v ([01]) ([01]) 0/v \1 \2 100/' target.obj >far.obj # finds nothing
touch -d '2020-01-01' ./*.obj ./*.mtl ./*.ppm
expect 1 transfer source.obj far.obj -o 'far.<CHANNEL>.png' --min-coverage 90
rm far.emissive.png
expect 1 transfer source.obj far.obj -o 'far.<CHANNEL>.png' --min-coverage 90 --skip-existing --report far.json
err_has 'far.obj: 0 of 64 texels covered'
err_has 'no texel found a source'
grep -q '"enough": false' far.json || fail 'enough'
expect 0 transfer source.obj far.obj -o 'far.<CHANNEL>.png' --min-coverage 90 --skip-existing
# A channel that lacks the images of its tile.
"$POUNCE_FIXTURE" plane -o p.obj --triangles 400 --uv-tiles 2 >"$out"
for udim in 1001 1002; do image base.$udim.ppm 16 16 200 100 50; done
image glow.1001.ppm 16 16 9 9 9
tiles=(--source-texture 'baseColor=base.<UDIM>.ppm' --source-texture 'emissive=glow.<UDIM>.ppm')
expect 1 transfer p.obj p.obj -o 'p.<CHANNEL>.<UDIM>.png' "${tiles[@]}" --min-coverage 90
err_has 'texels of emissive covered'
expect 0 transfer p.obj p.obj -o 'p.<CHANNEL>.<UDIM>.png' "${tiles[@]}" --min-coverage 20
expect 1 transfer source.obj wide.obj -o low.png --min-coverage 90 --progress json
[[ $(tail -n 1 "$err") == '{"end":"done","exit_status":1}' ]] || fail 'the last line does not say it'
rm -rf ./*
rejected --min-coverage -1 101 much
