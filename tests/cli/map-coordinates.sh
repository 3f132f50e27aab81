# SPDX-License-Identifier: Apache-2.0
# A scan at map coordinates (UTM) gives the same texels as it does at 0, and shows its own coordinates.
source "$(dirname "$0")/support.sh"

# Hills of 10 m x 10 m, 25 x 25 vertices, and a texture of noise.
awk -v n=24 'BEGIN {
  print "mtllib hills.mtl\nusemtl skin"
  for (j = 0; j <= n; ++j) for (i = 0; i <= n; ++i)
    printf "v %.4f %.4f %.4f\n", 10 * i / n, 10 * j / n, 0.4 * sin(i / 3) * cos(j / 4)
  for (j = 0; j <= n; ++j) for (i = 0; i <= n; ++i) printf "vt %.6f %.6f\n", i / n, j / n
  for (j = 0; j < n; ++j) for (i = 1; i <= n; ++i) {
    a = j * (n + 1) + i
    printf "f %d/%d %d/%d %d/%d %d/%d\n", a, a, a + 1, a + 1, a + n + 2, a + n + 2, a + n + 1, a + n + 1
  }
}' >local.obj
printf 'newmtl skin\nmap_Kd noise.ppm\n' >hills.mtl
awk 'BEGIN { printf "P6\n256 256\n255\n"; x = 1
  for (i = 0; i < 3 * 256 * 256; ++i) { x = (x * 16807) % 2147483647; printf "%c", x % 255 + 1 } }' >noise.ppm
awk '/^v /{printf "v %.4f %.4f %.4f\n", $2 + 448250, $3 + 5411900, $4 + 120; next} 1' local.obj >map.obj

# Onto itself every texel is its own, whatever the coordinates; so says a note.
expect 0 transfer map.obj map.obj -o map.png --size 256
err_has 'map.obj: far from the origin for its size'
same_picture map.png noise.ppm || fail 'the scan at map coordinates is not exact onto itself'
expect 0 transfer local.obj local.obj -o local.png --size 256
! grep -q 'far from the origin' "$err" || fail 'a note without a reason'
same_picture local.png map.png || fail 'the scan is another picture at 0'

# The same for a target with other axes.
awk '/^v /{printf "v %s %s %.4f\n", $2, $4, -$3; next} 1' map.obj >y_up.obj
expect 0 transfer map.obj y_up.obj -o y_up.png --size 256 --target-axes x,-z,y
same_picture y_up.png noise.ppm || fail 'a target with other axes'

# What shows coordinates shows those of the file; a float image has them in steps.
expect 0 transfer map.obj map.obj -o '<CHANNEL>.exr' --size 16 --bake position
err_has 'position: floats store these coordinates in steps of 0.5'
expect 0 maps map.obj -o 'of.<CHANNEL>.exr' --size 16
err_has 'position: floats store these coordinates in steps of 0.5'
expect 0 compare position.exr of.position.exr --min-psnr 110
expect 0 maps local.obj -o 'local.<CHANNEL>.exr' --size 16
! same_picture local.position.exr of.position.exr || fail 'positions lost their origin'
same_picture local.mask.exr of.mask.exr || fail 'the mask is another one'
awk '/^v /{printf "v %.4f %.4f %.4f\n", $2 + 500, $3, $4; next} 1' map.obj >apart.obj
expect 0 transfer map.obj apart.obj -o apart.png --size 16
err_has 'The source spans (448249.96 5411899.96 119.56'
expect 0 inspect map.obj
out_has '448250 5411900 119.6'
out_has '448260 5411910 120.'

# A file that holds single precision is stepped, which nobody can mend: a warning.
awk '/^v /{printf "v %.3f %.1f %.4f\n", int($2 * 32 + .5) / 32, int($3 * 2 + .5) / 2, $4; next} 1' map.obj >coarse.obj
expect 0 transfer coarse.obj map.obj -o coarse.png --size 256
err_has 'coarse.obj: stores positions in steps of 0.5'
! grep -q 'map.obj: stores' "$err" || fail 'the target has no steps'
# A regular grid finer than single precision has none of its steps.
awk '/^v /{printf "v %.2f %.2f %.4f\n", int($2 * 4 + .5) / 4, int($3 * 4 + .5) / 4, $4; next} 1' map.obj >grid.obj
expect 0 transfer grid.obj map.obj -o grid.png --size 256
err_lacks 'grid.obj: stores'

# Gaussians of it: floats in a PLY, a node's translation in a .glb, nothing in an SPZ.
expect 0 gaussians map.obj -o map.ply
err_has 'map.ply: positions are written in single precision, in steps of about 0.6 this far'
expect 0 inspect map.ply
out_has '448250'
expect 0 gaussians map.obj -o map.glb
! grep -q 'single precision' "$err" || fail 'a .glb keeps them'
grep -qaF '"translation":[448256' map.glb || fail 'the node has no translation'
expect 3 gaussians map.obj -o map.spz
