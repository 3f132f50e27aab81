# SPDX-License-Identifier: Apache-2.0
# A mesh that is not there or is no mesh is named.
source "$(dirname "$0")/support.sh"
make_job
for status_and_name in 5:missing.glb 3:letter.glb 3:letter.obj; do
  name=${status_and_name#*:}
  [[ $name == missing* ]] || echo 'hello' >"$name"
  expect "${status_and_name%%:*}" transfer "$name" target.obj -o o.png
  err_has "$name"
  expect "${status_and_name%%:*}" transfer source.obj "$name" -o o.png
  err_has "$name"
done
[[ ! -e o.png ]] || fail 'an image was written'
