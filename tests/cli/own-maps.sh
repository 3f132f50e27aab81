# SPDX-License-Identifier: Apache-2.0
# --source-texture NAME=PATH takes maps of the user's own, as colour or as data.
source "$(dirname "$0")/support.sh"
refused 'banana: unknown channel' transfer a.glb b.glb -o o.png --channels banana
refused 'a.glb is a model' transfer a.glb b.glb -o a.glb --source-texture mask=m.png
refused '--source-texture: got "all"' transfer a.glb b.glb -o o.png --source-texture all=m.png
refused '--source-texture: got "BaseColor", expected baseColor (names are case-sensitive)' transfer a.glb b.glb -o o.png --source-texture BaseColor=m.png
refused '--source-texture: got "a/b"' transfer a.glb b.glb -o o.png --source-texture a/b=m.png
refused '--data: got "baseColor"' transfer a.glb b.glb -o o.png --data baseColor
refused 'either --data or --color' transfer a.glb b.glb -o o.png --source-texture x=m.png --data x --color x
refused 'transfers only baseColor' transfer a.glb b.glb -o o.png --method gaussian --source-texture x=m.png --channels x
same() {
  image wanted.ppm 16 16 "${@:2}"
  expect 0 compare "$1" wanted.ppm
  grep -qiE 'infinite' "$out" || fail "$1 is not ${*:2}"
}

make_job
image lumps.ppm 4 4 10 20 30
image shine.ppm 4 4 200 100 50
run() { expect 0 transfer source.obj target.obj -o "$@" --size 16; }
run '<CHANNEL>.png' --source-texture displacement=lumps.ppm --source-texture gloss-2=shine.ppm --report r.json
err_has 'note: gloss-2: treated as data (never converted); use --color gloss-2 if it is colour'
! grep -q 'displacement:' "$err" || fail 'a name that says what it is'
grep -q '"channel": "displacement"' r.json || fail 'the report has another name'
same baseColor.png 200 100 50
same displacement.png 10 20 30
same gloss-2.png 200 100 50
# By name, in any order, alone; a map that nobody asked for is said.
run alone.png --channels displacement --source-texture displacement=lumps.ppm
same alone.png 10 20 30
run colour.png --source-texture displacement=lumps.ppm
err_has 'not transferred: displacement (lumps.ppm)'
same colour.png 200 100 50
expect 0 transfer source.obj target.obj -o '<CHANNEL>.png' --size 16 --plan --channels baseColor,displacement \
  --source-texture displacement=lumps.ppm
out_has 'displacement.png'
# Painted over its own image.
image old_displacement.ppm 16 16 1 2 3
run '<CHANNEL>.png' --channels displacement --source-texture displacement=lumps.ppm --onto 'old_<CHANNEL>.ppm'
same displacement.png 10 20 30
expect 2 transfer source.obj target.obj -o '<CHANNEL>.png' --source-texture mask=lumps.ppm --source-texture mask=shine.ppm
err_has 'two source textures for mask: lumps.ppm and shine.ppm'
# Colour becomes linear in an EXR, data does not.
for map in specular mask Spec_ular; do run "$map.exr" --channels "$map" --source-texture "$map=shine.ppm"; done
run mask-colour.exr --channels mask --source-texture mask=shine.ppm --color mask
run specular-data.exr --channels specular --source-texture specular=shine.ppm --data specular
run base.exr
identical() { # in samples; each says another job
  expect 0 compare "$1" "$2"
  grep -qi infinite "$out" || fail "$1 and $2 differ"
}
identical specular.exr base.exr
identical Spec_ular.exr base.exr
identical mask-colour.exr base.exr
identical specular-data.exr mask.exr
expect 0 compare mask.exr base.exr
! grep -qi infinite "$out" || fail "data was converted"
