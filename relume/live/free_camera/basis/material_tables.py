"""The out-factors of a look: those of terms that the same texture multiplies summed, highlights apart.

Functions cut off at a degree ring: beside what is bright they say less than black. Of what highlights send of other
light than the sky, in Σ_k w_k p_k t_k, w takes that away for a little blur (docs/free-camera.md#highlights).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import compress
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from relume.brdf.texture_slots import texture_slot
from relume.live.free_camera.basis.highlight_lobes import NUM_GROUPS, is_representable, terms_in_lobe
from relume.live.free_camera.basis.outgoing_coefficients import NUM_COLUMNS, NUM_ROWS, outgoing_coefficients
from relume.math.zernike import DEGREES, NUM_FUNCTIONS, WINDOW_DECAY, recurrence

F32 = NDArray[np.float32]

_FULL_WINDOW_RESIDUAL = 0.6  # what functions miss of a highlight, RMS, from which on all of the window is asked for


class Tables(NamedTuple):
    """The out-factors of all materials.

    Attributes:
        isotropic: of isotropic terms summed, for φo = 0, by rungs of the ladder. (tables, `NUM_ROWS`, 3, rungs) float32
        anisotropic: of the others summed. (tables, `NUM_ROWS`, `NUM_COLUMNS`, 3, K) float32
        table_index: table of each material and group in both, −1 for none: of terms without a highlight; of what those
            with one send of the sky, where the in-basis tells it; of what these send of other light. Groups are terms
            without a texture, and those that each of `relume.brdf.texture_slots.TEXTURES` multiplies. (materials,
            groups, 6) int32
    """

    isotropic: F32
    anisotropic: F32
    table_index: NDArray[np.int32]

    @classmethod
    def joined(cls, table_sets: Sequence[Tables]) -> Self:
        """Those of some materials, then of others."""
        isotropic, anisotropic = (np.concatenate([tables[kind] for tables in table_sets]) for kind in (0, 1))
        num = np.array([[len(tables.isotropic), len(tables.anisotropic)] for tables in table_sets], np.int32)
        first = np.repeat(
            np.cumsum(num, axis=0, dtype=np.int32) - num, [len(tables.table_index) for tables in table_sets], axis=0
        )
        table_index = np.concatenate([tables.table_index for tables in table_sets])
        return cls(
            isotropic, anisotropic, np.where(table_index >= 0, table_index + np.tile(first, 3)[:, None], table_index)
        )


def window(residual: float) -> F32:
    """Find w of each function, e^(−n (n + 2) f). (K,) float32

    Args:
        residual: by all functions of a highlight, RMS: little rings where they miss little, and blurs for nothing.
    """
    fall = WINDOW_DECAY * min(residual / _FULL_WINDOW_RESIDUAL, 1.0)
    return np.asarray(np.exp(-fall * DEGREES * (DEGREES + 2)), np.float32)


def build_tables(materials: Sequence[Sequence[Mapping[str, Any]]]) -> Tables:
    """Sum the out-factors of the terms of each material that the same texture multiplies, highlights apart.

    Args:
        materials: the terms of each, of a complete look.
    """
    recurrence_table = recurrence()
    isotropic: list[F32] = []
    anisotropic: list[F32] = []
    table_index = np.full((len(materials), NUM_GROUPS, 6), -1, np.int32)
    for index, terms in enumerate(materials):
        coefficients = [outgoing_coefficients(term) for term in terms]
        is_in_lobe = terms_in_lobe(coefficients)
        represents_environment = is_representable([*compress(terms, is_in_lobe)])
        grouped_terms = [*zip(map(texture_slot, terms), coefficients, is_in_lobe, strict=True)]
        for group in range(NUM_GROUPS):
            group_terms = [
                (term_coefficients, is_lobe)
                for term_group, term_coefficients, is_lobe in grouped_terms
                if term_group == group
            ]
            plain_tables = [term_coefficients.table for term_coefficients, is_lobe in group_terms if not is_lobe]
            environment_tables = [
                term_coefficients.table
                for term_coefficients, is_lobe in group_terms
                if is_lobe and represents_environment
            ]
            windowed_tables = [
                term_coefficients.table * window(term_coefficients.residual_energy)
                for term_coefficients, is_lobe in group_terms
                if is_lobe
            ]
            for first, term_tables in ((0, plain_tables), (2, environment_tables), (4, windowed_tables)):
                for kind, table_sums, summands in (
                    (0, isotropic, [t[:, 0][..., recurrence_table.cosine] for t in term_tables if t.shape[1] == 1]),
                    (1, anisotropic, [t for t in term_tables if t.shape[1] > 1]),
                ):
                    if summands:
                        table_index[index, group, first + kind] = len(table_sums)
                        table_sums.append(np.sum(summands, axis=0, dtype=np.float32))
    return Tables(
        np.stack(isotropic) if isotropic else np.empty((0, NUM_ROWS, 3, len(recurrence_table.order)), np.float32),
        np.stack(anisotropic) if anisotropic else np.empty((0, NUM_ROWS, NUM_COLUMNS, 3, NUM_FUNCTIONS), np.float32),
        table_index,
    )
