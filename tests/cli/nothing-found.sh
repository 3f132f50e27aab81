# SPDX-License-Identifier: Apache-2.0
# A result without one covered texel is a warning that says where both meshes are, and an empty mask.
source "$(dirname "$0")/support.sh"
make_job
sed -E 's/^v ([0-9.-]+) ([0-9.-]+) ([0-9.-]+)/v \1 \2 900/' target.obj >far.obj
expect 0 transfer source.obj far.obj -o o.png
err_has 'no texel found a source within'
err_has '900'
expect 0 transfer source.obj target.obj -o o.png
! grep -q 'no texel found' "$err" || fail 'a warning without a reason'
