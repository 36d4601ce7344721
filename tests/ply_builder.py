"""A square as a PLY file, in each of its formats."""

from __future__ import annotations

import numpy as np

POSITIONS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float64)


def header(form: str, num_faces: int, num_vertices: int = 4) -> str:
    """Vertices of doubles, faces as lists of ints."""
    columns = "".join(f"property double {name}\n" for name in "xyz")
    faces = f"element face {num_faces}\nproperty list uchar int vertex_indices\nend_header\n"
    return f"ply\nformat {form} 1.0\ncomment by hand\nelement vertex {num_vertices}\n{columns}{faces}"


def text(mixed: bool = False) -> bytes:
    """The square as text; `mixed` adds a triangle."""
    rows = "".join(f"{x} {y} {z}\n" for x, y, z in POSITIONS) + "4 0 1 2 3\n" + ("3 0 1 3\n" if mixed else "")
    return (header("ascii", 1 + mixed) + rows).encode()


def binary(order: str, mixed: bool = False) -> bytes:
    """The square in the byte order "<" or ">"."""
    faces = [[0, 1, 2, 3], *([[0, 1, 3]] if mixed else [])]
    body = POSITIONS.astype(f"{order}f8").tobytes()
    for face in faces:
        body += bytes([len(face)]) + np.array(face, f"{order}i4").tobytes()
    form = "binary_little_endian" if order == "<" else "binary_big_endian"
    return header(form, len(faces)).encode() + body
