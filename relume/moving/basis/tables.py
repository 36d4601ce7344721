"""The out-factors of a look: those of terms that the same texture multiplies summed, highlights apart.

Functions cut off at a degree ring: beside what is bright they say less than black. Of what highlights send of other
light than the sky, in Σ_k w_k p_k t_k, w takes that away for a little blur (docs/adr/0063-highlights.md).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import compress
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from relume.basis.zernike import DEGREES, FALL, NUM_FUNCTIONS, ladder
from relume.brdf.channels import group_of
from relume.moving.basis.lobes import NUM_GROUPS, are_lobes, is_told
from relume.moving.basis.out_factors import NUM_COLUMNS, NUM_ROWS, out_factors

F32 = NDArray[np.float32]

_RINGS = 0.6  # what functions miss of a highlight, RMS, from which on all of the window is asked for


class Tables(NamedTuple):
    """The out-factors of all materials.

    Attributes:
        even: of isotropic terms summed, for φo = 0, by rungs of the ladder. (tables, `NUM_ROWS`, 3, rungs) float32
        uneven: of the others summed. (tables, `NUM_ROWS`, `NUM_COLUMNS`, 3, K) float32
        of: table of each material and group in both, −1 for none: of terms without a highlight; of what those with one
            send of the sky, where the in-basis tells it; of what these send of other light. Groups are terms without a
            texture, and those that each of `relume.brdf.channels.TEXTURES` multiplies. (materials, groups, 6) int32
    """

    even: F32
    uneven: F32
    of: NDArray[np.int32]

    @classmethod
    def joined(cls, parts: Sequence[Tables]) -> Self:
        """Those of some materials, then of others."""
        even, uneven = (np.concatenate([part[kind] for part in parts]) for kind in (0, 1))
        num = np.array([[len(part.even), len(part.uneven)] for part in parts], np.int32)
        first = np.repeat(np.cumsum(num, axis=0, dtype=np.int32) - num, [len(part.of) for part in parts], axis=0)
        of = np.concatenate([part.of for part in parts])
        return cls(even, uneven, np.where(of >= 0, of + np.tile(first, 3)[:, None], of))


def window(missed: float) -> F32:
    """Find w of each function, e^(−n (n + 2) f). (K,) float32

    Args:
        missed: by all functions of a highlight, RMS: little rings where they miss little, and blurs for nothing.
    """
    fall = FALL * min(missed / _RINGS, 1.0)
    return np.asarray(np.exp(-fall * DEGREES * (DEGREES + 2)), np.float32)


def tables_of(materials: Sequence[Sequence[Mapping[str, Any]]]) -> Tables:
    """Sum the out-factors of the terms of each material that the same texture multiplies, highlights apart.

    Args:
        materials: the terms of each, of a complete look.
    """
    rungs = ladder()
    even: list[F32] = []
    uneven: list[F32] = []
    of = np.full((len(materials), NUM_GROUPS, 6), -1, np.int32)
    for index, terms in enumerate(materials):
        found_of = [out_factors(term) for term in terms]
        of_lobe = are_lobes(found_of)
        tells_sky = is_told([*compress(terms, of_lobe)])
        every = [*zip(map(group_of, terms), found_of, of_lobe, strict=True)]
        for group in range(NUM_GROUPS):
            shared = [(one, is_lobe) for of_group, one, is_lobe in every if of_group == group]
            plain = [one.table for one, is_lobe in shared if not is_lobe]
            told = [one.table for one, is_lobe in shared if is_lobe and tells_sky]
            others = [one.table * window(one.missed) for one, is_lobe in shared if is_lobe]
            for first, found in ((0, plain), (2, told), (4, others)):
                for kind, kept, tables in (
                    (0, even, [t[:, 0][..., rungs.cosine] for t in found if t.shape[1] == 1]),
                    (1, uneven, [t for t in found if t.shape[1] > 1]),
                ):
                    if tables:
                        of[index, group, first + kind] = len(kept)
                        kept.append(np.sum(tables, axis=0, dtype=np.float32))
    return Tables(
        np.stack(even) if even else np.empty((0, NUM_ROWS, 3, len(rungs.order)), np.float32),
        np.stack(uneven) if uneven else np.empty((0, NUM_ROWS, NUM_COLUMNS, 3, NUM_FUNCTIONS), np.float32),
        of,
    )
