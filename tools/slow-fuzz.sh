#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Coverage-guided fuzzing of all that reads files (tests/fuzz): glTF, OBJ with its materials, splat PLY, what is
# done with images before they are decoded, packs of the tile cache, glTF with new textures, whole jobs on odd
# meshes and scenes; under AddressSanitizer and UndefinedBehaviorSanitizer. An input passes if its reader ends, or
# refuses it with pounce's own error, within time and memory. Anything else fails, and is kept in
# build/fuzz/findings.
# Usage: tools/slow-fuzz.sh [SECONDS per target] [TARGET...]   (default 600, and all that tests/fuzz/targets.txt lists)
# POUNCE_FUZZ_SEED=N: the same inputs each time from the same corpus (0, the default: others each time). .ci/sanitize sets
# it, since a change is to be judged by what it did, not by what a fuzzer happens to find that day.
# POUNCE_FUZZ_AT_ONCE=N: run N targets side by side (default 1).
# POUNCE_FUZZ_UNIT_SECONDS=N: the most that one input may take, by the clock (default 60: on a machine that others use
# two seconds of work have taken one minute). Raise it where the fuzzers get what others leave.
# POUNCE_FUZZ_PRESET=fuzz-decoders: with the libraries that tools/fuzz-decoders.sh built, in build/fuzz-decoders.
# What was learnt stays in build/fuzz/corpus, where the next run goes on. To see a finding again:
#   build/fuzz/fuzz_gltf build/fuzz/findings/gltf-crash-...    (pack: POUNCE_FUZZ_PACKS=build/fuzz/corpus/packs)
set -euo pipefail
cd "$(dirname "$0")/.."
seconds=${1:-600}
shift || true
targets=("$@")
declare -A most_bytes words more_seeds
while read -r name bytes dictionary seeds; do
  [[ $name == [a-z]* ]] || continue
  most_bytes[$name]=$bytes words[$name]=$dictionary more_seeds[$name]=$seeds
  [[ $# -gt 0 ]] || targets+=("$name")
done <tests/fuzz/targets.txt
for target in "${targets[@]}"; do
  [[ -n ${most_bytes[$target]:-} ]] || {
    echo "slow-fuzz.sh: there is no target $target; there are: ${!most_bytes[*]}" >&2
    exit 2
  }
done

tools/install-packages.sh
tools/install-clang.sh
preset=${POUNCE_FUZZ_PRESET:-fuzz} build=$PWD/build/${POUNCE_FUZZ_PRESET:-fuzz}
cmake --preset "$preset" >/dev/null
cmake --build --preset "$preset" --target fuzz_seeds "${targets[@]/#/fuzz_}"

corpus=$build/corpus findings=$build/findings
mkdir -p "$findings"
data=${POUNCE_TEST_DATA:-$PWD/../shared/data}
[[ -d $data ]] || data=
"$build/fuzz_seeds" "$corpus" ${data:+"$data"}
export POUNCE_FUZZ_PACKS=$corpus/packs
export ASAN_OPTIONS=detect_stack_use_after_return=1:strict_string_checks=1:quarantine_size_mb=64
export UBSAN_OPTIONS=print_stacktrace=1

# fuzz TARGET: its log, and beside it its status and the seconds of CPU that it took.
fuzz() {
  local target=$1 log=$build/fuzz-$1.log status=0 seeds TIMEFORMAT='%0U %0S'
  local dictionary=() from=("$corpus/$target")
  [[ ${words[$target]} == - ]] || dictionary=(-dict="tests/fuzz/${words[$target]}")
  mkdir -p "$corpus/$target"
  for seeds in ${more_seeds[$target]}; do from+=("$corpus/$seeds"); done
  { time "$build/fuzz_$target" "${from[@]}" -max_total_time="$seconds" -seed="${POUNCE_FUZZ_SEED:-0}" \
    -timeout="${POUNCE_FUZZ_UNIT_SECONDS:-60}" -rss_limit_mb=1024 -malloc_limit_mb=512 -max_len="${most_bytes[$target]}" \
    "${dictionary[@]}" -use_value_profile=1 \
    -artifact_prefix="$findings/$target-" -print_final_stats=1 >"$log" 2>&1; } 2>"$log.cpu" || status=$?
  echo "$status" >"$log.status"
}
rm -f "$build"/fuzz-*.log.{status,cpu}
for target in "${targets[@]}"; do
  while [[ $(jobs -rp | wc -l) -ge ${POUNCE_FUZZ_AT_ONCE:-1} ]]; do wait -n; done
  fuzz "$target" &
done
wait

failed=0 cpu=0
for target in "${targets[@]}"; do
  log=$build/fuzz-$target.log
  status=$(cat "$log.status")
  took=$(awk 'NF == 2 { sum += $1 + $2 } END { print sum + 0 }' "$log.cpu")
  cpu=$((cpu + took))
  executions=$(sed -n 's/^stat::number_of_executed_units: *//p' "$log" | tail -n 1)
  coverage=$(sed -n 's/.* cov: \([0-9]*\) ft: \([0-9]*\) corp: \([0-9]*\).*/\1 edges, \2 features, \3 inputs/p' "$log" | tail -n 1)
  echo "fuzz_$target: ${executions:-?} executions in $took s of CPU, ${coverage:-nothing covered}"
  if [[ $status -ne 0 ]]; then
    failed=$((failed + 1))
    echo "FINDING in fuzz_$target (status $status); the whole log: $log"
    grep -m 12 -E 'a promise is broken|ERROR|SUMMARY|runtime error|Test unit written|terminate called|what\(\)|^ *#[0-9]+ .* pounce' "$log" || true
  fi
done
echo "$failed of ${#targets[@]} targets have findings; $cpu s of CPU in all"
[[ $failed -eq 0 ]]
