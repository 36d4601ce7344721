"""Tabulated highlights of patches under one look, for those too sharp for the low-degree basis."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.albedo import Reflectances, quantized_reflectance, white_term
from relume.brdf.frozen_term import FrozenTerm
from relume.brdf.highlight_tables import lobe_table
from relume.brdf.texture_slots import texture_slot
from relume.math.direction_grid import NUM_DIRECTION_BINS, NUM_FINE_BINS

F32 = NDArray[np.float32]


class HighlightTables(NamedTuple):
    """Highlights of the G patches that have any.

    Attributes:
        rows: these patches.
        table_index: table of each highlight of a patch, −1 for none. gain: color and texture of each highlight.
        tables: see `relume.brdf.highlight_tables.lobe_table`; one channel if all are gray. Their bins are
            `NUM_FINE_BINS` incident and `NUM_DIRECTION_BINS` outgoing ones.
        reflectance: F_00.
    """

    rows: Shaped[NDArray[np.intp], " G"]
    table_index: Shaped[NDArray[np.int16], "G highlights"]
    gain: Shaped[F32, "G highlights 3"]
    tables: Shaped[F32, "tables fine_bins channels bins"]
    reflectance: Shaped[F32, "G 3"]

    def subset(self, mask: Shaped[NDArray[np.bool_], " G"]) -> HighlightTables:
        """Select patches."""
        rows, table_index, gain = self.rows[mask], self.table_index[mask], self.gain[mask]
        return HighlightTables(rows, table_index, gain, self.tables, self.reflectance[mask])

    @classmethod
    def from_materials(
        cls,
        reflectances: Reflectances,
        material: Shaped[NDArray[np.uint16], " patches"],
        textures: Shaped[F32, "2 patches 3"],
        energy_scale: Shaped[F32, "patches 3"],
    ) -> HighlightTables:
        """Tabulate the highlights of all materials.

        Args:
            reflectances: reflectances of all materials. material: material index of each patch.
            textures: multipliers of each of `relume.brdf.texture_slots.TEXTURES`.
            energy_scale: factor on all outgoing light of a patch.
        """
        documents = [material_reflectance.lobes for material_reflectance in reflectances]
        max_highlights, table_numbers = max(map(len, documents), default=0), dict[FrozenTerm, int]()
        table_index = np.full((len(documents), max_highlights), -1, np.int16)
        slot_index, color, reflectance = (
            np.zeros_like(table_index, np.intp),
            np.zeros((*table_index.shape, 3)),
            np.zeros((*table_index.shape, 3)),
        )
        for m, entry in enumerate(documents):
            for k, document in enumerate(entry):
                untextured = white_term({**document, "texture": None})
                table_index[m, k] = table_numbers.setdefault(untextured, len(table_numbers))
                color[m, k], slot_index[m, k] = document["color"], texture_slot(document)
                reflectance[m, k] = quantized_reflectance(document)[:, 0]
        has_any = np.array([len(entry) > 0 for entry in documents])
        rows = np.flatnonzero(has_any[material])
        multipliers = np.concatenate([np.ones_like(textures[:1]), textures])[:, rows]
        # (highlights, G, 3)
        patch_factors = multipliers[slot_index[material[rows]].T, np.arange(len(rows))] * energy_scale[rows]
        factor = patch_factors.transpose(1, 0, 2)
        return cls(
            rows,
            table_index[material[rows]],
            (factor * color[material[rows]]).astype(np.float32),
            _stack_tables([lobe_table(term) for term in table_numbers]),
            (factor * reflectance[material[rows]]).sum(axis=1).astype(np.float32),
        )


def _stack_tables(tables: list[F32]) -> F32:
    """Stack all tables, with one channel if each is gray."""
    if not tables:
        return np.zeros((0, NUM_FINE_BINS, 1, NUM_DIRECTION_BINS), np.float32)
    is_gray = all((table == table[:, :1]).all() for table in tables)
    return np.ascontiguousarray(np.stack([table[:, :1] if is_gray else table for table in tables]))
