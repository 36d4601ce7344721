"""What share of light a material sends on, by where it comes from and where it goes.

    L_j = Σ_k F_jk t_k,   F_jk = ∫∫ f(ωi, ωo) h_j(ωo) h_k(ωi) cos θi cos θo dωi dωo

with one basis h for both sides (`relume.basis.zernike`; Mahajan 2008, section 3, whose out-factors it projects again).
F_00 is the reflectance ρ, whatever the directions. Where a term looks the same from all around, only functions of one
order m are mixed, their cosine and sine parts alike; of other terms F is the mean over turns about the normal.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.basis.zernike import SENT_DEGREE, in_basis, ladder
from relume.brdf.channels import TEXTURES, Images, NormalMap, group_of, images_of
from relume.brdf.evaluate import eval_brdf
from relume.brdf.mirror import mirrored_share
from relume.brdf.quadrature import Quadrature
from relume.brdf.registry import TERMS
from relume.brdf.symmetry import about_normal, is_isotropic

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

Reflectances = tuple[bytes, ...]
"""Of each material, from `reflectances_of`; as bytes, which are compared and hashed at every frame."""


def _pairs() -> tuple[tuple[int, int], ...]:
    order = ladder(SENT_DEGREE).order
    return tuple((j, k) for j in range(len(order)) for k in range(j, len(order)) if order[j] == order[k])


PAIRS = _pairs()
"""Rungs j ≤ k of equal order: F is known by their numbers; the first is F_00."""

_SHARE_BYTES = 4 * (1 + len(TEXTURES)) * 3 * len(PAIRS)
_NUM_COSINES, _NUM_AZIMUTHS = 24, 24
_NUM_OUT, _NUM_RADII, _NUM_AROUND = 10, 32, 12
_STEPS = 128  # of a highlight's numbers, from none to all
_A_DOUBLING = 64  # steps of a sharp highlight's numbers
_LEAST_SENT, _SHARP = 0.15, 0.03  # F_00 of a highlight that counts; F_66 of F_00 where functions miss some of it
_LAST = PAIRS.index((SENT_DEGREE // 2, SENT_DEGREE // 2))  # both of the highest degree, of order 0


def is_diffuse(term_document: Mapping[str, Any]) -> bool:
    """Whether a term scatters light about evenly; see `Term.scatters_evenly`."""
    return TERMS[term_document["model"]].scatters_evenly


def reflectances_of(terms: Sequence[Mapping[str, Any]], normals: NormalMap | None = None) -> bytes:
    """What a material sends on: the sum of its terms without a texture, and of those with each of `TEXTURES`; the
    images that its look names in their place; its mirrors; what few functions do not tell of it; and how it leans.

    Args:
        terms: of a complete look. normals: the image that it names in the place of the material's normal map.
    Returns:
        What `shares_in`, `images_in`, `mirrors_in`, `lobes_in` and `normals_in` read.
    """
    return _reflectances(json.dumps([{**term} for term in terms], sort_keys=True), normals)


@lru_cache(maxsize=256)
def _reflectances(terms_text: str, normals: NormalMap | None) -> bytes:
    total = np.zeros((1 + len(TEXTURES), 3, len(PAIRS)))
    terms = json.loads(terms_text)
    highlights = [term for term in terms if not is_diffuse(term)]
    lobes = sharp_lobes(highlights)
    for term in filter(is_diffuse, terms):
        total[group_of(term)] += shares(term)
    for term in lobes or highlights:
        total[group_of(term)] += shares_in_steps(term)
    named = [name or "" for name in images_of(terms)]
    mirrors = [_in_relative_steps(term) for term in highlights if mirrored_share(term).any()]
    return total.astype(np.float32).tobytes() + _text(named, mirrors, lobes, list(normals or ()))


def _text(*parts: Sequence[Any]) -> bytes:
    """What is known beside numbers: names of images, then all else, where there is anything."""
    named, *beside = parts
    return " ".join([*named, json.dumps(beside, sort_keys=True)] if any(beside) else named).encode()


def shares_in_steps(term: Mapping[str, Any]) -> F64:
    """F of a highlight as it counts: else all light would be made anew with each step of a hand. (3, pairs)"""
    return np.asarray(np.round(shares(term) * _STEPS) / _STEPS)


def sharp_lobes(highlights: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """All highlights of a material, where few functions do not tell one of them that sends much.

    Their numbers have steps of 1 %; curves that are drawn are as they are.

    Args:
        highlights: terms of a complete look.
    Returns:
        Their documents, for `relume.brdf.lobe_tables`; none where functions are enough.
    """
    if any(map(_is_textured, highlights)) or not any(map(_is_sharp, highlights)):
        return []
    return [_in_relative_steps(term) for term in highlights]


def _is_textured(term: Mapping[str, Any]) -> bool:
    """Whether texels cover a term: what it sends is their mean, which few functions tell."""
    return TERMS[term["model"]].settled(term).texels is not None


def _is_sharp(term: Mapping[str, Any]) -> bool:
    """Whether a highlight sends much, and not as few functions do."""
    share = shares(term).max(axis=0)
    return bool(share[0] > _LEAST_SENT and share[_LAST] > _SHARP * share[0])


def _in_relative_steps(term: Mapping[str, Any]) -> dict[str, Any]:
    """A term whose numbers are whole powers of 2^(1/64): a hand that hardly moves makes no light anew."""

    def rounded(value: Any) -> Any:
        if isinstance(value, list):
            return [rounded(one) for one in value]
        return float(2 ** (round(np.log2(value) * _A_DOUBLING) / _A_DOUBLING)) if value > 0 else value

    params = {name: rounded(value) for name, value in (term.get("params") or {}).items()}
    return {**term, "color": rounded(list(term["color"])), "params": params}


def shares_in(of_material: bytes) -> F32:
    """F of a material's terms without a texture, then of those with each of `TEXTURES`. (3, channels, pairs) float32"""
    return np.frombuffer(of_material[:_SHARE_BYTES], np.float32).reshape(1 + len(TEXTURES), 3, len(PAIRS))


def images_in(of_material: bytes) -> Images:
    """What a look names in the place of each of a material's `TEXTURES`. of_material: from `reflectances_of`"""
    (diffuse, specular), *_ = _parts(of_material)
    return diffuse or None, specular or None


def mirrors_in(of_material: bytes) -> list[dict[str, Any]]:
    """The terms of a material that are mirrors, in part at least, and flat. of_material: from `reflectances_of`"""
    _, mirrors, _, normals = _parts(of_material)
    return [] if normals else mirrors


def lobes_in(of_material: bytes) -> list[dict[str, Any]]:
    """The highlights of a material that few functions do not tell; see `sharp_lobes`. of_material: likewise"""
    return _parts(of_material)[2]


def normals_in(of_material: bytes) -> NormalMap | None:
    """What a look names in the place of a material's normal map. of_material: likewise"""
    found = _parts(of_material)[3]
    return NormalMap(*found) if found else None


def without_normals(of_material: bytes) -> bytes:
    """The same of a material that leans as it was baked. of_material: likewise"""
    named, mirrors, lobes, normals = _parts(of_material)
    return of_material[:_SHARE_BYTES] + _text(named, mirrors, lobes, []) if normals else of_material


def _parts(of_material: bytes) -> tuple[list[str], list[dict[str, Any]], list[dict[str, Any]], list[Any]]:
    """What `_text` wrote."""
    diffuse, specular, *beside = of_material[_SHARE_BYTES:].decode().split(" ", 2)
    mirrors, lobes, normals = json.loads(beside[0]) if beside else ([], [], [])
    return [diffuse, specular], mirrors, lobes, normals


def reflectance(term_document: Mapping[str, Any]) -> F64:
    """ρ = F_00 of a term, its colour included, its texture not. (3,), not negative"""
    return shares(term_document)[:, 0]


def shares(term_document: Mapping[str, Any]) -> F64:
    """F of a term, its colour included, its texture not; of a diffuse term F_00 alone.

    Args:
        term_document: one term of a complete look.
    Returns:
        (channels, pairs)
    """
    known = (_of_even if is_diffuse(term_document) else _of_lobe)(white_text(term_document))
    return known * np.asarray(term_document["color"], np.float64)[:, None]


def white_text(term_document: Mapping[str, Any]) -> str:
    """The text of a term whose colour is white: the colour multiplies what is found of it."""
    return json.dumps({**term_document, "color": [1.0, 1.0, 1.0]}, sort_keys=True)


@lru_cache(maxsize=1024)
def _of_lobe(term_text: str) -> F64:
    """As `_of_even`, of a term whose light crowds about the mirror direction, as the places of ωi do. (3, pairs)"""
    places, arriving = _about_mirrors(), _arriving(term_text)
    together = np.tensordot(places.h_o, arriving, axes=(0, 0))  # (rungs, 3, rungs)
    rows, columns = np.array(PAIRS).T
    return np.asarray(together[rows, :, columns].T)


@lru_cache(maxsize=256)
def _arriving(term_text: str) -> F64:
    """What each function of ωi sends towards each ωo, weighed as `_Places`. (o, 3, rungs)"""
    document, places = json.loads(term_text), _about_mirrors()
    if is_isotropic(document):
        value = _quadrature().values(document)
    else:
        turned = [eval_brdf(document, places.wi @ turn.T, places.wo @ turn.T) for turn in _TURNS]
        value = np.moveaxis(np.mean(turned, axis=0), -1, 0)
    sent = np.moveaxis((value[..., None, :] @ places.h_i)[..., 0, :], 0, 1)
    return np.broadcast_to(sent, (_NUM_OUT, 3, sent.shape[-1]))


@lru_cache(maxsize=1)
def _quadrature() -> Quadrature:
    return Quadrature(_about_mirrors().wi, _about_mirrors().wo)


def directional_albedo(terms: Sequence[Mapping[str, Any]]) -> tuple[F64, F64]:
    """What share of even light a material sends towards each θo, its textures white, the mean over turns:

        a(θo) = ∫ f(ωi, ωo) cos θi dωi

    Args:
        terms: of a complete look.
    Returns:
        θo in radians, rising, (o,), and a there, (o, 3).
    """
    places, total = _about_mirrors(), np.zeros((_NUM_OUT, 3))
    for term in terms:
        # the first function is the constant 1 / √π
        even = np.sqrt(np.pi) * _arriving(white_text(term))[..., 0]
        total += even / places.weight_o[:, None] * np.asarray(term["color"], np.float64)
    return np.arccos(places.wo[::-1, 0, 2]), total[::-1]


class _Places(NamedTuple):
    """Where terms are evaluated, which no term changes.

    Attributes:
        wi, wo: local directions. (o, n, 3), (o, 1, 3)
        h_i: functions of ωi, weighed. (o, n, rungs). h_o: of ωo, times ∫ cos² mφ dφ. (o, rungs)
        weight_o: of each ωo, its cosine included, which is in h_i. (o,)
    """

    wi: F64
    wo: F64
    h_i: F64
    h_o: F64
    weight_o: F64


@lru_cache(maxsize=1)
def _about_mirrors() -> _Places:
    """Spread ωi about the mirror directions of a few ωo.

    With θr the angle from there, θr = π u³ and dωi = 3π u² sin θr du dφr; below the horizon there is nothing.
    """
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
    rungs = ladder(SENT_DEGREE)
    around = np.where(rungs.order > 0, np.pi, 2 * np.pi)
    h_i, h_o = weight[..., None] * in_basis(wi)[..., rungs.cosine], around * in_basis(wo[:, 0])[:, rungs.cosine]
    return _Places(wi, wo, h_i, h_o, weight_o * cos_o)


def _gauss(num: int) -> tuple[F64, F64]:
    """Find the places and weights of Gauss and Legendre over [0, 1]. (num,) each"""
    nodes, weights = np.polynomial.legendre.leggauss(num)
    return (nodes + 1) / 2, weights / 2


_TURNS = [about_normal(np.pi * (k + 0.5) / 4) for k in range(4)]  # of a term that looks different from there


@lru_cache(maxsize=1024)
def _of_even(term_text: str) -> F64:
    """By Gauss–Legendre quadrature over cosines; diffuse terms are smooth, or steps of hand-drawn bands. (3, pairs)"""
    cosine, weight = _gauss(_NUM_COSINES)
    projected = weight * cosine
    sine = np.sqrt(1 - cosine**2)
    phi = np.pi * (np.arange(_NUM_AZIMUTHS) + 0.5) / _NUM_AZIMUTHS  # terms are symmetric about the plane of wo
    around = sine[:, None] * np.cos(phi), sine[:, None] * np.sin(phi), np.tile(cosine[:, None], _NUM_AZIMUTHS)
    wi = np.stack(around, axis=-1)[None]
    wo = np.stack([sine, 0 * sine, cosine], axis=-1)[:, None, None]
    over_azimuths = eval_brdf(json.loads(term_text), wi, wo).mean(axis=2)
    out = np.zeros((3, len(PAIRS)))
    # 2π for the azimuths of each direction, over π
    out[:, 0] = 4 * np.pi * np.einsum("o,i,oic->c", projected, projected, over_azimuths)
    return out
