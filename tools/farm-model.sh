#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Where sharing a job between tasks ends to scale: a model of UDIMS images of SIZE² on 1, 10, ... workers, from what a
# task is measured to take here: its CPU, its calls on files (strace, which must be installed), what it reads and writes.
# Prints time, gigabytes a second and calls a second on the shared file system, and where a file system of so many
# gigabytes and calls a second is what the job waits for.
# Usage: tools/farm-model.sh [UDIMS] [SIZE] [GB_PER_S] [CALLS_PER_S]   (default 8990 8192 10 50000), after tools/test.sh
# A grid of UDIMs has 8999 tiles at most.
set -euo pipefail
cd "$(dirname "$0")/.."
udims=${1:-8990} size=${2:-8192} disk=${3:-10} calls=${4:-50000}
pounce=$PWD/build/release/pounce fixture=$PWD/build/release/pounce-fixture
[[ -x $pounce && -x $fixture ]] || { echo "build first: tools/test.sh" >&2; exit 2; }
command -v strace >/dev/null || { echo "install strace first" >&2; exit 2; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
"$fixture" plane -o plane.glb --triangles 20000 --texture 4096 >/dev/null
# Each UDIM is a hundredth of a hundredth of the plane and covers 0.9 of its image.
grid() {  # grid N
  awk -v n="$1" 'BEGIN {
    for (i = 0; i < n; ++i) {
      x = 0.05 + 0.009 * (i % 100); y = 0.05 + 0.009 * int(i / 100); u = i % 10; v = int(i / 10); s = 0.95
      printf "v %f %f 0\nv %f %f 0\nv %f %f 0\nv %f %f 0\n", x, y, x + .009, y, x + .009, y + .009, x, y + .009
      printf "vt %f %f\nvt %f %f\nvt %f %f\nvt %f %f\n", u, v, u + s, v, u + s, v + s, u, v + s
      k = 4 * i
      printf "f %d/%d %d/%d %d/%d %d/%d\n", k + 1, k + 1, k + 2, k + 2, k + 3, k + 3, k + 4, k + 4
    } }'
}
grid "$udims" >grid.obj
# measure TASKS SIZE: one task of so many; its CPU, file calls, bytes read and written.
measure() {
  rm -rf job out
  local line=(plane.glb grid.obj -o 'out/<UDIM>.png' --size "$2" --cache cache --threads 1)
  "$pounce" prepare "${line[@]}" --job-folder job --tasks "$1" -q 2>/dev/null
  strace -f -qq -c -e trace=%file,fsync,fdatasync,flock,getdents64,ftruncate,close -o calls \
    "$pounce" transfer --job job --task 1/"$1" -q 2>/dev/null
  local made written
  made=$(ls out | wc -l) written=$(du -sb out | cut -f 1)
  rm -rf out job/tasks job/parts
  /usr/bin/env bash -c 'TIMEFORMAT="%U %S"; time "$@"' - "$pounce" transfer --job job --task 1/"$1" -q 2>cpu
  awk -v made="$made" -v written="$written" 'FNR == NR { if ($NF == "total") calls = $(NF - 1) ~ /^[0-9]+$/ && NF > 4 ? $4 : $3; next }
    { cpu = $1 + $2 } END { print made, cpu, calls, written }' calls <(tail -n 1 cpu)
}
read -r few few_cpu few_calls _ < <(measure "$udims" 64)
read -r many many_cpu many_calls _ < <(measure $((udims / 50)) 64)
read -r big big_cpu _ big_bytes < <(measure "$udims" "$size")
awk -v few="$few" -v fc="$few_cpu" -v fk="$few_calls" -v many="$many" -v mc="$many_cpu" -v mk="$many_calls" -v big="$big" \
  -v bc="$big_cpu" -v bb="$big_bytes" -v n="$udims" -v size="$size" -v disk="$disk" -v rate="$calls" \
  -v mesh="$(stat -c %s grid.obj)" 'BEGIN {
    per_image = (mk - fk) / (many - few); per_task = fk - few * per_image
    fixed = fc; image_s = (bc - fc) / big; bytes = bb / big
    printf "a task: %.2f s of CPU and %d calls to begin (a mesh of %d UDIMs), %.1f MB read\n", fixed, per_task, n, mesh / 1e6
    printf "an image of %d²: %.2f s of CPU, %d calls, %.1f MB written\n", size, image_s, per_image, bytes / 1e6
    printf "%8s %10s %8s %10s %12s  %s\n", "workers", "time", "busy", "GB/s", "calls/s", "waits for"
    for (w = 1; w <= 10000; w *= 10) {
      tasks = w
      each = n / tasks; if (each < 1) each = 1
      s = fixed + each * image_s
      gb = n * bytes / 1e9 + tasks * mesh / 1e9; ops = n * per_image + tasks * per_task
      t = s; why = "workers"
      if (gb / disk > t) { t = gb / disk; why = "the bytes of the file system" }
      if (ops / rate > t) { t = ops / rate; why = "the calls of the file system" }
      printf "%8d %9.0f s %6.0f %% %10.2f %12.0f  %s\n", w, t, 100 * n * image_s / (w * t), gb / t, ops / t, why
    }
    end = image_s * disk / (bytes / 1e9)
    printf "bytes are the end at %.0f workers; calls at %.0f\n", end, image_s * rate / per_image
  }'
