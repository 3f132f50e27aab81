# SPDX-License-Identifier: Apache-2.0
# --memory takes an amount of bytes with a unit.
source "$(dirname "$0")/support.sh"
rejected --memory 0 -1 12XB
