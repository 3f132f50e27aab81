# SPDX-License-Identifier: Apache-2.0
# A file size limit (ulimit -f) is a storage error, not a death by signal, and leaves nothing behind.
source "$(dirname "$0")/support.sh"
"$POUNCE_FIXTURE" head -o head >/dev/null
mkdir result
for cache in '--no-cache' '--cache stored'; do
  status=0
  (ulimit -f 64 && exec "$POUNCE" transfer head/head_src.glb head/head_same.glb -o result/o.png --size 1024 \
    $cache) >"$out" 2>"$err" || status=$?
  [[ $status == 5 ]] || fail "exit status $status, not 5, with $cache"
  err_has 'File too large; raise the limit of file sizes (ulimit -f)'
  [[ -z $(ls -A result) ]] || fail "left behind: $(ls -A result)"
done
expect 0 transfer head/head_src.glb head/head_same.glb -o result/o.png --size 64 --cache stored
# Also where only the smaller levels do not fit; the old file stays.
head -c 786432 /dev/urandom >noise.raw # what no encoder makes smaller: no scratch file is larger than the image
{ printf 'P6\n512 512\n255\n' && cat noise.raw; } >skin.ppm
quad source skin.ppm
expect 0 transfer source.obj source.obj -o result/o.tx --no-cache
[[ $(stat -c %s result/o.tx) -gt 1000000 ]] || fail 'the noise was compressed'
echo 'an old picture' >result/o.tx
status=0
(ulimit -f 960 && exec "$POUNCE" transfer source.obj source.obj -o result/o.tx --no-cache) >"$out" 2>"$err" || status=$?
[[ $status == 5 ]] || fail "exit status $status, not 5, among the levels"
err_has 'cannot write result/o.tx: File too large'
[[ $(ls -A result | tr '\n' ' ') == 'o.png o.tx ' && $(cat result/o.tx) == 'an old picture' ]] || fail 'the old picture was touched'

# A limit that the job's files fit into does no harm, though a cache reserves more than it needs.
rm -rf stored
(ulimit -f 2048 && exec "$POUNCE" transfer head/head_src.glb head/head_same.glb -o result/p.png --size 64 --cache stored \
  --cache-limit 4GiB) >"$out" 2>"$err" || fail 'a job that fits was refused'
cmp result/o.png result/p.png || fail 'the limit changes the picture'
[[ -n $(ls stored/v3/geometry/*.pack) ]] || fail 'nothing was kept'

# What would only save a later job time is done without, and said: a limit between the source's images and the hits.
head=(transfer head/head_src.glb head/head_same.glb --size 512)
(ulimit -f 1600 && expect 0 "${head[@]}" -o result/q.png --cache few) || exit 1
err_has 'the next job will search again'
[[ -z $(ls few/v3/hits)$(ls few/v3/tmp) ]] || fail 'half a pack was kept'
expect 0 "${head[@]}" -o result/r.png --cache few
! grep -q 'will search again' "$err" || fail 'said where there is room'
cmp result/q.png result/r.png || fail 'hits that are not kept change the picture'
[[ -n $(ls few/v3/hits) ]] || fail 'hits were not kept'
