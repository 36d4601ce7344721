"""What an eye sees, layer by layer: its rays meet surfaces, go on behind glass, and are sent back by mirrors.

A pixel has samples in layers: what its rays meet first, what they meet behind glass, what they meet after a mirror.
What glass lets through is baked; what a mirror sends back its look decides (`relume.brdf.mirror`), so a bake keeps by
which mirrors a ray came.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.eye.glass import MAX_GLASS, MOST_SHOWN, has_glass, panes_of, through_glass
from relume.eye.mirrors import MOST_MIRRORS, are_mirrors, sent_back
from relume.eye.ways import Chain, Ways
from relume.scene.model import Material
from relume.trace.geometry import Geometry
from relume.trace.primary import Hits, trace_from

F32 = NDArray[np.float32]


_ARRAYS = ("ray", "directions", "through", "is_shown", "eyes", "is_mirrored", "key")  # of a `Layer`, a row for each ray


class Layer(NamedTuple):
    """What some of an eye's rays meet after as many surfaces.

    Attributes:
        ray: which of the rays they are, ascending. (m,) int64
        hits: what they meet; distances are along the whole way.
        directions: of the rays there, unit. (m, 3) float32
        through: share of what is sent there that comes to the eye, but for what mirrors take of it. (m, 3) float32
        is_shown: whether there is something to be seen, and not just a way on. (m,)
        eyes: where the rays come from: the eye itself, or the last surface that turned them. (m, 3) float32
        chain: the mirrors that sent them here; None where none did.
        is_mirrored: whether the surface is a mirror, and another layer has what is seen in it. (m,)
        key: number of the mesh there, −1 where nothing is met; larger ones after mirrors, others after others.
            (m,) int64
    """

    ray: NDArray[np.int64]
    hits: Hits
    directions: F32
    through: F32
    is_shown: NDArray[np.bool_]
    eyes: F32
    chain: Chain | None
    is_mirrored: NDArray[np.bool_]
    key: NDArray[np.int64]

    def rows(self, chosen: NDArray[np.integer] | NDArray[np.bool_]) -> Layer:
        """Those of some rays."""
        chain = None if self.chain is None else self.chain.rows(chosen)
        kept = self._replace(hits=self.hits.rows(chosen), chain=chain)
        return kept._replace(**{name: getattr(self, name)[chosen] for name in _ARRAYS})

    @staticmethod
    def joined(parts: Sequence[Layer], most_mirrors: int) -> Layer:
        """Those of several, one after another. most_mirrors: that any ray has met."""
        chains = [Chain.filled(part.chain, len(part.ray), most_mirrors) for part in parts]
        return Layer(
            hits=Hits.joined([part.hits for part in parts]),
            chain=Chain(*map(np.concatenate, zip(*chains, strict=True))),
            **{name: np.concatenate([getattr(part, name) for part in parts]) for name in _ARRAYS},
        )

    @property
    def shown(self) -> Layer:
        """Where there is something to be seen."""
        return self.rows(self.is_shown)


def has_layers(materials: Sequence[Material]) -> bool:
    """Tell whether rays go on from any material."""
    return has_glass(materials) or bool(are_mirrors(materials).any())


def most_layers(materials: Sequence[Material]) -> int:
    """The most layers that there are: what mirrors show is behind glass as well."""
    glass, mirrors = has_glass(materials), bool(are_mirrors(materials).any())
    return 2 * MAX_GLASS if glass and mirrors else MAX_GLASS if glass else 1 + MOST_MIRRORS if mirrors else 1


def most_shown(materials: Sequence[Material]) -> int:
    """The most layers of a ray in which there is something to be seen."""
    has_both = has_glass(materials) and bool(are_mirrors(materials).any())
    return 1 + MOST_SHOWN if has_glass(materials) and not has_both else most_layers(materials)


def layers_of(
    geometry: Geometry,
    materials: Sequence[Material],
    eye: F32,
    directions: F32,
    chance: F32 | np.float32,
    pixel_angle: float = 0.0,
    *,
    follows_mirrors: bool = True,
) -> list[Layer]:
    """Follow an eye's rays through glass, and off mirrors.

    Args:
        geometry: the triangles. materials: of the scene. eye: (3,) float32
        directions: unit. (n, 3) float32. chance: of `trace_from`.
        pixel_angle: that a ray stands for, radians: what textures on mirrors are filtered by.
        follows_mirrors: whether there are layers of what is seen in mirrors.
    Returns:
        All rays first; then, layer by layer, those that went on.
    """
    num, panes, mirrors = len(directions), panes_of(materials), are_mirrors(materials)
    mirrors &= follows_mirrors
    num_keys, most = int(geometry.face_mesh.max(initial=0)) + 2, most_layers(materials)
    chances, layers = np.broadcast_to(chance, num), list[Layer]()
    ways = deque([Ways.begun(eye, directions)])

    def has_room() -> bool:
        return len(layers) + 1 + len(ways) < most  # the one that is being followed is in neither

    while ways:
        way = ways.popleft()
        hits = trace_from(geometry.embree, way.origins, way.directions, chances[way.ray])
        is_hit = hits.face >= 0
        face = np.maximum(hits.face, 0)
        material = geometry.face_material[face]
        is_shown, is_mirrored = np.ones(len(way.ray), np.bool_), np.zeros(len(way.ray), np.bool_)
        glass = np.flatnonzero(is_hit & panes.is_glass[material])
        if len(glass):
            is_outer, behind = through_glass(geometry, panes, way, hits, glass)
            is_shown[glass] = is_outer & (way.num_passed < MOST_SHOWN)
            if way.num_passed + 1 < MAX_GLASS and has_room():
                ways.append(behind)
        facing = np.flatnonzero(is_hit & mirrors[material] & is_shown)
        if len(facing) and way.num_mirrors < MOST_MIRRORS and has_room():
            ways.append(sent_back(geometry, materials, way, hits, facing, pixel_angle, num_keys))
            is_mirrored[facing] = True
        whole = replace(hits, distance=hits.distance + way.length)
        key = np.where(is_hit, geometry.face_mesh[face], -1) + way.via * num_keys
        eyes = np.broadcast_to(way.origins, (len(way.ray), 3))
        layers.append(Layer(way.ray, whole, way.directions, way.through, is_shown, eyes, way.chain, is_mirrored, key))
    return layers
