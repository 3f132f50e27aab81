# SPDX-License-Identifier: Apache-2.0
# A file system without flock(): the usual cache is left out with a warning, one that was named is refused with the
# reason, and tasks of a job need none.
source "$(dirname "$0")/support.sh"
command -v cc >/dev/null || { echo 'SKIPPED: no C compiler' && exit 77; }
[[ -z $(ldd "$POUNCE_BUILD_DIR/pounce" | grep -E 'asan|tsan') ]] || { echo 'SKIPPED: sanitizers want to be first' && exit 77; }
printf '#include <errno.h>\nint flock(int file, int what) { (void)file, (void)what; errno = ENOLCK; return -1; }\n' |
  cc -shared -fPIC -x c -o "$work/no-locks.so" -
export LD_PRELOAD=$work/no-locks.so
make_job
job=(transfer source.obj target.obj --size 300)
expect 0 "${job[@]}" -o o.png
err_has 'the cache cannot be used: '
err_has 'cannot lock'
expect 5 "${job[@]}" -o p.png --cache named
err_has 'choose another folder with --cache, or run with --no-cache'
for task in 1 2; do expect 0 "${job[@]}" -o q.png --no-cache --job-folder job --task $task/2; done
[[ ! -e q.png ]] || fail 'the image was not cut'
expect 0 assemble job --no-cache
cmp o.png q.png || fail 'other bytes without locks'
