# SPDX-License-Identifier: Apache-2.0
# --ocio: colour spaces of an OpenColorIO configuration. Figures by hand: in "squared" a number's square is linear light, so
# that 200, 100, 50 are 0.6151, 0.1538, 0.0384 of it, in sRGB 205.7, 109.3, 55.2; sRGB's 200, 100, 50 are 0.5776, 0.1274,
# 0.0319, whose roots are 193.8, 91.0, 45.5. Half of the light of "squared" 200, 100, 50 is 141.4, 70.7, 35.4.
source "$(dirname "$0")/support.sh"
config() { # NAME, then its colour spaces from the standard input
  {
    printf 'ocio_profile_version: 2\nsearch_path: .\nroles: {default: raw}\nfile_rules:\n  - !<Rule> {name: Default, colorspace: default}\n'
    printf 'displays:\n  d:\n    - !<View> {name: v, colorspace: raw}\ncolorspaces:\n  - !<ColorSpace>\n    name: raw\n    isdata: true\n'
    cat
  } >"$1"
}
# same FILE R G B: every texel of it is that; a difference of one step in a channel would show.
same() {
  image wanted.ppm 16 16 "${@:2}"
  expect 0 compare "$1" wanted.ppm
  grep -qiE 'infinite' "$out" || fail "$1 is not ${*:2}"
}

refused 'none of its colour spaces is used' transfer a.glb b.glb -o o.png --ocio c.ocio
expect 5 transfer a.glb b.glb -o o.png --ocio c.ocio --source-colorspace squared
err_has 'c.ocio: cannot open'

make_job
config c.ocio <<'CONFIG'
  - !<ColorSpace>
    name: lin_rec709
  - !<ColorSpace>
    name: squared
    aliases: [square, "a=b"]
    to_scene_reference: !<ExponentTransform> {value: 2}
  - !<ColorSpace>
    name: tinted
    to_scene_reference: !<MatrixTransform> {matrix: [1, 0, 0, 0, 0, 0.5, 0, 0, 0, 0, 0.25, 0, 0, 0, 0, 1]}
  - !<ColorSpace>
    name: srgb
    to_scene_reference: !<ExponentTransform> {value: 2.2}
  - !<ColorSpace>
    name: table
    to_scene_reference: !<FileTransform> {src: table.spi1d, interpolation: linear}
  - !<ColorSpace>
    name: lost
    to_scene_reference: !<FileTransform> {src: lost.spi1d, interpolation: linear}
CONFIG
table() { printf 'Version 1\nFrom 0 1\nLength 3\nComponents 1\n{\n0\n%s\n1\n}\n' "$1" >table.spi1d; }
table 0.25
run() { expect 0 transfer source.obj target.obj --size 16 --ocio c.ocio -o "$@"; }
ends() { expect "$1" transfer source.obj target.obj --size 16 -o no.png --ocio "${@:2}"; }
ends 2 c.ocio --source-colorspace nope
err_has 'c.ocio has no such colour space; it has raw, lin_rec709, squared, tinted, srgb, table, lost; built in are srgb'
ends 2 c.ocio --source-colorspace raw
err_has 'declares this space as data, which is never converted'
ends 2 c.ocio --source-colorspace squared
err_has 'add --output-colorspace'
ends 2 c.ocio --output-colorspace srgb
err_has 'c.ocio gives this built-in name to a different colour space'
ends 5 c.ocio --source-colorspace lost --output-colorspace lin_rec709
err_has 'c.ocio: cannot convert from "lost": '
ends 3 source.obj --source-colorspace squared
err_has 'source.obj: not a usable OpenColorIO configuration'
expect 2 transfer source.obj target.obj -o no.glb --ocio c.ocio --output-colorspace squared
err_has 'glTF textures are always srgb'
[[ ! -e no.png && ! -e no.glb ]] || fail 'an output of a job that was refused'

# Out of the configuration, into it, through it; by another name; in a model.
run out.png --source-colorspace squared --output-colorspace display-p3 --report r.json
err_has 'note: baseColor is converted from squared to display-p3'
err_has 'note: colours are converted by OpenColorIO with c.ocio: the last bits of the output may differ'
grep -q '"ocio": "c.ocio"' r.json || fail 'no option in the report'
sed -i 's/name: srgb/name: other/' c.ocio
run out.png --source-colorspace baseColor=Square --output-colorspace srgb
same out.png 206 109 55
run in.png --output-colorspace squared
same in.png 194 91 46
! grep -q sRGB in.png || fail 'an image that is no sRGB says it is'
run through.png --source-colorspace squared --output-colorspace squared
same through.png 200 100 50
run through.png --source-colorspace SQUARE --output-colorspace squared # one space by two names
! grep -q 'is converted' "$err" || fail 'a conversion from a space to itself'
same through.png 200 100 50
run through.png --source-colorspace squared --output-colorspace squared --method gaussian
same through.png 200 100 50
run tinted.exr --output-colorspace tinted --depth float
expect 0 transfer source.obj target.obj --size 16 -o linear.exr --depth float
if command -v oiiotool >/dev/null; then
  oiiotool tinted.exr --mulc 1,0.5,0.25 -o back.exr
  expect 0 compare back.exr linear.exr --min-psnr 120
else
  echo 'SKIPPED: needs oiiotool'
fi
"$POUNCE_FIXTURE" plane -o plane.glb --triangles 12 --texture 16 >/dev/null
expect 0 transfer plane.glb plane.glb -o new.glb --ocio c.ocio --source-texture baseColor=skin.ppm --source-colorspace squared
expect 0 transfer new.glb target.obj -o model.png --size 16
expect 0 transfer plane.glb target.obj -o images.png --size 16 --ocio c.ocio --source-texture baseColor=skin.ppm \
  --source-colorspace squared --output-colorspace srgb
same_picture model.png images.png || fail 'a model has other colours than images'

# Factors are of light. Grey becomes colour where it must.
printf 'newmtl skin\nKd 0.5 0.5 0.5\nmap_Kd skin.ppm\n' >source.mtl
run half.png --source-colorspace squared --output-colorspace squared
same half.png 141 71 35
run gaussian.png --source-colorspace squared --output-colorspace squared --method gaussian
same gaussian.png 141 71 35
printf 'newmtl skin\nmap_Kd grey.pgm\n' >source.mtl
mask grey.pgm 16 16 $(for ((i = 0; i < 256; ++i)); do echo 100; done)
run grey.png --source-colorspace tinted --output-colorspace lin_rec709
same grey.png 100 50 25

# A channel that cannot be read so is left out, one that is asked for is not.
cp skin.ppm light.ppm
printf 'newmtl skin\nmap_Kd skin.ppm\nmap_Ke light.ppm\nKe 1 1 1\n' >source.mtl
run 'left.<CHANNEL>.png' --source-colorspace emissive=lost --output-colorspace lin_rec709
err_has 'cannot convert from "lost"'
[[ -e left.baseColor.png && ! -e left.emissive.png ]] || fail 'what was left out'
expect 5 transfer source.obj target.obj --size 16 --ocio c.ocio -o e.png --channels emissive --source-colorspace lost \
  --output-colorspace lin_rec709
printf 'newmtl skin\nmap_Kd grey.pgm\n' >source.mtl

# Data stay what they are.
run own.png --source-texture mask=skin.ppm --data mask --channels mask --output-colorspace squared
same own.png 200 100 50

# What a table says is part of the job.
run 'kept.png' --source-colorspace table --output-colorspace lin_rec709
same kept.png 50 50 50
run 'kept.png' --source-colorspace table --output-colorspace lin_rec709 --skip-existing
err_has 'skipped'
table 0.5
run 'kept.png' --source-colorspace table --output-colorspace lin_rec709 --skip-existing
same kept.png 100 100 100
run gaussian.png --source-colorspace table --output-colorspace lin_rec709 --method gaussian
table 0.25
run gaussian.png --source-colorspace table --output-colorspace lin_rec709 --method gaussian
same gaussian.png 50 50 50

# Gaussians have colours of sRGB.
expect 0 gaussians source.obj -o table.ply --ocio c.ocio --source-colorspace table
mask grey.pgm 16 16 $(for ((i = 0; i < 256; ++i)); do echo 122; done) # sRGB, of the light 50 / 255
expect 0 gaussians source.obj -o srgb.ply
expect 0 transfer table.ply target.obj -o a.png --size 8
expect 0 transfer srgb.ply target.obj -o b.png --size 8
expect 0 compare a.png b.png --min-psnr 45
expect 2 gaussians table.ply -o again.ply --ocio c.ocio
err_has '--ocio applies only to meshes'
# A scene of splats, into the configuration: as if its picture went there.
printf 'newmtl skin\nmap_Kd a.png\n' >source.mtl
expect 0 transfer table.ply target.obj -o s.png --size 8 --ocio c.ocio --output-colorspace squared
expect 0 transfer source.obj target.obj -o i.png --size 8 --ocio c.ocio --output-colorspace squared
expect 0 compare s.png i.png --min-psnr 45

# A configuration that has nothing in common with what is known here.
config strange.ocio <<'CONFIG'
  - !<ColorSpace>
    name: base
  - !<ColorSpace>
    name: film
    to_scene_reference: !<ExponentTransform> {value: 2}
CONFIG
ends 3 strange.ocio --source-colorspace film --output-colorspace srgb
err_has 'strange.ocio: cannot be converted to other colour spaces'

# ACES, beside OpenColorIO itself.
command -v oiiotool >/dev/null || exit 0
config aces.ocio <<'CONFIG'
  - !<ColorSpace>
    name: ap0
  - !<ColorSpace>
    name: camera
    to_scene_reference: !<BuiltinTransform> {style: "ACEScct_to_ACES2065-1"}
  - !<ColorSpace>
    name: screen
    from_scene_reference: !<GroupTransform>
      children:
        - !<BuiltinTransform> {style: "UTILITY - ACES-AP0_to_CIE-XYZ-D65_BFD"}
        - !<MatrixTransform> {matrix: [3.2409699419, -1.5373831776, -0.4986107603, 0, -0.9692436363, 1.8759675015, 0.0415550574, 0, 0.0556300797, -0.203976959, 1.0569715142, 0, 0, 0, 0, 1]}
        - !<ExponentWithLinearTransform> {gamma: 2.4, offset: 0.055, direction: inverse}
CONFIG
sed -i 's/roles: {/roles: {aces_interchange: ap0, /' aces.ocio
"$POUNCE_FIXTURE" plane -o s.obj --triangles 200 --texture 64 >/dev/null
"$POUNCE_FIXTURE" plane -o t.obj --triangles 200 >/dev/null
oiiotool s.png --mulc 0.6 -d uint16 -o s16.png
for space in srgb screen; do
  expect 0 transfer s.obj t.obj -o "$space.png" --source-texture baseColor=s16.png --ocio aces.ocio --source-colorspace camera \
    --output-colorspace $space --threads 1
  expect 0 transfer s.obj t.obj -o again.png --source-texture baseColor=s16.png --ocio aces.ocio --source-colorspace camera \
    --output-colorspace $space --threads 2 --memory 64MiB --no-cache
  cmp "$space.png" again.png || fail 'other bytes with more threads'
  oiiotool --colorconfig aces.ocio s16.png --iscolorspace camera --colorconvert camera screen --clamp:min=0:max=1 -d uint16 -o ocio.png
  expect 0 compare "$space.png" ocio.png
  error=$(sed -n 's/^largest error *\([0-9.]*\).*/\1/p' "$out")
  awk -v e="$error" 'BEGIN { exit !(e <= 0.001) }' || fail "off from OpenColorIO by $error"
done
