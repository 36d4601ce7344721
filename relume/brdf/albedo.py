"""Reflectance of materials in the hemispherical basis, for indirect light.

    L_j = Σ_k F_jk t_k,   F_jk = ∫∫ f(ωi, ωo) h_j(ωo) h_k(ωi) cos θi cos θo dωi dωo

with one basis h for both sides (`relume.math.zernike`; Mahajan 2008, section 3, projects its out-going factors again).
F_00 is the reflectance ρ for diffuse light. An isotropic term mixes only functions of one order m, with equal weights
for their cosine and sine parts; for other terms F is the mean over rotations about the normal.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.evaluate import eval_brdf
from relume.brdf.frozen_term import FrozenTerm
from relume.brdf.quadrature import Quadrature
from relume.brdf.registry import TERMS
from relume.brdf.specular import specular_albedo
from relume.brdf.symmetry import is_isotropic, rotational_symmetry
from relume.brdf.texture_slots import TEXTURES, Images, NormalMap, texture_slot, user_images
from relume.core.digest import digest
from relume.math.uv_transform import UvTransform
from relume.math.zernike import OUTGOING_DEGREE, basis_functions, recurrence

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]


def _pairs() -> tuple[tuple[int, int], ...]:
    order = recurrence(OUTGOING_DEGREE).order
    return tuple((j, k) for j in range(len(order)) for k in range(j, len(order)) if order[j] == order[k])


PAIRS = _pairs()
"""Rows j ≤ k of the recurrence table with equal order: the entries of F that are stored; the first is F_00."""

_NUM_COSINES, _NUM_AZIMUTHS = 24, 24
_NUM_OUT, _NUM_RADII, _NUM_AROUND = 10, 32, 12
_STEPS = 128  # quantization steps of a highlight's F, from 0 to 1
_STEPS_PER_OCTAVE = 64  # quantization steps per octave of a sharp highlight's parameters
# least F_00 of a highlight that matters; least F_66 / F_00 of a highlight that the basis does not represent
_MIN_REFLECTANCE, _MIN_RESIDUAL_RATIO = 0.15, 0.03
_LAST_PAIR = PAIRS.index((OUTGOING_DEGREE // 2, OUTGOING_DEGREE // 2))  # both of the highest degree, of order 0


def scatters_diffusely(term_document: Mapping[str, Any]) -> bool:
    """True if a term is nearly diffuse; see `Term.scatters_diffusely`."""
    return TERMS[term_document["model"]].scatters_diffusely


Documents = tuple[Mapping[str, Any], ...]
"""Terms of a complete look."""


@dataclass(frozen=True)
class Reflectance:
    """Reflectance of a material for indirect light; hashable, because every frame compares lights.

    Attributes:
        matrix: F of the terms without a texture, then of those with each of `TEXTURES`.
        images: that a look uses instead of each of the material's `TEXTURES`.
        mirrors: terms that are at least partly mirrors. lobes: highlights that the basis does not represent.
        normals: the image that a look uses instead of the material's normal map.
        uv: transform of the texture coordinates of `images`.
        digest: of all others; two materials with equal digests are equal.
    """

    matrix: Shaped[F32, "slots 3 pairs"] = field(compare=False, repr=False)
    images: Images = field(compare=False, repr=False)
    mirrors: Documents = field(compare=False, repr=False)
    lobes: Documents = field(compare=False, repr=False)
    normals: NormalMap | None = field(compare=False, repr=False)
    uv: UvTransform | None = field(compare=False, repr=False)
    digest: str = field(init=False)

    def __post_init__(self) -> None:
        content = self.matrix.tobytes(), self.images, self.mirrors, self.lobes, self.normals, self.uv
        object.__setattr__(self, "digest", digest(content))

    @property
    def planar_mirrors(self) -> Documents:
        """Terms that mirror like planes: none with a normal map."""
        return () if self.normals else self.mirrors

    def with_baked_normals(self) -> Reflectance:
        """Return the same without the look's normal map."""
        return replace(self, normals=None) if self.normals else self


def max_albedo_change(before: Sequence[Reflectance], after: Sequence[Reflectance]) -> float:
    """Return the greatest change of an albedo between two looks, over materials, slots and channels.

    The albedo is ∫∫ f cos θi cos θo dωi dωo / π, one for a white diffuse surface.

    Args:
        before, after: one per material of the same scene.
    """
    changes = (abs(b.matrix[..., 0] - a.matrix[..., 0]).max() for b, a in zip(before, after, strict=True))
    return float(max(changes, default=0.0)) / _white_albedo()


Reflectances = tuple[Reflectance, ...]
"""One per material."""


def material_reflectance(
    terms: Sequence[Mapping[str, Any]], normals: NormalMap | None = None, uv: UvTransform | None = None
) -> Reflectance:
    """Return the reflectance of a material, summed over its terms.

    Args:
        terms: of a complete look. normals: the image that the look uses instead of the material's normal map.
        uv: transform of texture coordinates; None for the identity.
    """
    images = user_images(terms)
    return _sum_reflectance(tuple(map(FrozenTerm.from_document, terms)), normals, uv if any(images) else None)


@lru_cache(maxsize=1)
def _white_albedo() -> float:
    """First entry of F for a white diffuse term."""
    white: dict[str, Any] = {"model": "lambert", "color": [1.0] * 3, "params": {}, "curves": {}, "texture": None}
    return float(reflectance_matrix(white)[0, 0])


@lru_cache(maxsize=256)
def _sum_reflectance(
    frozen_terms: tuple[FrozenTerm, ...], normals: NormalMap | None, uv: UvTransform | None
) -> Reflectance:
    total, terms = np.zeros((1 + len(TEXTURES), 3, len(PAIRS))), [term.document for term in frozen_terms]
    highlights = [term for term in terms if not scatters_diffusely(term)]
    lobes = narrow_lobes(highlights)
    for term in filter(scatters_diffusely, terms):
        total[texture_slot(term)] += reflectance_matrix(term)
    for term in lobes or highlights:
        total[texture_slot(term)] += quantized_reflectance(term)
    mirrors = [_quantize_parameters(term) for term in highlights if specular_albedo(term).any()]
    return Reflectance(total.astype(np.float32), user_images(terms), tuple(mirrors), tuple(lobes), normals, uv)


def quantized_reflectance(term: Mapping[str, Any]) -> Shaped[F64, "3 pairs"]:
    """F of a highlight in coarse steps, so that not every small edit of a slider recomputes all indirect light."""
    return np.asarray(np.round(reflectance_matrix(term) * _STEPS) / _STEPS)


def narrow_lobes(highlights: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """All highlights of a material, if the basis does not represent a significant one.

    Their parameters are quantized in steps of 1 %; drawn curves are not.

    Args:
        highlights: terms of a complete look.
    Returns:
        Documents of the highlights, for `relume.brdf.highlight_tables`; empty if the basis suffices.
    """
    if any(map(_is_textured, highlights)) or not any(map(_is_narrow, highlights)):
        return []
    return [_quantize_parameters(term) for term in highlights]


def _is_textured(term: Mapping[str, Any]) -> bool:
    """True if the term is a BTF: its mean over texels is represented well by the basis."""
    return TERMS[term["model"]].normalized(term).texels is not None


def _is_narrow(term: Mapping[str, Any]) -> bool:
    """True if a highlight is significant and not represented by the basis."""
    matrix = reflectance_matrix(term).max(axis=0)
    return bool(matrix[0] > _MIN_REFLECTANCE and matrix[_LAST_PAIR] > _MIN_RESIDUAL_RATIO * matrix[0])


def _quantize_parameters(term: Mapping[str, Any]) -> dict[str, Any]:
    """Round a term's numbers to powers of 2^(1/64), so that tiny edits recompute no light."""

    def rounded(value: Any) -> Any:
        if isinstance(value, list | tuple):
            return [rounded(item) for item in value]
        return float(2 ** (round(np.log2(value) * _STEPS_PER_OCTAVE) / _STEPS_PER_OCTAVE)) if value > 0 else value

    params = {name: rounded(value) for name, value in (term.get("params") or {}).items()}
    return {**term, "color": rounded(list(term["color"])), "params": params}


def reflectance(term_document: Mapping[str, Any]) -> Shaped[F64, " 3"]:
    """Reflectance ρ = F_00 ≥ 0 of a term, with its color but without its texture."""
    return reflectance_matrix(term_document)[:, 0]


def reflectance_matrix(term_document: Mapping[str, Any]) -> Shaped[F64, "3 pairs"]:
    """F of a term of a complete look, with its color but without its texture; F_00 alone for a diffuse term."""
    compute = _diffuse_matrix if scatters_diffusely(term_document) else _lobe_matrix
    return compute(white_term(term_document)) * np.asarray(term_document["color"], np.float64)[:, None]


def white_term(term_document: Mapping[str, Any]) -> FrozenTerm:
    """Return a term with a white color, by which results are cached that are scaled by the color later."""
    return FrozenTerm.from_document(term_document, color=[1.0, 1.0, 1.0])


@lru_cache(maxsize=1024)
def _lobe_matrix(term: FrozenTerm) -> F64:
    """F of a term with a lobe: like `_diffuse_matrix`, with ωi concentrated around the mirror direction. (3, pairs)"""
    points, projected = _mirror_quadrature(), _project_incident(term)
    products = np.tensordot(points.h_o, projected, axes=(0, 0))  # (rows, 3, rows)
    rows, columns = np.array(PAIRS).T
    return np.asarray(products[rows, :, columns].T)


@lru_cache(maxsize=256)
def _project_incident(term: FrozenTerm) -> F64:
    """Radiance toward each ωo for light in each basis function, weighted as `_QuadraturePoints`. (o, 3, rows)"""
    document, points = term.document, _mirror_quadrature()
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


def directional_albedo(terms: Sequence[Mapping[str, Any]]) -> tuple[Shaped[F64, " n"], Shaped[F64, "n 3"]]:
    """Directional albedo of a material with white textures, the mean over rotations about the normal:

        a(θo) = ∫ f(ωi, ωo) cos θi dωi

    Args:
        terms: terms of a complete look.
    Returns:
        θo in radians, ascending, and a(θo).
    """
    points, total = _mirror_quadrature(), np.zeros((_NUM_OUT, 3))
    for term in terms:
        # the first function is the constant 1 / √π
        outgoing = np.sqrt(np.pi) * _project_incident(white_term(term))[..., 0]
        total += outgoing / points.weight_o[:, None] * np.asarray(term["color"], np.float64)
    return np.arccos(points.wo[::-1, 0, 2]), total[::-1]


class _QuadraturePoints(NamedTuple):
    """Quadrature points and weights, the same for all terms.

    Attributes:
        wi, wo: local directions. (o, n, 3), (o, 1, 3)
        h_i: weighted basis functions at ωi. (o, n, rows). h_o: basis functions at ωo, times ∫ cos² mφ dφ. (o, rows)
        weight_o: weights of ωo with the cosine; h_i contains them. (o,)
    """

    wi: F64
    wo: F64
    h_i: F64
    h_o: F64
    weight_o: F64


@lru_cache(maxsize=1)
def _mirror_quadrature() -> _QuadraturePoints:
    """Distribute ωi around the mirror directions of a few ωo.

    With θr the angle from the mirror direction, θr = π u³ and dωi = 3π u² sin θr du dφr; the weight is zero below the
    horizon.
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
    h_i, h_o = (
        weight[..., None] * basis_functions(wi)[..., table.cosine],
        azimuth_norm * basis_functions(wo[:, 0])[:, table.cosine],
    )
    return _QuadraturePoints(wi, wo, h_i, h_o, weight_o * cos_o)


def _gauss(num: int) -> tuple[F64, F64]:
    """Nodes and weights of Gauss-Legendre quadrature over [0, 1]. (num,) each"""
    nodes, weights = np.polynomial.legendre.leggauss(num)
    return (nodes + 1) / 2, weights / 2


_ROTATIONS = [rotational_symmetry(np.pi * (k + 0.5) / 4) for k in range(4)]  # for anisotropic terms


@lru_cache(maxsize=1024)
def _diffuse_matrix(term: FrozenTerm) -> F64:
    """F by Gauss-Legendre quadrature over cosines; diffuse terms are smooth, or steps of drawn bands. (3, pairs)"""
    cosine, weight = _gauss(_NUM_COSINES)
    cosine_weight = weight * cosine
    sine = np.sqrt(1 - cosine**2)
    phi = np.pi * (np.arange(_NUM_AZIMUTHS) + 0.5) / _NUM_AZIMUTHS  # terms are symmetric about the plane of wo
    components = sine[:, None] * np.cos(phi), sine[:, None] * np.sin(phi), np.tile(cosine[:, None], _NUM_AZIMUTHS)
    wi = np.stack(components, axis=-1)[None]
    wo = np.stack([sine, 0 * sine, cosine], axis=-1)[:, None, None]
    over_azimuths = eval_brdf(term.document, wi, wo).mean(axis=2)
    out = np.zeros((3, len(PAIRS)))
    # 2π for the azimuths of each direction, divided by π
    out[:, 0] = 4 * np.pi * np.einsum("o,i,oic->c", cosine_weight, cosine_weight, over_azimuths)
    return out
