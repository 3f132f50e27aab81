# SPDX-License-Identifier: Apache-2.0
# --memory takes an amount of bytes with a unit.
source "$(dirname "$0")/support.sh"
rejected --memory 0 -1 0.5 12XB MiB 1MiBs inf nan 99999999999TiB 1MM ''
