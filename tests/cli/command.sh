# SPDX-License-Identifier: Apache-2.0
# No command, and commands and options of later versions, are unknown.
source "$(dirname "$0")/support.sh"
refused 'no command given'
for command in denoise frobnicate; do refused "\"$command\" is not a command" $command; done
refused '"-v" is not a command' -v
refused 'SOURCE is required' transfer
refused 'TARGET is required' transfer a.glb
refused '--output is required' transfer a.glb b.glb
refused '2 targets need <TARGET> in the output' transfer a.glb b.glb c.glb -o o.png
for option in --cage --colour-space --normal-map --bogus; do
  refused "$option" transfer a.glb b.glb -o o.png $option
done
refused '--coverage' maps b.glb -o '<CHANNEL>.exr' --coverage c.png
