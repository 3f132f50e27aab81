# SPDX-License-Identifier: Apache-2.0
# Scratch files are compressed where their limit would be too little for them as they are, and only there: the same image.
source "$(dirname "$0")/support.sh"
"$POUNCE_FIXTURE" plane -o p.obj --triangles 20000 --texture 512 >"$out"
number() { tr -d ' \n' <"$1" | sed -nE "s/.*$2.*/\1/p"; }
peak() { number "$1" '"temp_peak":([0-9]+)'; }
job=(transfer p.obj p.obj -o o.png --size 512 --no-cache)
expect 0 "${job[@]}" --report plain.json
mv o.png plain.png
most=$(number plain.json '"disk_most":\{"scratch":([0-9]+)')
expect 0 "${job[@]}" --max-temp $((most - 1)) --report small.json
err_has 'scratch files may need'
cmp o.png plain.png || fail 'other bytes'
(($(peak small.json) * 4 < $(peak plain.json) * 3)) || fail "scratch of $(peak small.json), $(peak plain.json) as it is"
# With a limit that does for all, and in little memory.
expect 0 "${job[@]}" --max-temp "$most" --report exact.json
(($(peak exact.json) == $(peak plain.json))) || fail 'compressed, though there is room'
expect 0 "${job[@]}" --memory 24MiB --report memory.json
cmp o.png plain.png || fail 'other bytes in little memory'
# Other pieces have other records: a little more or less.
(($(peak memory.json) * 4 > $(peak plain.json) * 3)) || fail 'compressed in little memory, which has room for 32 MiB'
# Beyond these 32 MiB it is compressed where the memory's share of eight is no more.
large=(transfer p.obj p.obj -o o.png --size 4096 --no-cache)
expect 0 "${large[@]}" --report large.json
mv o.png large.png
expect 0 "${large[@]}" --memory 64MiB --report memory.json
cmp o.png large.png || fail 'other bytes where some scratch is compressed'
(($(peak large.json) > 48 << 20 && $(peak memory.json) < $(peak large.json))) ||
  fail "not compressed beyond 32 MiB: $(peak memory.json), $(peak large.json) as it is"
# What a cache keeps is compressed in any case.
expect 0 transfer p.obj p.obj -o o.png --size 512 --report kept.json
(($(number kept.json '"target_store":([0-9]+)') * 4 < $(number plain.json '"target_store":([0-9]+)') * 3)) || fail 'a large cache'
(ulimit -f $((most / 1024 - 8)) && expect 0 "${job[@]}" --report files.json) || exit 1
(($(peak files.json) * 4 < $(peak plain.json) * 3)) || fail 'not compressed where files may not be that large'
