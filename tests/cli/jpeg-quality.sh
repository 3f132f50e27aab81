# SPDX-License-Identifier: Apache-2.0
# --jpeg-quality: a lower one is smaller and farther from the picture; its default is none, and it is part of the job.
source "$(dirname "$0")/support.sh"
rejected --jpeg-quality 0 101 -1 9.5 best ''
refused '--jpeg-quality applies only to JPEG output, but o.png is not' transfer a.glb b.glb -o o.png --jpeg-quality 90
"$POUNCE_FIXTURE" head -o head --triangles 2000 --texture 256 --target-size 64 >/dev/null
job=(transfer head/head_src.glb head/head_same.glb --size 256 --cache cache)
bytes() { wc -c <"$1"; }
decibels() { "$POUNCE" compare true.png "$1" | awk '$1 == "psnr" { print int($2) }'; }
expect 0 "${job[@]}" -o true.png
expect 0 "${job[@]}" -o usual.jpg
for quality in 10 60 95 100; do expect 0 "${job[@]}" -o "$quality.jpg" --jpeg-quality "$quality"; done
cmp usual.jpg 95.jpg || fail 'the default is another job'
(($(bytes 10.jpg) < $(bytes 60.jpg) && $(bytes 60.jpg) < $(bytes 95.jpg) && $(bytes 95.jpg) < $(bytes 100.jpg))) ||
  fail "sizes: $(wc -c ./*.jpg)"
(($(decibels 10.jpg) < $(decibels 60.jpg) && $(decibels 60.jpg) < $(decibels 95.jpg) &&
  $(decibels 95.jpg) < $(decibels 100.jpg))) || fail 'a better quality is no nearer to the picture'
expect 0 "${job[@]}" -o 60.jpg --jpeg-quality 60 --skip-existing --report r.json
grep -qF '"outputs": []' r.json || fail 'made again'
expect 0 "${job[@]}" -o 60.jpg --skip-existing --report r.json
grep -qF '"60.jpg"' r.json || fail 'a file of another quality was kept'
