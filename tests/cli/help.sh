# SPDX-License-Identifier: Apache-2.0
# --help teaches: purpose, examples, every option with its unit and default, the exit statuses; on stdout.
source "$(dirname "$0")/support.sh"
expect 0 --help
silent "$err"
for word in transfer maps inspect compare 'Exit status' 'interrupted'; do out_has "$word"; done
expect 0 transfer --help
silent "$err"
for option in -o,--output --source-texture --size --depth --channels --coverage --max-distance --max-angle \
  --padding --memory --threads --cache --no-cache --temp --plan --report --progress -q,--quiet -v,--verbose; do
  out_has "  $option "
done
for word in Usage: Examples: SOURCE TARGET '[default: 5%' '[0 to 89.9; default: 80]' 'Exit status:' 'least that works'; do
  out_has "$word"
done
[[ $(grep -c '^  pounce transfer ' "$out") -ge 2 ]] || fail 'fewer than two worked examples'
for command in maps inspect compare; do
  expect 0 $command --help
  out_has 'Examples:'
  out_has 'Exit status:'
done
awk 'length > 100 { exit 1 }' "$out" || fail 'a line is wider than 100 columns'
