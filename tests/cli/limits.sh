# SPDX-License-Identifier: Apache-2.0
# Whatever the system refuses (memory, threads, stacks, open files), a command ends with 0, 4 or 5 and one
# sentence, and what it leaves is whole. A sample of limits and commands; tools/slow-limits.sh takes all of them, in
# steps of POUNCE_LIMIT_STEP MiB.
source "$(dirname "$0")/support.sh"
step=${POUNCE_LIMIT_STEP:-40}
sample=$([[ -v POUNCE_LIMIT_STEP ]] && echo 1 || echo 7)
chmod 755 "$work"
chmod 777 .
umask 022

"$POUNCE_FIXTURE" head -o in --triangles 2000 --texture 512 --target-size 64 >/dev/null
"$POUNCE_FIXTURE" splats -o in/scene.ply --count 20000 --target-size 64 >/dev/null
make_job
printf '%s\n' 'v 0 0 0' 'v 2 0 0' 'v 2 1 0' 'v 0 1 0' 'vt 0 0' 'vt 2 0' 'vt 2 1' 'vt 0 1' 'f 1/1 2/2 3/3 4/4' >tiles.obj

names=(mesh splats tiles model gaussians maps inspect compare)
declare -A command=(
  [mesh]='transfer in/head_src.glb in/head_same.glb -o out/o.png --size 1024 --no-cache --threads 4 -q'
  [splats]='transfer in/scene.ply in/scene_target.glb -o out/o.png --size 256 --no-cache --threads 4 -q'
  [tiles]='transfer source.obj tiles.obj -o out/o.<UDIM>.tif --size 512 --no-cache -q'
  [model]='transfer in/head_src.glb in/head_same.glb -o out/o.glb --size 256 --cache cache -q'
  [gaussians]='gaussians in/head_src.glb -o out/o.ply --no-cache -q'
  [maps]='maps in/head_same.glb -o out/o_<CHANNEL>.exr --size 512 --no-cache -q'
  [inspect]='inspect in/head_src.glb'
  [compare]='compare expected/mesh/o.png expected/mesh/o.png'
)
for name in "${names[@]}"; do
  rm -rf out && mkdir out
  # shellcheck disable=SC2086  # words on purpose
  expect 0 ${command[$name]}
  mkdir -p expected/$name
  cp -r out/. expected/$name/
done
rm -rf cache out && mkdir -m 777 out

runs=0 asked=0
# under WHAT NAME PROGRAM...: one run of a command under a limit that the program before it sets.
under() {
  local what=$1 name=$2 status=0 file
  shift 2
  asked=$((asked + 1))
  ((asked % sample == 0)) || return 0
  rm -rf out/* out/.[!.]* cache
  # shellcheck disable=SC2086
  timeout 60 "$@" "$POUNCE" ${command[$name]} >"$out" 2>"$err" || status=$?
  runs=$((runs + 1))
  # The loader of programs has no memory for the libraries: nothing of ours has run.
  [[ $status == 127 ]] && grep -q 'error while loading shared libraries' "$err" && return
  [[ $status == 0 || $status == 4 || $status == 5 ]] || fail "$name, $what: exit status $status"
  if [[ $status != 0 ]]; then
    [[ $(wc -l <"$err") == 1 ]] || fail "$name, $what: not one sentence"
    grep -q '^pounce: error: ' "$err" || fail "$name, $what: no error is told"
  fi
  for file in $(ls -A out); do
    cmp -s "out/$file" "expected/$name/$file" || fail "$name, $what: out/$file is not whole or not right"
  done
}

for name in "${names[@]}"; do
  for ((mib = 40; mib <= 640; mib += step)); do
    under "--as=$mib MiB" $name prlimit --as=$((mib << 20))
    under "--data=$mib MiB" $name prlimit --data=$((mib << 20))
  done
  for files in 3 4 5 6 8 12 16 24; do under "--nofile=$files" $name prlimit --nofile=$files; done
  for kib in 64 256 1024 4096; do under "--stack=$kib KiB" $name prlimit --stack=$((kib << 10)):; done
done

# Root may have as many threads as it likes.
if [[ $(id -u) == 0 ]] && command -v setpriv >/dev/null &&
  setpriv --reuid 65534 --clear-groups "$POUNCE" --version >/dev/null 2>&1; then
  for name in "${names[@]}"; do
    for threads in 0 1 2 3 4 5 6 8; do
      under "--nproc=$threads" $name setpriv --reuid 65534 --clear-groups prlimit --nproc=$threads
    done
  done
else
  echo "SKIPPED: limits of threads (needs root and setpriv)"
fi
echo "FIGURE runs under a limit: $runs"
