"""A .btf container like those of the Bonn measurements of 2014: small, written from the description of the layout."""

import struct
from dataclasses import dataclass, field, replace

import numpy as np

ELEVATION_RINGS = [(0.0, 1, 0.0), (40.0, 4, 15.0), (70.5, 5, 0.0)]  # θ, directions, φ of the first, degrees
ANGLES = np.array([(theta, start + 360 * k / n) for theta, n, start in ELEVATION_RINGS for k in range(n)])
SIZE = (6, 5)
YUV_TO_RGB = np.array([[1, 0, 1.13983], [1, -0.39465, -0.5806], [1, 2.03211, 0]])


@dataclass(frozen=True)
class Written:
    """The written contents; tests change parts. channels: U and V of each, (pairs, C), (texels, C)"""

    signature: bytes = b"!DFMF08FCR"
    version: int = 4
    cosine: int = 0
    xml: bytes = b"<measured/>"
    views: np.ndarray = field(default_factory=lambda: ANGLES[::-1])
    lights: np.ndarray = field(default_factory=lambda: ANGLES[::-1])
    size: tuple[int, int] = SIZE
    rotations: int = 1
    model: int = 0
    kind: str = "<f2"
    channels: list = field(default_factory=list)
    is_transposed: bool = False


def random_factors(num=100, ranks=(4, 2, 3)):
    """Positive factors in half precision with 4, 2 and 3 components."""
    rng, texels = np.random.default_rng(0), SIZE[0] * SIZE[1]
    return [tuple(rng.uniform(0.05, 0.5, (rows, rank)).astype(np.float16) for rows in (num, texels)) for rank in ranks]


def encode_header(file):
    chunks = [b"".join(text.ljust(80, b"\0") for text in (b"Dome", b"sensor", b"lamp")), struct.pack("<4f", 1, 1, 1, 1)]
    if file.version > 1:
        chunks.append(struct.pack("<I", file.cosine))
    if file.version > 2:
        chunks += [struct.pack("<I", len(file.xml)), file.xml]
    if file.version > 3:
        chunks += [struct.pack("<I", 3), *(struct.pack("<I", 1) + name for name in (b"R", b"G", b"B"))]
    body = struct.pack("<I", file.version) + b"".join(chunks)
    return struct.pack("<I", len(body) + 4) + body


def encode_container(file):
    views, lights = (np.radians(angles).astype("<f4") for angles in (file.views, file.lights))
    chunks = [file.signature, encode_header(file), struct.pack("<I", len(views))]
    for view in views:
        chunks += [view.tobytes(), struct.pack("<I", len(lights)), lights.tobytes()]
    chunks += [struct.pack("<III", file.size[1], file.size[0], file.rotations), bytes(36 * file.rotations)]
    chunks.append(struct.pack("<Ii12f", max(u.shape[1] for u, _ in file.channels), file.model, *[0.0] * 12))
    for left_factor, right_factor in file.channels:
        left_factor, right_factor = (right_factor, left_factor) if file.is_transposed else (left_factor, right_factor)
        chunks.append(
            struct.pack(
                "<BIII", np.dtype(file.kind).itemsize, left_factor.shape[1], len(left_factor), len(right_factor)
            )
        )
        chunks += [
            np.asarray(angles, file.kind).tobytes()
            for angles in (np.ones(left_factor.shape[1]), left_factor, right_factor)
        ]
    return b"".join(chunks)


def container(path, **changes):
    """Write a container; return its path and contents."""
    file = replace(Written(channels=random_factors()), **changes)
    path.write_bytes(encode_container(file))
    return path, file


def values(file, view, light):
    """Channels of an image for directions by their indices in the file. (texels, 3)"""
    pair = view * len(file.lights) + light
    return np.stack([v.astype(float) @ u[pair].astype(float) for u, v in file.channels], axis=1)
