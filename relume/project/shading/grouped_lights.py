"""Lights that points see in whole groups, and that are as good as one light to them.

What a group brings is evaluated as one light's; where its curves vary so much within it that this may be wrong, its
lights are left to be shaded one by one. What of a group a dormant curve does not see brings nothing.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relume.bits import into_rows, into_words
from relume.brdf.term import Term
from relume.light.triangles import Groups
from relume.project.contraction import Contraction
from relume.project.listed_lights import ListedLights
from relume.project.receivers import Receivers
from relume.project.shading.group_kernel import add_groups, take_whole

F32 = NDArray[np.float32]
Bits = NDArray[np.uint8]


class GroupedLights:
    """Shades groups of lights at blocks of receivers; holds the scratch memory of one thread.

    Args:
        term, contraction, receivers: as `relume.project.shading.shader.Shader` takes them.
        groups: of the lights that receivers see. num_lights: of these.
    """

    def __init__(
        self, term: Term, contraction: Contraction, groups: Groups, num_lights: int, receivers: Receivers
    ) -> None:
        self._receivers, self._contraction, self._groups = receivers, contraction, groups
        self._listed = ListedLights(term, contraction, groups.lights, receivers)
        self._words, self._whole = np.empty(num_lights, np.uint64), np.empty(groups.lights.num_lights, np.uint64)

    def add(self, start: int, stop: int, out: F32) -> Bits:
        """Add what groups bring to points [start, stop), at most a block.

        Args:
            out: (points, 3, 1) float32, added to.
        Returns:
            The lights that are left, as in `Receivers`. (stop - start, bytes) uint8
        """
        r, c, groups, listed = self._receivers, self._contraction, self._groups, self._listed
        left = np.empty_like(r.visible[start:stop])
        whole = np.empty((stop - start, (len(self._whole) + 7) // 8), np.uint8)
        into_words(r.visible[start:stop], self._words)
        take_whole(self._words, groups.first, groups.part, self._whole)
        into_rows(self._words, left)
        into_rows(self._whole, whole)
        shading, wo = listed.list(start, stop, whole)
        lights = groups.lights.by_light, listed.brings, groups.between
        add_groups(
            r.normal, r.tangent, (listed.first, listed.light, shading), wo, lights, (groups.first, groups.part),
            c.axes, c.whole, start, stop, left, out,
        )  # fmt: skip
        return left
