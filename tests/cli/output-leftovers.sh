# SPDX-License-Identifier: Apache-2.0
# A job that was killed just before its output got its name leaves a hidden file, which the next job with that
# output removes; never one that a living process holds, nor one that is none of these.
source "$(dirname "$0")/support.sh"
make_job
mkdir out
touch out/.o.png.123-0.tmp out/.o.png.99999-17.tmp out/.o.png.4711-1.tmp
touch out/.other.png.123-0.tmp out/.o.png.tmp out/.o.png.12a-0.tmp out/.o.png.-1.tmp
ln -s "$PWD/skin.ppm" out/.o.png.5-5.tmp
exec 8<>out/.o.png.4711-1.tmp
flock -x 8
left='.o.png.-1.tmp .o.png.12a-0.tmp .o.png.4711-1.tmp .o.png.5-5.tmp .o.png.tmp .other.png.123-0.tmp '
expect 0 transfer source.obj target.obj -o out/o.png --size 64 --no-cache -q
[[ $(ls -A out | LC_ALL=C sort | tr '\n' ' ') == "${left}o.png " ]] || fail "there are: $(ls -A out)"
[[ -e skin.ppm ]] || fail 'what a link led to was removed'
exec 8>&-
expect 0 transfer source.obj target.obj -o out/o.png --size 64 --no-cache -q
[[ ! -e out/.o.png.4711-1.tmp ]] || fail 'the file of a dead process stayed'

# Also one that nobody may write to, and for root one that belongs to whom the output belongs to.
if [[ $(id -u) == 0 ]] && command -v setpriv >/dev/null; then
  chmod 755 "$work" && chmod 777 out
  touch out/.o.png.6-6.tmp && chown 65534:65534 out/.o.png.6-6.tmp out/o.png
  expect 0 transfer source.obj target.obj -o out/o.png --size 64 --no-cache -q
  [[ ! -e out/.o.png.6-6.tmp ]] || fail 'a leftover of the owner of the output stayed'
  touch out/.o.png.6-6.tmp && chmod 444 out/.o.png.6-6.tmp && chown 65534:65534 out/.o.png.6-6.tmp
  setpriv --reuid 65534 --clear-groups "$POUNCE" transfer source.obj target.obj -o out/o.png --size 64 --no-cache -q \
    2>"$err" || fail 'the job as nobody'
  [[ ! -e out/.o.png.6-6.tmp ]] || fail 'a leftover without write permission stayed'
  rm -f out/o.png
fi

# A job's own file is locked while it has a name: many at once, each with the same output, do not hurt each other.
for i in 1 2 3 4; do "$POUNCE" transfer source.obj target.obj -o out/o.png --size 256 --no-cache -q 2>>"$err" & done
wait
expect 0 transfer source.obj target.obj -o expected.png --size 256 --no-cache -q
cmp out/o.png expected.png || fail 'jobs with one output disturbed each other'
silent "$err"

# Beside an output that is skipped, too: nobody writes it.
touch out/.o.png.0-0.tmp out/.o.png.7-3.tmp
expect 0 transfer source.obj target.obj -o out/o.png --size 256 --no-cache --skip-existing
err_has 'skipped 1 file'
[[ ! -e out/.o.png.0-0.tmp && ! -e out/.o.png.7-3.tmp ]] || fail 'what dead jobs left stays beside an output that is skipped'

# Where there are no nameless files (without /proc here) the file has its hidden name from the start; a kill at any
# time leaves it.
if [[ $(id -u) == 0 ]] && unshare -m mount -t tmpfs none /proc 2>/dev/null; then
  named() { exec unshare -m bash -c 'mount -t tmpfs none /proc && exec "$@"' - "$POUNCE" "$@"; }
  (named transfer source.obj target.obj -o out/n.png --size 4096 --no-cache -q) 2>/dev/null & job=$!
  for wait in $(seq 3000); do compgen -G 'out/.n.png.*.tmp' >/dev/null && break; sleep 0.01; done
  kill -STOP $job
  compgen -G 'out/.n.png.*.tmp' >/dev/null || fail 'the file has no hidden name'
  (named transfer source.obj target.obj -o out/n.png --size 64 --no-cache -q) || fail 'a second job fails'
  compgen -G 'out/.n.png.*.tmp' >/dev/null || fail 'the file of a living process was removed'
  { kill -9 $job && wait $job; } 2>/dev/null || true
  compgen -G 'out/.n.png.*.tmp' >/dev/null || fail 'a killed job left nothing: this test tests nothing'
  (named transfer source.obj target.obj -o out/n.png --size 64 --no-cache -q) || fail 'a third job fails'
  compgen -G 'out/.n.png.*.tmp' >/dev/null && fail 'what a killed job left stayed'
else
  echo 'SKIPPED: outputs without nameless files (needs root and mount namespaces)'
fi
exit 0
