"""Ways that an eye's rays go, before it is known what they meet."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

F32 = NDArray[np.float32]

NO_MIRROR = 65_535


class Chain(NamedTuple):
    """The mirrors that sent rays on, the first one first; as many for each of them.

    Attributes:
        material: of each mirror, index into the scene's. (m, mirrors) uint16
        cos_theta_i: at which it was met. (m, mirrors) float32
        tint: its texture of highlights there. (m, mirrors, 3) float32
    """

    material: NDArray[np.uint16]
    cos_theta_i: F32
    tint: F32

    def rows(self, chosen: NDArray[np.integer] | NDArray[np.bool_]) -> Chain:
        """Those of some rays."""
        return Chain(self.material[chosen], self.cos_theta_i[chosen], self.tint[chosen])

    def then(self, after: Chain) -> Chain:
        """This, and the mirrors of another after it, ray by ray."""
        return Chain(
            np.concatenate([self.material, after.material], axis=1),
            np.concatenate([self.cos_theta_i, after.cos_theta_i], axis=1),
            np.concatenate([self.tint, after.tint], axis=1),
        )

    @property
    def num_mirrors(self) -> int:
        """How many each ray has met."""
        return int(self.material.shape[1])

    @classmethod
    def filled(cls, chain: Chain | None, num_rays: int, most: int) -> Chain:
        """One with room for `most` mirrors a ray, `NO_MIRROR` where it has met fewer.

        Args:
            chain: the mirrors of `num_rays` rays; None where they have met none. most: at least as many as there are.
        """
        num = most - (0 if chain is None else chain.num_mirrors)
        ones = np.ones((num_rays, num), np.float32)
        none = cls(np.full((num_rays, num), NO_MIRROR, np.uint16), ones, np.ones((num_rays, num, 3), np.float32))
        return none if chain is None else chain.then(none)


class Ways(NamedTuple):
    """Rays, and what became of them so far.

    Attributes:
        ray: which of the eye's they are, ascending. (m,) int64
        origins: where they begin, one for all or one each. (1 or m, 3) float32. directions: unit. (m, 3) float32
        through: share of what they meet that comes to the eye. (m, 3) float32
        length: of the way to where they begin. (m,) float32
        num_passed: surfaces of glass since the eye.
        chain: mirrors on the way; None where there were none. via: tells ways over other mirrors apart. (m,) int64
    """

    ray: NDArray[np.int64]
    origins: F32
    directions: F32
    through: F32
    length: F32
    num_passed: int
    chain: Chain | None
    via: NDArray[np.int64]

    @property
    def num_mirrors(self) -> int:
        """How many each ray has met."""
        return 0 if self.chain is None else self.chain.num_mirrors

    @classmethod
    def begun(cls, eye: F32, directions: F32) -> Ways:
        """Those of an eye's rays. eye: (3,) float32. directions: unit. (n, 3) float32"""
        num = len(directions)
        white, begun = np.ones((num, 3), np.float32), np.zeros(num, np.float32)
        return cls(np.arange(num), np.reshape(eye, (1, 3)), directions, white, begun, 0, None, np.zeros(num, np.int64))
