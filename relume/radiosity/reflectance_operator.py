"""Reflectance operator of patches under one look: L_j = Σ_k F_jk t_k (`relume.brdf.albedo`)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.albedo import PAIRS, Reflectances
from relume.math.zernike import OUTGOING_DEGREE, recurrence

F32 = NDArray[np.float32]


# functions of order 0
_DIAGONAL_PAIRS = {2 * k: PAIRS.index((k, k)) for k in range(1 + OUTGOING_DEGREE // 2)}


class IncidentLight(NamedTuple):
    """Incident light of patches.

    Attributes:
        irradiance: E of all patches.
        coefficients: t of patches with directional light, `ReflectanceOperator.rows`.
    """

    irradiance: Shaped[F32, "patches 3"]
    coefficients: Shaped[F32, "G 3 J"]


@dataclass(frozen=True)
class ReflectanceOperator:
    """F of all patches, textures included.

    Attributes:
        reflectance: F_00, at most 1.
        has_lobe: one byte per material, nonzero if it reflects directionally; part of cache keys.
        rows: patches of these materials.
        reflectance_matrix: all of F for `rows`.
        energy_scale: factor on all outgoing light of a patch, so that it never reflects more than it receives.
    """

    reflectance: Shaped[F32, "patches 3"]
    has_lobe: bytes
    rows: Shaped[NDArray[np.intp], " G"]
    reflectance_matrix: Shaped[F32, "pairs G 3"]
    energy_scale: Shaped[F32, "patches 3"]

    @cached_property
    def roughening(self) -> Shaped[F32, " G"]:
        """Decay f by the highlights of `rows`: light of degree n is multiplied by e^(−n (n + 2) f)."""
        low, high = (np.abs(self.reflectance_matrix[_DIAGONAL_PAIRS[n]]).mean(axis=1) for n in (2, OUTGOING_DEGREE))
        decay = np.log(np.maximum(low, 1e-30) / np.maximum(high, 1e-30)) / (
            OUTGOING_DEGREE * (OUTGOING_DEGREE + 2) - 2 * 4
        )
        return np.asarray(np.clip(decay, 0, 1), np.float32)

    @classmethod
    def from_materials(
        cls,
        reflectances: Reflectances,
        material: Shaped[NDArray[np.uint16], " patches"],
        textures: Shaped[F32, "2 patches 3"],
    ) -> ReflectanceOperator:
        """Compute F of patches.

        Args:
            reflectances: reflectances of all materials. material: material index of each patch.
            textures: multipliers of each of `relume.brdf.texture_slots.TEXTURES`.
        """
        matrices = np.stack([material_reflectance.matrix for material_reflectance in reflectances])
        multipliers = np.concatenate([np.ones_like(textures[:1]), textures])
        total_reflectance = np.einsum("tnc,ntc->nc", multipliers, matrices[material, :, :, 0])
        has_lobe = np.abs(matrices[:, :, :, 1:]).max(axis=(1, 2, 3)) > 0
        rows = np.flatnonzero(has_lobe[material])
        reflectance_matrix = np.einsum("tnc,ntcp->pnc", multipliers[:, rows], matrices[material[rows]])
        energy_scale = (np.clip(total_reflectance, 0, 1) / np.maximum(total_reflectance, 1e-30)).astype(np.float32)
        reflectance_matrix *= energy_scale[rows]
        reflectance = np.clip(total_reflectance, 0, 1).astype(np.float32)
        return cls(reflectance, has_lobe.tobytes(), rows, reflectance_matrix.astype(np.float32), energy_scale)

    def apply(self, incident: IncidentLight) -> tuple[Shaped[F32, "patches 3"], Shaped[F32, "G 3 J"]]:
        """Return the reflected light: the isotropic part, and L_j of `rows`."""
        # contiguous per function
        coefficients = np.ascontiguousarray(incident.coefficients.transpose(2, 0, 1))
        recurrence_table, outgoing = recurrence(OUTGOING_DEGREE), np.zeros_like(coefficients)
        for pair, (j, k) in enumerate(PAIRS[1:], 1):
            for index in (recurrence_table.cosine, recurrence_table.sine)[: 2 if recurrence_table.order[j] else 1]:
                outgoing[index[j]] += self.reflectance_matrix[pair] * coefficients[index[k]]
                if j != k:
                    outgoing[index[k]] += self.reflectance_matrix[pair] * coefficients[index[j]]
        isotropic = (self.reflectance / np.float32(np.pi) * incident.irradiance).astype(np.float32)
        return isotropic, np.ascontiguousarray(outgoing.transpose(1, 2, 0))
