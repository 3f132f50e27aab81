# SPDX-License-Identifier: Apache-2.0
# What is wrong with a material file is said as it is: gone, damaged, no file at all. A byte order mark is nothing wrong.
source "$(dirname "$0")/support.sh"
make_job
wrong() { # WORDS: the source has no texture, and that is why.
  expect 3 transfer source.obj target.obj -o o.png
  err_has "its material file source.mtl $1"
}
cp source.mtl whole.mtl
rm source.mtl
wrong 'is missing: restore it'
{ cat whole.mtl && printf 'map_Bump ' && head -c 1100000 /dev/zero | tr '\0' x; } >source.mtl
wrong 'is damaged: export it again'
rm source.mtl
mkfifo source.mtl
wrong 'is not a readable file: replace it by one'
rm source.mtl
{ cat whole.mtl && for i in 1 2 3; do printf 'map_Bump ' && head -c 1000000 /dev/zero | tr '\0' x && echo; done; } >source.mtl
wrong 'is damaged: export it again'
expect 0 inspect source.obj
out_has 'a material longer than 2 MiB; this is not a material file'

{ printf '\357\273\277' && cat whole.mtl; } >source.mtl
expect 0 transfer source.obj target.obj -o o.png -q
silent "$err"
