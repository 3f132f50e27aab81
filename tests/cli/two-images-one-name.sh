# SPDX-License-Identifier: Apache-2.0
# Two images that would get one name are a usage error before anything is read or written.
source "$(dirname "$0")/support.sh"
make_job
expect 2 transfer source.obj target.obj -o o.png --channels baseColor,emissive \
  --source-texture emissive=skin.ppm
err_has 'o.png'
expect 2 transfer source.obj target.obj -o o.png --coverage o.png
err_has 'o.png'
expect 0 transfer source.obj target.obj -o '<CHANNEL>.png' --source-texture emissive=skin.ppm
only_files baseColor.png emissive.png skin.ppm source.mtl source.obj target.obj
# What is said depends on why: targets of one file name, material names that files cannot tell apart.
rm baseColor.png emissive.png
mkdir one two
cp target.obj one && cp target.obj two
expect 2 transfer source.obj one/target.obj two/target.obj -o '<TARGET>.png'
err_has 'the same for one/target.obj and two/target.obj'
expect 2 transfer source.obj target.obj one/target.obj -o '<TARGET>.glb'
expect 2 transfer source.obj target.obj source.obj -o '<TARGET>.png' --coverage mask.png
err_has 'add <TARGET> to --coverage'
{ sed 's/^f/usemtl a\/b\nf/' target.obj && echo 'usemtl a_b' && echo 'f 1/1 2/2 3/3'; } >names.obj
expect 2 transfer source.obj names.obj -o '<MATERIAL>.png'
err_has 'a_b.png: <MATERIAL>'
sed "s/a_b/$(printf 'x%.0s' {1..300})/" names.obj >long.obj
expect 2 transfer source.obj long.obj -o '<MATERIAL>.png'
err_has 'the file name is too long'
[[ -z $(ls | grep png) ]] || fail 'an image was written'
