# SPDX-License-Identifier: Apache-2.0
# --plan says on the standard output what would be done, and does and writes nothing.
source "$(dirname "$0")/support.sh"
make_job
expect 0 transfer source.obj target.obj -o o.png --plan --coverage mask.png
only_files skin.ppm source.mtl source.obj target.obj
[[ ! -e $XDG_CACHE_HOME ]] || fail 'the cache was written'
grep -qxE 'least memory +[0-9.]+ [KMG]?i?B \([0-9]+ bytes\)' "$out" || fail 'no least memory'
out_has 'would write   o.png'
grep -qxE 'needed for +[a-z]+ .+' "$out" || fail 'not said what needs so much'
out_has 'would write   mask.png'
expect 0 transfer source.obj target.obj -o o.png --plan --report - -q
out_has '"least":'
out_has '"o.png"'
out_has '"least_for":'
expect 5 transfer source.obj target.obj -o o.png --plan --source-texture baseColor=absent.png
err_has 'absent.png'
only_files skin.ppm source.mtl source.obj target.obj
