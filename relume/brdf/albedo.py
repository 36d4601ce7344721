"""Reflectance: what share of light a term sends on, whatever the directions it comes from and goes to."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.brdf.evaluate import eval_brdf
from relume.brdf.registry import TERMS
from relume.brdf.symmetry import about_normal, is_isotropic

F64 = NDArray[np.float64]

TEXTURES = ("diffuse", "specular")

Reflectances = tuple[tuple[float, ...], ...]
"""Of each material, from `reflectances_of`."""

_NUM_COSINES, _NUM_AZIMUTHS = 24, 24
_NUM_OUT, _NUM_RADII, _NUM_AROUND = 10, 32, 12
_STEPS = 128  # of a highlight's reflectance, from none to all


def is_diffuse(term_document: Mapping[str, Any]) -> bool:
    """Whether a term scatters light about evenly: those do whose colour is the diffuse one by default."""
    return TERMS[term_document["model"]].texture == "diffuse"


def reflectances_of(terms: Sequence[Mapping[str, Any]]) -> tuple[float, ...]:
    """Reflectance of a material: R, G, B of its terms without a texture, then of those with each of `TEXTURES`.

    Args:
        terms: of a complete look.
    Returns:
        Nine numbers, hashable.
    """
    total = np.zeros((1 + len(TEXTURES), 3))
    for term in terms:
        found = reflectance(term)
        if not is_diffuse(term):  # else all light would be made anew with each step of a hand on a highlight
            found = np.round(found * _STEPS) / _STEPS
        total[0 if term["texture"] is None else 1 + TEXTURES.index(term["texture"])] += found
    return tuple(total.ravel().tolist())


def reflectance(term_document: Mapping[str, Any]) -> F64:
    """ρ = 1/π ∫∫ f(ωi, ωo) cos θi cos θo dωi dωo of a term, its colour included, its texture not.

    Args:
        term_document: one term of a complete look.
    Returns:
        (3,), not negative
    """
    white = {**term_document, "color": [1.0, 1.0, 1.0]}
    known = (_of_even if is_diffuse(term_document) else _of_lobe)(json.dumps(white, sort_keys=True))
    return known * np.asarray(term_document["color"], np.float64)


@lru_cache(maxsize=1024)
def _of_lobe(term_text: str) -> F64:
    """As `_of_even`, of a term whose light crowds about the mirror direction, as the places of ωi then do. (3,)

    With θr the angle from there, θr = π u³ and dωi = 3π u² sin θr du dφr; below the horizon there is nothing.
    """
    document = json.loads(term_text)
    cos_o, weight_o = _gauss(_NUM_OUT)
    u, weight_u = _gauss(_NUM_RADII)
    theta, phi = np.pi * u**3, np.pi * (np.arange(_NUM_AROUND) + 0.5) / _NUM_AROUND
    solid = np.repeat(weight_u * 3 * np.pi * u**2 * np.sin(theta), len(phi)) * (2 * np.pi / len(phi))
    x, y = (np.outer(np.sin(theta), turn(phi)).ravel() for turn in (np.cos, np.sin))
    z = np.repeat(np.cos(theta), len(phi))
    sine = np.sqrt(1 - cos_o**2)
    along, above = x * cos_o[:, None] - z * sine[:, None], x * sine[:, None] + z * cos_o[:, None]
    wi = np.stack([along, np.broadcast_to(y, above.shape), np.maximum(above, 0)], axis=-1)
    wo = np.stack([sine, 0 * sine, cos_o], axis=-1)[:, None]
    weight = (weight_o * cos_o)[:, None] * solid * np.maximum(above, 0)
    turns = _TURNS[:1] if is_isotropic(document) else _TURNS
    value = np.mean([eval_brdf(document, wi @ turn.T, wo @ turn.T) for turn in turns], axis=0)
    return np.asarray(2 * np.einsum("on,onc->c", weight, value))


def _gauss(num: int) -> tuple[F64, F64]:
    """Find the places and weights of Gauss and Legendre over [0, 1]. (num,) each"""
    nodes, weights = np.polynomial.legendre.leggauss(num)
    return (nodes + 1) / 2, weights / 2


_TURNS = [about_normal(np.pi * (k + 0.5) / 4) for k in range(4)]  # of a term that looks different from there


@lru_cache(maxsize=1024)
def _of_even(term_text: str) -> F64:
    """By Gauss–Legendre quadrature over cosines; diffuse terms are smooth, or steps of hand-drawn bands. (3,)"""
    cosine, weight = _gauss(_NUM_COSINES)
    projected = weight * cosine
    sine = np.sqrt(1 - cosine**2)
    phi = np.pi * (np.arange(_NUM_AZIMUTHS) + 0.5) / _NUM_AZIMUTHS  # terms are symmetric about the plane of wo
    around = sine[:, None] * np.cos(phi), sine[:, None] * np.sin(phi), np.tile(cosine[:, None], _NUM_AZIMUTHS)
    wi = np.stack(around, axis=-1)[None]
    wo = np.stack([sine, 0 * sine, cosine], axis=-1)[:, None, None]
    over_azimuths = eval_brdf(json.loads(term_text), wi, wo).mean(axis=2)
    # 2π for the azimuths of each direction, over π
    return np.asarray(4 * np.pi * np.einsum("o,i,oic->c", projected, projected, over_azimuths))
