# SPDX-License-Identifier: Apache-2.0
# A decoder that gets no memory is exit 4 and says so: the image is not damaged.
source "$(dirname "$0")/support.sh"
# little SIZE NUMBER: its bytes, the lowest first.
little() {
  local i n=$2
  for ((i = 0; i < $1; ++i)); do printf "\\x$(printf '%02x' $((n & 255)))" && n=$((n >> 8)); done
}
# field TAG TYPE VALUE: of a TIFF's directory (3: 16 bits, 4: 32 bits).
field() { little 2 "$1" && little 2 "$2" && little 4 1 && little 4 "$3"; }
# black TIFF SIDE: a grey image in one tile, PackBits; two zeros are a black texel, so what it has is a hole.
black() {
  {
    printf 'II' && little 2 42 && little 4 8
    little 2 10
    field 256 4 "$2" && field 257 4 "$2" && field 258 3 8 && field 259 3 32773 && field 262 3 1
    field 277 3 1 && field 322 4 "$2" && field 323 4 "$2" && field 324 4 4096 && field 325 4 $(($2 * $2 * 2))
    little 4 0
  } >"$1"
  truncate -s $((4096 + $2 * $2 * 2)) "$1"
}
black small.tif 64
expect 0 compare small.tif small.tif
black large.tif 8192
expect 0 compare large.tif large.tif
for sandbox in auto off; do
  got=0
  prlimit --data=$((160 << 20)) "$POUNCE" compare large.tif large.tif --sandbox $sandbox >"$out" 2>"$err" || got=$?
  [[ $got == 4 ]] || fail "exit status $got, not 4, with --sandbox $sandbox"
  err_has 'pounce: error: large.tif: not enough memory to decode it ('
  [[ $(wc -l <"$err") == 1 ]] || fail 'not one sentence'
done
# A damaged one is damaged, however little memory there is.
truncate -s $((4096 + 8192 * 8192)) large.tif
expect 3 compare large.tif large.tif
