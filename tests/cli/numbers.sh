# SPDX-License-Identifier: Apache-2.0
# --padding, --max-angle and --max-distance are finite and in range.
source "$(dirname "$0")/support.sh"
rejected --padding 99999 -1 1.5 1px ''
rejected --max-angle 90 89.91 -1 nan inf 45deg ''
rejected --max-distance 0 -1 0% 101% 5%% inf nan 1e31 5px ''
