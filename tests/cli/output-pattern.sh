# SPDX-License-Identifier: Apache-2.0
# OUTPUT is an image name, with known tokens only.
source "$(dirname "$0")/support.sh"
for name in 'o.<CHANNEL>.glb' 'o.<FRAME>.png' ''; do
  refused "-o: got \"$name\"" transfer a.glb b.glb -o "$name"
  refused "--coverage: got \"$name\"" transfer a.glb b.glb -o o.png --coverage "$name"
done
refused '-o: got "o.exr", expected <CHANNEL>' maps b.glb -o o.exr
