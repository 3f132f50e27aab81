# SPDX-License-Identifier: Apache-2.0
# Folders of outputs that are not there are made when something is written into them, and only then. What cannot be a
# folder is exit 5 and named.
source "$(dirname "$0")/support.sh"
make_job
inputs=(skin.ppm source.mtl source.obj target.obj)
expect 0 transfer source.obj target.obj -o new/deep/o.png --coverage masks/m.png --report logs/run/report.json --no-cache -q
[[ -s new/deep/o.png && -s masks/m.png && -s logs/run/report.json ]] || fail 'an output is missing'
expect 0 maps target.obj -o 'maps/<CHANNEL>/m.exr' --size 4 -q
[[ -s maps/mask/m.exr ]] || fail 'a map is missing'
expect 0 gaussians source.obj -o splats/new/scene.ply -q
[[ -s splats/new/scene.ply ]] || fail 'the splats are missing'
rm -r new masks logs maps splats
# Neither a plan nor a job that fails leaves a folder.
expect 0 transfer source.obj target.obj -o new/deep/o.png --plan
out_has 'would write   new/deep/o.png'
expect 3 transfer target.obj target.obj -o new/deep/o.png
expect 4 transfer source.obj target.obj -o new/deep/o.png --memory 1MiB --no-cache
(ulimit -f 0 && expect 5 transfer source.obj target.obj -o new/deep/o.png --no-cache -q --temp /tmp) || exit 1
only_files "${inputs[@]}"
# What cannot be made is said before any work.
mkdir taken.png
expect 5 transfer source.obj target.obj -o taken.png
err_has 'taken.png: is a folder'
expect 5 transfer source.obj target.obj -o skin.ppm/new/o.png
err_has 'skin.ppm/new/o.png: skin.ppm is not a folder'
expect 5 transfer source.obj target.obj -o o.png --report skin.ppm/report.json
err_has 'skin.ppm/report.json'
# As whom permissions stop: every file is made anew in its folder, also where it replaces one that may be written.
locked() {
  local wanted=$1 got=0
  if [[ $(id -u) == 0 ]]; then
    as_nobody "$POUNCE" "${@:2}" --no-cache || got=$?
  else
    "$POUNCE" "${@:2}" --no-cache >"$out" 2>"$err" || got=$?
  fi
  [[ $got == "$wanted" ]] || fail "exit status $got, not $wanted: pounce ${*:2}"
}
if [[ $(id -u) == 0 ]] && ! as_nobody "$POUNCE" --version; then
  echo 'SKIPPED: folders that may not be written (root without setpriv)'
else
  mkdir locked open
  echo 'an old picture' >locked/old.png
  ln -s ../open/there.png locked/there.png
  ln -s ../locked/away.png open/away.png
  chmod 666 locked/old.png && chmod 555 locked && chmod 777 open
  for name in locked/o.png locked/old.png open/away.png; do
    locked 5 transfer source.obj target.obj -o $name --temp /tmp --plan
    err_has "$name: cannot create files in the folder "
    locked 5 transfer source.obj target.obj -o $name --temp /tmp
    ! grep -q project "$err" || fail "$name: refused after the work"
  done
  locked 5 transfer source.obj target.obj -o locked/new/o.png --plan
  err_has 'cannot create the folder locked/new in locked'
  locked 5 transfer source.obj target.obj -o open/o.png --coverage locked/m.png --plan
  err_has 'locked/m.png'
  locked 5 maps target.obj -o 'locked/<CHANNEL>.exr' --size 4
  err_has 'locked/position.exr: cannot create files'
  locked 5 gaussians source.obj -o locked/s.ply
  err_has 'locked/s.ply: cannot create files'
  locked 0 transfer source.obj target.obj -o locked/there.png --temp /tmp
  [[ -s open/there.png ]] || fail 'a link out of a locked folder leads nowhere'
  chmod 755 locked && rm -rf locked open
fi
ln -s round.png round.png
expect 5 transfer source.obj target.obj -o round.png --plan
err_has 'round.png: is a broken link'
rm round.png && mkfifo pipe.png
expect 5 transfer source.obj target.obj -o pipe.png --plan
err_has 'pipe.png: exists but is not a regular file'
rm pipe.png
only_files "${inputs[@]:0:3}" taken.png target.obj
# Tokens may be in the folders.
expect 0 transfer source.obj target.obj -o 'tree/<CHANNEL>/o.png' --no-cache -q
expect 0 transfer source.obj target.obj -o 'tree/<TARGET>/o.png' --no-cache -q
[[ -s tree/baseColor/o.png && -s tree/target/o.png ]] || fail 'an image is missing'
expect 0 transfer source.obj target.obj -o '<TARGET>/o.png' --no-cache -q
[[ -s target/o.png ]] || fail 'an image is missing'
