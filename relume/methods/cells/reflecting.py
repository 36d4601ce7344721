"""What gather cells make of light that arrives at them, under one look: L_j = Σ_k F_jk t_k (`relume.brdf.albedo`)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.basis.zernike import SENT_DEGREE, ladder
from relume.brdf.albedo import PAIRS, Reflectances, shares_in

F32 = NDArray[np.float32]


_OF_DEGREE = {2 * rung: PAIRS.index((rung, rung)) for rung in range(1 + SENT_DEGREE // 2)}  # those of order 0


class Arrived(NamedTuple):
    """What has come to cells.

    Attributes:
        irradiance: E of all. (C, 3) float32
        vectors: t of those that send more one way than another, `Reflecting.rows`. (G, 3, J) float32
    """

    irradiance: F32
    vectors: F32


@dataclass(frozen=True)
class Reflecting:
    """F of all cells, textures included.

    Attributes:
        reflectance: F_00, never above one. (C, 3) float32
        has_lobe: tells which materials send more one way than another; as bytes, a part of keys.
        rows: cells of these. (G,) intp
        shares: all of F of those. (pairs, G, 3) float32
        held: what all that cells send is multiplied by, so that none sends more than it gets. (C, 3) float32
    """

    reflectance: F32
    has_lobe: bytes
    rows: NDArray[np.intp]
    shares: F32
    held: F32

    @cached_property
    def widening(self) -> F32:
        """How fast the highlights of `rows` let light fall with the degree n, as e^(−n (n + 2) f). f: (G,) float32"""
        low, high = (np.abs(self.shares[_OF_DEGREE[n]]).mean(axis=1) for n in (2, SENT_DEGREE))
        falls = np.log(np.maximum(low, 1e-30) / np.maximum(high, 1e-30)) / (SENT_DEGREE * (SENT_DEGREE + 2) - 2 * 4)
        return np.asarray(np.clip(falls, 0, 1), np.float32)

    @classmethod
    def of(cls, reflectances: Reflectances, material: NDArray[np.uint16], textures: F32) -> Reflecting:
        """F of cells.

        Args:
            reflectances: of all materials. material: of each cell. (C,) uint16
            textures: multipliers of each of `relume.brdf.channels.TEXTURES`. (2, C, 3) float32
        """
        known = np.stack([shares_in(of_material) for of_material in reflectances])
        plain = np.concatenate([np.ones_like(textures[:1]), textures])
        whole = np.einsum("tnc,ntc->nc", plain, known[material, :, :, 0])
        has_lobe = np.abs(known[:, :, :, 1:]).max(axis=(1, 2, 3)) > 0
        rows = np.flatnonzero(has_lobe[material])
        shares = np.einsum("tnc,ntcp->pnc", plain[:, rows], known[material[rows]])
        held = (np.clip(whole, 0, 1) / np.maximum(whole, 1e-30)).astype(np.float32)
        shares *= held[rows]
        reflectance = np.clip(whole, 0, 1).astype(np.float32)
        return cls(reflectance, has_lobe.tobytes(), rows, shares.astype(np.float32), held)

    def sent(self, arrived: Arrived) -> tuple[F32, F32]:
        """What cells send of what arrives.

        Returns:
            The part that is the same everywhere, (C, 3), and L_j of `rows` beside it, (G, 3, J); float32
        """
        vectors = np.ascontiguousarray(arrived.vectors.transpose(2, 0, 1))  # a function's numbers lie together
        rungs, found = ladder(SENT_DEGREE), np.zeros_like(vectors)
        for pair, (j, k) in enumerate(PAIRS[1:], 1):
            for part in (rungs.cosine, rungs.sine)[: 2 if rungs.order[j] else 1]:
                found[part[j]] += self.shares[pair] * vectors[part[k]]
                if j != k:
                    found[part[k]] += self.shares[pair] * vectors[part[j]]
        even = (self.reflectance / np.float32(np.pi) * arrived.irradiance).astype(np.float32)
        return even, np.ascontiguousarray(found.transpose(1, 2, 0))
