// SPDX-License-Identifier: Apache-2.0
// Replaces the KTX2 images (KHR_texture_basisu) of a glTF by PNGs, which pounce reads. Needs node and three from npm,
// whose transcoder of Basis Universal (ETC1S and UASTC) it uses:
//   npm install --prefix FOLDER three@0.187.0
//   node ktx2-to-png.cjs FOLDER IN.glb OUT.glb      (or .gltf; the PNGs are written beside it as OUT.imageN.png)
// All else stays as it is: a GLB keeps its buffer byte for byte, with the KTX2 images in it. Files that IN names by
// relative paths are not copied, so such an OUT belongs into the folder of IN.
'use strict';
const fs = require('fs');
const path = require('path');
const zlib = require('zlib');

const EXTENSION = 'KHR_texture_basisu';
const RGBA32 = 13; // of the transcoder's formats

function fail(message) {
  console.error(`ktx2-to-png: error: ${message}`);
  process.exit(1);
}

/// The transcoder is a script that is no module.
async function load_transcoder(folder) {
  const stem = path.join(folder, 'node_modules/three/examples/jsm/libs/basis/basis_transcoder');
  if (!fs.existsSync(stem + '.js')) fail(`${folder} has no three: npm install --prefix ${folder} three@0.187.0`);
  const script = fs.readFileSync(stem + '.js', 'utf8');
  const basis = new Function('require', '__dirname', script + '; return BASIS;')(require, path.dirname(stem));
  const transcoder = await basis({ wasmBinary: fs.readFileSync(stem + '.wasm') });
  transcoder.initializeBasis();
  return transcoder;
}

/// The largest level of a KTX2 image, as rows of R, G, B, A.
function decode(transcoder, bytes, label) {
  const file = new transcoder.KTX2File(new Uint8Array(bytes));
  try {
    if (!file.isValid() || !(file.isUASTC() || file.isETC1S())) fail(`${label} is no KTX2 with ETC1S or UASTC`);
    if (!file.startTranscoding()) fail(`${label} is damaged`);
    const { origWidth: width, origHeight: height } = file.getImageLevelInfo(0, 0, 0);
    const texels = new Uint8Array(file.getImageTranscodedSizeInBytes(0, 0, 0, RGBA32));
    if (!file.transcodeImage(texels, 0, 0, 0, RGBA32, 0, -1, -1)) fail(`${label} is damaged`);
    return { width, height, texels, has_alpha: Boolean(file.getHasAlpha()) };
  } finally {
    file.close();
    file.delete();
  }
}

const crcs = Int32Array.from({ length: 256 }, (_, n) => {
  for (let k = 0; k < 8; ++k) n = n & 1 ? 0xedb88320 ^ (n >>> 1) : n >>> 1;
  return n;
});

function png_chunk(type, data) {
  const body = Buffer.concat([Buffer.from(type), data]);
  const crc = ~body.reduce((c, byte) => crcs[(c ^ byte) & 255] ^ (c >>> 8), -1) >>> 0;
  const ends = Buffer.alloc(8);
  ends.writeUInt32BE(data.length, 0);
  ends.writeUInt32BE(crc, 4);
  return Buffer.concat([ends.subarray(0, 4), body, ends.subarray(4)]);
}

function png({ width, height, texels, has_alpha }) {
  const samples = has_alpha ? 4 : 3;
  const rows = Buffer.alloc(height * (1 + samples * width)); // each row begins with 0: no filter
  for (let y = 0, at = 0; y < height; ++y) {
    ++at;
    for (let x = 0; x < width; ++x) {
      for (let k = 0; k < samples; ++k) rows[at++] = texels[4 * (y * width + x) + k];
    }
  }
  const head = Buffer.alloc(13);
  head.writeUInt32BE(width, 0);
  head.writeUInt32BE(height, 4);
  head.set([8, has_alpha ? 6 : 2], 8);
  return Buffer.concat([
    Buffer.from('\x89PNG\r\n\x1a\n', 'latin1'),
    png_chunk('IHDR', head),
    png_chunk('IDAT', zlib.deflateSync(rows)),
    png_chunk('IEND', Buffer.alloc(0)),
  ]);
}

/// The JSON of a glTF or GLB, and what follows it in a GLB.
function read_model(file) {
  const bytes = fs.readFileSync(file);
  if (bytes.toString('latin1', 0, 4) !== 'glTF') return { json: JSON.parse(bytes), rest: null };
  const end = 20 + bytes.readUInt32LE(12);
  return { json: JSON.parse(bytes.subarray(20, end)), rest: bytes.subarray(end) };
}

function write_model(file, json, rest) {
  const text = Buffer.from(JSON.stringify(json));
  if (rest === null) return fs.writeFileSync(file, text);
  const chunk = Buffer.concat([text, Buffer.alloc((4 - (text.length % 4)) % 4, ' ')]);
  const head = Buffer.alloc(20);
  head.write('glTF');
  head.writeUInt32LE(2, 4);
  head.writeUInt32LE(20 + chunk.length + rest.length, 8);
  head.writeUInt32LE(chunk.length, 12);
  head.write('JSON', 16);
  fs.writeFileSync(file, Buffer.concat([head, chunk, rest]));
}

function read_uri(uri, folder) {
  const data = /^data:[^,]*;base64,/.exec(uri);
  if (data) return Buffer.from(uri.slice(data[0].length), 'base64');
  return fs.readFileSync(path.join(folder, decodeURIComponent(uri)));
}

function image_bytes(image, { json, rest }, folder) {
  if (image.uri !== undefined) return read_uri(image.uri, folder);
  const view = json.bufferViews[image.bufferView];
  const { uri } = json.buffers[view.buffer];
  const buffer = uri === undefined ? rest.subarray(8) : read_uri(uri, folder);
  return buffer.subarray(view.byteOffset ?? 0, (view.byteOffset ?? 0) + view.byteLength);
}

/// Writes image `index` as a PNG and refers to that.
function convert(transcoder, model, index, folder, name) {
  const { uri, bufferView, mimeType, ...image } = model.json.images[index];
  const found = decode(transcoder, image_bytes({ uri, bufferView }, model, folder), `image ${index}`);
  fs.writeFileSync(name, png(found));
  model.json.images[index] = { ...image, uri: encodeURIComponent(path.basename(name)), mimeType: 'image/png' };
  console.log(`${name}: ${found.width} x ${found.height}`);
}

async function main(folder, input, output) {
  if (!output) fail('usage: node ktx2-to-png.cjs FOLDER IN OUT');
  if (path.resolve(input) === path.resolve(output)) fail('OUT is IN');
  const model = read_model(input);
  if ((model.rest === null) !== /\.gltf$/i.test(output)) fail('IN and OUT must be both .glb or both .gltf');
  const transcoder = await load_transcoder(folder);
  const converted = new Set();
  for (const texture of model.json.textures ?? []) {
    const source = texture.extensions?.[EXTENSION]?.source;
    if (source === undefined) continue;
    delete texture.extensions[EXTENSION];
    if (Object.keys(texture.extensions).length === 0) delete texture.extensions;
    if (texture.source !== undefined) continue; // a plain image is there already
    texture.source = source;
    if (converted.has(source)) continue;
    converted.add(source);
    convert(transcoder, model, source, path.dirname(input), output.replace(/\.[^.]*$/, `.image${source}.png`));
  }
  for (const list of ['extensionsUsed', 'extensionsRequired']) {
    const others = (model.json[list] ?? []).filter((name) => name !== EXTENSION);
    if (others.length > 0) model.json[list] = others;
    else delete model.json[list];
  }
  write_model(output, model.json, model.rest);
}

main(...process.argv.slice(2)).catch((error) => fail(error.message));
