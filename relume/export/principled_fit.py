"""The principled surface of a material's terms: read from terms that an import makes, otherwise fitted.

The fit minimizes Σ w² |f − g|² over `direction_pairs`. For given widths it is linear in albedo, f0 and f90, which are
bounded by 0 and 1; the widths are searched. Sheen and coat are read from the terms.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray
from scipy.optimize import lsq_linear, minimize_scalar

from relume.brdf.symmetry import is_isotropic
from relume.export.surface_values import (
    DirectionPairs,
    direction_pairs,
    layer_values,
    lobes,
    microfacet_widths,
    surface_values,
    term_values,
)
from relume.scene_io.surfaces.surface_parameters import from_microfacet_widths
from relume.scene_io.surfaces.to_terms import COAT_F0, CoatLayer, PbrSurface

F64 = NDArray[np.float64]
Terms = Sequence[Mapping[str, Any]]

EXACT = 0.005
"""Relative error of terms that an import makes: rounded numbers, and curves in bands."""
_LOG_ROUGHNESS = float(np.log(0.01)), 0.0
_ROUGHNESS = np.exp(np.linspace(*_LOG_ROUGHNESS, 16))
_ANISOTROPY = (0.3, 0.5, 0.7, 0.85, 0.95)
_MAX_STEPS = 12
HIGHLIGHTS = {"ggx", "ashikhmin_shirley"}  # of imports
_COAT_F0_TOLERANCE = 0.005
_GRAY_TOLERANCE = 1e-3


class PrincipledFit(NamedTuple):
    """A surface without textures, and its relative RMS error.

    Attributes:
        surface: its albedo is that of the diffuse layer below the highlight, `specular_reflectance` is 0.
        coat: sheen, coat and anisotropy. turn: radians from the tangent to the direction of the wider highlight.
    """

    surface: PbrSurface
    coat: CoatLayer
    error: float
    turn: float = 0.0


def fit_principled(terms: Terms) -> PrincipledFit:
    """Return the principled surface of terms of a complete look.

    Args:
        terms: at the mean of their textures.
    Raises:
        NotFoundError: measured data of a term do not exist.
    """
    pairs = direction_pairs(is_isotropic=all(map(is_isotropic, terms)))
    target = term_values(terms, pairs)
    read = read_surface(terms)
    if read is not None:
        error = pairs.relative_error(surface_values(read.surface, read.coat, read.turn, pairs), target)
        if error <= EXACT or _is_import_of_anisotropy(terms):
            return read._replace(error=error)
    _, layers = _peel_layers(terms)
    candidates = [_fitted(target, coat, pairs) for coat in dict.fromkeys((layers, CoatLayer()))]
    return min(candidates, key=lambda fit: fit.error)


def surface_error(terms: Terms, fit: PrincipledFit) -> float:
    """Relative RMS error of a surface that replaces terms."""
    pairs = direction_pairs(is_isotropic=fit.coat.anisotropy == 0 and all(map(is_isotropic, terms)))
    return pairs.relative_error(surface_values(fit.surface, fit.coat, fit.turn, pairs), term_values(terms, pairs))


def read_surface(terms: Terms) -> PrincipledFit | None:
    """Invert `make_terms`; None if there are other terms. The error is unknown, 0, and so are drawn curves."""
    base, coat = _peel_layers(terms)
    by_model = {term["model"]: term for term in base}
    highlights = [term for model, term in by_model.items() if model in HIGHLIGHTS]
    if len(by_model) != len(base) or len(highlights) > 1 or by_model.keys() - {"lambert", *HIGHLIGHTS}:
        return None
    diffuse = np.array(by_model["lambert"]["color"], np.float64) if "lambert" in by_model else np.zeros(3)
    surface = PbrSurface(diffuse, np.zeros(3), 0.0, 1.0)
    if not highlights:
        return PrincipledFit(surface, coat, 0.0)
    params, color = highlights[0]["params"], np.array(highlights[0]["color"], np.float64)
    roughness, anisotropy, turn = _roughness(highlights[0]["model"], params)
    f0 = color * np.asarray(params["f0"], np.float64)
    surface = replace(surface, f0=f0, f90=float(color.max()), roughness=roughness)
    return PrincipledFit(surface, replace(coat, anisotropy=anisotropy), 0.0, turn)


def _roughness(model: str, params: Mapping[str, Any]) -> tuple[float, float, float]:
    """Roughness, strength of anisotropy and turn of a highlight; n = 2/α² − 2 of Ashikhmin-Shirley."""
    if model == "ggx":
        return float(np.mean(params["roughness"])), 0.0, 0.0
    x, y = (float(np.sqrt(2 / (np.mean(params[name]) + 2))) for name in ("nu", "nv"))
    return *from_microfacet_widths(max(x, y), min(x, y)), 0.0 if x >= y else np.pi / 2


def _is_import_of_anisotropy(terms: Terms) -> bool:
    """True for the stand-in of an anisotropic highlight: its widths are those of the file that it came from."""
    anisotropic = [term for term in terms if term["model"] == "ashikhmin_shirley"]
    return any(np.mean(term["params"]["nu"]) != np.mean(term["params"]["nv"]) for term in anisotropic)


def _peel_layers(terms: Terms) -> tuple[list[Mapping[str, Any]], CoatLayer]:
    """The terms below sheen and coat, and these two if the terms have them."""
    base, coat = list(terms), CoatLayer()
    below = {term["model"] for term in base[:-1]}
    if below & HIGHLIGHTS and _is_coat(base[-1]):
        layer = base.pop()
        weight, roughness = float(np.mean(layer["color"])), float(np.mean(layer["params"]["roughness"]))
        coat = replace(coat, coat=weight, coat_roughness=roughness)
    if len(base) > 1 and base[-1]["model"] == "sheen" and max(base[-1]["color"]) <= 1:
        layer = base.pop()
        red, green, blue = map(float, layer["color"])
        coat = replace(coat, sheen=(red, green, blue), sheen_roughness=float(layer["params"]["roughness"]))
    return base, coat


def _is_coat(term: Mapping[str, Any]) -> bool:
    """True for a gray, unedited highlight with the reflectance of clear coats."""
    if term["model"] != "ggx" or term.get("curves"):
        return False
    f0, color = np.asarray(term["params"]["f0"], np.float64), np.asarray(term["color"], np.float64)
    is_gray = np.ptp(color) < _GRAY_TOLERANCE and color.max() <= 1 and np.ptp(term["params"]["roughness"]) == 0
    return bool(is_gray and np.abs(f0 - COAT_F0).max() <= _COAT_F0_TOLERANCE)


def _fitted(target: Shaped[F64, "n 3"], coat: CoatLayer, pairs: DirectionPairs) -> PrincipledFit:
    """The best surface below given layers."""
    below, above = layer_values(coat, pairs)
    rest = (target - above) * pairs.weight[:, None]

    def solve(roughness: float, anisotropy: float = 0.0, turn: float = 0.0) -> PrincipledFit:
        widths = microfacet_widths(roughness, anisotropy, turn)
        columns = np.stack(lobes(*widths, pairs), axis=1) * (below * pairs.weight)[:, None]
        surface = _bounded_solution(columns, rest, roughness)
        difference = columns @ np.stack([surface.diffuse, surface.f0, np.full(3, surface.f90)]) - rest
        norm = float(np.linalg.norm(target * pairs.weight[:, None]))
        error = float(np.linalg.norm(difference)) / max(norm, 1e-30)
        return PrincipledFit(surface, replace(coat, anisotropy=anisotropy), error, turn)

    turns = [(0.0, 0.0)]
    if pairs is not direction_pairs(is_isotropic=True):
        turns += [(strength, turn) for strength in _ANISOTROPY for turn in (0.0, np.pi / 2)]
    best = min((solve(r, *each) for r in _ROUGHNESS for each in turns), key=lambda fit: fit.error)
    return _refined(lambda roughness: solve(roughness, best.coat.anisotropy, best.turn), best)


def _refined(solve: Callable[[float], PrincipledFit], start: PrincipledFit) -> PrincipledFit:
    """Search the roughness near a start."""
    center, step = np.log(start.surface.roughness), np.log(_ROUGHNESS[1] / _ROUGHNESS[0])
    bounds = max(center - step, _LOG_ROUGHNESS[0]), min(center + step, _LOG_ROUGHNESS[1])
    options = {"maxiter": _MAX_STEPS}
    result = minimize_scalar(lambda x: solve(np.exp(x)).error, bounds=bounds, method="bounded", options=options)
    return min(start, solve(float(np.exp(result.x))), key=lambda fit: fit.error)


def _bounded_solution(columns: Shaped[F64, "n 3"], rest: Shaped[F64, "n 3"], roughness: float) -> PbrSurface:
    """Albedo and f0 per channel and a common f90 in [0, 1], with f0 ≤ f90, by the normal equations."""
    gram, moments = columns.T @ columns, columns.T @ rest
    matrix, vector = np.zeros((7, 7)), np.zeros(7)
    for channel in range(3):
        unknowns = [channel, 3 + channel, 6]
        matrix[np.ix_(unknowns, unknowns)] += gram
        vector[unknowns] += moments[:, channel]
    matrix += np.eye(7) * (1e-12 * np.trace(matrix) + 1e-30)
    factor = np.linalg.cholesky(matrix)
    x = np.clip(lsq_linear(factor.T, np.linalg.solve(factor, vector), (0, 1), "bvls").x, 0, 1)
    return PbrSurface(x[:3], x[3:6], float(max(x[3:].max(), 0.0)), roughness)
