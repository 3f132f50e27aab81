# SPDX-License-Identifier: Apache-2.0
# --channels, --depth and --source-texture name what glTF names; normal maps are for a later version.
source "$(dirname "$0")/support.sh"
rejected --channels baseColor,baseColor
for list in normal '' all,emissive; do
  refused '--channels: got' transfer a.glb b.glb -o o.png --channels "$list"
done
rejected --depth u32
rejected --source-texture baseColor 'baseColor=skin.<FRAME>.png'
for text in normal=n.png; do
  refused '--source-texture: got' transfer a.glb b.glb -o o.png --source-texture "$text"
done
