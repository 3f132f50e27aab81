# SPDX-License-Identifier: Apache-2.0
# Of all the source's channels, one whose map is missing or damaged is left out with a warning; asked for by name it is
# refused, and the colour always is. A map that is there and cannot be read ends the job.
source "$(dirname "$0")/support.sh"
image skin.ppm 4 4 200 100 50
quad source skin.ppm
echo 'map_Ke glow.png' >>source.mtl
quad target
expect 0 transfer source.obj target.obj -o 'o.<CHANNEL>.png' --no-cache
err_has 'source.obj: emissive is left out: '
err_has 'glow.png'
err_has 'with --channels emissive this is an error'
[[ -s o.baseColor.png && ! -e o.emissive.png ]] || fail 'the wrong images'
rm -- o.*
expect 0 transfer source.obj target.obj -o 'o.<CHANNEL>.png' --channels all --plan
err_has 'emissive is left out'
out_has 'o.baseColor.png'
! grep -q 'emissive' "$out" || fail 'it is planned'
# A damaged one is the same to whom did not ask.
echo 'no image' >glow.png
expect 0 transfer source.obj target.obj -o 'o.<CHANNEL>.png' --no-cache
err_has 'emissive is left out'
rm -- o.* glow.png
for asked in '--channels emissive' '--channels baseColor,emissive' '--source-texture emissive=gone.png'; do
  expect 5 transfer source.obj target.obj -o 'o.<CHANNEL>.png' $asked
  err_has "$([[ $asked == *gone* ]] && echo gone.png || echo glow.png)"
done
# What the system does not give is another matter: the next run may give more.
mkdir glow.png
expect 5 transfer source.obj target.obj -o 'o.<CHANNEL>.png'
err_has 'glow.png: cannot read: it is a folder, not a file'
rmdir glow.png
image glow.png 4 4 1 2 3
if [[ $(id -u) != 0 ]]; then
  chmod 0 glow.png
  expect 5 transfer source.obj target.obj -o 'o.<CHANNEL>.png'
  err_has 'glow.png: Permission denied'
  chmod 644 glow.png
elif as_nobody "$POUNCE" --version; then
  chmod 0 glow.png
  status=0
  as_nobody "$POUNCE" transfer source.obj target.obj -o 'o.<CHANNEL>.png' --no-cache --temp /tmp || status=$?
  [[ $status == 5 ]] || fail "exit status $status, not 5, for a map that this user may not read"
  err_has 'Permission denied'
  chmod 644 glow.png
fi
rm skin.ppm
expect 5 transfer source.obj target.obj -o 'o.<CHANNEL>.png'
err_has 'skin.ppm'
# It is the only one: there is nothing to leave out.
printf 'newmtl skin\nmap_Ke gone.png\n' >source.mtl
expect 5 transfer source.obj target.obj -o 'o.<CHANNEL>.png'
err_has 'gone.png'
[[ -z $(ls o.* 2>/dev/null) ]] || fail 'an image was written'
