"""What surfaces send of beams, as far as rays see them: unhidden light is interpolated between points, shadows are not.

    B(pixel) = Σ_points w (B − S) + V(pixel) Σ_points w U

S is what a point knows of the beam, with the shadows that points know; U what it would get if nothing were in the
way. Light vectors that are shown beside beams lack S; V is the share that `relume.moving.beams.shadows` finds.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from relume.moving.basis.lobes import lobes_of
from relume.moving.basis.tables import Tables
from relume.moving.beams.beam import Beam
from relume.moving.evaluate import send
from relume.moving.highlights.looking import SkyLight
from relume.moving.look_up import Seen, at_vertices
from relume.moving.pixels import FromVertices, Mirrored, combine
from relume.moving.points.surface import Surface
from relume.scene.model import Camera

F32 = NDArray[np.float32]


class Materials(Protocol):
    """What is asked of `relume.moving.frame.Materials`."""

    @property
    def tables(self) -> Tables: ...
    @property
    def sends(self) -> NDArray[np.bool_]: ...


def add_beams(
    beams: Sequence[Beam],
    shares: Sequence[F32],
    surface: Surface,
    seen: Seen,
    camera: Camera,
    pixel_angle: float,
    materials: Materials,
    no_sky: SkyLight,
    rays: NDArray[np.int32] | None,
    out: F32,
) -> None:
    """Add what surfaces send of beams, by the terms that the in-basis tells.

    Args:
        beams: of the light. shares: that rays see of each. (rays,) float32 each
        surface: that is seen. seen: by the rays. camera: the eye. pixel_angle: that a pixel spans, radians.
        materials: of the surface. no_sky: any; nothing of it is shown.
        rays: that are asked; None: all. (n,) int32
        out: added to there. (rays, 3) float32
    """
    num_materials, eye = len(materials.sends), camera.to_world[:3, 3].astype(np.float32)
    dark = np.zeros((num_materials, 3), np.float32)
    glances, turns = np.zeros((0, 3), np.float32), np.zeros((0, 4), np.float32)
    nothing = Mirrored(lobes_of([[]] * num_materials), no_sky, glances, turns, is_fine=False)
    for beam, share in zip(beams, shares, strict=True):
        rows = np.flatnonzero(share > 0).astype(np.int32) if rays is None else rays[share[rays] > 0]
        by_points = send(surface, beam.vectors, None, materials.tables, eye, seen.is_needed).radiance
        sent = FromVertices(at_vertices(surface, seen.is_seen, by_points), materials.sends, _towards(surface, beam))
        of_beam = combine(surface, seen, pixel_angle, sent, dark, nothing, rows)
        out[rows] += of_beam[rows] * (share[rows, None] * beam.gain)


def _towards(surface: Surface, beam: Beam) -> F32:
    """Where a beam comes from, for normal maps: seen from each vertex. (vertices or 0, 3) float32"""
    if not len(surface.tangents):
        return np.empty((0, 3), np.float32)
    if beam.targets.is_far:
        return np.tile(beam.middle, (len(surface.vertices.normal), 1))
    away = beam.middle - surface.points.position
    away /= np.maximum(np.linalg.norm(away, axis=1, keepdims=True), np.float32(1e-20))
    return np.asarray(away[surface.vertices.point[:, 0]], np.float32)
