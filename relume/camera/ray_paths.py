"""Ways that an eye's rays go, before it is known what they meet."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

F32 = NDArray[np.float32]

NO_MIRROR = 65_535


class SpecularChain(NamedTuple):
    """The mirrors that sent rays on, the first one first; as many for each of them.

    Attributes:
        material: of each mirror, index into the scene's. (m, mirrors) uint16
        cos_theta_i: at which it was met. (m, mirrors) float32
        tint: its texture of highlights there. (m, mirrors, 3) float32
    """

    material: NDArray[np.uint16]
    cos_theta_i: F32
    tint: F32

    def rows(self, rows: NDArray[np.integer] | NDArray[np.bool_]) -> SpecularChain:
        """Those of some rays."""
        return SpecularChain(self.material[rows], self.cos_theta_i[rows], self.tint[rows])

    def append(self, continuation: SpecularChain) -> SpecularChain:
        """This, and the mirrors of another after it, ray by ray."""
        return SpecularChain(
            np.concatenate([self.material, continuation.material], axis=1),
            np.concatenate([self.cos_theta_i, continuation.cos_theta_i], axis=1),
            np.concatenate([self.tint, continuation.tint], axis=1),
        )

    @property
    def num_mirrors(self) -> int:
        """How many each ray has met."""
        return int(self.material.shape[1])

    @classmethod
    def padded(cls, chain: SpecularChain | None, num_rays: int, max_mirrors: int) -> SpecularChain:
        """One with room for `max_mirrors` mirrors a ray, `NO_MIRROR` where it has met fewer.

        Args:
            chain: the mirrors of `num_rays` rays; None where they have met none. max_mirrors: at least as many as there
                are.
        """
        num_missing = max_mirrors - (0 if chain is None else chain.num_mirrors)
        ones = np.ones((num_rays, num_missing), np.float32)
        padding = cls(
            np.full((num_rays, num_missing), NO_MIRROR, np.uint16),
            ones,
            np.ones((num_rays, num_missing, 3), np.float32),
        )
        return padding if chain is None else chain.append(padding)


class RayPaths(NamedTuple):
    """Rays, and what became of them so far.

    Attributes:
        ray: which of the eye's they are, ascending. (m,) int64
        origins: where they begin, one for all or one each. (1 or m, 3) float32. directions: unit. (m, 3) float32
        transmittance: share of what they meet that comes to the eye. (m, 3) float32
        length: of the way to where they begin. (m,) float32
        num_glass: surfaces of glass since the eye.
        chain: mirrors on the way; None where there were none. path_key: tells ways over other mirrors apart. (m,) int64
    """

    ray: NDArray[np.int64]
    origins: F32
    directions: F32
    transmittance: F32
    length: F32
    num_glass: int
    chain: SpecularChain | None
    path_key: NDArray[np.int64]

    @property
    def num_mirrors(self) -> int:
        """How many each ray has met."""
        return 0 if self.chain is None else self.chain.num_mirrors

    @classmethod
    def from_camera(cls, camera_position: F32, directions: F32) -> RayPaths:
        """Those of an eye's rays. eye: (3,) float32. directions: unit. (n, 3) float32"""
        num = len(directions)
        ones, zeros = np.ones((num, 3), np.float32), np.zeros(num, np.float32)
        return cls(
            np.arange(num),
            np.reshape(camera_position, (1, 3)),
            directions,
            ones,
            zeros,
            0,
            None,
            np.zeros(num, np.int64),
        )
