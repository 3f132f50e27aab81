# SPDX-License-Identifier: Apache-2.0
# A cache that somebody else may write to: links in it lead nobody to write, empty or remove files elsewhere, and
# a pack that cannot be believed and not be removed is left out.
source "$(dirname "$0")/support.sh"
make_job
mkdir victim
job() { expect "$1" transfer source.obj target.obj -o o.png --size 64 --cache cache -q; }
job 0
cp o.png expected.png
pristine() { rm -rf cache victim && mkdir victim && echo precious | tee victim/file victim/1-0.part >victim/a.hashes && job 0; }
# The job does without, or says that the cache cannot be used; it never crashes or makes another picture.
refused_or_right() {
  local got=0
  rm -f o.png
  "$POUNCE" transfer source.obj target.obj -o o.png --size 64 --cache cache -q 2>"$err" || got=$?
  case $got in
    0) cmp o.png expected.png || fail 'another picture' ;;
    5) err_has 'cache' && [[ ! -e o.png ]] || fail 'a picture of a job that failed' ;;
    *) fail "exit status $got for a link in the cache" ;;
  esac
}
unharmed() {
  [[ $(cat victim/* | sort -u) == precious && $(ls -A victim | wc -l) == 3 ]] || fail "harm done by a link in $1"
}

# A lock of a pack that is to be made, the lock of the folder, the folders of parts and of locks.
pristine
rm -rf cache
mkdir -p cache/v3
ln -s "$PWD/victim/file" cache/v3/space.lock
refused_or_right
unharmed space.lock
for folder in tmp locks; do
  pristine
  rm -rf cache/v3/$folder cache/v3/*/*.pack
  ln -s "$PWD/victim" cache/v3/$folder
  refused_or_right
  unharmed $folder
done
# A pack that is a link counts as none.
pristine
pack=$(ls cache/v3/colour/*.pack)
mv "$pack" elsewhere.pack
ln -s "$PWD/elsewhere.pack" "$pack"
touch -d 2001-01-01 elsewhere.pack
job 0
cmp o.png expected.png
[[ $(stat -c %Y elsewhere.pack) == $(date -d 2001-01-01 +%s) ]] || fail 'the time of a file elsewhere was set'

# So does one that is a pipe or a folder; no job waits for it or ends by it.
for make in mkfifo mkdir; do
  pristine
  pack=$(ls cache/v3/colour/*.pack)
  rm "$pack"
  $make "$pack"
  job 0
  cmp o.png expected.png
  ! grep -q 'not a file' "$err" || fail "$make stops a job"
done
# A link in a folder's place is told as such.
pristine
mv cache/v3/geometry elsewhere.geometry
ln -s "$PWD/elsewhere.geometry" cache/v3/geometry
expect 5 cache info --cache cache
err_has 'it is a link, and links are not followed there'

# Another user's damaged pack, in a folder where each removes their own.
if [[ $(id -u) == 0 ]] && command -v setpriv >/dev/null &&
  setpriv --reuid 65534 --clear-groups "$POUNCE" --version >/dev/null 2>&1; then
  pristine
  pack=$(ls cache/v3/colour/*.pack)
  printf 'x' | dd of="$pack" bs=1 seek=70 conv=notrunc status=none
  chmod 755 "$work" && chmod 777 . && find cache -type d -exec chmod 1777 {} + && rm o.png
  status=0
  setpriv --reuid 65534 --clear-groups "$POUNCE" transfer source.obj target.obj -o o.png --size 64 --cache cache \
    >"$out" 2>"$err" || status=$?
  [[ $status == 0 ]] || fail "exit status $status for another user's damaged pack"
  err_has 'ignored; rebuilding it'
  cmp o.png expected.png
fi
