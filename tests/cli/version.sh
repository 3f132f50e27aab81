# SPDX-License-Identifier: Apache-2.0
# --version prints one line and nothing else.
source "$(dirname "$0")/support.sh"
expect 0 --version
silent "$err"
grep -qxE 'pounce [0-9]+\.[0-9]+\.[0-9]+' "$out" || fail 'not a version'
