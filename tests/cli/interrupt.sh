# SPDX-License-Identifier: Apache-2.0
# SIGINT and SIGTERM stop a job with status 130; the old image stays, nothing half-written is left.
source "$(dirname "$0")/support.sh"
make_job
for signal in INT TERM; do
  echo 'an old picture' >o.png
  status=0
  : >"$err"  # what the last run said must not pass for this one's first word
  # SIGINT is ignored in background jobs of a script, hence the subshell that restores it.
  env --default-signal=INT "$POUNCE" transfer source.obj target.obj -o o.png --size 16384 --no-cache \
    --progress json 2>"$err" >"$out" &
  job=$!
  for wait in $(seq 200); do
    [[ -s $err ]] && break
    sleep 0.05
  done
  kill -$signal $job
  wait $job || status=$?
  [[ $status == 130 ]] || fail "status $status after SIG$signal"
  [[ $(cat o.png) == 'an old picture' ]] || fail 'the old picture was touched'
  only_files o.png skin.ppm source.mtl source.obj target.obj
done
