# SPDX-License-Identifier: Apache-2.0
# A source with KTX2 textures is refused with the recipe of docs/limits.md, and tools/ktx2-to-png.cjs makes of it what
# pounce reads: the colours within what ETC1S and UASTC lose.
source "$(dirname "$0")/support.sh"
npm=$POUNCE_BUILD_DIR/npm
recipe=$POUNCE_SOURCE_DIR/tools/ktx2-to-png.cjs
for package in three ktx2-encoder; do
  command -v node >/dev/null && [[ -d $npm/node_modules/$package ]] ||
    { echo "SKIPPED: needs $package (tools/install-oracles.sh BUILD/npm)"; exit 77; }
done
three=$(grep -o 'three@[0-9.]*' "$POUNCE_SOURCE_DIR/tools/install-oracles.sh")
grep -qF "npm install --prefix ktx2 $three " "$POUNCE_SOURCE_DIR/docs/limits.md" ||
  fail "docs/limits.md names another version than the one tested, $three"
quad target

# A square with a gradient of 33 x 18 texels, which are no whole blocks of 4 x 4: as skin.ppm, and as KTX2 within
# KIND.glb and beside KIND.gltf. clear has an alpha too.
mkdir 'in here'
node - "$npm" >"$out" 2>"$err" <<'END' || fail 'no KTX2 was made'
const fs = require('fs');
const [width, height] = [33, 18];
const texels = new Uint8Array(4 * width * height);
for (let i = 0; i < width * height; ++i) {
  const [x, y] = [i % width, Math.floor(i / width)];
  texels.set([20 + 6 * x, 220 - 9 * y, 90 + 2 * x + 3 * y, 255], 4 * i);
}
const rgb = texels.filter((_, i) => i % 4 !== 3);
fs.writeFileSync('skin.ppm', Buffer.concat([Buffer.from(`P6\n${width} ${height}\n255\n`), rgb]));

function model(ktx2, uri) {
  const shape = Buffer.alloc(80);
  [0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0, 1, 1, 1, 1, 0, 0, 0].forEach((v, i) => shape.writeFloatLE(v, 4 * i));
  const indices = Buffer.from(Uint16Array.of(0, 1, 2, 0, 2, 3).buffer);
  const bytes = Buffer.concat([shape, indices, uri ? Buffer.alloc(0) : ktx2]);
  const view = (byteOffset, byteLength) => ({ buffer: 0, byteOffset, byteLength });
  const views = [view(0, 48), view(48, 32), view(80, 12)];
  if (!uri) views.push(view(92, ktx2.length));
  const json = {
    asset: { version: '2.0' },
    scenes: [{ nodes: [0] }],
    nodes: [{ mesh: 0 }],
    meshes: [{ primitives: [{ attributes: { POSITION: 0, TEXCOORD_0: 1 }, indices: 2, material: 0 }] }],
    materials: [{ pbrMetallicRoughness: { baseColorTexture: { index: 0 } } }],
    textures: [{ sampler: 0, extensions: { KHR_texture_basisu: { source: 0 } } }],
    samplers: [{ wrapS: 33071, wrapT: 33071 }],
    images: [{ name: 'skin', mimeType: 'image/ktx2', ...(uri ? { uri } : { bufferView: 3 }) }],
    extensionsUsed: ['KHR_texture_basisu'],
    extensionsRequired: ['KHR_texture_basisu'],
    accessors: [
      { bufferView: 0, componentType: 5126, count: 4, type: 'VEC3', min: [0, 0, 0], max: [1, 1, 0] },
      { bufferView: 1, componentType: 5126, count: 4, type: 'VEC2' },
      { bufferView: 2, componentType: 5123, count: 6, type: 'SCALAR' },
    ],
    bufferViews: views,
    buffers: [{ byteLength: bytes.length }],
  };
  return { json, bytes };
}

function glb({ json, bytes }) {
  const padded = (data, fill) => Buffer.concat([data, Buffer.alloc((4 - (data.length % 4)) % 4, fill)]);
  const chunk = (type, data) => {
    const head = Buffer.alloc(8);
    head.writeUInt32LE(data.length, 0);
    head.write(type, 4);
    return Buffer.concat([head, data]);
  };
  const chunks = [chunk('JSON', padded(Buffer.from(JSON.stringify(json)), ' ')), chunk('BIN\0', padded(bytes))];
  const head = Buffer.from('glTF\x02\0\0\0\0\0\0\0', 'latin1');
  head.writeUInt32LE(12 + chunks[0].length + chunks[1].length, 8);
  return Buffer.concat([head, ...chunks]);
}

(async () => {
  const { encodeToKTX2 } = await import(`${process.argv[2]}/node_modules/ktx2-encoder/dist/node/index.js`);
  for (const [kind, isUASTC, alpha] of [['uastc', true, 255], ['etc1s', false, 255], ['clear', true, 128]]) {
    const data = texels.map((value, i) => (i % 4 === 3 ? alpha : value));
    const options = { isUASTC, isKTX2File: true, isSetKTX2SRGBTransferFunc: true, generateMipmap: true };
    options.imageDecoder = async () => ({ width, height, data });
    const ktx2 = Buffer.from(await encodeToKTX2(new Uint8Array(1), options));
    fs.writeFileSync(`in here/${kind}.glb`, glb(model(ktx2)));
    fs.writeFileSync(`in here/${kind} skin.ktx2`, ktx2);
    const { json, bytes } = model(ktx2, `${kind}%20skin.ktx2`);
    json.buffers[0].uri = `data:application/octet-stream;base64,${bytes.toString('base64')}`;
    fs.writeFileSync(`in here/${kind}.gltf`, JSON.stringify(json));
  }
})();
END

# check KIND PSNR CHANNELS: the PSNRs are a little less than those seen (45.68, 30.31, 42.25 dB).
check() {
  local format
  for format in glb gltf; do
    expect 3 transfer "in here/$1.$format" target.obj -o o.png
    err_has 'KHR_texture_basisu'
    err_has 'convert it to PNG (docs/limits.md shows how, under "KTX2 textures")'
    node "$recipe" "$npm" "in here/$1.$format" "$1 png.$format" >"$out" 2>"$err" || fail "$1.$format was not converted"
    out_has "$1 png.image0.png: 33 x 18"
    expect 0 inspect "$1 png.$format"
    out_has "33 x 18, $3, u8, srgb, png"
    expect 0 transfer "$1 png.$format" target.obj -o back.png --size 33x18
    expect 0 compare back.png skin.ppm --min-psnr "$2"
  done
}
check uastc 45 "3 channels"
check etc1s 30 "3 channels"
check clear 42 "4 channels with alpha"
