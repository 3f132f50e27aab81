# SPDX-License-Identifier: Apache-2.0
# A picture that a material names elsewhere is taken from the folder of the model, and said: once for each name.
source "$(dirname "$0")/support.sh"
make_job
expect 0 transfer source.obj target.obj -o truth.png --size 16
! grep -q 'of the same name' "$err" || fail 'a note of an image in its place'
for name in 'C:\Users\joe\skin.ppm' /old/place/skin.ppm ../skin.ppm textures/skin.ppm; do
  printf 'newmtl skin\nmap_Kd %s\nmap_Ke %s\n' "$name" "$name" >source.mtl
  expect 0 transfer source.obj target.obj -o o.png --size 16 --report r.json --channels baseColor
  err_has "note: source.obj: $name is missing or not readable; skin.ppm of the same name is used instead"
  [[ $(grep -c 'of the same name' "$err") == 1 ]] || fail "$name: told twice"
  grep -q 'of the same name' r.json || fail 'the report does not tell of it'
  same_picture o.png truth.png || fail "$name: another picture"
done
expect 0 gaussians source.obj -o o.ply
err_has 'skin.ppm of the same name is used instead'
printf 'newmtl skin\nmap_Kd textures/none.ppm\n' >source.mtl
expect 5 transfer source.obj target.obj -o o.png
! grep -q 'of the same name' "$err" || fail 'a note of what is nowhere'
