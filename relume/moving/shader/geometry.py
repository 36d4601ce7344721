"""What a shader keeps of a bake: surfaces and points, in arrays of texels of one, two or four numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.basis.zernike import NUM_FUNCTIONS, ladder
from relume.moving.basis.out_factors import NUM_COLUMNS, NUM_ROWS
from relume.moving.bumps import expansions
from relume.moving.points.surface import Surface, Textures
from relume.moving.transfer import MovingTransfer

Texels = NDArray[Any]

MOST_TEXELS = 1 << 24  # of textures, all levels: finer ones are left out, finest first


def constants(transfer: MovingTransfer) -> dict[str, Any]:
    """What shaders are written from: the ladder of the in-basis, expansions of leaning normals, sizes of tables.

    `has_holes` says that surfaces have some, which shaders do not know of.
    """
    rungs = {name: field.tolist() for name, field in ladder()._asdict().items()}
    sizes = {"functions": NUM_FUNCTIONS, "rows": NUM_ROWS, "columns": NUM_COLUMNS}
    return {**sizes, "ladder": rungs, "expansions": expansions().tolist(), "has_holes": transfer.has_holes}


def arrays_of(transfer: MovingTransfer) -> Mapping[str, Callable[[], Texels]]:
    """Name the arrays of a bake; each is made when it is called.

    Returns:
        (texels, 1, 2 or 4) each, float32, float16 or uint32:
        corners: of faces, three and the material. lattice: of faces, where the nodes of both sides begin, both numbers
        of rows (the second times 256), 0. facing: normals of faces, `uv_scale`. positions: of corners. nodes: vertices
        of the lattice. normals, points, weights: of vertices. places, point_normals, tangents: of points, the first
        with their materials. sky_share: K numbers of each point in texels of four.
        Of scenes with textures besides: texels; levels: of each texture (first level's row, how many, both wraps),
        then of each level (first texel, height, width, 0); uvs: two of each corner, (u, v, sign of the bitangent, 0)
        and its tangent.
    """
    surface, points = transfer.surface, transfer.surface.points
    found: dict[str, Callable[[], Texels]] = {
        "corners": lambda: np.column_stack([surface.faces, surface.face_material]).astype(np.uint32),
        "lattice": lambda: _lattice(surface),
        "facing": lambda: _four(surface.face_normal, surface.uv_scale),
        "positions": lambda: _four(transfer.positions, 0),
        "nodes": lambda: surface.lattice.node.astype(np.uint32)[:, None],
        "normals": lambda: _four(surface.vertices.normal, 0),
        "points": lambda: surface.vertices.point.astype(np.uint32),
        "weights": lambda: surface.vertices.weight.astype(np.float32),
        "places": lambda: _four(points.position, surface.material),
        "point_normals": lambda: _four(points.normal, 0),
        "tangents": lambda: _four(points.tangent, 0),
        "sky_share": lambda: transfer.sky_share.astype(np.float16).reshape(-1, 4),
    }
    if len(surface.textures.wraps):
        found |= _of_textures(surface, surface.textures)
    return found


def _of_textures(surface: Surface, textures: Textures) -> dict[str, Callable[[], Texels]]:
    kept, first = _kept_levels(textures)
    begins = np.cumsum([0, *(textures.levels[k, 1] * textures.levels[k, 2] for k in kept)])

    def texels() -> Texels:
        parts = [textures.texels[s : s + h * w] for s, h, w in textures.levels[kept]]
        return _four(np.concatenate(parts), 0).astype(np.float16)

    num = len(textures.wraps)
    of_textures = np.column_stack([first[:-1] + num, np.diff(first), textures.wraps])
    of_levels = np.column_stack([begins[:-1], textures.levels[kept, 1:], np.zeros(len(kept), np.int64)])
    return {
        "uvs": lambda: _corner_frames(surface),
        "texels": texels,
        "levels": lambda: np.concatenate([of_textures, of_levels]).astype(np.uint32),
    }


def _corner_frames(surface: Surface) -> Texels:
    out = np.zeros((len(surface.uvs), 2, 4), np.float32)
    out[:, 0, :2] = surface.uvs
    if len(surface.tangents):
        out[:, 0, 2], out[:, 1, :3] = surface.tangents[:, 3], surface.tangents[:, :3]
    return out.reshape(-1, 4)


def _kept_levels(textures: Textures) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Levels of all textures that fit, and where those of each begin: the finest of the largest goes first."""
    ranges = [list(range(a, b)) for a, b in zip(textures.first[:-1], textures.first[1:], strict=True)]
    area = textures.levels[:, 1] * textures.levels[:, 2]
    while sum(int(area[k].sum()) for k in ranges) > MOST_TEXELS:
        widest = max(ranges, key=lambda levels: int(area[levels[0]]) if len(levels) > 1 else 0)
        if len(widest) == 1:
            break
        widest.pop(0)
    return np.concatenate(ranges).astype(np.int64), np.cumsum([0, *map(len, ranges)])


def _lattice(surface: Surface) -> Texels:
    first, rows = surface.lattice.first.astype(np.uint32), surface.lattice.num_rows.astype(np.uint32)
    return np.column_stack([first, rows[:, 0] + 256 * rows[:, 1], np.zeros(len(rows), np.uint32)])


def _four(three: NDArray[Any], more: Any) -> Texels:
    """Add a fourth number to each row."""
    out = np.empty((len(three), 4), np.float32)
    out[:, :3] = three
    out[:, 3] = more
    return out
