# SPDX-License-Identifier: Apache-2.0
# Texts and profiles in an image cost neither memory nor time: 53 bytes that claim 1.15 GB of text, and a text that
# inflates, are not looked at.
source "$(dirname "$0")/support.sh"
make_job
expect 0 transfer source.obj target.obj -o clean.png --no-cache
# chunk HEX-LENGTH TYPE DATA
chunk() { printf "\\x${1:0:2}\\x${1:2:2}\\x${1:4:2}\\x${1:6:2}%s%snono" "$2" "$3"; }
{
  head -c 33 clean.png
  chunk 448b9b80 tEXt 'k '
} >claim.png
expect 3 transfer source.obj target.obj -o o.png --source-texture baseColor=claim.png --no-cache
err_has 'claim.png: the image header cannot be read (the file ends too early)'
{
  head -c 33 clean.png
  printf '\x08\x00\x00\x00eXIf'
  head -c 134217728 /dev/zero
  printf 'nono'
  tail -c +34 clean.png
} >fat.png
# Far less than the 128 MiB of its EXIF, and less than the address space that holding it takes.
(
  ulimit -v 2000000
  expect 0 transfer source.obj target.obj -o o.png --source-texture baseColor=fat.png --no-cache --memory 64MiB \
    --report report.json
)
same_picture o.png clean.png || fail 'the text matters'
rss=$(sed -n 's/.*"peak_rss": \([0-9]*\).*/\1/p' report.json)
((rss < 240000000)) || fail "$rss bytes of resident memory"
