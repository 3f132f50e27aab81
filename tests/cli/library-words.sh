# SPDX-License-Identifier: Apache-2.0
# What image libraries print on the standard error output themselves stays out of ours: one sentence, or lines of JSON.
source "$(dirname "$0")/support.sh"
# chunk NAME BYTE...: a chunk of a PNG with the right checksum, which is gzip's.
chunk() {
  local name=$1 crc
  shift
  samples 0 0 0 $#
  printf %s "$name" && samples "$@"
  crc=$( (printf %s "$name" && samples "$@") | gzip -c | tail -c 8 | od -An -tu1 -N4)
  read -r -a crc <<<"$crc"
  samples "${crc[3]}" "${crc[2]}" "${crc[1]}" "${crc[0]}"
}
# All is as it should be, but for what is compressed: only zlib notices, and libpng says so.
{
  samples 137 80 78 71 13 10 26 10
  chunk IHDR 0 0 0 4 0 0 0 4 8 2 0 0 0
  chunk IDAT 120 156 255 255 255 255
  samples 0 0 0 0 73 69 78 68 174 66 96 130 # IEND
} >damaged.png
image whole.ppm 4 4 1 2 3
quad square
job=(transfer square.obj square.obj -o o.png --source-texture baseColor=damaged.png --no-cache)
expect 3 "${job[@]}" -q
[[ $(wc -l <"$err") == 1 ]] || fail 'not one sentence'
err_has 'pounce: error: damaged.png: decoding failed in row'
err_has '(IDAT: invalid block type)' # the library's reason is in it
expect 3 "${job[@]}" --progress json
! grep -v '^{' "$err" || fail 'a line that is no JSON'
expect 3 compare damaged.png whole.ppm
[[ $(wc -l <"$err") == 1 ]] || fail 'not one sentence'
