# SPDX-License-Identifier: Apache-2.0
# A container or a scheduler limits the process, not the budget: --plan says what that needs, a job that finds less ends
# before its work with status 4 and the cure, and no budget is larger than what a control group leaves.
TMPDIR=/tmp  # files in memory would be counted in the group
source "$(dirname "$0")/support.sh"
make_job
job=(transfer source.obj target.obj -o o.png --size 1024 --no-cache --threads 2)
expect 0 "${job[@]}" --plan --report plan.json
least=$(sed -nE 's/^least memory .*\(([0-9]+) bytes\)$/\1/p' "$out")
process=$(sed -nE 's/^process .*\(([0-9]+) bytes\).*/\1/p' "$out")
beside=$(sed -nE 's/.*"beside": ([0-9]+).*/\1/p' plan.json)
[[ -n $process && $process == $((least + beside)) ]] || fail 'the process needs the least and what is beside it'
grep -q "\"least_process\": $process" plan.json || fail 'the report lacks the need of the process'
expect 0 "${job[@]}" -q
mv o.png free.png

# Limits of the process itself: less than the least and what is taken already.
"$POUNCE_FIXTURE" head -o in --triangles 300000 --texture 16 --target-size 16 >/dev/null
status=0
prlimit --data=$((60 << 20)) "$POUNCE" transfer in/head_src.glb in/head_same.glb -o h.png --no-cache --memory 2GiB -q \
  >"$out" 2>"$err" || status=$?
[[ $status == 4 && $(wc -l <"$err") == 1 ]] || fail "exit status $status under ulimit -d"
err_has 'the data limit (ulimit -d) is 60.0 MiB: this job needs at least '
err_has 'raise that limit to '

# Control groups, where this user may make some: version 1 below the group that we are in, or version 2.
own=$(sed -nE 's/^[0-9]+:([^:]*,)?memory(,[^:]*)?://p' /proc/self/cgroup)
if [[ -n $own && -d /sys/fs/cgroup/memory ]]; then
  root=/sys/fs/cgroup/memory limit_file=memory.limit_in_bytes
  [[ -d $root$own ]] && root=$root$own
else
  root=/sys/fs/cgroup limit_file=memory.max
fi
outer=$root/pounce-test-$$ inner=$root/pounce-test-$$/inner
if ! mkdir "$outer" 2>/dev/null; then
  echo 'SKIPPED: control groups (needs root, and a hierarchy that may be written)'
  exit 0
fi
remove_groups() { rmdir "$inner" "$outer" 2>/dev/null || true; }
trap 'remove_groups; rm -rf "$work"' EXIT
if [[ $limit_file == memory.max ]]; then echo +memory >"$outer/cgroup.subtree_control" 2>/dev/null || true; fi
mkdir "$inner"
if [[ ! -w $inner/$limit_file ]] || ! (echo $BASHPID >"$inner/cgroup.procs") 2>/dev/null; then
  echo 'SKIPPED: control groups (no limits of memory here)'
  exit 0
fi

# in_group STATUS BYTES ARGUMENT...: as expect, in a group whose parent has this limit.
in_group() {
  local wanted=$1 got=0
  echo "$2" >"$outer/$limit_file" || fail "the group takes no limit of $2"
  shift 2
  (echo $BASHPID >"$inner/cgroup.procs" && exec "$POUNCE" "$@") >"$out" 2>"$err" || got=$?
  [[ $got == "$wanted" ]] || fail "exit status $got, not $wanted, in a group of $(cat "$outer/$limit_file"): pounce $*"
}

# What the plan names is enough, with the least budget and without any; pages of files are not counted.
enough=$((process + (2 << 20)))
in_group 0 $enough "${job[@]}" --memory "$least" -q
cmp o.png free.png || fail 'another image in a group'
rm o.png
in_group 0 $enough "${job[@]}"
cmp o.png free.png || fail 'another image in a group'
! grep -q warning: "$err" || fail 'a budget that nobody asked for is warned of'
rm o.png
# A budget that the group does not hold is lowered, and that is said.
in_group 0 $((process + (16 << 20))) "${job[@]}" --memory 1GiB --report r.json
cmp o.png free.png || fail 'another image in a group'
grep -Eq 'warning: the memory limit of the control group \(.*/pounce-test-.*\) is too small for --memory 1.00 GiB' "$err" ||
  fail 'the lower budget is not said'
budget=$(sed -nE 's/.*"budget": ([0-9]+).*/\1/p' r.json)
((budget >= least && budget <= least + (24 << 20))) || fail "a budget of $budget in a group of $process + 16 MiB"
rm o.png r.json
# Less ends before the work, with a sentence: here the kernel would kill.
for memory in "$least" 1GiB 2MiB; do
  in_group 4 $((12 << 20)) "${job[@]}" --memory "$memory"
  [[ $(wc -l <"$err") == 1 ]] || fail 'not one sentence'
  err_has "pounce-test-$$/$limit_file) is 12.0 MiB: this job needs at least "
  err_has 'raise that limit to '
  [[ ! -e o.png ]] || fail 'an image was written'
done
in_group 4 $((12 << 20)) "${job[@]}" --plan
