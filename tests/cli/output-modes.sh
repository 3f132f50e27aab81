# SPDX-License-Identifier: Apache-2.0
# An output that is replaced keeps its permissions and its owner; a new one has what the umask leaves.
source "$(dirname "$0")/support.sh"
make_job
job() { expect 0 transfer source.obj target.obj -o "$1" --size 64 --no-cache -q; }
for mode in 600 640 664 755 444; do
  echo 'an old picture' >o.png
  chmod $mode o.png
  job o.png
  [[ $(stat -c %a o.png) == "$mode" ]] || fail "mode $mode became $(stat -c %a o.png)"
  rm -f o.png
done
for mask in 022 077 002; do
  (umask $mask && job new.png)
  printf -v expected %o $((0666 & ~0$mask))
  [[ $(stat -c %a new.png) == "$expected" ]] || fail "umask $mask gave $(stat -c %a new.png)"
  rm new.png
done
if [[ $(id -u) == 0 ]]; then
  echo 'an old picture' >o.png
  chown 65534:65534 o.png
  job o.png
  [[ $(stat -c %u:%g o.png) == 65534:65534 ]] || fail "the owner became $(stat -c %u:%g o.png)"
fi
