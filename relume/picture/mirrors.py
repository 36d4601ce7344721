"""What mirrors send on of a picture: how samples that are seen in them count for their pixels, as the look has it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.brdf.mirror import mirrored
from relume.eye.ways import NO_MIRROR
from relume.views.view import View

F32 = NDArray[np.float32]
Documents = Sequence[Mapping[str, Any]]


class Mirrors:
    """Of one picture.

    Attributes:
        gains: what the radiance of each sample is multiplied by for its pixel, in the view's order; see `View.gains`.
    """

    def __init__(self, view: View) -> None:
        self._seen, self._shown = view.mirrored, dict[int, Documents | None]()
        self.gains = view.gains if view.mirrored is None else view.gains.copy()
        chain = None if view.mirrored is None else view.mirrored.chain
        self._sends = None if chain is None else np.ones((*chain.material.shape, 3), np.float32)

    @property
    def materials(self) -> list[int]:
        """Those that anything is seen in."""
        return [] if self._seen is None else np.setdiff1d(self._seen.chain.material, [NO_MIRROR]).tolist()

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
