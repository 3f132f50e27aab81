# SPDX-License-Identifier: Apache-2.0
# Less than half of a target covered is a warning, for each such target, with the options that change it.
source "$(dirname "$0")/support.sh"
make_job
sed -E 's/^v 1 /v 4 /' target.obj >wide.obj
expect 0 transfer source.obj wide.obj target.obj -o '<TARGET>.png'
err_has 'wide.obj: only 25.'
err_has '--max-distance'
err_has '--max-angle'
! grep -q 'target.obj: only' "$err" || fail 'a warning for the covered target'
# Three quarters are enough to say nothing.
sed -E 's/^v 1 /v 1.25 /' target.obj >near.obj
expect 0 transfer source.obj near.obj -o near.png
! grep -q 'warning' "$err" || fail 'a warning without a reason'
