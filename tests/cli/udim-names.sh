# SPDX-License-Identifier: Apache-2.0
# A material that names one tile's image of a UDIM set means the set, where UVs enter several tiles and their images lie there.
source "$(dirname "$0")/support.sh"
# Two squares side by side, on UDIMs 1001 and 1002; the target has one image for both.
squares() { # NAME U-OF-THE-RIGHT-ONE: with a material
  printf 'mtllib %s.mtl\nusemtl skin\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 0\nv 2 1 0\n' "$1"
  printf 'vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvt %s 0\nvt %s 0\nvt %s 1\nvt %s 1\n' "$2" "$(($2 + 1))" "$(($2 + 1))" "$2"
  printf 'f 1/1 2/2 3/3 4/4\nf 2/5 5/6 6/7 3/8\n'
}
squares source 1 >source.obj
printf 'v 0 0 0\nv 2 0 0\nv 2 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n' >target.obj
mkdir maps
image maps/s.1001.ppm 8 8 200 100 50
image maps/s.1002.ppm 8 8 20 40 60
image maps/one.1001.ppm 8 8 200 100 50
for name in s.1001 s.1002 one.1001; do cp maps/$name.ppm .; done
cp s.1001.ppm t_u1_v1.ppm
cp s.1002.ppm t_u2_v1.ppm
cp s.1001.ppm skin_2024.ppm
mtl() { printf "newmtl skin\nmap_Kd %s\n" "$1" >source.mtl; }
run() { expect 0 transfer source.obj target.obj -o "$1" --size 16 "${@:2}"; }
plain() { ! grep -E '^pounce: ' "$err" | grep -qE 'UDIM|tile' || fail "a set is told of where none is meant"; }

expect 0 transfer source.obj target.obj -o truth.png --size 16 --source-texture 'baseColor=s.<UDIM>.ppm'
plain
expect 0 transfer source.obj target.obj -o wrong.png --size 16 --source-texture baseColor=skin_2024.ppm
plain
! same_picture truth.png wrong.png || fail 'both tiles look alike'
for name in s.1001.ppm s.1002.ppm t_u1_v1.ppm maps/s.1001.ppm 'C:\art\s.1001.ppm'; do
  mtl "$name"
  run o.png --report r.json
  err_has 'note: baseColor: '
  err_has 'since the UVs enter 2 tiles and 2 of them have an image'
  same_picture o.png truth.png || fail "$name: one tile on all"
  grep -q 'is read as one of the UDIM tiles' r.json || fail 'the report does not tell of it'
done
for name in 's.<UDIM>.ppm' 't_<UVTILE>.ppm'; do
  mtl "$name"
  run o.png
  same_picture o.png truth.png || fail "$name is not read"
done
mtl skin_2024.ppm
run o.png --source-texture baseColor=s.1002.ppm --channels baseColor
err_has 's.1002.ppm is read as one of the UDIM tiles s.<UDIM>.ppm'
same_picture o.png truth.png || fail '--source-texture: one tile on all'
expect 0 gaussians source.obj -o a.ply --source-texture baseColor=s.1001.ppm
expect 0 gaussians source.obj -o b.ply --source-texture 'baseColor=s.<UDIM>.ppm'
cmp a.ply b.ply || fail 'other Gaussians'

# Alone: shown on all, and said.
mtl one.1001.ppm
run o.png
same_picture o.png wrong.png || fail 'another picture of the only image'
err_has "warning: one.1001.ppm: its name is that of one UDIM tile, but it is used for all 2 tiles that the UVs enter because the others have no images; add them, or name the set: --source-texture 'baseColor=one.<UDIM>.ppm'"
# A number that is no tile of these UVs, and other folders' images, are nothing.
for name in skin_2024.ppm maps/one.1001.ppm; do
  mtl "$name"
  run o.png
  [[ $name == maps/* ]] || plain
  same_picture o.png wrong.png || fail "$name"
done

# UVs of one tile are what they were, whatever lies there: repeated or shifted.
squares source 0 >source.obj
mtl s.1001.ppm
run o.png
plain
same_picture o.png wrong.png || fail 'one tile: another picture'
# So is a material per tile, each with its own image.
squares source 1 | sed 's/^f 2/usemtl other\n&/' >source.obj
printf 'newmtl skin\nmap_Kd s.1001.ppm\nnewmtl other\nmap_Kd s.1002.ppm\n' >source.mtl
run o.png
plain
same_picture o.png truth.png || fail 'a material per tile'

# An image of the set that is a link to elsewhere is not read along.
squares source 1 >source.obj
mkdir secret
mv s.1002.ppm secret/
mkdir model && mv source.* s.1001.ppm model/
ln -s ../secret/s.1002.ppm model/s.1002.ppm
expect 3 transfer model/source.obj target.obj -o o2.png --size 16
err_has '--allow-external'
expect 0 transfer model/source.obj target.obj -o o2.png --size 16 --allow-external
