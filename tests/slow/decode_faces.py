# SPDX-License-Identifier: Apache-2.0
"""What meshio reads of a PLY or STL: corners as slow_models compares them (mesh_models.cpp says how).

python3 decode_faces.py IN CORNERS     needs python3-meshio
"""
import sys
import tempfile

import meshio
import numpy

with open(sys.argv[1], "rb") as file:
    data = file.read()
with tempfile.NamedTemporaryFile(suffix=sys.argv[1][-4:].lower()) as file:
    # meshio knows one of the two names.
    file.write(data.replace(b"vertex_index\n", b"vertex_indices\n", 1))
    file.flush()
    mesh = meshio.read(file.name)
uvs = numpy.full((len(mesh.points), 2), numpy.nan)
for u, v in (("s", "t"), ("u", "v"), ("texture_u", "texture_v")):
    if u in mesh.point_data:
        uvs = numpy.stack([mesh.point_data[u], 1 - numpy.asarray(mesh.point_data[v], float)], axis=1)
is_ordered = all(cells.type == "triangle" for cells in mesh.cells)
corners = []
for cells in mesh.cells:
    if cells.type not in ("triangle", "quad", "polygon"):
        continue
    data = numpy.asarray(cells.data)
    fan = [data[:, [0, k, k + 1]] for k in range(1, data.shape[1] - 1)]
    corners.extend(face.reshape(-1) for face in fan)
index = numpy.concatenate(corners).astype(int)
rows = numpy.hstack([numpy.asarray(mesh.points, float)[index], uvs[index]])
with open(sys.argv[2], "wb") as out:
    out.write(b"o" if is_ordered else b"p")
    out.write(rows.astype("<f4").tobytes())
