# SPDX-License-Identifier: Apache-2.0
# What a heavy model's materials say by factors is in the light one, too: what all share in its material, what they
# differ by in a texture, or, with the heavy one's UVs, each in its own.
source "$(dirname "$0")/support.sh"
has() { grep -aqF -- "$2" "$1" || fail "$1 lacks: $2"; }
lacks() { ! grep -aqF -- "$2" "$1" || fail "$1 has: $2"; }
# A square is red, the one beside it blue; nothing has a texture.
printf 'newmtl red\nKd 1 0 0\nnewmtl blue\nKd 0 0 1\n' >flat.mtl
squares() {  # squares NAME MATERIAL MATERIAL
  {
    echo "mtllib $1.mtl"
    printf 'v %s\n' '0 0 0' '1 0 0' '1 1 0' '0 1 0' '2 0 0' '2 1 0'
    printf 'vt %s\n' '0 0' '.5 0' '.5 1' '0 1' '1 0' '1 1'
    printf 'usemtl %s\nf %s\n' "$2" '1/1 2/2 3/3 4/4' "$3" '2/2 5/5 6/6 3/3'
  } >"$1.obj"
}
squares flat red blue
expect 0 mesh flat.obj -o flat.glb --size 512
has flat.glb '"baseColorTexture"'
lacks flat.glb '"baseColorFactor"'
# Seen by a square as large as both: half of it is red, half blue.
printf 'v 0 0 0\nv 2 0 0\nv 2 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n' >both.obj
expect 0 transfer flat.glb both.obj -o seen.png --size 64
{
  printf 'P6\n64 64\n255\n'
  for row in {1..64}; do printf '\377\0\0%.0s' {1..32} && printf '\0\0\377%.0s' {1..32}; done
} >half.ppm
expect 0 compare seen.png half.ppm --min-psnr 30
# Each keeps its own where the materials stay.
expect 0 mesh flat.obj -o own.glb --size 64 --keep-uvs
has own.glb '"baseColorFactor":[1,0,0,1]'
has own.glb '"baseColorFactor":[0,0,1,1]'
lacks own.glb '"baseColorTexture"'
# Glass beside what is solid, of one colour; lamps of two strengths, neither of which is clipped.
printf 'newmtl solid\nKd 1 0 0\nnewmtl glass\nKd 1 0 0\nd .5\n' >glass.mtl
squares glass solid glass
expect 0 mesh glass.obj -o glass.glb --size 64
has glass.glb '"baseColorTexture"'
has glass.glb '"alphaMode":"BLEND"'
printf 'newmtl weak\nKe 0 .5 0\nnewmtl strong\nKe 4 0 0\n' >lamps.mtl
squares lamps weak strong
expect 0 mesh lamps.obj -o lamps.glb --size 64
has lamps.glb '"emissiveTexture"'
has lamps.glb '"emissiveStrength":4'
err_lacks 'clip'
# What has a texture that is not asked for keeps no factor of it alone.
printf 'newmtl red\nmap_Kd dark.ppm\nKe 1 1 1\nmap_Ke dark.ppm\n' >unlit.mtl
image dark.ppm 1 1 0 0 0
squares unlit red red
expect 0 mesh unlit.obj -o unlit.glb --size 64 --channels baseColor
lacks unlit.glb '"emissiveFactor"'
# The normal map alone, which is made here, is not all channels.
expect 0 mesh unlit.obj -o normal.glb --size 64 --channels normal
has normal.glb '"normalTexture"'
lacks normal.glb '"baseColorTexture"'
lacks normal.glb '"emissiveTexture"'
expect 0 mesh unlit.obj -o two.glb --size 64 --channels normal,emissive
has two.glb '"normalTexture"'
has two.glb '"emissiveTexture"'
lacks two.glb '"baseColorTexture"'
# One colour needs no texture.
printf 'newmtl red\nKd 1 0 0\n' >one.mtl
squares one red red
expect 0 proxy one.obj -o one.glb --size 64
has one.glb '"baseColorFactor":[1,0,0,1]'
lacks one.glb '"baseColorTexture"'
# And all else that a glTF material says.
if command -v python3 >/dev/null; then
  python3 - <<'PYTHON'
import base64, json, struct
corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
data = b''.join(struct.pack('<3f', *p) for p in corners) + b''.join(struct.pack('<2f', x, 1 - y) for x, y, _ in corners)
data += struct.pack('<6H', 0, 1, 2, 0, 2, 3)
json.dump({
    'asset': {'version': '2.0'}, 'scene': 0, 'scenes': [{'nodes': [0]}], 'nodes': [{'mesh': 0}],
    'extensionsUsed': ['KHR_materials_emissive_strength'],
    'materials': [{
        'name': 'glow', 'doubleSided': True, 'alphaMode': 'MASK', 'alphaCutoff': 0.75,
        'pbrMetallicRoughness': {'roughnessFactor': 0.25, 'baseColorFactor': [0.5, 0.25, 1, 0.875]},
        'emissiveFactor': [0.5, 0, 0.125], 'extensions': {'KHR_materials_emissive_strength': {'emissiveStrength': 4}}}],
    'meshes': [{'primitives': [{'attributes': {'POSITION': 0, 'TEXCOORD_0': 1}, 'indices': 2, 'material': 0}]}],
    'accessors': [
        {'bufferView': 0, 'componentType': 5126, 'count': 4, 'type': 'VEC3', 'min': [0, 0, 0], 'max': [1, 1, 0]},
        {'bufferView': 1, 'componentType': 5126, 'count': 4, 'type': 'VEC2'},
        {'bufferView': 2, 'componentType': 5123, 'count': 6, 'type': 'SCALAR'}],
    'bufferViews': [{'buffer': 0, 'byteOffset': o, 'byteLength': n} for o, n in ((0, 48), (48, 32), (80, 12))],
    'buffers': [{'byteLength': len(data), 'uri': 'data:application/octet-stream;base64,' + base64.b64encode(data).decode()}],
}, open('glow.gltf', 'w'))
PYTHON
  for how in '' --keep-uvs; do
    expect 0 mesh glow.gltf -o glow.glb --size 64 $how
    for member in '"roughnessFactor":0.25' '"baseColorFactor":[0.5,0.25,1,0.875]' '"emissiveFactor":[0.5,0,0.125]' \
      '"emissiveStrength":4' '"alphaMode":"MASK"' '"alphaCutoff":0.75' '"doubleSided":true' \
      '"extensionsUsed":["KHR_materials_emissive_strength"]'; do
      has glow.glb "$member"
    done
    lacks glow.glb '"metallicFactor"' # 1, by default
    expect 0 inspect glow.glb
  done
fi
