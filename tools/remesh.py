#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Kernels on a photograph: a scanned model re-meshed with other UVs, against the photograph itself.

Usage: tools/remesh.py POUNCE MODEL.glb FOLDER [--shrink 2] [--size 512] [FILTER...]

The model's texture, shrunk by box means, is the source. The target is the same surface cut into other triangles, in flat charts
along the six axes. The truth of a target's texel is the mean of 4x4 lookups in the texture at its full size, each where that part
of the texel lies on the surface. Prints similarity and PSNR of each filter. Needs numpy and Pillow.
"""
import argparse
import io
import json
import struct
import subprocess

import numpy as np
from PIL import Image

PARTS = 4  # of a texel, along each side


def read_glb(path):
    """Positions, UVs and triangles of the first primitive, and the image of its material."""
    with open(path, "rb") as file:
        data = file.read()
    size = struct.unpack_from("<I", data, 12)[0]
    gltf, binary = json.loads(data[20:20 + size]), data[28 + size:]

    def accessor(index):
        a = gltf["accessors"][index]
        view = gltf["bufferViews"][a["bufferView"]]
        kind = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}[a["componentType"]]
        width = {"SCALAR": 1, "VEC2": 2, "VEC3": 3}[a["type"]]
        begin = view.get("byteOffset", 0) + a.get("byteOffset", 0)
        item = np.dtype(kind).itemsize
        stride = view.get("byteStride", width * item)
        return np.ndarray((a["count"], width), kind, binary, begin, (stride, item))

    primitive = gltf["meshes"][0]["primitives"][0]
    view = gltf["bufferViews"][gltf["images"][0]["bufferView"]]
    begin = view.get("byteOffset", 0)
    image = Image.open(io.BytesIO(binary[begin:begin + view["byteLength"]])).convert("RGB")
    attributes = primitive["attributes"]
    return (accessor(attributes["POSITION"]).astype(float), accessor(attributes["NORMAL"]).astype(float),
            accessor(attributes["TEXCOORD_0"]).astype(float),
            accessor(primitive["indices"]).reshape(-1, 3).astype(np.int64), np.asarray(image, float) / 255)


def cut(triangles):
    """Each triangle in three about a place off its middle: corners as (source triangle, weights)."""
    inside = np.array([0.4, 0.35, 0.25])
    corners = np.eye(3)
    parts = np.array([[corners[a], corners[(a + 1) % 3], inside] for a in range(3)])
    return np.repeat(np.arange(len(triangles)), 3), np.tile(parts, (len(triangles), 1, 1))


def charts(points, size):
    """Flat charts along the axis that each triangle faces most: UVs of the corners, in texels of an image of `size`."""
    normal = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    axis = np.argmax(np.abs(normal), axis=1)
    side = axis * 2 + (np.take_along_axis(normal, axis[:, None], 1)[:, 0] < 0)
    _, corner = np.unique(points.reshape(-1, 3).round(6), axis=0, return_inverse=True)
    corner = corner.reshape(-1, 3)
    chart = np.arange(len(points))
    while True:  # triangles of one side that share a corner are one chart
        least = np.full((corner.max() + 1, 6), len(points))
        for k in range(3):
            np.minimum.at(least, (corner[:, k], side), chart)
        next_chart = np.min([least[corner[:, k], side] for k in range(3)], axis=0)
        if np.array_equal(next_chart, chart):
            break
        chart = next_chart
    flat = np.stack([np.take_along_axis(points, ((axis + k) % 3)[:, None, None].repeat(3, 1), 2)[..., 0] for k in (1, 2)], -1)
    names, index = np.unique(chart, return_inverse=True)
    low = np.full((len(names), 2), np.inf)
    high = -low
    np.minimum.at(low, index, flat.min(1))
    np.maximum.at(high, index, flat.max(1))
    order = np.lexsort((names, -(high - low)[:, 1]))

    def packed(scale):
        at, x, y, shelf = np.zeros((len(names), 2)), 4.0, 4.0, 0.0
        for c in order:
            width, height = np.ceil((high - low)[c] * scale) + 8
            if x + width > size:
                x, y, shelf = 4.0, y + shelf, 0.0
            at[c] = x, y
            x += width
            shelf = max(shelf, height)
        return at if y + shelf <= size else None

    scale = size / (high - low).max()
    while packed(scale) is None:
        scale *= 0.98
    return (flat - low[index][:, None]) * scale + packed(scale)[index][:, None] + 0.37


def write_obj(path, points, normals, uv, size):
    with open(path, "w", encoding="ascii") as file:
        for p in points.reshape(-1, 3):
            file.write("v %.9g %.9g %.9g\n" % tuple(p))
        for n in normals.reshape(-1, 3):
            file.write("vn %.9g %.9g %.9g\n" % tuple(n))
        for t in uv.reshape(-1, 2):
            file.write("vt %.9g %.9g\n" % (t[0] / size, 1 - t[1] / size))
        for i in range(len(points)):
            file.write("f " + " ".join("%d/%d/%d" % ((3 * i + k + 1,) * 3) for k in range(3)) + "\n")


def bilinear(image, x, y):
    height, width = image.shape[:2]
    i, j = np.floor(x).astype(int), np.floor(y).astype(int)
    u, v = (x - i)[:, None], (y - j)[:, None]

    def at(a, b):
        return image[b % height, a % width]

    return (1 - v) * ((1 - u) * at(i, j) + u * at(i + 1, j)) + v * ((1 - u) * at(i, j + 1) + u * at(i + 1, j + 1))


def truth(image, uv, source_uv, size):
    """The mean of each texel's parts, and which texels are covered whole."""
    fine = size * PARTS
    total, count = np.zeros((size, size, 3)), np.zeros((size, size), int)
    height, width = image.shape[:2]
    for corners, places in zip(uv * PARTS, source_uv):
        x0, y0 = np.floor(corners.min(0)).astype(int)
        x1, y1 = np.minimum(np.ceil(corners.max(0)).astype(int), fine - 1)
        y, x = np.mgrid[y0:y1 + 1, x0:x1 + 1]
        x, y = x.ravel(), y.ravel()
        a, b = corners[1] - corners[0], corners[2] - corners[0]
        area = a[0] * b[1] - a[1] * b[0]
        if area == 0:
            continue
        dx, dy = x + 0.5 - corners[0, 0], y + 0.5 - corners[0, 1]
        w1, w2 = (dx * b[1] - dy * b[0]) / area, (a[0] * dy - a[1] * dx) / area
        inside = (w1 >= 0) & (w2 >= 0) & (w1 + w2 < 1)
        if not inside.any():
            continue
        w1, w2 = w1[inside, None], w2[inside, None]
        place = places[0] * (1 - w1 - w2) + places[1] * w1 + places[2] * w2
        colour = bilinear(image, place[:, 0] * width - 0.5, place[:, 1] * height - 0.5)
        np.add.at(total, (y[inside] // PARTS, x[inside] // PARTS), colour)
        np.add.at(count, (y[inside] // PARTS, x[inside] // PARTS), 1)
    whole = count == PARTS * PARTS
    return total / np.maximum(count, 1)[..., None], whole


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pounce")
    parser.add_argument("model")
    parser.add_argument("folder")
    parser.add_argument("--shrink", type=int, default=2)
    parser.add_argument("--size", type=int, default=512)
    parser.add_argument("filters", nargs="*", default=["tent", "cubic", "sharp"])
    options = parser.parse_intermixed_args()
    positions, normals, uvs, triangles, image = read_glb(options.model)
    n = options.shrink
    height, width = image.shape[0] // n * n, image.shape[1] // n * n
    image = image[:height, :width]
    small = image.reshape(height // n, n, width // n, n, 3).mean((1, 3))
    texture = options.folder + "/source.png"
    Image.fromarray((small * 255 + 0.5).astype(np.uint8)).save(texture)
    parent, weights = cut(triangles)

    def on_source(values):
        return np.einsum("tck,tkd->tcd", weights, values[triangles[parent]])

    points = on_source(positions)
    real = np.linalg.norm(np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]), axis=1) > 1e-12
    parent, weights, points = parent[real], weights[real], points[real]
    uv = charts(points, options.size)
    target = options.folder + "/target.obj"
    write_obj(target, points, on_source(normals), uv, options.size)
    expected, whole = truth(image, uv, on_source(uvs), options.size)
    Image.fromarray((expected * 255 + 0.5).astype(np.uint8)).save(options.folder + "/truth.png")
    for name in options.filters:
        out, mask = ("%s/%s.png" % (options.folder, f) for f in (name, name + ".mask"))
        subprocess.run([options.pounce, "transfer", options.model, target, "-o", out, "--coverage", mask, "--size",
                        str(options.size), "--no-cache", "-q", "--filter", name, "--source-texture", "baseColor=" + texture],
                       check=True)
        seen = whole & (np.asarray(Image.open(mask)) > 0)
        error = np.asarray(Image.open(out), float)[..., :3][seen] / 255 - expected[seen]
        print("%-6s %8.3f %% %7.2f dB   %d texels" %
              (name, 100 * (1 - np.abs(error).mean()), -10 * np.log10((error**2).mean()), seen.sum()))


if __name__ == "__main__":
    main()
