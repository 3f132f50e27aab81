# SPDX-License-Identifier: Apache-2.0
# What is there but no readable file is exit 5 with its reason, at once: nothing is waited for.
source "$(dirname "$0")/support.sh"
make_job
mkfifo pipe.png
mkdir folder.png
mask mask.pgm 16 16 255
at_once() { # WORDS OPTION...
  local words=$1 got=0
  shift
  timeout 20 "$POUNCE" transfer source.obj target.obj -o o.png --no-cache "$@" >"$out" 2>"$err" </dev/null || got=$?
  [[ $got == 5 ]] || fail "exit status $got, not 5: $*"
  err_has "$words"
}
for name in pipe.png folder.png /dev/zero; do
  at_once "$name" --source-texture "baseColor=$name"
  at_once "not a file" --source-texture "baseColor=$name"
  at_once "$name" --onto "$name"
  at_once "$name" --onto skin.ppm --mask "$name"
done
at_once 'folder.png: cannot read: it is a folder' --source-texture baseColor=folder.png
at_once 'set.<UDIM>.png' --source-texture 'baseColor=set.<UDIM>.png'
at_once 'skin.ppm/none.png: cannot open: Not a directory' --source-texture baseColor=skin.ppm/none.png
at_once 'gone.png: cannot open: No such file or directory' --onto gone.png
at_once 'gone.png: missing for --mask' --onto skin.ppm --mask gone.png
for name in pipe.png folder.png gone.png; do
  got=0
  timeout 20 "$POUNCE" compare "$name" skin.ppm >"$out" 2>"$err" </dev/null || got=$?
  [[ $got == 5 ]] || fail "compare $name: exit status $got, not 5"
  err_has "$name"
done
# The same as a map of a material.
for name in pipe.png folder.png gone.png; do
  quad source "$name"
  at_once "$name"
done
if [[ $(id -u) != 0 ]]; then
  chmod 0 skin.ppm
  quad source skin.ppm
  at_once 'skin.ppm: cannot open: Permission denied'
fi
[[ ! -e o.png ]] || fail 'an image was written'
