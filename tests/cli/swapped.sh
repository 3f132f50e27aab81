# SPDX-License-Identifier: Apache-2.0
# SOURCE and TARGET in the wrong order are told as such; a source that only lacks its MTL file, too.
source "$(dirname "$0")/support.sh"
make_job
expect 3 transfer target.obj source.obj -o o.png
err_has 'target.obj: the source has no texture, but the target source.obj has one; the source comes first: swap the two'
expect 3 transfer target.obj source.obj -o o.png --channels occlusion
err_has 'swap the two'
# Nobody has a texture: that alone is said.
expect 3 transfer target.obj target.obj -o o.png
err_has 'target.obj: no material has a baseColor texture; specify one with --source-texture'
! grep -q 'swap' "$err" || fail 'nothing is swapped'
expect 3 transfer source.obj target.obj -o o.png --channels occlusion
err_has 'source.obj: no material has an occlusion texture'
expect 3 transfer source.obj target.obj -o o.png --channels emissive
err_has 'source.obj: no material has an emissive texture'
# The MTL file is gone, and with it the texture.
rm source.mtl
expect 3 transfer source.obj target.obj -o o.png
err_has 'no material has a baseColor texture (its material file source.mtl is missing: restore it)'
expect 3 transfer source.obj target.obj -o 'o.<CHANNEL>.png'
err_has 'has no textures (its material file source.mtl is missing: restore it)'
expect 0 transfer source.obj target.obj -o o.png --source-texture baseColor=skin.ppm -q
# Also where the target has textures: nothing is swapped.
quad textured skin.ppm
for harm in 'rm source.mtl' 'mkfifo source.mtl'; do
  rm -f source.mtl
  [[ $harm == rm* ]] || $harm
  expect 3 transfer source.obj textured.obj -o o.png
  err_has 'no material has a baseColor texture (its material file source.mtl '
  ! grep -q 'swap' "$err" || fail 'nothing is swapped'
done
rm source.mtl
quad source skin.ppm
chmod 0 source.mtl
if [[ $(id -u) != 0 ]]; then
  expect 5 transfer source.obj textured.obj -o o.png
  err_has 'source.mtl: cannot open: Permission denied'
elif command -v setpriv >/dev/null; then
  chmod 755 "$work"
  got=0
  setpriv --reuid 65534 --clear-groups "$POUNCE" transfer source.obj textured.obj -o o.png --no-cache >"$out" 2>"$err" || got=$?
  [[ $got == 5 ]] || fail "exit status $got, not 5, for a material file that may not be read"
  err_has 'source.mtl: cannot open: Permission denied'
fi
