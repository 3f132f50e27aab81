# SPDX-License-Identifier: Apache-2.0
# Whatever --memory, a job ends well or says that it is too small: between the two there is no other status.
source "$(dirname "$0")/support.sh"
# 4140 triangles that all show the same 89 x 89 texels: a block of theirs has as many as one may. The target has a chart of
# few texels in a large image: an index of results beside little else.
{ printf 'P6\n1024 1024\n255\n' && head -c 3145728 /dev/zero; } >skin.ppm
awk 'BEGIN {
  print "mtllib source.mtl\nusemtl skin\nvt 0 1\nvt 0.086 1\nvt 0 0.914\nvt 0.086 0.914"
  for (j = 0; j <= 46; ++j) for (i = 0; i <= 45; ++i) print "v", i / 45, j / 46, 0
  for (j = 0; j < 46; ++j) for (i = 1; i <= 45; ++i) {
    k = j * 46 + i
    printf "f %d/1 %d/2 %d/3\nf %d/1 %d/2 %d/3\n", k, k + 1, k + 47, k, k + 47, k + 46
  }
}' >source.obj
printf 'newmtl skin\nmap_Kd skin.ppm\n' >source.mtl
printf 'v 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nvt .004 0\nvt .004 .004\nf 1/1 2/2 3/3\n' >target.obj
job=(transfer source.obj target.obj -o o.png --size 4096 --padding 0 --threads 1 --no-cache -q)
low=4000000 high=64000000 # refused and accepted
expect 0 "${job[@]}" --memory $high
mv o.png well.png
for ((step = 0; high - low > 4096 && step < 20; ++step)); do
  middle=$(((low + high) / 2 | 1)) got=0
  "$POUNCE" "${job[@]}" --memory $middle >"$out" 2>"$err" || got=$?
  case $got in
    0) high=$middle && cmp o.png well.png || fail 'the budget changes the picture' ;;
    4) low=$middle ;;
    *) fail "exit status $got with --memory $middle" ;;
  esac
done
# What a refusal names as the least does work, in a step or two: each names what is needed next.
got=4
for ((step = 0; step < 4 && got == 4; ++step)); do
  got=0
  "$POUNCE" "${job[@]}" --memory "$low" >"$out" 2>"$err" || got=$?
  [[ $got == 0 ]] || low=$(sed -nE 's/.*(about|with --memory) ([0-9]+[KM]iB).*/\2/p' "$err")
done
[[ $got == 0 ]] || fail "the named least of $low does not work"
# What --plan names works to the byte, also where triangles of the source lie on top of each other in its image.
printf 'v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n' >target.obj
for threads in 1 3 8; do
  job=(transfer source.obj target.obj -o o.png --size 512 --threads $threads --no-cache -q)
  expect 0 "${job[@]}" --plan
  least=$(sed -nE 's/^least memory .*\(([0-9]+) bytes\)$/\1/p' "$out")
  expect 0 "${job[@]}" --memory "$least"
  expect 4 "${job[@]}" --memory $((least - 4096))
done
