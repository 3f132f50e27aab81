# SPDX-License-Identifier: Apache-2.0
# A job that tasks share: what they make together is what one run makes, byte for byte, whoever dies, comes twice or
# never comes. No scheduler is needed for that: each task is a process.
skips=made
source "$(dirname "$0")/support.sh"
"$POUNCE_FIXTURE" plane -o plane.glb --triangles 2000 --texture 512 >/dev/null
cmp_all() {  # cmp_all FOLDER: the files there, and here
  local file
  for file in "$1"/*; do cmp "$file" "${file##*/}" || fail "other bytes in ${file##*/}"; done
}
share() {  # share FOLDER TASK: as a worker would, without knowing what the job is
  expect 0 transfer --job "$1" --task "$2"
}
# Five UDIMs over the plane, of which the first has a hundred times the area of the last in its image, and one that
# finds nothing, so that no file says that it was made.
five_udims() {
  local n=0 side
  for side in 0.99 0.5 0.3 0.2 0.1 0.3; do
    local x0 x1
    x0=$(awk "BEGIN { print 0.05 + 0.18 * $n + ($n > 4) }") x1=$(awk "BEGIN { print 0.2 + 0.18 * $n + ($n > 4) }")
    printf 'v %s 0.05 0\nv %s 0.05 0\nv %s 0.95 0\nv %s 0.95 0\n' "$x0" "$x1" "$x1" "$x0"
    awk "BEGIN { n = $n; s = $side; printf \"vt %f 0\nvt %f 0\nvt %f %f\nvt %f %f\n\", n, n + s, n + s, s, n, s }"
    printf 'f %d/%d %d/%d %d/%d %d/%d\n' $((4*n+1)) $((4*n+1)) $((4*n+2)) $((4*n+2)) $((4*n+3)) $((4*n+3)) $((4*n+4)) $((4*n+4))
    n=$((n + 1))
  done
}
five_udims >five.obj

# --- whole images, and parts of the large one --------------------------------------------------------------------------
udims=(plane.glb five.obj -o 'o.<UDIM>.png' --size 512 --cache cache)
expect 0 transfer "${udims[@]}"
mkdir quiet && mv o.*.png quiet
expect 0 prepare "${udims[@]}" --job-folder job --tasks 3
err_has 'the cache has'
[[ -z $(ls o.* 2>/dev/null) ]] || fail 'preparing wrote images'
for task in 3 1 2; do share job $task/3; done
[[ -n $(ls job/parts) ]] || fail 'no image was cut: this test shows less than it should'
expect 0 status job
out_has '3 tasks: 3 done'
expect 0 assemble job
cmp_all quiet
[[ -z $(ls job/parts/*.part 2>/dev/null) ]] || fail "parts are left: $(ls job/parts)"
share job 2/3
err_has 'skipped'
expect 0 assemble job
cmp_all quiet

# --- one image, in parts: with a mask, all formats, and a model --------------------------------------------------------
for kind in png exr tif tx jpg glb; do
  one=(plane.glb plane.glb -o "one.$kind" --size 700 --cache cache)
  [[ $kind == glb ]] || one+=(--coverage "mask.png")
  expect 0 transfer "${one[@]}"
  mkdir "quiet.$kind" && mv "one.$kind" "quiet.$kind"
  [[ $kind == glb ]] || mv mask.png "quiet.$kind"
  for task in 1 2 3; do
    expect 0 transfer "${one[@]}" --job-folder "job.$kind" --task $task/3 --threads $task --memory $((task * 64))MiB
  done
  [[ ! -e one.$kind ]] || fail "a task wrote one.$kind, which is not its own"
  expect 0 assemble "job.$kind"
  cmp_all "quiet.$kind"
  rm -f "one.$kind" mask.png
done

# --- who dies, comes late or twice -------------------------------------------------------------------------------------
big=(plane.glb plane.glb -o big.png --size 4096 --filter cubic --cache cache --threads 1)
expect 0 transfer "${big[@]}"
mkdir quiet.big && mv big.png quiet.big
kill_job 0.5 transfer "${big[@]}" --job-folder jobs/big --task 1/2
[[ -s $(ls -S jobs/big/parts/*.part | head -n 1) ]] || fail 'nothing was kept of a task that was killed'
expect 0 transfer "${big[@]}" --job-folder jobs/big --task 1/2 --report again.json
expect 75 assemble jobs/big
err_has 'big.png: not all of it is there; run what is missing of task 2 again'
err_has 'assemble'
expect 0 status jobs/big
out_has '1 done, 1 missing'
# Two at the same share, with other pieces: neither waits for the other, and neither does harm.
"$POUNCE" transfer --job jobs/big --task 2/2 --memory 96MiB -q & first=$!
"$POUNCE" transfer --job jobs/big --task 2/2 --memory 1GiB -q & second=$!
wait $first || fail "the first of two workers: status $?"
wait $second || fail "the second of two workers: status $?"
expect 0 assemble jobs/big
cmp_all quiet.big
# A part that somebody cut off is missing as far as it was cut.
rm big.png
for task in 1/2 2/2; do share jobs/big $task; done
part=$(ls -S jobs/big/parts/*.part | head -n 1)
truncate -s $(($(stat -c %s "$part") / 2)) "$part"
expect 75 assemble jobs/big
for task in 1/2 2/2; do share jobs/big $task; done
expect 0 assemble jobs/big
cmp_all quiet.big

# --- which task --------------------------------------------------------------------------------------------------------
usage() {  # usage WORDS VARIABLE=VALUE... -- ARGUMENT...
  local words=$1 variables=()
  shift
  while [[ $1 != -- ]]; do variables+=("$1") && shift; done
  shift
  local status=0
  env "${variables[@]}" "$POUNCE" transfer plane.glb plane.glb -o one.png --size 64 "$@" >"$out" 2>"$err" || status=$?
  [[ $status == 2 ]] || fail "exit status $status, not 2: $*"
  err_has "$words"
  [[ ! -e one.png ]] || fail 'an image was written'
}
usage 'no scheduler has set' A=1 -- --task auto/4
usage 'both SLURM_ARRAY_TASK_ID and SGE_TASK_ID are set' SLURM_ARRAY_TASK_ID=1 SGE_TASK_ID=1 -- --task auto/4
usage 'the array begins at 3' SLURM_ARRAY_TASK_ID=3 SLURM_ARRAY_TASK_MIN=3 -- --task auto/4
usage 'is no task of 4' JOB_COMPLETION_INDEX=4 -- --task auto/4
usage 'is no task of 4' PBS_ARRAY_INDEX=0 -- --task auto/4
usage 'no scheduler has set' SGE_TASK_ID=undefined -- --task auto/4
usage 'expected K/N' A=1 -- --task 5/4
usage 'expected K/N' A=1 -- --task 0/4
usage 'say of how many' JOB_COMPLETION_INDEX=1 -- --task auto
usage '--min-coverage' A=1 -- --task 1/2 --min-coverage 5
usage '--job-folder: is shared by tasks' A=1 -- --job-folder job
usage 'is the folder of another job' A=1 -- --job-folder job --task 1/3
usage 'expected K/N' A=1 -- --job-folder new --task 1
# The first task of an array of two makes the only image, whatever its scheduler calls it; there is no folder, so
# nothing is cut.
for variable in SLURM_ARRAY_TASK_ID=0 JOB_COMPLETION_INDEX=0 AWS_BATCH_JOB_ARRAY_INDEX=0 SGE_TASK_ID=1 PBS_ARRAY_INDEX=1 \
  'SLURM_ARRAY_TASK_ID=1 SLURM_ARRAY_TASK_MIN=1'; do
  rm -f one.png
  env $variable "$POUNCE" transfer plane.glb plane.glb -o one.png --size 64 --no-cache --task auto/2 -q
  [[ -e one.png ]] || fail "$variable: the first task has not made the image"
done
AWS_BATCH_JOB_ARRAY_INDEX=1 AWS_BATCH_JOB_ARRAY_SIZE=2 expect 0 transfer plane.glb plane.glb -o two.png --size 64 \
  --no-cache --task auto
[[ ! -e two.png ]] || fail 'the second task made the image of the first'
expect 2 transfer plane.glb five.obj -o 'o.<UDIM>.png' --size 512 --job-folder job --task 1/4
err_has '3 tasks share this job, not 4'

# --- commands, one a line ----------------------------------------------------------------------------------------------
rm -f o.*.png
expect 0 submit commands lines plane.glb five.obj -o 'o.<UDIM>.png' --size 512 --tasks 4
[[ $(wc -l <"$out") == 6 ]] || fail "not prepare, four tasks and assemble: $(cat "$out")"
cp "$out" lines.txt
sed -n 1p lines.txt | sh >/dev/null 2>&1
sed -n 3p lines.txt | sh >/dev/null 2>&1
expect 0 submit commands lines
[[ $(wc -l <"$out") == 5 ]] || fail "what is done is done again: $(cat "$out")"
sh "$out" >/dev/null 2>&1
cmp_all quiet
expect 0 submit commands lines
silent "$out"
expect 0 status lines --json
grep -q '"state": "done"' "$out" || fail 'status says nothing of done tasks'
expect 5 status nowhere
err_has 'is no job folder'
# A file that opens and cannot be read says so.
mkdir -p unread/job.json
expect 5 assemble unread
err_has 'job.json: cannot read'

# --- Slurm, without one ------------------------------------------------------------------------------------------------
expect 0 submit slurm dry plane.glb five.obj -o 'p.<UDIM>.png' --size 512 --tasks 4 --max-running 2 --partition night \
  --dry-run -- --account=show
out_has "'--array=1-4%2'"
out_has "'--partition=night' "
out_has "'--account=show'"
out_has 'scontrol requeue'
[[ ! -e dry ]] || fail '--dry-run made the folder'
status=0
env PATH=/nowhere "$POUNCE" submit slurm dry plane.glb five.obj -o 'p.<UDIM>.png' --size 512 --tasks 4 >"$out" 2>"$err" ||
  status=$?
[[ $status == 2 ]] || fail "status $status without sbatch"
err_has 'use pounce submit commands'
refused_count() { expect 2 submit commands never plane.glb five.obj -o 'p.<UDIM>.png' --tasks "$1" && err_has 'expected a whole number'; }
for count in 0 2.5 -1 many 100001; do refused_count $count; done
[[ ! -e never ]] || fail 'a refused line made the folder'
