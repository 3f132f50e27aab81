# SPDX-License-Identifier: Apache-2.0
# A coloured point cloud is a source like a splat scene: what it shows, whatever it is given in and whoever reads it.
source "$(dirname "$0")/support.sh"
"$POUNCE_FIXTURE" splats --points -o c.ply --shape sphere --count 20000 --noise 0.2 --target-size 256 >"$out"
expect 0 transfer c.ply c_target.glb -o a.png --size 256 --no-cache --threads 1 --report a.json
psnr=$("$POUNCE" compare a.png c_target.truth.png | sed -nE 's/^psnr +([0-9]+).*/\1/p')
((psnr >= 35)) || fail "the cloud's picture is $psnr dB from the right one"
number() { tr -d ' \n' <"$1" | sed -nE "s/.*$2.*/\1/p"; }
texels=$(number a.json '"target":\{"texels":([0-9]+)') covered=$(number a.json '"target":[^}]*"covered":([0-9]+)')
((covered * 1000 >= texels * 998)) || fail "$covered of $texels texels have a colour"
# The same bytes: threads, memory, a cache that is new or not.
for more in '--no-cache --threads 4' '--no-cache --memory 24MiB' '' ''; do
  expect 0 transfer c.ply c_target.glb -o b.png --size 256 $more
  cmp a.png b.png || fail "other bytes with: $more"
done
expect 0 inspect c.ply
out_has 'point cloud PLY'
out_has 'points     20000, 20000 usable'
! grep -q 'size\|opacity\|model' "$out" || fail 'of points, sizes'
expect 0 inspect c.ply --json
out_has '"points": 20000'
# A grid of text, by hand: columns of red to the left, of blue to the right, with normals; a lattice of 1 over 40 by 40.
awk 'BEGIN {
  print "ply\nformat ascii 1.0\nelement vertex 1681\nproperty float x\nproperty float y\nproperty float z"
  print "property float nx\nproperty float ny\nproperty float nz\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nend_header"
  for (y = 0; y <= 40; ++y) for (x = 0; x <= 40; ++x) print x, y, "0 0 0 1", x < 20 ? "255 0 0" : "0 0 255"
}' >grid.ply
cat >plate.obj <<'END'
v 0 0 0
v 40 0 0
v 40 40 0
v 0 40 0
vt 0 0
vt 1 0
vt 1 1
vt 0 1
f 1/1 2/2 3/3 4/4
END
expect 0 transfer grid.ply plate.obj -o grid.png --size 64 --no-cache --report g.json
[[ $(number g.json '"target":[^}]*"empty":([0-9]+)') == 0 ]] || fail 'holes in a plate'
# Two columns of pixels where they meet are neither.
{
  printf 'P6\n64 64\n255\n'
  for ((y = 0; y < 64; ++y)); do
    for ((x = 0; x < 64; ++x)); do ((x < 32)) && printf '\xff\0\0' || printf '\0\0\xff'; done
  done
} >right.ppm
psnr=$("$POUNCE" compare grid.png right.ppm | sed -nE 's/^psnr +([0-9]+).*/\1/p')
((psnr >= 18)) || fail "the plate is $psnr dB from red and blue"
# At map coordinates the same picture; --box is in these.
moved() { awk -v v="$2" '/^[-0-9]/ || $1 == v { k = $1 == v ? 2 : 1; $k += 448256; $(k + 1) += 5411904; $(k + 2) += 128 } 1' OFMT=%.3f CONVFMT=%.3f "$1"; }
moved grid.ply - | sed 's/float \([xyz]\)$/double \1/' >map.ply
moved plate.obj v >map.obj
expect 0 transfer map.ply map.obj -o map.png --size 64 --no-cache
err_has 'map.ply: far from the origin for its size'
expect 0 compare grid.png map.png --min-psnr 60
expect 0 transfer map.ply map.obj -o left.png --size 64 --no-cache --box 448255,5411903,127,448272,5411945,129 --report l.json
empty=$(number l.json '"target":[^}]*"empty":([0-9]+)')
((empty > 2000 && empty < 2600)) || fail "of a plate of which 16 / 40 are in the box, $empty of 4096 texels are empty"
expect 0 inspect map.ply
out_has 'box        448256 5411904 128  to  448296 5411944 128'
# What a cloud does not have.
expect 2 transfer c.ply c_target.glb -o n.png --max-scale 0.1
err_has 'the points of a cloud have no size'
expect 3 gaussians c.ply -o n.ply
err_has 'holds no Gaussians'
sed 's/^property uchar red$/property uchar reflectance/' c.ply >grey.ply
expect 3 transfer grey.ply c_target.glb -o n.png
err_has 'a point cloud without colours (20000 points); export it with red, green and blue'
expect 3 transfer c_target.glb c.ply -o n.png
err_has 'a point cloud, but a mesh'
only_files a.json a.png b.png c.ply c_target.glb c_target.truth.png g.json grey.ply grid.ply grid.png l.json left.png map.obj map.ply map.png plate.obj right.ppm
