# SPDX-License-Identifier: Apache-2.0
# Of all the source's channels, one whose map cannot be read is left out with a warning; asked for by name it is refused,
# and the colour always is.
source "$(dirname "$0")/support.sh"
image skin.ppm 4 4 200 100 50
quad source skin.ppm
echo 'map_Ke glow.png' >>source.mtl
quad target
expect 0 transfer source.obj target.obj -o 'o.<CHANNEL>.png' --no-cache
err_has 'source.obj: emissive is left out: '
err_has 'glow.png'
err_has '--channels emissive insists on it'
[[ -s o.baseColor.png && ! -e o.emissive.png ]] || fail 'the wrong images'
rm -- o.*
expect 0 transfer source.obj target.obj -o 'o.<CHANNEL>.png' --channels all --plan
err_has 'emissive is left out'
out_has 'o.baseColor.png'
! grep -q 'emissive' "$out" || fail 'it is planned'
# A damaged one is the same to whom did not ask.
echo 'no image' >glow.png
expect 0 transfer source.obj target.obj -o 'o.<CHANNEL>.png' --no-cache -q
rm -- o.* glow.png
for asked in '--channels emissive' '--channels baseColor,emissive' '--source-texture emissive=gone.png'; do
  "$POUNCE" transfer source.obj target.obj -o 'o.<CHANNEL>.png' $asked >"$out" 2>"$err" && fail "$asked passes"
done
rm skin.ppm
image glow.png 4 4 1 2 3
"$POUNCE" transfer source.obj target.obj -o 'o.<CHANNEL>.png' >"$out" 2>"$err" && fail 'no colour, no word'
err_has 'skin.ppm'
# It is the only one: there is nothing to leave out.
printf 'newmtl skin\nmap_Ke gone.png\n' >source.mtl
"$POUNCE" transfer source.obj target.obj -o 'o.<CHANNEL>.png' >"$out" 2>"$err" && fail 'no channel, no word'
err_has 'gone.png'
[[ -z $(ls o.* 2>/dev/null) ]] || fail 'an image was written'
