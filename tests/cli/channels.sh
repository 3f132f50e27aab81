# SPDX-License-Identifier: Apache-2.0
# --channels, --depth and --source-texture name what glTF names.
source "$(dirname "$0")/support.sh"
rejected --channels baseColor,baseColor
for list in '' all,emissive; do
  refused '--channels: got' transfer a.glb b.glb -o o.png --channels "$list"
done
rejected --depth u32
rejected --source-texture baseColor 'baseColor=skin.<FRAME>.png'
for text in =n.png a.b=n.png; do
  refused '--source-texture: got' transfer a.glb b.glb -o o.png --source-texture "$text"
done
