# SPDX-License-Identifier: Apache-2.0
# A target without UVs is exit 3, says so and leaves nothing.
source "$(dirname "$0")/support.sh"
make_job
quad_without_uvs bare
expect 3 transfer source.obj bare.obj -o o.png
err_has 'bare.obj'
grep -qi 'uv' "$err" || fail 'the message does not speak of UVs'
expect 3 maps bare.obj -o '<CHANNEL>.exr'
err_has 'bare.obj'
only_files bare.obj skin.ppm source.mtl source.obj target.obj
