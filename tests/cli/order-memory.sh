# SPDX-License-Identifier: Apache-2.0
# Targets that are looked at to see whether the order is right stay within the budget, as when they are read.
source "$(dirname "$0")/support.sh"
{ printf '{"asset":{"version":"2.0"},"nodes":[' && yes '{},' | head -n 5000000 | tr -d '\n' && printf '{}]}'; } >many.gltf
image skin.ppm 16 16 200 100 50
quad textured skin.ppm
quad plain
for source in textured plain; do
  expect 4 transfer $source.obj many.gltf -o o.png --memory 256MiB --no-cache
  err_has 'for reading many.gltf'
done
