# SPDX-License-Identifier: Apache-2.0
# Models written onto real targets have no error that the target does not have, says Khronos' validator; and
# everything in them but materials, textures and images is as it was.
source "$(dirname "$0")/support.sh"
data=${POUNCE_TEST_DATA:-$POUNCE_SOURCE_DIR/../shared/data}
[[ -d $data ]] || { echo 'SKIPPED: needs test data (set POUNCE_TEST_DATA)'; exit 77; }
command -v python3 >/dev/null || { echo 'SKIPPED: needs python3'; exit 77; }
validator=$POUNCE_SOURCE_DIR/tools/gltf-validator.sh

check() {
  local source=$data/$1 target=$data/$2 format status
  for format in glb gltf; do
    expect 0 transfer "$source" "$target" -o "out.$format" --size 128 -q
    status=0
    "$validator" compare "$POUNCE_BUILD_DIR/npm" "$target" "out.$format" >"$out" 2>&1 || status=$?
    [[ $status != 77 ]] || skipped=yes
    [[ $status == 0 || $status == 77 ]] || fail "out.$format of $2 is not valid"
    python3 - "$target" "out.$format" <<'END' || fail "out.$format of $2 has lost something"
import json, struct, sys
def document(path):
    data = open(path, 'rb').read()
    if data[:4] == b'glTF':
        data = data[20:20 + struct.unpack('<I', data[12:16])[0]]
    return json.loads(data)
target, output = map(document, sys.argv[1:])
assert len(output['asset']['extras'].pop('pounce')['job']) == 32
if not output['asset']['extras'] and 'extras' not in target['asset']:
    del output['asset']['extras']
for key in ('asset', 'scene', 'scenes', 'nodes', 'accessors', 'skins', 'animations', 'cameras', 'samplers', 'extensions', 'extras'):
    assert target.get(key) == output.get(key), key
for a, b in zip(target.get('materials', []), output['materials']):
    for key in set(a) - {'pbrMetallicRoughness', 'normalTexture', 'occlusionTexture', 'emissiveTexture', 'emissiveFactor', 'extensions'}:
        assert a[key] == b[key], key
END
    rm -f out*
  done
}

skipped=
check heads/head_src.glb heads/head_dst.glb
check meshes/cesium_man/CesiumMan.glb meshes/cesium_man/CesiumMan.glb
check meshes/water_bottle/SpecGlossVsMetalRough.gltf meshes/water_bottle/SpecGlossVsMetalRough.gltf
check meshes/multi_uv/MultiUVTest.gltf meshes/multi_uv/MultiUVTest.gltf
# Packed with Draco and with meshoptimizer: a copy keeps that.
check meshes/lee_perry_smith/LeePerrySmith_plain_textured.glb meshes/lee_perry_smith/LeePerrySmith.glb
check meshes/milk_truck_draco/CesiumMilkTruck.gltf meshes/milk_truck_draco/CesiumMilkTruck.gltf
check meshes/duck/gltf/Duck.gltf meshes/duck/Duck-vp-12-vt-12-vn-12.glb
check splats/playbot_lod3_converted/playbot_lod3.ply meshes/playbot_proxy/playbot_proxy.glb
[[ -z $skipped ]] || echo 'SKIPPED: needs the glTF validator (tools/install-oracles.sh BUILD/npm)'
