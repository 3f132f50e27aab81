# SPDX-License-Identifier: Apache-2.0
# --threads takes 1 to 1024; the report says how many were used: no more than there are cores.
source "$(dirname "$0")/support.sh"
rejected --threads -1 0
make_job
for threads in 1 3; do
  expect 0 transfer source.obj target.obj -o $threads.png --threads $threads --report - -q
  used=$((threads < $(nproc) ? threads : $(nproc)))
  out_has "\"threads\": $used,"
done
cmp 1.png 3.png || fail 'the picture depends on the number of threads'
# More than there are cores: no word of the scheduler's.
expect 0 transfer source.obj target.obj -o many.png --threads 64 -q
silent "$err"
