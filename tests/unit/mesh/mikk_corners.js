// SPDX-License-Identifier: Apache-2.0
//
// Makes mikk_corners.txt: small meshes as unindexed corners and the tangents that the reference
// implementation of MikkTSpace gives them.
//
//   npm install mikktspace && node mikk_corners.js > mikk_corners.txt
//
// A line "mesh NAME CORNERS", then a line per corner: position, normal, UV (v up, as the reference
// takes it), tangent, handedness. All numbers are single precision.
const { generateTangents } = require('mikktspace');

let seed = 1;
function random() {
  seed = (Math.imul(seed, 1664525) + 1013904223) >>> 0;
  return seed / 4294967296;
}
const unit = (v) => {
  const size = Math.hypot(...v);
  return v.map((x) => x / size);
};
const cross = (a, b) => [
  a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const minus = (a, b) => a.map((x, i) => x - b[i]);

/// n x n quads over point(i, j) -> {p, n, uv}, each cut along a diagonal.
function grid(n, point, uv_of = (corner) => corner.uv) {
  const corners = [];
  for (let j = 0; j < n; ++j) {
    for (let i = 0; i < n; ++i) {
      for (const [a, b] of [[0, 0], [1, 0], [1, 1], [0, 0], [1, 1], [0, 1]]) {
        const corner = point(i + a, j + b, i, j);
        corners.push({ ...corner, uv: uv_of(corner) });
      }
    }
  }
  return corners;
}

function hill(i, j) {
  const x = i / 4 - 0.5, y = j / 4 - 0.5, z = 0.4 * Math.exp(-4 * (x * x + y * y));
  return { p: [x, y, z], n: unit([8 * x * z, 8 * y * z, 1]), uv: [i / 4, j / 4] };
}

const meshes = {
  hill: grid(4, hill),
  // Each half shows the same image, turned over in the middle.
  mirrored: grid(4, (i, j) => ({ ...hill(i, j), uv: [Math.abs(i - 2) / 2, j / 4] })),
  // UVs that are squeezed, sheared and noisy.
  warped: (() => {
    const noise = [...Array(25)].map(() => [random(), random()]);
    return grid(4, (i, j) => {
      const [a, b] = noise[5 * j + i], h = hill(i, j);
      return { ...h, uv: [0.3 * h.uv[0] + 0.2 * h.uv[1] + 0.08 * a, 0.9 * h.uv[1] + 0.1 * b] };
    });
  })(),
  // A sphere: fans at its poles, a seam, triangles without area where a row ends in a pole.
  sphere: grid(5, (i, j) => {
    const a = 2 * Math.PI * (i % 5) / 5, b = Math.PI * j / 5;
    const ring = j % 5 === 0 ? 0 : Math.sin(b);
    const p = [ring * Math.cos(a), j === 0 ? 1 : j === 5 ? -1 : Math.cos(b), ring * Math.sin(a)];
    return { p, n: p, uv: [i / 5, 1 - j / 5] };
  }),
  // Some triangles have no area in UV space; all of one corner have none.
  flat_uvs: grid(4, hill, (c) => c.uv[0] > 0.3 && c.uv[0] < 0.8 ? [0.5, c.uv[1]] : c.uv),
  // A flat-shaded tetrahedron-like strip with a chart per triangle.
  charts: (() => {
    const corners = [];
    for (let t = 0; t < 12; ++t) {
      const p = [0, 1, 2].map(() => [random(), random(), random()]);
      const n = unit(cross(minus(p[1], p[0]), minus(p[2], p[0])));
      for (const q of p) corners.push({ p: q, n, uv: [random(), random()] });
    }
    return corners;
  })(),
  // Three triangles share an edge, of which two run the same way.
  fin: (() => {
    const at = { a: [0, 0, 0], b: [0, 1, 0], c: [1, 0.2, 0], d: [-1, 0.3, 0], e: [0, 0.4, 1] };
    const uv = { a: [0.5, 0], b: [0.5, 1], c: [1, 0.2], d: [0, 0.3], e: [0.8, 0.7] };
    return [...'acb', ...'abd', ...'abe'].map((k) => ({ p: at[k], n: [0, 0, 1], uv: uv[k] }));
  })(),
};

for (const [name, corners] of Object.entries(meshes)) {
  const flat = (key) => new Float32Array(corners.flatMap((c) => c[key]));
  const p = flat('p'), n = flat('n'), uv = flat('uv');
  const t = generateTangents(p, n, uv);
  console.log(`mesh ${name} ${corners.length}`);
  corners.forEach((_, i) => console.log([
    ...p.slice(3 * i, 3 * i + 3), ...n.slice(3 * i, 3 * i + 3), ...uv.slice(2 * i, 2 * i + 2),
    ...t.slice(4 * i, 4 * i + 4)].map((x) => Number(x.toPrecision(9))).join(' ')));
}
