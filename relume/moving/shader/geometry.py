"""What a shader keeps of a bake: surfaces and points, in arrays of texels of one, two or four numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.basis.zernike import NUM_FUNCTIONS, ladder
from relume.moving.basis.out_factors import NUM_COLUMNS, NUM_ROWS
from relume.moving.basis.shapes import NUM_RINGS, NUM_SPOKES, WIDTHS
from relume.moving.bumps import expansions
from relume.moving.highlights.by_lights import LEAST_BITS
from relume.moving.highlights.lobe_lights import LIGHTS_A_LAMP, NARROWEST, NUM_LISTED, NUM_WIDTHS, SIDE
from relume.moving.points.grids import Lattice, num_nodes
from relume.moving.points.surface import Surface, Textures
from relume.moving.transfer import MovingTransfer

Texels = NDArray[Any]

MOST_TEXELS = 1 << 24  # of textures, all levels: finer ones are left out, finest first


def constants(transfer: MovingTransfer) -> dict[str, Any]:
    """What shaders are written from: the ladder of the in-basis, expansions of leaning normals, sizes of tables
    and of lists of lights.

    `first_points` are those of the materials, and one more at the end. `has_holes` says that surfaces have some, which
    shaders do not know of.
    """
    rungs = {name: field.tolist() for name, field in ladder()._asdict().items()}
    sizes = {"functions": NUM_FUNCTIONS, "rows": NUM_ROWS, "columns": NUM_COLUMNS}
    first = first_points(transfer).tolist()
    texts = {"ladder": rungs, "expansions": expansions().tolist(), "first_points": first}
    lists: dict[str, float] = {"side": SIDE, "listed": NUM_LISTED, "lights_a_lamp": LIGHTS_A_LAMP}
    lists |= {"narrowest": NARROWEST, "widths": NUM_WIDTHS}
    shapes = {"rings": NUM_RINGS, "spokes": NUM_SPOKES, "widths": len(WIDTHS), "least_bits": int(LEAST_BITS)}
    return {**sizes, **texts, "lobe_lists": lists, "shapes": shapes, "has_holes": transfer.has_holes}


def first_points(transfer: MovingTransfer) -> NDArray[np.int64]:
    """Find where the points of each material begin, which come one after another. (materials + 1,)"""
    return np.searchsorted(transfer.surface.material, np.arange(len(transfer.material_names) + 1))


def arrays_of(transfer: MovingTransfer) -> Mapping[str, Callable[[], Texels]]:
    """Name the arrays of a bake; each is made when it is called.

    Returns:
        (texels, 1, 2 or 4) each, float32, float16 or uint32:
        corners: of faces, three and the material. sides: two of each face, see `slots_of`. facing: normals of faces,
        `uv_scale`. positions: of corners. normals, points, weights: of slots. places, point_normals, tangents: of
        points. seen_lights: bits of the lights that each sees, 128 a texel, which lobes alone need.
        Of scenes with textures besides: texels; levels: of each texture (first level's row, how many, both wraps),
        then of each level (first texel, height, width, 0); uvs: two of each corner, (u, v, sign of the bitangent, 0)
        and its tangent.
    """
    surface, points = transfer.surface, transfer.surface.points
    slots = slots_of(surface.lattice)
    vertices = surface.vertices
    found: dict[str, Callable[[], Texels]] = {
        "corners": lambda: np.column_stack([surface.faces, surface.face_material]).astype(np.uint32),
        "sides": lambda: slots.sides.reshape(-1, 4),
        "facing": lambda: _four(surface.face_normal, surface.uv_scale),
        "positions": lambda: _four(transfer.positions, 0),
        "normals": lambda: _four(vertices.normal[slots.vertex], 0).astype(np.float16),
        "points": lambda: vertices.point[slots.vertex].astype(np.uint32),
        "weights": lambda: vertices.weight[slots.vertex].astype(np.float16),
        "places": lambda: _four(points.position, 0),
        "point_normals": lambda: _four(points.normal, 0).astype(np.float16),
        "tangents": lambda: _four(points.tangent, 0).astype(np.float16),
        "seen_lights": lambda: _bits(transfer.seen_lights),
    }
    if len(surface.textures.wraps):
        found |= _of_textures(surface, surface.textures)
    return found


class Slots(NamedTuple):
    """Where a shader keeps what vertices send.

    Nodes of a grid have a slot each, one after another, so that they are found without being looked up. Faces with one
    row, which are many where a mesh is fine, share those of their corners.

    Attributes:
        sides: of each side of a face, the numbers of its rows last. Of one row: the slots of its corners. Of more: its
            first slot, 0, 0. A side without any has what the other has. (faces, 2, 4) uint32
        vertex: that each slot is. (slots,) uint32
    """

    sides: NDArray[np.uint32]
    vertex: NDArray[np.uint32]


def slots_of(lattice: Lattice) -> Slots:
    """Number the slots of a lattice."""
    rows, first = lattice.num_rows.ravel().astype(np.int64), lattice.first.ravel().astype(np.int64)
    counts = num_nodes(rows)
    is_wide = rows > 1
    of_wide = np.repeat(is_wide, counts)  # nodes are in the order of sides
    narrow = first[rows == 1, None] + np.array([0, 2, 1])  # i towards the second corner, j towards the third
    corners, which = np.unique(lattice.node[narrow], return_inverse=True)
    num_wide = int(of_wide.sum())
    of_each = np.zeros((len(rows), 4), np.uint32)
    of_each[:, 3] = rows
    of_each[is_wide, 0] = (np.cumsum(counts * is_wide) - counts)[is_wide]
    of_each[rows == 1, :3] = num_wide + which.reshape(narrow.shape)
    sides = of_each.reshape(-1, 2, 4)
    has_none = sides[..., 3] == 0
    sides = np.where(has_none[..., None], sides[:, ::-1], sides)
    return Slots(sides, np.concatenate([lattice.node[of_wide], corners]).astype(np.uint32))


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


def textures_with(baked: Surface, surface: Surface) -> dict[str, Texels]:
    """Find what takes the place of a bake's arrays of textures where a look names images: textures keep their numbers.

    Args:
        baked: what is seen. surface: it with the images.
    """
    found = _of_textures(surface, surface.textures)
    has_frames = len(baked.textures.wraps) and surface.tangents is baked.tangents
    return {name: make() for name, make in found.items() if name != "uvs" or not has_frames}


def _corner_frames(surface: Surface) -> Texels:
    out = np.zeros((len(surface.uvs), 2, 4), np.float32)
    out[:, 0, :2] = surface.uvs
    num = len(surface.tangents)  # corners whose places are projected have none of their own
    out[:num, 0, 2], out[:num, 1, :3] = surface.tangents[:, 3], surface.tangents[:, :3]
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


def _bits(visible: NDArray[np.uint8]) -> Texels:
    """Put bits of points, low ones first, into whole texels."""
    num = -(-visible.shape[1] // 16)
    out = np.zeros((len(visible), 16 * num), np.uint8)
    out[:, : visible.shape[1]] = visible
    return out.view("<u4").reshape(-1, 4)


def _four(three: NDArray[Any], more: Any) -> Texels:
    """Add a fourth number to each row."""
    out = np.empty((len(three), 4), np.float32)
    out[:, :3] = three
    out[:, 3] = more
    return out
