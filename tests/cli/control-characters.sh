# SPDX-License-Identifier: Apache-2.0
# Names that files hold reach neither terminal nor log with anything in them that a terminal obeys.
source "$(dirname "$0")/support.sh"

# plain FILE: no control characters but line ends and tabs, neither as bytes nor in UTF-8.
plain() {
  ! LC_ALL=C grep -qP '[\x00-\x08\x0b-\x1f\x7f]|\xc2[\x80-\x9f]' "$1" || fail "$(basename "$1") holds control characters"
}

name=$'re\x1b[2Jd\xc2\x9b31m\x7f\x07'
image skin.ppm 16 16 200 100 50
quad source skin.ppm
sed -i "s/skin$/$name/" source.obj source.mtl
quad target
expect 0 inspect source.obj
plain "$out"
out_has 're\u001b[2Jd\u009b31m\u007f\u0007'
expect 0 inspect source.obj --json
plain "$out"
python3 - "$out" "$name" <<'END' || fail 'the JSON says another name'
import json, os, sys
assert json.load(open(sys.argv[1], encoding="utf-8"))["materials"][0]["name"] == os.fsencode(sys.argv[2]).decode()
END

# A warning, with a line end that would look like an error of its own; an error; what was written.
printf '{"asset":{"version":"2.0","minVersion":"2.\\nx\\u001b[1m"}}' >new.gltf
expect 3 inspect new.gltf
plain "$err"
[[ $(wc -l <"$err") == 1 ]] || fail 'one error is not one line'
err_has '"2.\u000ax\u001b[1m"'
expect 5 inspect $'no\x1b[5mthing.obj'
plain "$err"
err_has 'no\u001b[5mthing.obj'
expect 0 transfer source.obj target.obj -o $'o\x1b[7m\n.png'
plain "$err"
err_has 'wrote o\u001b[7m\u000a.png'
expect 2 transfer source.obj target.obj -o o.png --size $'\x1b[2J'
plain "$err"

# A usage error is one line, too, whatever was given; so is a name that is compared or inspected.
forged=$'x\npounce: error: forged'
for words in "-o|$forged.xyz" "--size|$forged"; do
  got=0
  "$POUNCE" transfer a.glb b.glb -o o.png "${words%%|*}" "${words#*|}" >"$out" 2>"$err" || got=$?
  [[ $got == 2 && $(grep -c '^pounce: error' "$err") == 1 ]] || fail "a forged line: ${words%%|*}"
done
mask "$forged" 2 2 10 20 30 40
mask plain.pgm 2 2 40 30 20 10
expect 1 compare "$forged" plain.pgm --min-psnr 90
[[ $(grep -c '^pounce: ' "$err") == 1 ]] || fail 'a forged line: compare'
expect 0 inspect "$forged"
! grep -q '^pounce: error' "$out" || fail 'a forged line: inspect'
