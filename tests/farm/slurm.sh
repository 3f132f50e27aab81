# SPDX-License-Identifier: Apache-2.0
# A real Slurm of two nodes makes what one process makes, and goes on when it is asked again.
source "$(dirname "$0")/support.sh"
start_cluster 2
"$POUNCE_FIXTURE" plane -o plane.glb --triangles 2000 --texture 512 >/dev/null
udims 6 >six.obj
job=(plane.glb six.obj -o 'six.<UDIM>.exr' --size 512)
"$POUNCE" transfer "${job[@]}" -q
mkdir quiet && mv six.*.exr quiet

submit job "${job[@]}" --tasks 3 --mem 600MiB
settle 60
[[ $(state job assemble) == done ]] || fail "not assembled: $("$POUNCE" status job)"
same quiet
submit job
grep -q 'all is done' submitted || fail "what is done is done again: $(cat submitted)"

# One image. A task is killed, as the kernel does where memory ends: Slurm calls that failed and leaves it; assembling
# says what is missing, and submitting again does that alone, with twice the memory.
one=(plane.glb plane.glb -o one.png --size 1500)
"$POUNCE" transfer "${one[@]}" -q
mkdir quiet.one && mv one.png quiet.one
(until pkill -KILL -f -- 'job.one --task 2/2'; do sleep 0.01; done) &
killer=$!
submit job.one "${one[@]}" --tasks 2 --mem 600MiB
settle 60
wait $killer || fail 'no task was killed'
[[ $(state job.one 1) == done && $(state job.one 2) == failed ]] || fail "$("$POUNCE" status job.one)"
grep -q 'run what is missing of task 2' job.one/log/assemble-*.log || fail 'what is missing is not said'
submit job.one
grep -q 'tasks [0-9]* 2 with 1.2 GiB' submitted || fail "not task 2 with twice the memory: $(cat submitted)"
settle 60
[[ $(state job.one assemble) == done ]] || fail "not assembled: $("$POUNCE" status job.one)"
same quiet.one

# Submitted twice in a row: the second time all is under way, and nothing is done twice.
rm one.png
submit job.twice "${one[@]}" --tasks 2 --mem 600MiB
submit job.twice
grep -q 'all is under way' submitted || fail "done twice: $(cat submitted)"
settle 60
same quiet.one
