# SPDX-License-Identifier: Apache-2.0
# What the source is made of is never written over, under any name; nor is the picture by the report.
source "$(dirname "$0")/support.sh"
make_job
cp skin.ppm skin.tif
before=$(md5sum skin.tif)
expect 2 transfer source.obj target.obj -o skin.tif --source-texture baseColor=skin.tif
err_has 'skin.tif: is also an input'
ln -s skin.tif link.tif
expect 2 transfer source.obj target.obj -o link.tif --source-texture baseColor=skin.tif
err_has 'is also an input'
[[ $(md5sum skin.tif) == "$before" ]] || fail 'the texture was written over'
expect 2 transfer source.obj target.obj -o o.png --report o.png
err_has '--report: got "o.png"'
[[ ! -e o.png ]] || fail 'something was written'
