// SPDX-License-Identifier: Apache-2.0
// What glTF-Transform reads of a glTF: corners as slow_models compares them (mesh_models.cpp says how).
//   node decode_gltf.mjs FOLDER IN CORNERS     FOLDER has npm's @gltf-transform/cli (tools/slow-models.sh)
import fs from 'node:fs';
import { createRequire } from 'node:module';
import path from 'node:path';
import { pathToFileURL } from 'node:url';

const [folder, input, output] = process.argv.slice(2);
const require = createRequire(path.resolve(folder, 'package.json'));
const load = (name) => import(pathToFileURL(require.resolve(name)));
const { NodeIO, Primitive } = await load('@gltf-transform/core');
const { ALL_EXTENSIONS } = await load('@gltf-transform/extensions');
const { MeshoptDecoder } = await load('meshoptimizer');
const draco3d = require('draco3dgltf');

function* corners(document) {
  const nodes = [];
  const scene = document.getRoot().getDefaultScene() ?? document.getRoot().listScenes()[0];
  scene.traverse((node) => nodes.push(node));
  for (const node of nodes) {
    const m = node.getWorldMatrix();
    for (const primitive of node.getMesh()?.listPrimitives() ?? []) {
      if (primitive.getMode() !== Primitive.Mode.TRIANGLES) continue;
      const positions = primitive.getAttribute('POSITION');
      const uvs = primitive.getAttribute('TEXCOORD_0');
      const indices = primitive.getIndices();
      const count = indices ? indices.getCount() : positions.getCount();
      const [p, uv] = [[], []];
      for (let i = 0; i < count - (count % 3); ++i) {
        const vertex = indices ? indices.getScalar(i) : i;
        positions.getElement(vertex, p);
        for (let k = 0; k < 3; ++k) yield m[k] * p[0] + m[4 + k] * p[1] + m[8 + k] * p[2] + m[12 + k];
        yield* uvs ? uvs.getElement(vertex, uv) : [NaN, NaN];
      }
    }
  }
}

const io = new NodeIO().registerExtensions(ALL_EXTENSIONS);
io.registerDependencies({
  'draco3d.decoder': await draco3d.createDecoderModule(),
  'meshopt.decoder': MeshoptDecoder,
});
const found = Float32Array.from(corners(await io.read(input)));
fs.writeFileSync(output, Buffer.concat([Buffer.from('o'), Buffer.from(found.buffer)]));
