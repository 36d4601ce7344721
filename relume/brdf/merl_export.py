"""Terms of a look sampled on the MERL grid: an edited material as a file that other renderers read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

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

_STRIDE = 61  # every so manyth node is looked at for anisotropy
_TOLERANCE = 1e-6


def sample_terms(terms: Sequence[Mapping[str, Any]]) -> F64:
    """The sum of terms at all nodes; not measured below the horizon, and where a material that they name was not.

    Args:
        terms: of a complete look. Textures are not part of it.
    Returns:
        (3, 90, 90, 180) float64, as `relume.assets.measured.merl.write_merl` takes them.
    Raises:
        MaterialError: the terms change as the surface turns about its normal, or are above 10⁶ per steradian.
        NotFoundError: a measured material is not here.
    """
    wi, wo = grid_directions()
    is_valid = (wi[..., 2] > 0) & (wo[..., 2] > 0)
    for data in {term["data"] for term in terms if "data" in term}:
        is_valid &= is_measured(read_merl(source_path(data)))
    _check_isotropic(terms, wi[is_valid][::_STRIDE], wo[is_valid][::_STRIDE])
    planes = np.full((3, *SHAPE), NOT_MEASURED)
    for h in range(SHAPE[0]):  # slab by slab: each term makes a dozen arrays of this size
        values = _total(terms, wi[h], wo[h])
        if float(values.max(initial=0.0)) > MAX_VALUE:
            raise MaterialError(f"the material is above {MAX_VALUE:g} per steradian somewhere; lower its curves")
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
        raise MaterialError("the material is anisotropic, a MERL file is not; make it the same along and across")
