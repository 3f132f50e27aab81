# SPDX-License-Identifier: Apache-2.0
# A symbolic link as output stays a link: what it leads to is written, also where nothing is there yet. One that
# leads to no file is refused.
source "$(dirname "$0")/support.sh"
make_job
job() { expect "$1" transfer source.obj target.obj -o "$2" --size 64 --no-cache -q; }
job 0 expected.png
mkdir elsewhere links
echo 'an old picture' >elsewhere/old.png
ln -s ../elsewhere/old.png links/old.png
ln -s ../elsewhere/new.png links/new.png
ln -s old.png links/twice.png
ln -s links folder
for name in old new twice; do
  job 0 folder/$name.png
  [[ -L links/$name.png ]] || fail "the link $name.png was replaced"
  cmp "links/$name.png" expected.png || fail "$name.png is another picture"
done
[[ ! -L elsewhere/new.png ]] || fail 'no file was made where the link leads'
[[ $(ls -A elsewhere links | tr '\n' ' ') == 'elsewhere: new.png old.png  links: new.png old.png twice.png ' ]] ||
  fail "left behind: $(ls -A elsewhere links)"

ln -s circle.png links/circle.png
job 5 links/circle.png
err_has 'links/circle.png'
ln -s ../elsewhere links/to_folder.png
job 5 links/to_folder.png
err_has 'links/to_folder.png'
for device in null stdout; do
  ln -s /dev/$device $device.png
  job 5 $device.png
  err_has "$device.png"
  silent "$out"
  [[ -L $device.png ]] || fail "the link to /dev/$device was replaced"
done
[[ -c /dev/null ]] || fail '/dev/null is no device any more'
