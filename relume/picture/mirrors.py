"""What mirrors send on of a picture: how samples that are seen in them count for their pixels, as the look has it; and
rectangles that shine, which nothing but a mirror shows.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.brdf.mirror import mirrored
from relume.eye.ways import NO_MIRROR
from relume.light.local import rectangle
from relume.picture.light import Light, Source
from relume.views.mirrored import Mirrored
from relume.views.view import View

F32 = NDArray[np.float32]
Documents = Sequence[Mapping[str, Any]]


def rectangles_of(light: Light) -> tuple[Source, ...]:
    """The rectangles that are lit in a light."""
    return tuple(one for one in light.local if one.geometry.kind == "rectangle" and light.paths.direct)


class Mirrors:
    """Of one picture.

    Attributes:
        gains: what the radiance of each sample is multiplied by for its pixel, in the view's order; see `View.gains`.
        materials: those that anything is seen in.
    """

    def __init__(self, view: View) -> None:
        self._seen, self._shown = view.mirrored, dict[int, Documents | None]()
        self.gains = view.gains if view.mirrored is None else view.gains.copy()
        chain = None if view.mirrored is None else view.mirrored.chain
        self._lamps: tuple[tuple[Source, ...], F32 | None] = (), None
        self._sends = None if chain is None else np.ones((*chain.material.shape, 3), np.float32)
        self.materials: list[int] = [] if chain is None else np.setdiff1d(chain.material, [NO_MIRROR]).tolist()

    def lamps(self, light: Light) -> F32 | None:
        """Radiance of the rectangles between mirrors and what is seen in them; the same array while they stay as they
        are. (3, m) float32, None where there are none."""
        sources = rectangles_of(light)
        if self._seen is not None and sources != self._lamps[0]:
            self._lamps = sources, _seen_in(self._seen, sources) if sources else None
        return self._lamps[1]

    def follow(self, documents: Mapping[int, Documents | None]) -> list[int]:
        """Bring mirrors to a look.

        Args:
            documents: terms of the materials that anything is seen in; None where none of them is shown.
        Returns:
            Those of the materials that send on something else than before.
        """
        changed = [index for index in documents if index not in self._shown or documents[index] != self._shown[index]]
        if self._seen is None or self._sends is None or not changed:
            return []
        chain = self._seen.chain
        for index in changed:
            terms = self._shown[index] = documents[index]
            at = chain.material == index
            self._sends[at] = 0 if terms is None else mirrored(terms, chain.cos_theta_i[at], chain.tint[at])
        self.gains[self._seen.place] = self._seen.gain * self._sends.prod(axis=1)
        return changed


def _seen_in(seen: Mirrored, sources: Sequence[Source]) -> F32:
    """Radiance of rectangles on the ways from mirrors to what is seen in them. (3, m)"""
    radiance = np.zeros((3, len(seen.sample)), np.float32)
    for geometry, gain in sources:
        corner, edges = rectangle(geometry)
        facing = np.cross(*edges)
        against = -(seen.direction @ facing)
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = -((corner - seen.eye) @ facing) / against
            place = seen.eye + distance[:, None] * seen.direction - corner
            u, v = (place @ edge / (edge @ edge) for edge in edges)
        is_met = (against > 0) & (distance > 0) & (distance < seen.distance) & (u >= 0) & (u <= 1) & (v >= 0) & (v <= 1)
        radiance[:, is_met] += np.array(gain, np.float32)[:, None]
    return radiance
