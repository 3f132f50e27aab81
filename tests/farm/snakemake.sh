# SPDX-License-Identifier: Apache-2.0
# The same 20 UDIMs by Snakemake: one task is killed and tried again.
nodes=0
source "$(dirname "$0")/support.sh"
command -v snakemake >/dev/null || { echo 'SKIPPED: snakemake is not installed' && exit 77; }
"$POUNCE_FIXTURE" plane -o plane.glb --triangles 2000 --texture 512 >/dev/null
udims 20 >twenty.obj
job=(plane.glb twenty.obj -o 'twenty.<UDIM>.png' --size "${SIZE:-512}")
"$POUNCE" transfer "${job[@]}" -q
mkdir quiet && mv twenty.*.png quiet
"$POUNCE" submit commands job "${job[@]}" --tasks 4 >/dev/null
(until pkill -KILL -f -- "--task 3/4 --threads"; do sleep 0.01; done) &
killer=$!
snakemake --snakefile "$farm/Snakefile" --cores 2 --config pounce="$POUNCE" tasks=4 >snakemake.log 2>&1 ||
  fail "snakemake: $(tail -n 30 snakemake.log)"
wait $killer || fail 'no task was killed'
grep -q 'Trying to restart job' snakemake.log || fail 'no task was tried again'
[[ $(state job assemble) == done ]] || fail 'not assembled'
same quiet
