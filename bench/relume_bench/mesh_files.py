"""import.obj, import.ply: seconds to read a grid of a million triangles, compared with other libraries.

The OBJ text has positions, texture coordinates and normals; the PLY is binary. If tinyobjloader and plyfile are
installed, which relume does not need, they read the same bytes, alternating. docs/adr/0010-scene-file-readers.md.
"""

from __future__ import annotations

import importlib.util
import io
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.scene_io.obj_ply.obj import as_rows, read_obj
from relume.scene_io.obj_ply.ply import read_ply
from relume.scene_io.obj_ply.polygons import triangulate
from relume_bench.figure import Figure
from relume_bench.timing import time_interleaved

F32 = NDArray[np.float32]
I32 = NDArray[np.int32]
_ROUNDS = 3


def measure(tiny: bool) -> list[Figure]:
    """Both formats, each with our reader and, if installed, with the library for it."""
    positions, faces = grid(8 if tiny else 707)
    obj, ply = _obj_text(positions, faces), ply_bytes(positions, faces)
    return [
        _figure("import.obj", len(faces), obj, lambda: _read_obj(obj), "tinyobjloader", _by_tinyobjloader),
        _figure("import.ply", len(faces), ply, lambda: _read_ply(ply), "plyfile", _by_plyfile),
    ]


def _read_obj(data: bytes) -> object:
    """The triangles of an OBJ file."""
    obj = read_obj(data)
    counts = len(obj.uvs) // 2, len(obj.normals) // 3
    return triangulate(obj.polygons(), as_rows(obj.positions, 3), *counts, ".obj")


def _read_ply(data: bytes) -> object:
    """The triangles of a PLY file."""
    ply = read_ply(data, [])
    return triangulate(ply.polygons, ply.positions, len(ply.uvs), len(ply.normals), ".ply")


def _figure(
    name: str,
    num_triangles: int,
    data: bytes,
    relume_reader: Callable[[], object],
    library: str,
    library_reader: Callable[[bytes], int],
) -> Figure:
    calls = [relume_reader]
    if importlib.util.find_spec(library) is not None:
        calls.append(lambda: library_reader(data))
    fastest = [min(times) for times in time_interleaved(calls, _ROUNDS)]
    context: dict[str, Any] = {"triangles": num_triangles, "bytes": len(data), "rounds": _ROUNDS}
    context |= {f"{library}_s": seconds for seconds in fastest[1:]}
    return Figure(name, fastest[0], "s", context)


def grid(size: int) -> tuple[F32, I32]:
    """2 · size² triangles of rough terrain. (n, 3) and (num_triangles, 3)"""
    y, x = np.mgrid[0 : size + 1, 0 : size + 1]
    height = np.random.default_rng(0).random(x.shape)
    first = (np.arange(size)[:, None] * (size + 1) + np.arange(size)).ravel()
    above = first + size + 1
    faces = np.concatenate([np.stack([first, first + 1, above + 1], -1), np.stack([first, above + 1, above], -1)])
    return np.stack([x, y, height], -1).reshape(-1, 3).astype(np.float32), faces.astype(np.int32)


def _obj_text(positions: F32, faces: I32) -> bytes:
    text = io.StringIO()
    np.savetxt(text, positions, "v %.6f %.6f %.6f")
    np.savetxt(text, positions[:, :2] / positions.max(), "vt %.6f %.6f")
    np.savetxt(text, np.broadcast_to([0.0, 0.0, 1.0], positions.shape), "vn %.4f %.4f %.4f")
    np.savetxt(text, np.repeat(faces + 1, 3, axis=1), "f %d/%d/%d %d/%d/%d %d/%d/%d")
    return text.getvalue().encode()


def ply_bytes(positions: F32, faces: I32) -> bytes:
    """Encode triangles as a binary PLY."""
    columns = "".join(f"property float {name}\n" for name in "xyz")
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(positions)}\n{columns}"
    header += f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    rows = np.empty(len(faces), [("count", "u1"), ("corners", "<i4", 3)])
    rows["count"], rows["corners"] = 3, faces
    return header.encode() + positions.astype("<f4").tobytes() + rows.tobytes()


def _by_tinyobjloader(data: bytes) -> int:
    """Read corner by corner: its array `numpy_indices` repeats the first one (2.0.0rc13)."""
    import tinyobjloader

    reader = tinyobjloader.ObjReader()
    reader.ParseFromString(data.decode(), "", tinyobjloader.ObjReaderConfig())
    np.array(reader.GetAttrib().numpy_vertices())
    corners = [
        (corner.vertex_index, corner.texcoord_index, corner.normal_index)
        for shape in reader.GetShapes()
        for corner in shape.mesh.indices
    ]
    return len(np.array(corners))


def _by_plyfile(data: bytes) -> int:
    import plyfile

    ply = plyfile.PlyData.read(io.BytesIO(data))
    return len(np.vstack(ply["face"]["vertex_indices"]))
