# SPDX-License-Identifier: Apache-2.0
# A texture that is needed and missing is exit 5, one that is damaged exit 3, and named; one that is not needed
# is not opened.
source "$(dirname "$0")/support.sh"
make_job
"$POUNCE_FIXTURE" one-texel -o one >"$out"
cp skin.ppm good.ppm
rm skin.ppm
expect 5 transfer source.obj target.obj -o o.png
err_has 'skin.ppm'
head -c 100 good.ppm >skin.ppm
expect 3 transfer source.obj target.obj -o o.png
err_has 'skin.ppm'
expect 5 transfer source.obj target.obj -o o.png --source-texture baseColor=absent.png
err_has 'absent.png'
# A PNG with one flipped byte inside a GLB.
glb=one/one_texel_src.glb
at=$(grep -obUa IDAT $glb | head -1 | cut -d: -f1)
printf '\377' | dd of=$glb bs=1 seek=$((at + 8)) conv=notrunc status=none
expect 3 transfer $glb target.obj -o o.png
err_has 'one_texel_src.glb'
[[ ! -e o.png ]] || fail 'an image was written'
# The bad file is not needed when another one takes its place, nor as the target's own texture.
expect 0 transfer source.obj target.obj -o o.png --source-texture baseColor=good.ppm
expect 0 transfer source.obj source.obj -o p.png --source-texture baseColor=good.ppm
same_picture o.png p.png || fail 'the target texture matters'
