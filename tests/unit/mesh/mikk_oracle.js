// SPDX-License-Identifier: Apache-2.0
//
// node mikk_oracle.js CORNERS TANGENTS, in a folder that has npm's "mikktspace".
//
// CORNERS has 9 floats per corner: position, normal, UV with v up, material, ascending. TANGENTS
// gets 4 each. Every material is a primitive of its own.
const fs = require('fs');
const { createRequire } = require('module');
const { generateTangents } = createRequire(process.cwd() + '/')('mikktspace');

const bytes = fs.readFileSync(process.argv[2]);
const rows = new Float32Array(bytes.buffer, bytes.byteOffset, bytes.byteLength / 4);
const corners = rows.length / 9;
const out = new Float32Array(4 * corners);
for (let first = 0; first < corners;) {
  let last = first;
  while (last < corners && rows[9 * last + 8] === rows[9 * first + 8]) ++last;
  const part = (from, size) => {
    const values = new Float32Array(size * (last - first));
    for (let c = first; c < last; ++c)
      for (let k = 0; k < size; ++k) values[size * (c - first) + k] = rows[9 * c + from + k];
    return values;
  };
  out.set(generateTangents(part(0, 3), part(3, 3), part(6, 2)), 4 * first);
  first = last;
}
fs.writeFileSync(process.argv[3], Buffer.from(out.buffer));
