"""Highlights of gather cells under one look, as tables: those that few functions do not tell."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.basis.lobe_grid import NUM_BINS, NUM_SQUARES
from relume.brdf.albedo import Reflectances, lobes_in, shares_in_steps, white_text
from relume.brdf.channels import group_of
from relume.brdf.lobe_tables import lobe_table

F32 = NDArray[np.float32]


class Lobes(NamedTuple):
    """Of cells that have any.

    Attributes:
        rows: these cells. (G,) intp
        which: table of each highlight of a cell, −1 for none. (G, highlights) int16
        gain: its colour and texture. (G, highlights, 3) float32
        tables: see `relume.brdf.lobe_tables.lobe_table`; one channel where all are grey.
            (tables, `NUM_BINS`, 1 or 3, `NUM_SQUARES`) float32
        reflectance: how much they send of all that comes, F_00. (G, 3) float32
    """

    rows: NDArray[np.intp]
    which: NDArray[np.int16]
    gain: F32
    tables: F32
    reflectance: F32

    def some(self, chosen: NDArray[np.bool_]) -> Lobes:
        """Those of some of the cells. chosen: (G,)"""
        rows, which, gain = self.rows[chosen], self.which[chosen], self.gain[chosen]
        return Lobes(rows, which, gain, self.tables, self.reflectance[chosen])

    @classmethod
    def of(cls, reflectances: Reflectances, material: NDArray[np.uint16], textures: F32, held: F32) -> Lobes:
        """Tabulate the highlights of all materials.

        Args:
            reflectances: of all materials. material: of each cell. (C,) uint16
            textures: multipliers of each of `relume.brdf.channels.TEXTURES`. (2, C, 3) float32
            held: what all that a cell sends is multiplied by. (C, 3) float32
        """
        documents = [lobes_in(of_material) for of_material in reflectances]
        most, numbers = max(map(len, documents), default=0), dict[str, int]()
        which = np.full((len(documents), most), -1, np.int16)
        group, color, share = np.zeros_like(which, np.intp), np.zeros((*which.shape, 3)), np.zeros((*which.shape, 3))
        for m, of_material in enumerate(documents):
            for k, document in enumerate(of_material):
                which[m, k] = numbers.setdefault(white_text({**document, "texture": None}), len(numbers))
                color[m, k], group[m, k] = document["color"], group_of(document)
                share[m, k] = shares_in_steps(document)[:, 0]
        has_any = np.array([len(of_material) > 0 for of_material in documents])
        rows = np.flatnonzero(has_any[material])
        plain = np.concatenate([np.ones_like(textures[:1]), textures])[:, rows]
        of_cells = plain[group[material[rows]].T, np.arange(len(rows))] * held[rows]  # (highlights, G, 3)
        factor = of_cells.transpose(1, 0, 2)
        return cls(
            rows,
            which[material[rows]],
            (factor * color[material[rows]]).astype(np.float32),
            _stacked([lobe_table(text) for text in numbers]),
            (factor * share[material[rows]]).sum(axis=1).astype(np.float32),
        )


def _stacked(tables: list[F32]) -> F32:
    """All tables, of one channel where each has three alike."""
    if not tables:
        return np.zeros((0, NUM_BINS, 1, NUM_SQUARES), np.float32)
    is_grey = all((table == table[:, :1]).all() for table in tables)
    return np.ascontiguousarray(np.stack([table[:, :1] if is_grey else table for table in tables]))
