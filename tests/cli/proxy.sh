# SPDX-License-Identifier: Apache-2.0
# proxy makes a mesh with UVs of a scene, the target of a transfer of it: whole or not at all, the same for anybody.
source "$(dirname "$0")/support.sh"
number() { tr -d ' \n' <"$1" | sed -nE "s/.*$2.*/\1/p"; }
misused 'SOURCE is required' proxy
misused 'is written as .glb' proxy s.ply -o s.obj
misused '--triangles' proxy s.ply -o s.glb --triangles 9
misused '--cells' proxy s.ply -o s.glb --cells 1000
"$POUNCE_FIXTURE" splats -o s.ply --shape sphere --count 40000 --floaters 0.005 --target-size 256 >"$out"
expect 0 proxy s.ply -o s.glb --cells 64 --triangles 3000 --size 512 --threads 1 --no-cache --report s.json
err_has 'triangles in'
err_has 'wrote s.glb'
[[ $(number s.json '"command":"([a-z]+)"') == proxy && $(number s.json '"outputs":\["(s.glb)"') == s.glb ]] || fail 'the report'
expect 0 inspect s.glb --json
triangles=$(number "$out" '"triangles":([0-9]+)')
((triangles > 2500 && triangles <= 3000)) || fail "$triangles triangles of 3000"
cp "$out" own.json
# The same bytes: threads, memory, a cache that is new or not.
for more in '--no-cache --threads 4' '--no-cache --memory 96MiB' '' ''; do
  expect 0 proxy s.ply -o again.glb --cells 64 --triangles 3000 --size 512 $more
  cmp s.glb again.glb || fail "other bytes with: $more"
done
# The scene onto it: nothing is left empty, no two charts share a texel, and from the same place on it has the right colour.
expect 0 transfer s.ply s.glb -o s.png --size 512 --report t.json
texels=$(number t.json '"target":\{"texels":([0-9]+)') empty=$(number t.json '"target":[^}]*"empty":([0-9]+)')
((empty * 200 < texels)) || fail "$empty of $texels texels are empty"
((texels > 512 * 512 / 2)) || fail "$texels texels: charts fill less than half of the image"
[[ $(number t.json '"target":[^}]*"overlapping":([0-9]+)') == 0 ]] || fail 'charts overlap'
# Back from the proxy to the sphere that the fixture knows the answer for.
expect 0 transfer s.ply s.glb -o textured.glb --size 512
expect 0 transfer textured.glb s_target.glb -o back.png --size 256
psnr=$("$POUNCE" compare back.png s_target.truth.png | sed -nE 's/^psnr +([0-9]+).*/\1/p')
((psnr >= 28)) || fail "over the proxy the sphere is $psnr dB from the right one"
# Of a cloud, and of part of it.
"$POUNCE_FIXTURE" splats --points -o c.ply --shape sphere --count 40000 --noise 0.2 >"$out"
expect 0 proxy c.ply -o c.glb --cells 48 --triangles 1000
expect 0 proxy c.ply -o half.glb --cells 48 --triangles 1000 --box -2,-2,0,2,2,2
expect 0 inspect half.glb --json
begins=$(number "$out" '"lo":\[[-0-9.e]+,[-0-9.e]+,([-0-9.e]+)')
awk -v z="$begins" 'BEGIN { exit !(z != "" && z > -0.1 && z < 0.1) }' || fail "half of a sphere begins at $begins"
# What cannot be made leaves nothing.
expect 3 proxy s_target.truth.png -o n.glb
expect 4 proxy s.ply -o n.glb --memory 1MiB
err_has 'the surface of s.ply'
expect 2 proxy s.ply -o s.ply
expect 2 proxy s.ply -o n.glb --cells 32 --size 64 --gutter 64
err_has '--size 64: too small for '
[[ ! -e n.glb ]] || fail 'a file of a job that failed'
