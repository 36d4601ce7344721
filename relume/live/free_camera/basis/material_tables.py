"""Outgoing coefficients of a look: summed over terms with the same texture, highlights separate.

Truncation at a degree causes ringing: next to bright light the sum is negative. For highlights of light other than the
environment, Σ_k w_k p_k t_k, the window w removes ringing at the cost of a little blur
(docs/free-camera.md#highlights).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import compress
from typing import Any, NamedTuple, Self

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.texture_slots import texture_slot
from relume.live.free_camera.basis.highlight_lobes import NUM_GROUPS, is_representable, terms_in_lobe
from relume.live.free_camera.basis.outgoing_coefficients import NUM_COLUMNS, NUM_ROWS, outgoing_coefficients
from relume.math.zernike import DEGREES, NUM_FUNCTIONS, WINDOW_DECAY, recurrence

F32 = NDArray[np.float32]

_FULL_WINDOW_RESIDUAL = 0.6  # RMS residual of a highlight from which the full window is used


class Tables(NamedTuple):
    """The outgoing coefficients of all materials.

    Attributes:
        isotropic: sums of isotropic terms for φo = 0, per entry of the recurrence table.
        anisotropic: sums of other terms.
        table_index: table of each material and group, −1 for none, an isotropic and an anisotropic one each: for terms
            without a highlight; for the environment in highlights, if the basis represents it; for other light in
            highlights. Groups are terms without a texture, and those with each of
            `relume.brdf.texture_slots.TEXTURES`.
    """

    isotropic: Shaped[F32, "tables rows 3 entries"]
    anisotropic: Shaped[F32, "anisotropic_tables rows columns 3 K"]
    table_index: Shaped[NDArray[np.int32], "materials groups 6"]

    @classmethod
    def joined(cls, table_sets: Sequence[Tables]) -> Self:
        """Concatenate the tables of several sets of materials."""
        isotropic, anisotropic = (np.concatenate([tables[kind] for tables in table_sets]) for kind in (0, 1))
        num = np.array([[len(tables.isotropic), len(tables.anisotropic)] for tables in table_sets], np.int32)
        first = np.repeat(
            np.cumsum(num, axis=0, dtype=np.int32) - num, [len(tables.table_index) for tables in table_sets], axis=0
        )
        table_index = np.concatenate([tables.table_index for tables in table_sets])
        return cls(
            isotropic, anisotropic, np.where(table_index >= 0, table_index + np.tile(first, 3)[:, None], table_index)
        )


def window(residual: float) -> Shaped[F32, " K"]:
    """Return w of each function, e^(−n (n + 2) f), float32.

    Args:
        residual: RMS residual of a highlight; a smaller one causes less ringing and needs less blur.
    """
    fall = WINDOW_DECAY * min(residual / _FULL_WINDOW_RESIDUAL, 1.0)
    return np.asarray(np.exp(-fall * DEGREES * (DEGREES + 2)), np.float32)


def build_tables(materials: Sequence[Sequence[Mapping[str, Any]]]) -> Tables:
    """Sum the outgoing coefficients of each material's terms with the same texture, highlights separate.

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
