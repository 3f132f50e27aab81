# SPDX-License-Identifier: Apache-2.0
# A job that finds damage in the cache while it runs begins again: what it painted over in place is painted once, what it
# made before is no older work for --skip-existing.
source "$(dirname "$0")/support.sh"
{
  printf 'v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 0\nv 2 1 0\n'
  printf 'vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvt 1 0\nvt 2 0\nvt 2 1\nvt 1 1\n'
  printf 'f 1/1 2/2 3/3 4/4\nf 2/5 5/6 6/7 3/8\n'
} >two.obj
picture() { printf 'P6\n16 16\n255\n' && for ((i = 0; i < 768; ++i)); do printf "\\x$(printf %02x $((i * $1 % 251)))"; done; }
picture 3 >t.1001.ppm
picture 5 >t.1002.ppm
for udim in 1001 1002; do
  picture 7 >o.$udim.ppm
  { printf 'P5\n16 16\n255\n' && head -c 256 /dev/zero | tr '\0' '\200'; } >mask.$udim.pgm
done
expect 0 transfer two.obj two.obj --source-texture 'baseColor=o.<UDIM>.ppm' --size 16 --no-cache -o 'old.<UDIM>.png'
run() { expect 0 transfer two.obj two.obj --source-texture 'baseColor=t.<UDIM>.ppm' --size 16 --cache cache "$@"; }
paint() {
  for udim in 1001 1002; do cp old.$udim.png w.$udim.png; done
  run -o 'w.<UDIM>.png' --onto 'w.<UDIM>.png' --mask 'mask.<UDIM>.pgm'
}
paint
cp w.1001.png right.1001.png
cp w.1002.png right.1002.png

# One byte in the middle of each pack in turn: of an image, of a mesh.
packs=$(find cache/v3/colour cache/v3/geometry -name '*.pack')
for pack in $packs; do
  cp "$pack" sound
  chmod u+w "$pack"
  printf '\xff' | dd of="$pack" bs=1 seek=$(($(stat -c %s sound) / 2 - 70)) conv=notrunc status=none
  cmp -s "$pack" sound && fail "$pack was not damaged"
  paint
  for udim in 1001 1002; do
    cmp w.$udim.png right.$udim.png || fail "w.$udim.png is another picture after damage in $pack"
  done
done

run -o 'sound.<UDIM>.png'
for pack in $(find cache/v3/colour -name '*.pack'); do
  chmod u+w "$pack"
  printf '\xff' | dd of="$pack" bs=1 seek=$(($(stat -c %s "$pack") / 2 - 70)) conv=notrunc status=none
  rm -f made.*.png
  run -o 'made.<UDIM>.png' --skip-existing --report r.json
  for udim in 1001 1002; do cmp made.$udim.png sound.$udim.png || fail "made.$udim.png is another picture"; done
  grep -q '"kept": \[\]' r.json || fail "its own work is kept: $(grep -A3 '"kept"' r.json)"
done
