# SPDX-License-Identifier: Apache-2.0
# --padding, --max-angle and --max-distance are finite and in range.
source "$(dirname "$0")/support.sh"
rejected --padding 99999 -1
rejected --max-angle 90 nan
rejected --max-distance 0 101% inf
