"""Outgoing coefficients of a look: summed over terms with the same texture, highlights separate.

Each material has as many functions as its terms need: those up to the degree that omits less than 0.1 % of a table
(Mahajan 2008, section 4: the number of terms is chosen for each material), or as many as its look asks for. Truncation
at a degree causes ringing: next to bright light the sum is negative. For highlights of light other than the
environment, Σ_k w_k p_k t_k, the window w removes ringing at the cost of a little blur
(docs/free-camera.md#highlights).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import compress, zip_longest
from typing import Any, NamedTuple, Self

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.texture_slots import texture_slot
from relume.live.free_camera.basis.highlight_lobes import NUM_GROUPS, is_representable, terms_in_lobe
from relume.live.free_camera.basis.outgoing_coefficients import NUM_COLUMNS, NUM_ROWS, outgoing_coefficients
from relume.math.zernike import DEGREE, DEGREES, NUM_FUNCTIONS, WINDOW_DECAY, recurrence_by_degree

F32 = NDArray[np.float32]

_MAX_OMITTED = 1e-3  # RMS of omitted functions, relative to the table's
_FULL_WINDOW_RESIDUAL = 0.6  # RMS residual of a highlight from which the full window is used


class Tables(NamedTuple):
    """The outgoing coefficients of all materials.

    Attributes:
        isotropic: sums of isotropic terms for φo = 0, for the rows of `recurrence_by_degree`.
        anisotropic: sums of other terms.
        table_index: table of each material and group, −1 for none, an isotropic and an anisotropic one each: for terms
            without a highlight; for the environment in highlights, if the basis represents it; for other light in
            highlights. Groups are terms without a texture, and those with each of
            `relume.brdf.texture_slots.TEXTURES`.
        degree: highest degree that a material's tables of each of these three kinds need; −1 for none.
    """

    isotropic: Shaped[F32, "tables rows 3 entries"]
    anisotropic: Shaped[F32, "anisotropic_tables rows columns 3 K"]
    table_index: Shaped[NDArray[np.int32], "materials groups 6"]
    degree: Shaped[NDArray[np.int32], "materials 3"]

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
            isotropic,
            anisotropic,
            np.where(table_index >= 0, table_index + np.tile(first, 3)[:, None], table_index),
            np.concatenate([tables.degree for tables in table_sets]),
        )


def window(residual: float) -> Shaped[F32, " K"]:
    """Return w of each function, e^(−n (n + 2) f), float32.

    Args:
        residual: RMS residual of a highlight; a smaller one causes less ringing and needs less blur.
    """
    fall = WINDOW_DECAY * min(residual / _FULL_WINDOW_RESIDUAL, 1.0)
    return np.asarray(np.exp(-fall * DEGREES * (DEGREES + 2)), np.float32)


def needed_degrees(
    table: Shaped[F32, "tables *batch functions"], function_degrees: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Return the degree of each table above which less than 0.1 % of its RMS is left.

    Args:
        table: any tables. function_degrees: degree of each function.
    """
    energy = np.square(table, dtype=np.float64).sum(axis=tuple(range(1, table.ndim - 1)))
    by_degree = np.stack([energy[:, function_degrees == degree].sum(axis=1) for degree in range(DEGREE + 1)], axis=1)
    tail = by_degree[:, ::-1].cumsum(axis=1)[:, ::-1]  # of this degree and all higher ones
    is_needed = tail > _MAX_OMITTED**2 * np.maximum(tail[:, :1], 1e-30)
    return np.asarray(is_needed.sum(axis=1) - 1, np.int64).clip(0)


class _Summands(NamedTuple):
    """Tables of a material's terms with one texture.

    Attributes:
        plain: terms without a highlight. environment: terms with one, for the environment, if the basis represents it.
        windowed: terms with one, for other light.
    """

    plain: list[F32]
    environment: list[F32]
    windowed: list[F32]


def _summands(terms: Sequence[Mapping[str, Any]], degree: int | None) -> dict[int, _Summands]:
    """Sort the tables of a material's terms, by group. degree: a chosen one; None: highlights are separate."""
    coefficients = [outgoing_coefficients(term) for term in terms]
    is_in_lobe = [False] * len(terms) if degree is not None else terms_in_lobe(coefficients)
    represents_environment = is_representable([*compress(terms, is_in_lobe)])
    by_group: dict[int, _Summands] = {}
    for term, term_coefficients, is_lobe in zip(terms, coefficients, is_in_lobe, strict=True):
        summands, table = by_group.setdefault(texture_slot(term), _Summands([], [], [])), term_coefficients.table
        if not is_lobe:
            summands.plain.append(table if degree is None else table * (degree >= DEGREES))
            continue
        if represents_environment:
            summands.environment.append(table)
        summands.windowed.append(table * window(term_coefficients.residual_energy))
    return by_group


def build_tables(materials: Sequence[Sequence[Mapping[str, Any]]], degrees: Sequence[int | None] = ()) -> Tables:
    """Sum the outgoing coefficients of each material's terms with the same texture, highlights separate.

    Args:
        materials: the terms of each, of a complete look.
        degrees: chosen degree of each, whose terms are Σ_k p_k t_k up to it and nothing else; None or absent: as high
            as they need, with highlights.
    """
    rows = recurrence_by_degree()
    isotropic: list[F32] = []
    anisotropic: list[F32] = []
    table_index = np.full((len(materials), NUM_GROUPS, 6), -1, np.int32)
    for index, (terms, degree) in enumerate(zip_longest(materials, degrees)):
        for group, summands in _summands(terms, degree).items():
            for first, term_tables in zip((0, 2, 4), summands, strict=True):
                for kind, table_sums, same_kind in (
                    (0, isotropic, [t[:, 0][..., rows.cosine] for t in term_tables if t.shape[1] == 1]),
                    (1, anisotropic, [t for t in term_tables if t.shape[1] > 1]),
                ):
                    if same_kind:
                        table_index[index, group, first + kind] = len(table_sums)
                        table_sums.append(np.sum(same_kind, axis=0, dtype=np.float32))
    isotropic_tables = np.stack(isotropic) if isotropic else np.empty((0, NUM_ROWS, 3, len(rows.order)), np.float32)
    anisotropic_tables = (
        np.stack(anisotropic) if anisotropic else np.empty((0, NUM_ROWS, NUM_COLUMNS, 3, NUM_FUNCTIONS), np.float32)
    )
    needed = needed_degrees(isotropic_tables, DEGREES[rows.cosine]), needed_degrees(anisotropic_tables, DEGREES)
    return Tables(isotropic_tables, anisotropic_tables, table_index, _degrees_by_material(table_index, needed))


def _degrees_by_material(
    table_index: NDArray[np.int32], needed: tuple[NDArray[np.int64], NDArray[np.int64]]
) -> NDArray[np.int32]:
    """Return `Tables.degree`. needed: degrees of the isotropic, and of the anisotropic tables"""
    degree = np.full((len(table_index), NUM_GROUPS, 3, 2), -1, np.int32)
    for kind, degrees in enumerate(needed):
        index = table_index[..., kind::2]
        degree[..., kind][index >= 0] = degrees[index[index >= 0]]
    return np.asarray(degree.max(axis=(1, 3)), np.int32)
