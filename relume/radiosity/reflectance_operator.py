"""What gather cells make of light that arrives at them, under one look: L_j = Σ_k F_jk t_k (`relume.brdf.albedo`)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.brdf.albedo import PAIRS, Reflectances, unpack_reflectance
from relume.math.zernike import OUTGOING_DEGREE, recurrence

F32 = NDArray[np.float32]


_DIAGONAL_PAIRS = {2 * rung: PAIRS.index((rung, rung)) for rung in range(1 + OUTGOING_DEGREE // 2)}  # those of order 0


class IncidentLight(NamedTuple):
    """What has come to cells.

    Attributes:
        irradiance: E of all. (C, 3) float32
        coefficients: t of those that send more one way than another, `ReflectanceOperator.rows`. (G, 3, J) float32
    """

    irradiance: F32
    coefficients: F32


@dataclass(frozen=True)
class ReflectanceOperator:
    """F of all cells, textures included.

    Attributes:
        reflectance: F_00, never above one. (C, 3) float32
        has_lobe: tells which materials send more one way than another; as bytes, a part of keys.
        rows: cells of these. (G,) intp
        reflectance_matrix: all of F of those. (pairs, G, 3) float32
        energy_scale: what all that cells send is multiplied by, so that none sends more than it gets. (C, 3) float32
    """

    reflectance: F32
    has_lobe: bytes
    rows: NDArray[np.intp]
    reflectance_matrix: F32
    energy_scale: F32

    @cached_property
    def roughening(self) -> F32:
        """How fast the highlights of `rows` let light fall with the degree n, as e^(−n (n + 2) f). f: (G,) float32"""
        low, high = (np.abs(self.reflectance_matrix[_DIAGONAL_PAIRS[n]]).mean(axis=1) for n in (2, OUTGOING_DEGREE))
        decay = np.log(np.maximum(low, 1e-30) / np.maximum(high, 1e-30)) / (
            OUTGOING_DEGREE * (OUTGOING_DEGREE + 2) - 2 * 4
        )
        return np.asarray(np.clip(decay, 0, 1), np.float32)

    @classmethod
    def from_materials(
        cls, reflectances: Reflectances, material: NDArray[np.uint16], textures: F32
    ) -> ReflectanceOperator:
        """F of cells.

        Args:
            reflectances: of all materials. material: of each cell. (C,) uint16
            textures: multipliers of each of `relume.brdf.texture_slots.TEXTURES`. (2, C, 3) float32
        """
        matrices = np.stack([unpack_reflectance(material_reflectance) for material_reflectance in reflectances])
        multipliers = np.concatenate([np.ones_like(textures[:1]), textures])
        total_reflectance = np.einsum("tnc,ntc->nc", multipliers, matrices[material, :, :, 0])
        has_lobe = np.abs(matrices[:, :, :, 1:]).max(axis=(1, 2, 3)) > 0
        rows = np.flatnonzero(has_lobe[material])
        reflectance_matrix = np.einsum("tnc,ntcp->pnc", multipliers[:, rows], matrices[material[rows]])
        energy_scale = (np.clip(total_reflectance, 0, 1) / np.maximum(total_reflectance, 1e-30)).astype(np.float32)
        reflectance_matrix *= energy_scale[rows]
        reflectance = np.clip(total_reflectance, 0, 1).astype(np.float32)
        return cls(reflectance, has_lobe.tobytes(), rows, reflectance_matrix.astype(np.float32), energy_scale)

    def apply(self, incident: IncidentLight) -> tuple[F32, F32]:
        """What cells send of what arrives.

        Returns:
            The part that is the same everywhere, (C, 3), and L_j of `rows` beside it, (G, 3, J); float32
        """
        # a function's numbers lie together
        coefficients = np.ascontiguousarray(incident.coefficients.transpose(2, 0, 1))
        recurrence_table, outgoing = recurrence(OUTGOING_DEGREE), np.zeros_like(coefficients)
        for pair, (j, k) in enumerate(PAIRS[1:], 1):
            for index in (recurrence_table.cosine, recurrence_table.sine)[: 2 if recurrence_table.order[j] else 1]:
                outgoing[index[j]] += self.reflectance_matrix[pair] * coefficients[index[k]]
                if j != k:
                    outgoing[index[k]] += self.reflectance_matrix[pair] * coefficients[index[j]]
        isotropic = (self.reflectance / np.float32(np.pi) * incident.irradiance).astype(np.float32)
        return isotropic, np.ascontiguousarray(outgoing.transpose(1, 2, 0))
