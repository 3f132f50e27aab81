# SPDX-License-Identifier: Apache-2.0
# Options that exclude each other; switches take no value.
source "$(dirname "$0")/support.sh"
refused 'excludes' transfer a.glb b.glb -o o.png --cache folder --no-cache
refused 'excludes' transfer a.glb b.glb -o o.png -q -v
refused 'plan' transfer a.glb b.glb -o o.png --plan=no
rejected --progress fast AUTO ''
