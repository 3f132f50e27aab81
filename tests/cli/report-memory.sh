# SPDX-License-Identifier: Apache-2.0
# The report's peak memory is that of pounce, whatever was in the process before it: what starts it may be large.
source "$(dirname "$0")/support.sh"
make_job
(
  large=$(head -c 500M /dev/zero | tr '\0' x)
  [[ ${#large} == 524288000 ]]
  exec "$POUNCE" transfer source.obj target.obj -o o.png --no-cache --threads 1 --report r.json -q
)
peak=$(sed -nE 's/.*"peak_rss": ([0-9]+).*/\1/p' r.json)
((peak > 1 << 20)) || fail "peak_rss is $peak"
((peak < 450 << 20)) || fail "peak_rss is $peak, the size of what started it"
