"""Diffuse reflectance: what share of light a term scatters, whatever the directions it comes from and goes to."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.brdf.evaluate import eval_brdf
from relume.brdf.registry import TERMS

F64 = NDArray[np.float64]

TEXTURES = ("diffuse", "specular")

Reflectances = tuple[tuple[float, ...], ...]
"""Of each material, from `reflectances_of`."""

_NUM_COSINES, _NUM_AZIMUTHS = 24, 24


def is_diffuse(term_document: Mapping[str, Any]) -> bool:
    """Whether a term scatters light about evenly: those do whose colour is the diffuse one by default."""
    return TERMS[term_document["model"]].texture == "diffuse"


def reflectances_of(terms: Sequence[Mapping[str, Any]]) -> tuple[float, ...]:
    """Diffuse reflectance of a material: R, G, B of its terms without a texture, then of those with each of `TEXTURES`.

    Args:
        terms: of a complete look.
    Returns:
        Nine numbers, hashable.
    """
    total = np.zeros((1 + len(TEXTURES), 3))
    for term in filter(is_diffuse, terms):
        total[0 if term["texture"] is None else 1 + TEXTURES.index(term["texture"])] += diffuse_reflectance(term)
    return tuple(total.ravel().tolist())


def diffuse_reflectance(term_document: Mapping[str, Any]) -> F64:
    """ρ = 1/π ∫∫ f(ωi, ωo) cos θi cos θo dωi dωo of a diffuse term, its colour included, its texture not.

    Args:
        term_document: one term of a complete look.
    Returns:
        (3,), not negative
    """
    white = {**term_document, "color": [1.0, 1.0, 1.0]}
    return _white_reflectance(json.dumps(white, sort_keys=True)) * np.asarray(term_document["color"], np.float64)


@lru_cache(maxsize=1024)
def _white_reflectance(term_text: str) -> F64:
    """By Gauss–Legendre quadrature over cosines; diffuse terms are smooth, or steps of hand-drawn bands. (3,)"""
    nodes, weights = np.polynomial.legendre.leggauss(_NUM_COSINES)
    cosine, projected = (nodes + 1) / 2, weights / 2 * (nodes + 1) / 2
    sine = np.sqrt(1 - cosine**2)
    phi = np.pi * (np.arange(_NUM_AZIMUTHS) + 0.5) / _NUM_AZIMUTHS  # terms are symmetric about the plane of wo
    around = sine[:, None] * np.cos(phi), sine[:, None] * np.sin(phi), np.tile(cosine[:, None], _NUM_AZIMUTHS)
    wi = np.stack(around, axis=-1)[None]
    wo = np.stack([sine, 0 * sine, cosine], axis=-1)[:, None, None]
    over_azimuths = eval_brdf(json.loads(term_text), wi, wo).mean(axis=2)
    # 2π for the azimuths of each direction, over π
    return np.asarray(4 * np.pi * np.einsum("o,i,oic->c", projected, projected, over_azimuths))
