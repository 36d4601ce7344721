"""Which turns and mirrorings leave a term as it is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.brdf.evaluate import eval_brdf

F64 = NDArray[np.float64]

_SAME = 1e-6  # relative difference that rounding may make
_MIRRORED = {"x": np.diag([-1.0, 1.0, 1.0]), "y": np.diag([1.0, -1.0, 1.0])}


def about_normal(phi: float) -> F64:
    """Find the matrix that turns local directions about their normal, radians. (3, 3)"""
    cosine, sine = np.cos(phi), np.sin(phi)
    return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])


def is_isotropic(term_document: Mapping[str, Any]) -> bool:
    """Tell whether a term looks the same when both directions turn about the normal, or are mirrored."""
    return _stays(term_document, (about_normal(1.2345), _MIRRORED["y"]))  # an angle that no other symmetry has


def is_mirrored(term_document: Mapping[str, Any]) -> bool:
    """Tell whether a term looks the same on both sides of its tangent, and of what lies across that."""
    return _stays(term_document, tuple(_MIRRORED.values()))


def _stays(term_document: Mapping[str, Any], maps: Sequence[F64]) -> bool:
    """Tell whether a term has the same values after each of some maps of both directions, at a few of them."""
    rng = np.random.default_rng(1)
    wi, wo = (np.abs(rng.normal(size=(256, 3))) for _ in range(2))
    wi[:128, 0] *= -1
    wi, wo = (w / np.linalg.norm(w, axis=1, keepdims=True) for w in (wi, wo))
    plain = eval_brdf(term_document, wi, wo)
    scale = np.abs(plain).max() + 1e-30
    others = (eval_brdf(term_document, wi @ one.T, wo @ one.T) for one in maps)
    return all(np.abs(other - plain).max() <= _SAME * scale for other in others)
