"""Sample terms of a look on the MERL grid, to export an edited material for other renderers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import Shaped

from relume.assets.measured.measured_store import source_path
from relume.assets.measured.merl import (
    CHANNEL_SCALE,
    F64,
    MAX_VALUE,
    NOT_MEASURED,
    SHAPE,
    grid_directions,
    is_measured,
    read_merl,
)
from relume.brdf.evaluate import eval_brdf
from relume.core.errors import MaterialError

_STRIDE = 61  # every 61st node is tested for anisotropy
_TOLERANCE = 1e-6


def sample_terms(terms: Sequence[Mapping[str, Any]]) -> Shaped[F64, "3 90 90 180"]:
    """Evaluate the sum of terms, without textures, at all nodes of the MERL grid.

    Nodes below the horizon and unmeasured nodes of the terms' own data are marked as not measured.

    Args:
        terms: terms of a complete look.
    Returns:
        Input of `relume.assets.measured.merl.write_merl`.
    Raises:
        MaterialError: the terms are anisotropic, or exceed 10⁶ per steradian.
        NotFoundError: a measured material does not exist.
    """
    wi, wo = grid_directions()
    is_valid = (wi[..., 2] > 0) & (wo[..., 2] > 0)
    for data in {term["data"] for term in terms if "data" in term}:
        is_valid &= is_measured(read_merl(source_path(data)))
    _check_isotropic(terms, wi[is_valid][::_STRIDE], wo[is_valid][::_STRIDE])
    planes = np.full((3, *SHAPE), NOT_MEASURED)
    for h in range(SHAPE[0]):  # one slab at a time: each term makes a dozen arrays of this size
        values = _total(terms, wi[h], wo[h])
        if float(values.max(initial=0.0)) > MAX_VALUE:
            raise MaterialError(f"the material exceeds {MAX_VALUE:g} per steradian somewhere; lower its curves")
        planes[:, h] = np.where(is_valid[h], np.moveaxis(values / CHANNEL_SCALE, -1, 0), NOT_MEASURED)
    return planes


def _total(terms: Sequence[Mapping[str, Any]], wi: F64, wo: F64) -> F64:
    total = np.zeros(wi.shape)
    for term in terms:
        total += eval_brdf(term, wi, wo)
    return total


def _check_isotropic(terms: Sequence[Mapping[str, Any]], wi: F64, wo: F64) -> None:
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    original, rotated = _total(terms, wi, wo), _total(terms, wi @ quarter, wo @ quarter)
    if np.abs(rotated - original).max(initial=0.0) > _TOLERANCE * np.abs(original).max(initial=0.0):
        raise MaterialError("the material is anisotropic, but a MERL file is not; make it the same along and across")
