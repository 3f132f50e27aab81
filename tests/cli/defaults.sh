# SPDX-License-Identifier: Apache-2.0
# A default said aloud is the same job: --skip-existing keeps what was made without it.
source "$(dirname "$0")/support.sh"
make_job
"$POUNCE_FIXTURE" splats -o scene.ply --count 2000 --target-size 64 >/dev/null
# kept DEFAULT... of the job in $job: all of its outputs stay, said one by one and all together.
kept() {
  local default
  for default in "$@" "$*"; do
    # shellcheck disable=SC2086
    expect 0 "${job[@]}" --skip-existing $default --report r.json
    grep -qF '"outputs": []' r.json || fail "made again: ${job[*]} $default"
  done
}
both=('--channels baseColor' '--max-angle 80' '--method surface' '--output-colorspace srgb' '--target-uv-set 0'
  '--target-axes x,y,z' '--source-axes x,y,z' '--min-coverage 0' '--exr-compression zip' '--no-wait' '--threads 1' '--temp .'
  '--max-temp none' '--allow-external' '--allow-format bmp' '--sandbox auto')
job=(transfer source.obj target.obj -o mesh.png)
expect 0 "${job[@]}"
kept "${both[@]}" '--size 16' '--depth u8' '--padding 0' '--filter cubic' '--factors apply' '--max-distance 5%' '--normal-y up' \
  '--output-normal-y up' '--source-colorspace srgb' '--source-uv-set 0' '--source-texture baseColor=skin.ppm' '--sh mean' \
  '--rays 0' '--look auto' '--views 36' '--min-confidence 0.01' '--min-opacity 0.0039' '--sigma 0.5'
job=(transfer scene.ply scene_target.glb -o scene.png --size 64)
expect 0 "${job[@]}"
kept "${both[@]}" '--depth u8' '--padding 0' '--max-distance 3%' '--sh mean' '--min-opacity 0.0039' '--rays 0' '--look auto' '--views 36' \
  '--min-confidence 0.01' '--filter cubic' '--sigma 0.5' '--factors apply' '--normal-y up' '--output-normal-y up'
job=(transfer source.obj target.obj -o 't.<UDIM>.tx' --size 64)
expect 0 "${job[@]}"
kept '--tile-size 64' '--mipmap' '--exr-compression zip'
job=(maps target.obj -o '<CHANNEL>.exr')
expect 0 "${job[@]}"
