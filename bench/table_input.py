# SPDX-License-Identifier: Apache-2.0
"""Input for bench/table.py that pounce-fixture does not make: many images, many tiles, maps. Standard library alone."""
import functools
import multiprocessing
import struct
import zlib


def rows_of(width, rows, colour):
    """Rows of a PNG of 24 bits: blocks of 8 x 16 texels, each of one colour."""
    made = {}
    for y in rows:
        if y >> 4 not in made:
            made[y >> 4] = b"\0" + bytes(value for x in range(width) for value in colour(x >> 3, y >> 4))
        yield made[y >> 4]


def gaudy(x, y):
    return (x * 7 + y * 11) & 255, (x * 13 + y * 5 + 50) & 255, (x * 3 + y * 17 + 100) & 255


def bent(x, y):
    """As a normal map is: everywhere near to +z."""
    return 128 + (x * 7 & 31) - 16, 128 + (y * 11 & 31) - 16, 250


@functools.lru_cache(maxsize=4)
def tail_of(size, colour):
    """All rows but the first, as they are and compressed on their own."""
    raw = b"".join(rows_of(size, range(1, size), colour))
    packer = zlib.compressobj(1, zlib.DEFLATED, -15)
    return raw, packer.compress(raw) + packer.flush()


def write_pngs(paths, size, colour=gaudy):
    """Images that differ in their first texel. By a process of its own: the most memory that this one has ever had
    would count as that of each program that it starts."""
    process = multiprocessing.get_context("fork").Process(
        target=lambda: [write_png(path, size, number, colour) for number, path in enumerate(paths)])
    process.start()
    process.join()
    if process.exitcode != 0:
        raise OSError(f"{paths[0]}: the images could not be made")


def write_png(path, size, number, colour):
    def chunk(name, data):
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
    first = bytearray(next(rows_of(size, range(1), colour)))
    first[1:4] = number.to_bytes(3, "big")
    raw, packed = tail_of(size, colour)
    packer = zlib.compressobj(1, zlib.DEFLATED, -15)
    begin = packer.compress(bytes(first)) + packer.flush(zlib.Z_FULL_FLUSH)
    sum_of_all = zlib.adler32(raw, zlib.adler32(bytes(first)))
    with open(path, "wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", size, size, 8, 2, 0, 0, 0)))
        file.write(chunk(b"IDAT", b"\x78\x01" + begin + packed + struct.pack(">I", sum_of_all)))
        file.write(chunk(b"IEND", b""))


def write_quads(path, edge, uvs, materials=None):
    """A unit square of edge x edge quads as OBJ. `uvs(k)` gives the corner of quad k's UVs and their extent;
    `materials` names an image for each quad, or one for all."""
    name = path[:-len(".obj")]
    if materials:
        with open(name + ".mtl", "w", encoding="utf-8") as file:
            for k, image in enumerate(materials):
                file.write(f"newmtl m{k}\nmap_Kd {image}\n")
    with open(path, "w", encoding="utf-8") as file:
        if materials:
            file.write(f"mtllib {name.rsplit('/', 1)[-1]}.mtl\nusemtl m0\n")
        for k in range(edge * edge):
            (u, v), extent = uvs(k)
            for across, up in ((0, 0), (1, 0), (1, 1), (0, 1)):
                file.write(f"v {(k % edge + across) / edge:.9g} {(k // edge + up) / edge:.9g} 0\n"
                           f"vt {u + across * extent:.9g} {v + up * extent:.9g}\n")
            if materials and len(materials) > 1:
                file.write(f"usemtl m{k}\n")
            file.write("f " + " ".join(f"{i}/{i}" for i in range(4 * k + 1, 4 * k + 5)) + "\n")
