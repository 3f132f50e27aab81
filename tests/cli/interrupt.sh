# SPDX-License-Identifier: Apache-2.0
# SIGINT and SIGHUP stop a job with status 130, SIGTERM and SIGUSR1 with 143, whatever it is at; the old image stays, nothing half-written is left.
skips=made
source "$(dirname "$0")/support.sh"
make_job
status_of() { case $1 in TERM | USR1) echo 143 ;; *) echo 130 ;; esac; }
for signal in INT TERM HUP USR1; do
  echo 'an old picture' >o.png
  status=0
  : >"$err"  # what the last run said must not pass for this one's first word
  # SIGINT is ignored in background jobs of a script, hence the subshell that restores it.
  env --default-signal=INT "$POUNCE" transfer source.obj target.obj -o o.png --size 16384 --no-cache \
    --progress json 2>"$err" >"$out" &
  job=$!
  for wait in $(seq 200); do
    grep -q '"stage":"project"' "$err" && break
    sleep 0.05
  done
  grep -q '"stage":"project"' "$err" || fail 'the job never came to its work'
  kill -$signal $job || fail 'the job was done before the signal'
  wait $job || status=$?
  [[ $status == "$(status_of $signal)" ]] || fail "status $status after SIG$signal"
  err_has 'run the same command again'
  [[ $(cat o.png) == 'an old picture' ]] || fail 'the old picture was touched'
  only_files o.png skin.ppm source.mtl source.obj target.obj
done

# Before any job runs, too: here it waits for room in a pipe, as soon as its handlers are there.
mkfifo pipe
exec 3<>pipe
head -c 65536 /dev/zero >&3
# handles SIGNAL: whether the job has its own handler for it by now. They come one after the other, and before the
# program is there, the shell's own copy has some.
handles() {
  [[ $(readlink "/proc/$job/exe") == "$(readlink -f "$POUNCE")" ]] &&
    (($(sed -n 's/^SigCgt:[[:space:]]*/0x/p' "/proc/$job/status") & 1 << ($(kill -l "$1") - 1)))
}
for signal in INT TERM HUP USR1; do
  status=0
  env --default-signal=INT "$POUNCE" --help >&3 2>"$err" &
  job=$!
  for wait in $(seq 100); do
    handles $signal && break
    sleep 0.05
  done
  kill -$signal $job
  wait $job || status=$?
  [[ $status == "$(status_of $signal)" ]] || fail "status $status after SIG$signal without a job"
done
# What nohup starts outlives its terminal.
status=0
env --ignore-signal=HUP "$POUNCE" --help >&3 2>"$err" &
job=$!
for wait in $(seq 100); do
  handles TERM && break
  sleep 0.05
done
kill -HUP $job
sleep 0.1
! grep -q '^State:[[:space:]]*Z' "/proc/$job/status" || fail 'an ignored SIGHUP was heard'
kill -TERM $job
wait $job || status=$?
[[ $status == 143 ]] || fail "status $status after SIGTERM"
