"""The projector of pictures: no curve is free, so that what arrives is summed without sharing it out to bands.

    R(x) = Σ_m V(x, m) L_m Ω_m cos θi · q(x, ω_m) · Π_f mean_m(f)

The sums of `relume.project.projector`, by a quadrature that need not be right for whatever a curve may become: the
pictures are the same to a thousandth or two (docs/adr/0055-boxes-for-pictures.md).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relume.brdf.term import Term
from relume.light.triangles import TriangleLights
from relume.project.contraction import Contraction
from relume.project.lambertian import EvenShader
from relume.project.listed_lights import POINTS_A_BLOCK, ListedLamp, ListedLights, listed_lamps
from relume.project.ray_projector import RayProjector
from relume.project.receivers import Receivers
from relume.project.shading.grouped_lights import GroupedLights
from relume.project.shading.shade_kernel import shade_points

F32 = NDArray[np.float32]


class Shader:
    """Shades ranges of receivers; holds the scratch memory of one thread.

    Args:
        term: the BRDF term. contraction: its curves, none of them free and each of one setting, from `contract`.
        lights: triangles of the environment; `receivers` tell which of them each point sees.
        receivers: all points, and what arrives at them.
        beside: what the term makes of other light, where that is known: beside much of it little need be found less
            finely. (n, 3) float32
    """

    def __init__(
        self,
        term: Term,
        contraction: Contraction,
        lights: TriangleLights,
        receivers: Receivers,
        beside: F32 | None = None,
    ) -> None:
        self._contraction, self._lights, self._receivers, self._beside = contraction, lights, receivers, beside
        self._listed = ListedLights(term, contraction, lights, receivers)
        is_even = term.is_lambertian and contraction.kinds.size == 0
        self._even = EvenShader(term, contraction.constant, lights) if is_even else None
        is_told = contraction.kinds.size > 0 and not term.is_steep  # by curves, how the term varies within a group
        groups = lights.groups if is_told else None
        self._grouped = groups and GroupedLights(term, contraction, groups, lights.num_lights, receivers)
        self._rays = RayProjector(term, contraction, receivers, POINTS_A_BLOCK)
        self._lamps = listed_lamps(term, contraction, receivers)

    def project(self, start: int, stop: int) -> F32:
        """Shade points [start, stop). (stop - start, 1, 3) float32, as `Projector.project` returns it"""
        beside = np.zeros((stop - start, 3), np.float32) if self._beside is None else self._beside[start:stop]
        out = np.array(beside[..., None], order="C")
        if self._even is not None:
            out[:, :, 0] += self._even.shade(self._receivers, start, stop)
        elif self._lights.num_lights:
            self._add_listed(start, stop, out)
        self._rays.add(start, stop, out)
        for lamp in self._lamps:
            self._add_lamp(lamp, start, stop, out)
        return (out - beside[..., None]).transpose(0, 2, 1)

    def _add_lamp(self, lamp: ListedLamp, start: int, stop: int, out: F32) -> None:
        r, c = self._receivers, self._contraction
        for block in range(start, stop, lamp.points_a_block):
            end = min(block + lamp.points_a_block, stop)
            shading, wo, nodes, brings = lamp.list(block, end)
            shade_points(
                r.normal, r.tangent, lamp.first, lamp.light, shading, wo, nodes, brings,
                c.axes, c.whole, block, end, out[block - start : end - start],
            )  # fmt: skip

    def _add_listed(self, start: int, stop: int, out: F32) -> None:
        """Add the environment, of which lists are made."""
        r, c, listed = self._receivers, self._contraction, self._listed
        for block in range(start, stop, POINTS_A_BLOCK):
            end = min(block + POINTS_A_BLOCK, stop)
            here = out[block - start : end - start]
            visible = self._grouped.add(block, end, here) if self._grouped else r.visible[block:end]
            shading, wo = listed.list(block, end, visible)
            shade_points(
                r.normal, r.tangent, listed.first, listed.light, shading, wo, self._lights.by_light, listed.brings,
                c.axes, c.whole, block, end, here,
            )  # fmt: skip
