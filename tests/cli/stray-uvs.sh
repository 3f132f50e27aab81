# SPDX-License-Identifier: Apache-2.0
# UVs that repeat an image thousands of times, as one stray coordinate makes them do: a transfer costs what it does
# without, Gaussians of all those texels are said.
source "$(dirname "$0")/support.sh"
make_job
{ printf 'P6\n256 256\n255\n' && head -c 196608 /dev/zero; } >skin.ppm
expect 0 transfer source.obj target.obj -o plain.png --size 16 --report plain.json
cp source.obj plain.obj
sed -i 's/^vt 1 1$/vt 3569 1/' source.obj
expect 0 transfer source.obj target.obj -o o.png --size 16 --report o.json
size_of() { sed -n 's/.*"source_store": \([0-9]*\).*/\1/p' "$1"; }
(($(size_of o.json) < $(size_of plain.json) + 10000)) ||
  fail "a stray coordinate makes a source of $(size_of o.json) bytes, $(size_of plain.json) without"

# All those texels are not waited for: the job is stopped at its work, by two signals as timeout(1) sends them.
status=0
env --default-signal=INT "$POUNCE" gaussians source.obj -o o.ply --progress plain 2>"$err" &
job=$!
for wait in $(seq 600); do
  grep -q '^count' "$err" && break
  sleep 0.05
done
kill -INT $job && kill -INT $job
wait $job || status=$?
[[ $status == 130 ]] || fail "status $status"
only_files o.json o.png plain.json plain.obj plain.png skin.ppm source.mtl source.obj target.obj
err_has 'source.obj: the UVs of material "skin" repeat its image 1785 times, triangle 1 alone'
err_has '117 million Gaussians'
err_has 'repair the texture coordinates'
expect 0 gaussians plain.obj -o plain.ply
! grep -q repeat "$err" || fail 'a warning too many'
