"""Arrays of a bake for the browser's renderer: surfaces and probes, as texels with one, two or four components."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.live.free_camera.basis.lobe_shapes import NUM_AZIMUTHS, NUM_RINGS, WIDTHS
from relume.live.free_camera.basis.outgoing_coefficients import NUM_COLUMNS, NUM_ROWS
from relume.live.free_camera.highlights.light_sum_kernel import LEAST_BITS
from relume.live.free_camera.highlights.lobe_light_lists import (
    LIGHTS_PER_BRIGHT_LIGHT,
    MIN_SIGMA,
    NUM_LISTED,
    NUM_WIDTHS,
    SIDE,
)
from relume.live.free_camera.normal_mapping import basis_gradients
from relume.live.free_camera.protocol import FreeCameraTransfer
from relume.look.model import Link
from relume.math.zernike import NUM_FUNCTIONS, recurrence_by_degree
from relume.probes.stored_scene import StoredScene
from relume.probes.triangle_grids import ProbeGrid, num_nodes
from relume.raytrace.surface_textures import Textures

Texels = NDArray[Any]

MAX_TEXELS = 1 << 24  # of textures, all levels; the finest levels are omitted first


def constants(transfer: FreeCameraTransfer) -> dict[str, Any]:
    """Return the constants of shaders: the recurrence of the Zernike basis, its gradients for mapped normals, and sizes
    of tables and light lists.

    `first_probes`: index of the first probe of each material, and the total at the end. `has_alpha_test`: surfaces have
    alpha masks, which shaders do not support.
    """
    recurrence_fields = {name: field.tolist() for name, field in recurrence_by_degree()._asdict().items()}
    sizes = {"num_basis": NUM_FUNCTIONS, "table_rows": NUM_ROWS, "table_columns": NUM_COLUMNS}
    first = first_probes(transfer).tolist()
    texts = {"recurrence": recurrence_fields, "gradient_basis": basis_gradients().tolist(), "first_probes": first}
    lists: dict[str, float] = {"bins_per_side": SIDE, "max_listed": NUM_LISTED}
    lists |= {"lights_per_bright_light": LIGHTS_PER_BRIGHT_LIGHT, "min_width": MIN_SIGMA, "widths": NUM_WIDTHS}
    shapes = {
        "elevation_rings": NUM_RINGS,
        "azimuths": NUM_AZIMUTHS,
        "widths": len(WIDTHS),
        "min_bits": int(LEAST_BITS),
    }
    return {
        **sizes,
        **texts,
        "lobe_lists": lists,
        "shapes": shapes,
        "has_alpha_test": transfer.has_alpha_tested_surfaces,
    }


def first_probes(transfer: FreeCameraTransfer) -> Shaped[NDArray[np.int64], " bounds"]:
    """Return the index of the first probe of each material, and the total; probes are sorted by material."""
    return np.searchsorted(transfer.stored_scene.material, np.arange(len(transfer.material_names) + 1))


def array_factories(transfer: FreeCameraTransfer) -> Mapping[str, Callable[[], Texels]]:
    """Return functions that make the arrays of a bake, by name.

    Returns:
        (texels, 1, 2 or 4) each, float32, float16 or uint32:
        corners: three corners of each face and its material. sides: two of each face, see `node_arrays`. facing: face
        normals, `uv_scale`. positions: positions of corners.
        normals, points, weights: normals, points and weights of slots. probe_positions, probe_normals,
        tangents: tangents of probes.
        visible_lights: visibility bits of each probe's lights, 128 a texel, needed only for lobes.
        For scenes with textures also: texels; levels: levels of each texture (row of its first level, number of levels,
        both wrap modes), then of each level (first texel, height, width, 0); uvs: two of each corner, (u, v, sign of
        the bitangent, 0) and its tangent.
    """
    stored_scene, probes = transfer.stored_scene, transfer.stored_scene.probes
    shader_nodes = node_arrays(stored_scene.probe_grid)
    lattice_nodes = stored_scene.lattice_nodes
    factories: dict[str, Callable[[], Texels]] = {
        "corners": lambda: np.column_stack([stored_scene.faces, stored_scene.face_material]).astype(np.uint32),
        "sides": lambda: shader_nodes.sides.reshape(-1, 4),
        "facing": lambda: _to_vec4(stored_scene.face_normal, stored_scene.uv_scale),
        "positions": lambda: _to_vec4(transfer.positions, 0),
        "normals": lambda: _to_vec4(lattice_nodes.normal[shader_nodes.lattice_node], 0).astype(np.float16),
        "points": lambda: lattice_nodes.probe[shader_nodes.lattice_node].astype(np.uint32),
        "weights": lambda: lattice_nodes.weight[shader_nodes.lattice_node].astype(np.float16),
        "probe_positions": lambda: _to_vec4(probes.position, 0),
        "probe_normals": lambda: _to_vec4(probes.normal, 0).astype(np.float16),
        "tangents": lambda: _to_vec4(probes.tangent, 0).astype(np.float16),
        "visible_lights": lambda: visible_lights(transfer, None),
    }
    if len(stored_scene.textures.wraps):
        factories |= _texture_factories(stored_scene, stored_scene.textures)
    return factories


def visible_lights(transfer: FreeCameraTransfer, link: Link | None) -> Texels:
    """Return the visibility bits of the lights of an environment with a link; see `array_factories`."""
    return _bits(transfer.light_visibility_bits(link))


class NodeArrays(NamedTuple):
    """Slots of lattice nodes in shader arrays.

    The nodes of a grid have consecutive slots, so that no lookup is needed. Faces with one row, frequent in fine
    meshes, share the slots of their corners.

    Attributes:
        sides: sides of each side of a face; the last entry is the number of its rows. One row: the slots of its
            corners. More:
            its first slot, 0, 0. A side without nodes has those of the other side.
        lattice_node: lattice node of each slot.
    """

    sides: Shaped[NDArray[np.uint32], "faces 2 4"]
    lattice_node: Shaped[NDArray[np.uint32], " slots"]


def node_arrays(probe_grid: ProbeGrid) -> NodeArrays:
    """Assign slots to the nodes of a lattice."""
    rows, first = probe_grid.num_rows.ravel().astype(np.int64), probe_grid.first.ravel().astype(np.int64)
    counts = num_nodes(rows)
    is_wide = rows > 1
    is_wide_node = np.repeat(is_wide, counts)  # nodes are in the order of sides
    narrow = first[rows == 1, None] + np.array([0, 2, 1])  # i toward the second corner, j toward the third
    corners, corner_index = np.unique(probe_grid.node_index[narrow], return_inverse=True)
    num_wide = int(is_wide_node.sum())
    side_table = np.zeros((len(rows), 4), np.uint32)
    side_table[:, 3] = rows
    side_table[is_wide, 0] = (np.cumsum(counts * is_wide) - counts)[is_wide]
    side_table[rows == 1, :3] = num_wide + corner_index.reshape(narrow.shape)
    sides = side_table.reshape(-1, 2, 4)
    has_none = sides[..., 3] == 0
    sides = np.where(has_none[..., None], sides[:, ::-1], sides)
    return NodeArrays(sides, np.concatenate([probe_grid.node_index[is_wide_node], corners]).astype(np.uint32))


def _texture_factories(stored_scene: StoredScene, textures: Textures) -> dict[str, Callable[[], Texels]]:
    level_indices, first = _select_levels(textures)
    level_starts = np.cumsum([0, *(textures.levels[k, 1] * textures.levels[k, 2] for k in level_indices)])

    def texels() -> Texels:
        blocks = [textures.texels[s : s + h * w] for s, h, w in textures.levels[level_indices]]
        return _to_vec4(np.concatenate(blocks), 0).astype(np.float16)

    num = len(textures.wraps)
    texture_rows = np.column_stack([first[:-1] + num, np.diff(first), textures.wraps])
    level_rows = np.column_stack(
        [level_starts[:-1], textures.levels[level_indices, 1:], np.zeros(len(level_indices), np.int64)]
    )
    return {
        "uvs": lambda: _corner_frames(stored_scene),
        "texels": texels,
        "levels": lambda: np.concatenate([texture_rows, level_rows]).astype(np.uint32),
    }


def overridden_texture_arrays(baked: StoredScene, stored_scene: StoredScene) -> dict[str, Texels]:
    """Return the texture arrays that replace those of a bake for map overrides; texture indices stay.

    Args:
        baked: the scene without overrides. stored_scene: the scene with them.
    """
    factories = _texture_factories(stored_scene, stored_scene.textures)
    has_frames = len(baked.textures.wraps) and stored_scene.tangents is baked.tangents
    return {name: factory() for name, factory in factories.items() if name != "uvs" or not has_frames}


def _corner_frames(stored_scene: StoredScene) -> Texels:
    out = np.zeros((len(stored_scene.uvs), 2, 4), np.float32)
    out[:, 0, :2] = stored_scene.uvs
    num = len(stored_scene.tangents)  # tri-planar corners have no tangents
    out[:num, 0, 2], out[:num, 1, :3] = stored_scene.tangents[:, 3], stored_scene.tangents[:, :3]
    return out.reshape(-1, 4)


def _select_levels(textures: Textures) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Select the levels of all textures that fit, and the first of each; the finest level of the largest is omitted
    first.
    """
    ranges = [list(range(a, b)) for a, b in zip(textures.first[:-1], textures.first[1:], strict=True)]
    area = textures.levels[:, 1] * textures.levels[:, 2]
    while sum(int(area[k].sum()) for k in ranges) > MAX_TEXELS:
        widest = max(ranges, key=lambda levels: int(area[levels[0]]) if len(levels) > 1 else 0)
        if len(widest) == 1:
            break
        widest.pop(0)
    return np.concatenate(ranges).astype(np.int64), np.cumsum([0, *map(len, ranges)])


def _bits(visible: NDArray[np.uint8]) -> Texels:
    """Pack visibility bits of probes, low bits first, into whole texels."""
    num = -(-visible.shape[1] // 16)
    out = np.zeros((len(visible), 16 * num), np.uint8)
    out[:, : visible.shape[1]] = visible
    return out.view("<u4").reshape(-1, 4)


def _to_vec4(vectors: NDArray[Any], fourth: Any) -> Texels:
    """Append a fourth component to each row."""
    out = np.empty((len(vectors), 4), np.float32)
    out[:, :3] = vectors
    out[:, 3] = fourth
    return out
