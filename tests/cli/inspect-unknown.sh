# SPDX-License-Identifier: Apache-2.0
# inspect refuses what it does not know and names it.
source "$(dirname "$0")/support.sh"
echo 'hello' >letter.txt
: >empty
mkdir folder
for name in letter.txt empty; do
  expect 3 inspect $name
  silent "$out"
  err_has "$name"
done
expect 5 inspect folder
err_has 'folder: is a folder; specify a mesh, a splat scene, an image or a pack file'
expect 5 inspect missing.glb
err_has 'missing.glb: cannot open: No such file'
printf 'glTF\002\000\000\000' >short.glb
expect 3 inspect short.glb
err_has 'short.glb'
printf 'POUNCEPK' >short.pack
expect 6 inspect short.pack
err_has 'short.pack'
