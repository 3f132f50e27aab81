# SPDX-License-Identifier: Apache-2.0
# What happens to farms. Usage: faults.sh [SIZE of the large image]; see tools/slow-farm.sh.
source "$(dirname "$0")/support.sh"
large=${1:-16384}
start_cluster 3
"$POUNCE_FIXTURE" plane -o plane.glb --triangles 20000 --texture 2048 >/dev/null
udims 20 >twenty.obj

# cpu COMMAND...: seconds, its children's too.
cpu() { { /usr/bin/env TIMEFORMAT='%U %S' bash -c 'time "$@" >/dev/null 2>&1' - "$@"; } 2>&1 | awk '{ print $1 + $2 }'; }
# shares FOLDER ONE_S: how evenly the tasks of a job were cut, and what they took together against one process.
shares() {
  "$POUNCE" status "$1" --json | awk -v one="$2" -v name="$1" '
    $1 == "\"task\":" { gsub(/[",]/, "", $2); task = $2 }
    $1 == "\"cpu_s\":" { s = $2 + 0; all += s; if (task ~ /^[0-9]+$/) { tasks += s; n += 1; if (s > most) most = s } }
    END { printf "%s: %d tasks, the longest %.2f of their mean; all together %.2f of one process (%.1f s of %.1f s)\n",
          name, n, most * n / tasks, all / one, all, one }'
}
wait_for() {  # wait_for TEST: until it is true
  local try
  for try in $(seq 600); do
    eval "$1" && return 0
    sleep 0.1
  done
  fail "in vain: $1"
}
running() { squeue -h -t running -n pounce-task -o %N | grep -qx "$1"; }

job=(plane.glb twenty.obj -o 'twenty.<UDIM>.png' --size 2048)
one_s=$(cpu "$POUNCE" transfer "${job[@]}" -q --threads 1 --no-cache)
mkdir quiet && mv twenty.*.png quiet
submit job "${job[@]}" --tasks 6
settle 300
same quiet
shares job "$one_s"
rm twenty.*.png

# A node dies, with all that it was at: Slurm starts its tasks elsewhere.
submit job.node "${job[@]}" --tasks 12
wait_for 'running n2'
cluster kill-node n2
settle 300
same quiet
echo "a node was lost: the same bytes"
cluster start-node n2
rm twenty.*.png

# The controller is restarted while tasks are running, and a task is killed: submit does what is missing.
submit job.controller "${job[@]}" --tasks 12
wait_for 'running n1'
cluster restart-controller
(until pkill -KILL -f -- 'job.controller --task 7/12'; do sleep 0.01; done) & killer=$!
settle 300
wait $killer
submit job.controller
settle 300
same quiet
echo "the controller was restarted, and a task was killed: the same bytes"
rm twenty.*.png

# Scratch files are on each node's own disk, and that of n3 is full.
mkdir scratch
nsenter -t "$(pgrep -P "$(cat "$work/slurm/node-n3.pid")")" -m mount -t tmpfs -o size=64k none "$PWD/scratch"
submit job.full "${job[@]}" --tasks 12 --temp "$PWD/scratch"
settle 400
if [[ $(state job.full assemble) != done ]]; then submit job.full -- --exclude=n3 && settle 300; fi
grep -lq 'No space left' job.full/log/task-* || fail 'no disk was full'
same quiet
echo "the disk of a node was full: the same bytes"
rm twenty.*.png

# One large image, in parts; two more workers have the share of a third, on purpose.
one=(plane.glb plane.glb -o one.png --size "$large")
one_s=$(cpu "$POUNCE" transfer "${one[@]}" -q --threads 1 --no-cache)
mkdir quiet.one && mv one.png quiet.one
submit job.one "${one[@]}" --tasks 6
wait_for 'running n1'
"$POUNCE" transfer --job job.one --task 2/6 --memory 300MiB -q & first=$!
"$POUNCE" transfer --job job.one --task 2/6 --threads 2 -q & second=$!
wait $first && wait $second
settle 600
same quiet.one
echo "one image of $large², two workers on one share: the same bytes"
rm one.png
submit job.quiet "${one[@]}" --tasks 6
settle 600
same quiet.one
shares job.quiet "$one_s"
