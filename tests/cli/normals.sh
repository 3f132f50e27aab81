# SPDX-License-Identifier: Apache-2.0
# Normal maps and --bake: what is refused before any work, what is said, and what a flat case must give.
source "$(dirname "$0")/support.sh"
rejected --normal-y left
rejected --output-normal-y ''
rejected --bake confidance normal,normal
for name in Normal '' banana heights,normal; do
  refused 'expected normal, height, position or vertexColor' transfer a.obj b.obj -o o.png --bake "$name"
done
refused 'normal only once' transfer a.obj b.obj -o o.png --bake normal,normal
refused '--bake emissive: cannot be baked; choose normal, height, position or vertexColor' transfer a.obj b.obj -o o.png --bake emissive
refused '--channels height: not a material channel; use --bake height' transfer a.obj b.obj -o o.exr --channels height
refused '--bake position: o.glb is a model' transfer a.obj b.obj -o o.glb --bake position
refused '--output-normal-y down: o.glb is a glTF model' transfer a.obj b.obj -o o.glb --output-normal-y down
refused '--bake applies only to --method surface' transfer a.obj b.obj -o o.png --bake normal --method gaussian
refused '--source-texture: height is not a material channel; use --bake height' transfer a.obj b.obj -o o.png --source-texture height=h.png

# A square with a flat normal map, onto itself: a flat one.
quad target
quad source
image flat.ppm 8 8 128 128 255
image bump.ppm 8 8 128 100 250
printf 'mtllib source.mtl\nusemtl skin\n' | cat - source.obj >s && mv s source.obj
printf 'newmtl skin\nnorm flat.ppm\nmap_Bump bump.ppm\n' >source.mtl
expect 0 transfer source.obj target.obj -o flat.png --channels normal
err_has 'not transferred: map_Bump (bump.ppm)'
expect 0 compare flat.png flat.ppm --min-psnr 100
# Which is what green down turns over, once on each side.
for side in '' output-; do
  expect 0 transfer source.obj target.obj -o bump.png --channels normal --source-texture normal=bump.ppm --${side}normal-y down
  image turned.ppm 8 8 128 155 250
  expect 0 compare bump.png turned.ppm --min-psnr 45
done
expect 0 transfer source.obj target.obj -o bump.png --channels normal --source-texture normal=bump.ppm --normal-y down --output-normal-y down
expect 0 compare bump.png bump.ppm --min-psnr 45
# What a flag changes nothing of is said.
image skin.ppm 8 8 10 20 30
expect 0 transfer source.obj target.obj -o skin.png --source-texture baseColor=skin.ppm --normal-y down
err_has '--normal-y: no normal map is written'
err_has 'normal (flat.ppm)'

# Without any texture a bake needs a size; the square lies on itself.
quad bare
expect 2 transfer bare.obj target.obj -o n.png --bake normal
err_has 'specify --size'
expect 2 transfer bare.obj target.obj -o h.png --bake height --size 8
err_has 'write .exr or .tif'
expect 0 transfer bare.obj target.obj -o '<CHANNEL>.exr' --bake height,normal,position --size 8
only_files bare.obj bump.png bump.ppm flat.png flat.ppm height.exr normal.exr position.exr skin.png skin.ppm source.mtl \
  source.obj target.obj turned.ppm

# Where nothing was found and nothing is padded a normal map is flat, not black.
printf 'v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 0.5 0\nvt 0.5 0.5\nvt 0 0.5\nf 1/1 2/2 3/3 4/4\n' >quarter.obj
for depth in u8 u16; do
  expect 0 transfer bare.obj quarter.obj -o quarter.png --bake normal --size 16 --padding 0 --depth $depth --coverage covered.png
  image flat16.ppm 16 16 128 128 255
  mask all.pgm 16 16 $(for ((i = 0; i < 256; ++i)); do echo 255; done)
  expect 0 compare quarter.png flat16.ppm --min-psnr 55 --mask all.pgm
  expect 1 compare covered.png all.pgm --min-psnr 40 --mask all.pgm # what is covered is as it was
done
