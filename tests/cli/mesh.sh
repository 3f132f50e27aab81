# SPDX-License-Identifier: Apache-2.0
# mesh makes a textured model in one go: of a scene what proxy and transfer make one after the other, byte for byte; of
# a heavy model a lighter one that still looks like it, with its shape in a normal map.
source "$(dirname "$0")/support.sh"
number() { tr -d ' \n' <"$1" | sed -nE "s/.*$2.*/\1/p"; }
psnr() { "$POUNCE" compare "$@" | sed -nE 's/^psnr +([0-9]+).*/\1/p'; }
misused 'SOURCE is required' mesh
misused 'written as .glb or .gltf' mesh s.ply -o s.png
misused 'remove <TARGET>' mesh s.ply -o '<TARGET>.glb'
misused '--triangles' mesh s.ply -o s.glb --triangles 9
"$POUNCE_FIXTURE" splats -o s.ply --shape sphere --count 40000 --floaters 0 --target-size 256 >"$out"
shape=(--triangles 3000 --cells 64 --size 512)
expect 0 mesh s.ply -o s.glb "${shape[@]}" --report s.json
err_has 'triangles in'
err_has 'wrote s.glb'
[[ $(number s.json '"command":"([a-z]+)"') == mesh && $(number s.json '"outputs":\["(s.glb)"') == s.glb ]] || fail 'the report'
[[ $(number s.json '"inputs":\["(s.ply)"\]') == s.ply ]] || fail 'the report names what nobody knows'
! grep -q /proc/ s.json "$err" || fail 'the mesh in between is named'
# In two steps the same bytes; with any threads, memory and cache, too.
expect 0 proxy s.ply -o p.glb "${shape[@]}"
expect 0 transfer s.ply p.glb -o two.glb --size 512
cmp s.glb two.glb || fail 'proxy and transfer make another model'
for more in '--no-cache --threads 4' '--no-cache --memory 96MiB' ''; do
  expect 0 mesh s.ply -o again.glb "${shape[@]}" $more
  cmp s.glb again.glb || fail "other bytes with: $more"
done
# A report is a job file; a job that is done is left alone.
expect 0 mesh --job s.json -o again.glb
cmp s.glb again.glb || fail 'the report makes another model'
"$program" mesh s.ply -o s.glb "${shape[@]}" >"$out" 2>"$err" || fail 'the same job again'
err_has 'skipped 1 file'
# The right colours from the right places.
expect 0 transfer s.glb s_target.glb -o back.png --size 256
((db = $(psnr back.png s_target.truth.png), db >= 36)) || fail "the sphere is $db dB from the right one"
# A model: a tenth of its triangles, in UVs of their own, and back from there.
"$POUNCE_FIXTURE" head -o h --triangles 20000 --texture 512 --target-size 512 >"$out"
expect 0 mesh h/head_src.glb -o lod.glb --triangles 2000 --size 1024
expect 0 inspect lod.glb --json
triangles=$(number "$out" '"triangles":([0-9]+)')
((triangles > 1500 && triangles <= 2000)) || fail "$triangles triangles of 2000"
grep -q '"normalTexture"' lod.glb || fail 'no normal map'
expect 0 transfer lod.glb h/head_same.glb -o back.png --size 512
expect 0 transfer h/head_src.glb h/head_same.glb -o direct.png --size 512
((db = $(psnr back.png direct.png), db >= 40)) || fail "over the light model the head is $db dB from what the heavy one gives"
expect 0 proxy h/head_src.glb -o same.glb --triangles 2000 --size 1024
cmp lod.glb same.glb || fail 'proxy makes another model of a model'
# The normal map has what the triangles lost: normals of the heavy model, seen over the light one, are those it has.
expect 0 transfer h/head_src.glb h/head_same.glb -o 'fine_<CHANNEL>.png' --bake normal --size 512 --depth u8
expect 0 transfer lod.glb h/head_same.glb -o 'light_<CHANNEL>.png' --bake normal --size 512 --depth u8
((db = $(psnr light_normal.png fine_normal.png), db >= 38)) || fail "normals are $db dB from the heavy model's"
# Without a texture it is a source of shape.
expect 0 mesh s_target.glb -o shape.glb --triangles 500 --size 256
grep -q '"normalTexture"' shape.glb || fail 'no normal map of a mesh without textures'
! grep -q '"baseColorTexture"' shape.glb || fail 'a texture from nowhere'
# By how far it may be off instead of a number: finer, more.
triangles_of() {
  expect 0 inspect "$1" --json
  number "$out" '"triangles":([0-9]+)'
}
expect 0 proxy h/head_src.glb -o coarse.glb --detail 1% --size 256
expect 0 proxy h/head_src.glb -o fine.glb --detail 0.1% --size 256
(($(triangles_of coarse.glb) * 2 < $(triangles_of fine.glb) && $(triangles_of fine.glb) < 20000)) || fail '--detail'
misused '--detail' proxy h/head_src.glb -o n.glb --detail 1% --triangles 500
misused '--close applies only to splat scenes' mesh h/head_src.glb -o n.glb --close
expect 0 proxy s.ply -o closed.glb "${shape[@]}" --close
misused 'remove <CHANNEL>' mesh s.ply -o 'n<CHANNEL>.glb'
misused '<X>' mesh s.ply -o 'n<X>.glb'
# What cannot be made leaves nothing.
printf 'v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n' >line.obj
expect 3 mesh line.obj -o n.glb
err_has 'degenerate'
printf 'v 0 0 0\nv 1e20 0 0\nv 0 1e20 0\nf 1 2 3\n' >vast.obj
expect 3 mesh vast.obj -o n.glb
err_has 'scale it'
misused '--look applies only to splat scenes' mesh h/head_src.glb -o n.glb --look around
misused '--cells applies only to splat scenes' mesh h/head_src.glb -o n.glb --cells 99
misused '--filter applies only to meshes' mesh s.ply -o n.glb --filter tent
expect 2 mesh h/head_src.glb -o h/head_src.glb
expect 4 mesh s.ply -o n.glb --memory 1MiB
expect 5 mesh missing.glb -o n.glb
# A texture that is not there is said before the mesh is made for it.
quad bare absent.png
expect 5 mesh bare.obj -o n.glb -v
err_has 'absent.png'
err_lacks 'mesh:'
[[ ! -e n.glb ]] || fail 'a file of a job that failed'
[[ -z $(find . -name '.*' -type f) ]] || fail 'a hidden file is left'
