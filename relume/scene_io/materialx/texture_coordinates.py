"""Transforms of texture coordinates in node graphs: u′ = s u + c, with v from the bottom."""

from __future__ import annotations

from typing import NamedTuple

from relume.scene_io.gltf.uvs import UvTransform

Pair = tuple[float, float]
ZERO: Pair = (0.0, 0.0)
ONE: Pair = (1.0, 1.0)


class Placement(NamedTuple):
    """Scale and offset of texture coordinates."""

    scale: Pair = ONE
    offset: Pair = ZERO

    def then(self, scale: Pair, offset: Pair) -> Placement:
        """Apply another transform afterwards."""
        return Placement(
            (scale[0] * self.scale[0], scale[1] * self.scale[1]),
            (scale[0] * self.offset[0] + offset[0], scale[1] * self.offset[1] + offset[1]),
        )

    def place2d(self, pivot: Pair, scale: Pair, offset: Pair, *, offset_first: bool) -> Placement:
        """Apply the node `place2d` without rotation: (u − p) / s − o + p, or (u − p − o) / s + p.

        Args:
            pivot, scale, offset: p, s and o. offset_first: the second of these.
        """
        inverse = 1 / scale[0] if scale[0] else 1.0, 1 / scale[1] if scale[1] else 1.0
        moves = [inverse[k] * offset[k] if offset_first else offset[k] for k in (0, 1)]
        u, v = (pivot[k] * (1 - inverse[k]) - moves[k] for k in (0, 1))
        return self.then(inverse, (u, v))

    def uv_transform(self) -> UvTransform:
        """The transform with v from the top, v′ = s v + (1 − s − c)."""
        return UvTransform(scale=self.scale, offset=(self.offset[0], 1 - self.scale[1] - self.offset[1]))
