# SPDX-License-Identifier: Apache-2.0
# An option without its value is named; the next option is not taken for one; twice is once too often.
source "$(dirname "$0")/support.sh"
for option in --size --depth --channels --coverage --max-distance --max-angle --filter --padding --memory --threads \
  --cache --temp --report --progress --source-texture; do
  refused "$option" transfer a.glb b.glb -o o.png $option
done
refused '-o: got "--plan"' transfer a.glb b.glb -o --plan
refused '--output' transfer a.glb b.glb -o o.png -o p.png
refused '--size' transfer a.glb b.glb -o o.png --size 4 --size 5
