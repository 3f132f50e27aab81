# SPDX-License-Identifier: Apache-2.0
# A result that did not arrive on the standard output is an error.
source "$(dirname "$0")/support.sh"
[[ -w /dev/full ]] || { echo 'SKIPPED: no /dev/full'; exit 77; }
image a.ppm 2 2 1 2 3
for command in '--help' '--version' 'inspect a.ppm' 'compare a.ppm a.ppm'; do
  status=0
  "$POUNCE" $command >/dev/full 2>"$err" || status=$?
  [[ $status == 75 ]] || fail "exit status $status: pounce $command"
  err_has 'standard output'
done
