# SPDX-License-Identifier: Apache-2.0
# The report names inputs, options, and counts per target, image and channel; and what was kept.
source "$(dirname "$0")/support.sh"
make_job
has() { tr -d ' \n' <r.json | grep -qF -- "$1" || { cp r.json "$out"; fail "the report lacks: $1"; }; }
expect 0 transfer source.obj target.obj -o 'o.<UDIM>.png' --size 8 --max-angle 70 --padding 2 --report r.json
has '"inputs":["source.obj","target.obj","source.mtl","skin.ppm"]'
has '"output":"o.<UDIM>.png"'
has '"size":"8x8"'
has '"padding":"2"'
has '"max-angle":"70"'
has '"path":"o.1001.png","channel":"baseColor","material":"default","udim":1001,"width":8,"height":8,"state":"written","texels":64,"covered":64,"empty":0,"filled":0}'
has '"channels":[{"name":"baseColor","images":1,"texels":64,"covered":64,"empty":0,"filled":0}]'
has '"path":"target.obj","texels":64,"covered":64'
has '"kept":[]'
has '"nodes":[{"name":"fetch","runs":'
has '{"name":"store","runs":1,"most_waiting":1,'
[[ $(tr -d ' \n' <r.json) != *'"max-distance":'* ]] || fail 'an option that was not given'
size=$(stat -c %s o.1001.png)
has "\"outputs\":$size}"
expect 0 maps target.obj -o '<CHANNEL>.exr' --size 8 --report r.json
has '"inputs":["target.obj"]'
has '"path":"normal.exr","channel":"normal","material":"default","udim":null,"width":8,"height":8,"state":"written","texels":64,'
expect 0 gaussians source.obj -o s.ply --report r.json
has '"inputs":["source.obj","source.mtl","skin.ppm"]'
has '"outputs":["s.ply"]'
touch -d '1 hour ago' ./*.obj ./*.mtl ./*.ppm
expect 0 transfer source.obj target.obj -o 'o.<UDIM>.png' --size 8 --max-angle 70 --padding 2 --skip-existing --report r.json
has '"kept":["o.1001.png"]'
has '"skip-existing":"true"'
