# SPDX-License-Identifier: Apache-2.0
# A room is made into a mesh from within: its walls as the air sees them, what stands in it, and nothing beside.
source "$(dirname "$0")/support.sh"
number() { tr -d ' \n' <"$1" | sed -nE "s/.*$2.*/\1/p"; }
refused '--inside: got "1,2"' proxy s.ply -o s.glb --inside 1,2
refused '--inside' proxy s.ply -o s.glb --inside 1,2,3,4
refused '--inside' proxy s.ply -o s.glb --inside centre
# Points: green walls of 4 x 3 x 2 turned inwards, red ones a quarter farther out turned outwards, a blue cube of .8 on
# the floor, which is at z = 0.
awk '
function put(x, y, z, nx, ny, nz, c) { rows[n++] = x " " y " " z " " nx " " ny " " nz " " c }
function box(x0, y0, z0, x1, y1, z1, s, c, d,   a, b) {
  for (a = d / 2; a < x1 - x0; a += d) for (b = d / 2; b < y1 - y0; b += d) {
    put(x0 + a, y0 + b, z0, 0, 0, -s, c); put(x0 + a, y0 + b, z1, 0, 0, s, c) }
  for (a = d / 2; a < x1 - x0; a += d) for (b = d / 2; b < z1 - z0; b += d) {
    put(x0 + a, y0, z0 + b, 0, -s, 0, c); put(x0 + a, y1, z0 + b, 0, s, 0, c) }
  for (a = d / 2; a < y1 - y0; a += d) for (b = d / 2; b < z1 - z0; b += d) {
    put(x0, y0 + a, z0 + b, -s, 0, 0, c); put(x1, y0 + a, z0 + b, s, 0, 0, c) }
}
BEGIN {
  box(0, 0, 0, 4, 3, 2, -1, "0 200 0", 0.04)
  box(-0.25, -0.25, -0.25, 4.25, 3.25, 2.25, 1, "200 0 0", 0.04)
  box(2.4, 1.2, 0, 3.2, 2, 0.8, 1, "0 0 200", 0.04)
  print "ply\nformat ascii 1.0\nelement vertex " n "\nproperty float x\nproperty float y\nproperty float z"
  print "property float nx\nproperty float ny\nproperty float nz\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nend_header"
  for (i = 0; i < n; ++i) print rows[i]
}' >room.ply
expect 0 mesh room.ply -o room.glb --inside middle --cells 96 --triangles 4000 --size 512 --no-cache
expect 0 inspect room.glb --json
lo=$(number "$out" '"lo":\[([-0-9.e,]+)\]') hi=$(number "$out" '"hi":\[([-0-9.e,]+)\]')
echo "$lo,$hi" | awk -F, '{ e = 0.08; exit !($1 > -e && $2 > -e && $3 > -e && $4 < 4 + e && $5 < 3 + e && $6 < 2 + e && $1 < e && $6 > 2 - e) }' ||
  fail "the room goes from $lo to $hi"
# What its surface shows at the floor, and on top of the cube.
plate() { # NAME X0 Y0 X1 Y1 Z
  printf 'v %s %s %s\nv %s %s %s\nv %s %s %s\nv %s %s %s\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n' \
    "$2" "$3" "$6" "$4" "$3" "$6" "$4" "$5" "$6" "$2" "$5" "$6" >"$1.obj"
}
plate floor 0.2 0.2 2.2 2.8 0
plate top 2.5 1.3 3.1 1.9 0.8
for name in floor top; do expect 0 transfer room.glb $name.obj -o $name.png --size 64 --max-distance 0.15; done
image green.ppm 1 1 0 200 0
image blue.ppm 1 1 0 0 200
for pair in floor:green top:blue; do
  expect 0 transfer ${pair%:*}.obj ${pair%:*}.obj -o want.png --size 64 --redo --source-texture baseColor=${pair#*:}.ppm
  expect 0 compare ${pair%:*}.png want.png --min-psnr 25
done
# A point that is given; the same bytes with other threads and memory.
expect 0 proxy room.ply -o a.glb --inside 1,1,1 --cells 48 --triangles 1000 --no-cache --threads 1
expect 0 proxy room.ply -o b.glb --inside 1,1,1 --cells 48 --triangles 1000 --no-cache --threads 3 --memory 64MiB
cmp a.glb b.glb || fail 'other bytes with other threads and memory'
# A point beyond the room.
expect 2 proxy room.ply -o n.glb --inside 9,0,0
err_has '--inside 9,0,0: outside of room.ply'
expect 2 proxy room.ply -o n.glb --inside 1e300,0,0
[[ ! -e n.glb ]] || fail 'a file of a job that failed'
