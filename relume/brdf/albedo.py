"""What share of light a material sends on, by where it comes from and where it goes.

    L_j = Σ_k F_jk t_k,   F_jk = ∫∫ f(ωi, ωo) h_j(ωo) h_k(ωi) cos θi cos θo dωi dωo

with one basis h for both sides (`relume.math.zernike`; Mahajan 2008, section 3, whose out-factors it projects again).
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

from relume.brdf.evaluate import eval_brdf
from relume.brdf.quadrature import Quadrature
from relume.brdf.registry import TERMS
from relume.brdf.specular import specular_albedo
from relume.brdf.symmetry import is_isotropic, rotational_symmetry
from relume.brdf.texture_slots import TEXTURES, Images, NormalMap, texture_slot, user_images
from relume.math.zernike import OUTGOING_DEGREE, project, recurrence

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

Reflectances = tuple[bytes, ...]
"""Of each material, from `pack_reflectance`; as bytes, which are compared and hashed at every frame."""


def _pairs() -> tuple[tuple[int, int], ...]:
    order = recurrence(OUTGOING_DEGREE).order
    return tuple((j, k) for j in range(len(order)) for k in range(j, len(order)) if order[j] == order[k])


PAIRS = _pairs()
"""Rungs j ≤ k of equal order: F is known by their numbers; the first is F_00."""

_REFLECTANCE_BYTES = 4 * (1 + len(TEXTURES)) * 3 * len(PAIRS)
_NUM_COSINES, _NUM_AZIMUTHS = 24, 24
_NUM_OUT, _NUM_RADII, _NUM_AROUND = 10, 32, 12
_STEPS = 128  # of a highlight's numbers, from none to all
_STEPS_PER_OCTAVE = 64  # steps of a sharp highlight's numbers
# F_00 of a highlight that counts; F_66 of F_00 where functions miss some of it
_MIN_REFLECTANCE, _MIN_RESIDUAL_RATIO = 0.15, 0.03
_LAST_PAIR = PAIRS.index((OUTGOING_DEGREE // 2, OUTGOING_DEGREE // 2))  # both of the highest degree, of order 0


def scatters_diffusely(term_document: Mapping[str, Any]) -> bool:
    """Whether a term scatters light about evenly; see `Term.scatters_diffusely`."""
    return TERMS[term_document["model"]].scatters_diffusely


def pack_reflectance(terms: Sequence[Mapping[str, Any]], normals: NormalMap | None = None) -> bytes:
    """What a material sends on: the sum of its terms without a texture, and of those with each of `TEXTURES`; the
    images that its look names in their place; its mirrors; what few functions do not tell of it; and how it leans.

    Args:
        terms: of a complete look. normals: the image that it names in the place of the material's normal map.
    Returns:
        What `unpack_reflectance`, `unpack_images`, `unpack_mirrors`, `unpack_lobes` and `unpack_normal_map` read.
    """
    return _reflectances(json.dumps([{**term} for term in terms], sort_keys=True), normals)


@lru_cache(maxsize=256)
def _reflectances(terms_text: str, normals: NormalMap | None) -> bytes:
    total = np.zeros((1 + len(TEXTURES), 3, len(PAIRS)))
    terms = json.loads(terms_text)
    highlights = [term for term in terms if not scatters_diffusely(term)]
    lobes = narrow_lobes(highlights)
    for term in filter(scatters_diffusely, terms):
        total[texture_slot(term)] += reflectance_matrix(term)
    for term in lobes or highlights:
        total[texture_slot(term)] += quantized_reflectance(term)
    image_names = [name or "" for name in user_images(terms)]
    mirrors = [_quantize_parameters(term) for term in highlights if specular_albedo(term).any()]
    return total.astype(np.float32).tobytes() + _pack_text(image_names, mirrors, lobes, list(normals or ()))


def _pack_text(*sections: Sequence[Any]) -> bytes:
    """What is known beside numbers: names of images, then all else, where there is anything."""
    image_names, *extras = sections
    return " ".join([*image_names, json.dumps(extras, sort_keys=True)] if any(extras) else image_names).encode()


def quantized_reflectance(term: Mapping[str, Any]) -> F64:
    """F of a highlight as it counts: else all light would be made anew with each step of a hand. (3, pairs)"""
    return np.asarray(np.round(reflectance_matrix(term) * _STEPS) / _STEPS)


def narrow_lobes(highlights: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """All highlights of a material, where few functions do not tell one of them that sends much.

    Their numbers have steps of 1 %; curves that are drawn are as they are.

    Args:
        highlights: terms of a complete look.
    Returns:
        Their documents, for `relume.brdf.highlight_tables`; none where functions are enough.
    """
    if any(map(_is_textured, highlights)) or not any(map(_is_narrow, highlights)):
        return []
    return [_quantize_parameters(term) for term in highlights]


def _is_textured(term: Mapping[str, Any]) -> bool:
    """Whether texels cover a term: what it sends is their mean, which few functions tell."""
    return TERMS[term["model"]].normalized(term).texels is not None


def _is_narrow(term: Mapping[str, Any]) -> bool:
    """Whether a highlight sends much, and not as few functions do."""
    matrix = reflectance_matrix(term).max(axis=0)
    return bool(matrix[0] > _MIN_REFLECTANCE and matrix[_LAST_PAIR] > _MIN_RESIDUAL_RATIO * matrix[0])


def _quantize_parameters(term: Mapping[str, Any]) -> dict[str, Any]:
    """A term whose numbers are whole powers of 2^(1/64): a hand that hardly moves makes no light anew."""

    def rounded(value: Any) -> Any:
        if isinstance(value, list):
            return [rounded(item) for item in value]
        return float(2 ** (round(np.log2(value) * _STEPS_PER_OCTAVE) / _STEPS_PER_OCTAVE)) if value > 0 else value

    params = {name: rounded(value) for name, value in (term.get("params") or {}).items()}
    return {**term, "color": rounded(list(term["color"])), "params": params}


def unpack_reflectance(packed_material: bytes) -> F32:
    """F of a material's terms without a texture, then of those with each of `TEXTURES`. (3, channels, pairs) float32"""
    return np.frombuffer(packed_material[:_REFLECTANCE_BYTES], np.float32).reshape(1 + len(TEXTURES), 3, len(PAIRS))


def unpack_images(packed_material: bytes) -> Images:
    """What a look names in the place of each of a material's `TEXTURES`. of_material: from `pack_reflectance`"""
    (diffuse, specular), *_ = _unpack_text(packed_material)
    return diffuse or None, specular or None


def unpack_mirrors(packed_material: bytes) -> list[dict[str, Any]]:
    """The terms of a material that are mirrors, in part at least, and flat. of_material: from `pack_reflectance`"""
    _, mirrors, _, normals = _unpack_text(packed_material)
    return [] if normals else mirrors


def unpack_lobes(packed_material: bytes) -> list[dict[str, Any]]:
    """The highlights of a material that few functions do not tell; see `narrow_lobes`. of_material: likewise"""
    return _unpack_text(packed_material)[2]


def unpack_normal_map(packed_material: bytes) -> NormalMap | None:
    """What a look names in the place of a material's normal map. of_material: likewise"""
    normal_map = _unpack_text(packed_material)[3]
    return NormalMap(*normal_map) if normal_map else None


def drop_normal_map(packed_material: bytes) -> bytes:
    """The same of a material that leans as it was baked. of_material: likewise"""
    image_names, mirrors, lobes, normals = _unpack_text(packed_material)
    return (
        packed_material[:_REFLECTANCE_BYTES] + _pack_text(image_names, mirrors, lobes, [])
        if normals
        else packed_material
    )


def _unpack_text(packed_material: bytes) -> tuple[list[str], list[dict[str, Any]], list[dict[str, Any]], list[Any]]:
    """What `_text` wrote."""
    diffuse, specular, *extras = packed_material[_REFLECTANCE_BYTES:].decode().split(" ", 2)
    mirrors, lobes, normals = json.loads(extras[0]) if extras else ([], [], [])
    return [diffuse, specular], mirrors, lobes, normals


def reflectance(term_document: Mapping[str, Any]) -> F64:
    """ρ = F_00 of a term, its colour included, its texture not. (3,), not negative"""
    return reflectance_matrix(term_document)[:, 0]


def reflectance_matrix(term_document: Mapping[str, Any]) -> F64:
    """F of a term, its colour included, its texture not; of a diffuse term F_00 alone.

    Args:
        term_document: one term of a complete look.
    Returns:
        (channels, pairs)
    """
    white_matrix = (_diffuse_matrix if scatters_diffusely(term_document) else _lobe_matrix)(
        white_material_key(term_document)
    )
    return white_matrix * np.asarray(term_document["color"], np.float64)[:, None]


def white_material_key(term_document: Mapping[str, Any]) -> str:
    """The text of a term whose colour is white: the colour multiplies what is found of it."""
    return json.dumps({**term_document, "color": [1.0, 1.0, 1.0]}, sort_keys=True)


@lru_cache(maxsize=1024)
def _lobe_matrix(term_text: str) -> F64:
    """As `_diffuse_matrix`, of a term with a lobe about the mirror direction, where ωi are dense too. (3, pairs)"""
    points, projected = _mirror_quadrature(), _project_incident(term_text)
    products = np.tensordot(points.h_o, projected, axes=(0, 0))  # (rungs, 3, rungs)
    rows, columns = np.array(PAIRS).T
    return np.asarray(products[rows, :, columns].T)


@lru_cache(maxsize=256)
def _project_incident(term_text: str) -> F64:
    """What each function of ωi sends towards each ωo, weighed as `_QuadraturePoints`. (o, 3, rungs)"""
    document, points = json.loads(term_text), _mirror_quadrature()
    if is_isotropic(document):
        value = _quadrature().values(document)
    else:
        rotated = [eval_brdf(document, points.wi @ rotation.T, points.wo @ rotation.T) for rotation in _ROTATIONS]
        value = np.moveaxis(np.mean(rotated, axis=0), -1, 0)
    projected = np.moveaxis((value[..., None, :] @ points.h_i)[..., 0, :], 0, 1)
    return np.broadcast_to(projected, (_NUM_OUT, 3, projected.shape[-1]))


@lru_cache(maxsize=1)
def _quadrature() -> Quadrature:
    return Quadrature(_mirror_quadrature().wi, _mirror_quadrature().wo)


def directional_albedo(terms: Sequence[Mapping[str, Any]]) -> tuple[F64, F64]:
    """What share of even light a material sends towards each θo, its textures white, the mean over turns:

        a(θo) = ∫ f(ωi, ωo) cos θi dωi

    Args:
        terms: of a complete look.
    Returns:
        θo in radians, rising, (o,), and a there, (o, 3).
    """
    points, total = _mirror_quadrature(), np.zeros((_NUM_OUT, 3))
    for term in terms:
        # the first function is the constant 1 / √π
        outgoing = np.sqrt(np.pi) * _project_incident(white_material_key(term))[..., 0]
        total += outgoing / points.weight_o[:, None] * np.asarray(term["color"], np.float64)
    return np.arccos(points.wo[::-1, 0, 2]), total[::-1]


class _QuadraturePoints(NamedTuple):
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
def _mirror_quadrature() -> _QuadraturePoints:
    """Spread ωi about the mirror directions of a few ωo.

    With θr the angle from there, θr = π u³ and dωi = 3π u² sin θr du dφr; below the horizon there is nothing.
    """
    cos_o, weight_o = _gauss(_NUM_OUT)
    u, weight_u = _gauss(_NUM_RADII)
    theta, phi = np.pi * u**3, np.pi * (np.arange(_NUM_AROUND) + 0.5) / _NUM_AROUND
    solid_angle = np.repeat(weight_u * 3 * np.pi * u**2 * np.sin(theta), len(phi)) * (2 * np.pi / len(phi))
    x, y = (np.outer(np.sin(theta), function(phi)).ravel() for function in (np.cos, np.sin))
    z = np.repeat(np.cos(theta), len(phi))
    sine = np.sqrt(1 - cos_o**2)
    along, above = x * cos_o[:, None] - z * sine[:, None], x * sine[:, None] + z * cos_o[:, None]
    wi = np.stack([along, np.broadcast_to(y, above.shape), np.maximum(above, 0)], axis=-1)
    wo = np.stack([sine, 0 * sine, cos_o], axis=-1)[:, None]
    weight = (weight_o * cos_o)[:, None] * solid_angle * np.maximum(above, 0)
    table = recurrence(OUTGOING_DEGREE)
    azimuth_norm = np.where(table.order > 0, np.pi, 2 * np.pi)
    h_i, h_o = weight[..., None] * project(wi)[..., table.cosine], azimuth_norm * project(wo[:, 0])[:, table.cosine]
    return _QuadraturePoints(wi, wo, h_i, h_o, weight_o * cos_o)


def _gauss(num: int) -> tuple[F64, F64]:
    """Find the places and weights of Gauss and Legendre over [0, 1]. (num,) each"""
    nodes, weights = np.polynomial.legendre.leggauss(num)
    return (nodes + 1) / 2, weights / 2


_ROTATIONS = [rotational_symmetry(np.pi * (k + 0.5) / 4) for k in range(4)]  # of a term that looks different from there


@lru_cache(maxsize=1024)
def _diffuse_matrix(term_text: str) -> F64:
    """By Gauss–Legendre quadrature over cosines; diffuse terms are smooth, or steps of hand-drawn bands. (3, pairs)"""
    cosine, weight = _gauss(_NUM_COSINES)
    cosine_weight = weight * cosine
    sine = np.sqrt(1 - cosine**2)
    phi = np.pi * (np.arange(_NUM_AZIMUTHS) + 0.5) / _NUM_AZIMUTHS  # terms are symmetric about the plane of wo
    components = sine[:, None] * np.cos(phi), sine[:, None] * np.sin(phi), np.tile(cosine[:, None], _NUM_AZIMUTHS)
    wi = np.stack(components, axis=-1)[None]
    wo = np.stack([sine, 0 * sine, cosine], axis=-1)[:, None, None]
    over_azimuths = eval_brdf(json.loads(term_text), wi, wo).mean(axis=2)
    out = np.zeros((3, len(PAIRS)))
    # 2π for the azimuths of each direction, over π
    out[:, 0] = 4 * np.pi * np.einsum("o,i,oic->c", cosine_weight, cosine_weight, over_azimuths)
    return out
