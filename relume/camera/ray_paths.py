"""Ray paths: camera rays after glass and mirrors, before their next intersection."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

F32 = NDArray[np.float32]

NO_MIRROR = 65_535


class SpecularChain(NamedTuple):
    """Mirrors on the paths of rays in order from the camera, the same number for each ray.

    Attributes:
        material: index of each mirror's material in the scene.
        cos_theta_i: cos θi at the hit.
        tint: specular texture at the hit.
    """

    material: Shaped[NDArray[np.uint16], "n mirrors"]
    cos_theta_i: Shaped[F32, "n mirrors"]
    tint: Shaped[F32, "n mirrors 3"]

    def rows(self, rows: NDArray[np.integer] | NDArray[np.bool_]) -> SpecularChain:
        """Select rays."""
        return SpecularChain(self.material[rows], self.cos_theta_i[rows], self.tint[rows])

    def append(self, continuation: SpecularChain) -> SpecularChain:
        """Concatenate this chain and a continuation, ray by ray."""
        return SpecularChain(
            np.concatenate([self.material, continuation.material], axis=1),
            np.concatenate([self.cos_theta_i, continuation.cos_theta_i], axis=1),
            np.concatenate([self.tint, continuation.tint], axis=1),
        )

    @property
    def num_mirrors(self) -> int:
        """Number of mirrors on each path."""
        return int(self.material.shape[1])

    @classmethod
    def padded(cls, chain: SpecularChain | None, num_rays: int, max_mirrors: int) -> SpecularChain:
        """Pad a chain to `max_mirrors` mirrors with `NO_MIRROR`.

        Args:
            chain: chain of `num_rays` rays; None without mirrors.
            max_mirrors: at least the number of mirrors of the chain.
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
    """State of ray paths.

    Attributes:
        ray: index of the camera ray, ascending.
        origins: one for all or one each. directions: unit.
        transmittance: transmittance between the camera and the ray's origin.
        length: length of the path up to the origin.
        num_glass: number of glass surfaces since the camera.
        chain: mirrors on the path; None without mirrors. path_key: distinguishes paths over different mirrors.
        frost: 1 + index of the material of the first frosted glass on the path; 0 for none.
    """

    ray: Shaped[NDArray[np.int64], " n"]
    origins: Shaped[F32, "#n 3"]
    directions: Shaped[F32, "n 3"]
    transmittance: Shaped[F32, "n 3"]
    length: Shaped[F32, " n"]
    num_glass: int
    chain: SpecularChain | None
    path_key: Shaped[NDArray[np.int64], " n"]
    frost: Shaped[NDArray[np.uint16], " n"]

    def rows(self, rows: Shaped[NDArray[np.bool_], " n"]) -> RayPaths:
        """Select paths, each with an origin of its own."""
        names = "ray", "origins", "directions", "transmittance", "length", "path_key", "frost"
        chain = None if self.chain is None else self.chain.rows(rows)
        return self._replace(chain=chain, **{name: getattr(self, name)[rows] for name in names})

    @property
    def num_mirrors(self) -> int:
        """Number of mirrors on each path."""
        return 0 if self.chain is None else self.chain.num_mirrors

    @classmethod
    def from_camera(cls, camera_position: F32, directions: Shaped[F32, "n 3"]) -> RayPaths:
        """Start the paths of camera rays. camera_position: (3,), or (n, 3) on a lens. directions: unit"""
        num = len(directions)
        ones, zeros = np.ones((num, 3), np.float32), np.zeros(num, np.float32)
        return cls(
            np.arange(num),
            np.reshape(camera_position, (-1, 3)),
            directions,
            ones,
            zeros,
            0,
            None,
            np.zeros(num, np.int64),
            np.zeros(num, np.uint16),
        )
