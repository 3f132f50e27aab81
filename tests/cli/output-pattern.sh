# SPDX-License-Identifier: Apache-2.0
# OUTPUT is an image name, with known tokens only.
source "$(dirname "$0")/support.sh"
for name in 'o.<CHANNEL>.glb' 'o.<FRAME>.png' ''; do
  refused "-o: got \"$name\"" transfer a.glb b.glb -o "$name"
  refused "--coverage: got \"$name\"" transfer a.glb b.glb -o o.png --coverage "$name"
done
refused '-o: got "o.exr", expected <CHANNEL>' maps b.glb -o o.exr
refused 'o.obj: models are written as .glb or .gltf, images as .png' transfer a.glb b.glb -o o.obj
# What other programs write for a tile or a frame is told from a name.
for token in '%(UDIM)d' '<udim>' '<uvtile>' '$UDIM' '${UDIM}' '{udim}' '_MAPID_' '%(U)04d'; do
  refused "expected <UDIM> (1001) or <UVTILE> (u1_v1) for a tile's number, not $token" \
    transfer a.glb b.glb -o "o.<UDIM>.$token.png"
done
for token in '%04d' '####' '##' '$F' '$F4' '${F4}' '${F}' '$FF'; do
  refused "expected no $token: pounce has no frames; a UDIM tile's number is written as <UDIM>" \
    transfer a.glb b.glb -o "o.$token.png"
done
refused '--coverage: got "m.%(UDIM)d.png"' transfer a.glb b.glb -o o.png --coverage 'm.%(UDIM)d.png'
refused '--source-texture: got "baseColor=s.<udim>.png"' transfer a.glb b.glb -o o.png --source-texture 'baseColor=s.<udim>.png'
refused '-o: got "o.####.glb"' transfer a.glb b.glb -o 'o.####.glb'
refused '-o: got "<CHANNEL>.$F.exr"' maps b.glb -o '<CHANNEL>.$F.exr'
# Names that only look a little like one.
for name in 'a#1.png' '100%.png' '$Fur.png' 'o.%d.png' '100%04done/o.png' 'C##/o.png' '$F/%(UDIM)d/o.png'; do
  expect 5 transfer a.glb b.glb -o "$name"
  err_has 'a.glb: cannot open'
done
# A source texture is there, whatever it is called; frames mean nothing for it.
for name in 'skin##.png' 'skin.$F4.png' 'skin.%04d.png'; do
  expect 5 transfer a.glb b.glb -o o.png --source-texture "baseColor=$name"
  err_has 'a.glb: cannot open'
done
touch 's.<udim>.png' '%(UDIM)d.png'
expect 5 transfer a.glb b.glb -o o.png --source-texture 'baseColor=%(UDIM)d.png'
err_has 'a.glb: cannot open'
