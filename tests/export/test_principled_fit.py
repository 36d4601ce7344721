"""Fits of terms by a principled surface: imported terms are read exactly, others fitted with their error."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from export_scenes import METAL, PLASTIC, terms_of

from relume.brdf.term_validation import complete_term
from relume.export.principled_fit import EXACT, fit_principled
from relume.export.surface_values import direction_pairs, surface_values, term_values
from relume.scene_io.surfaces.to_terms import CoatLayer, PbrSurface

COATS = {
    "bare": CoatLayer(),
    "coat": CoatLayer(coat=0.7, coat_roughness=0.1),
    "sheen": CoatLayer(sheen=(0.2, 0.4, 0.1), sheen_roughness=0.4),
    "coat over sheen": CoatLayer(coat=0.5, coat_roughness=0.2, sheen=(0.2, 0.4, 0.1), sheen_roughness=0.4),
}
LAMBERT = {"model": "lambert", "color": [0.5, 0.3, 0.1]}


def complete(*terms: Any) -> list[dict[str, Any]]:
    return [complete_term(("terms", k), term, None) for k, term in enumerate(terms)]


@pytest.mark.parametrize("coat", COATS.values(), ids=COATS)
@pytest.mark.parametrize("surface", [PLASTIC, METAL], ids=["plastic", "metal"])
def test_imported_terms_are_read(surface: PbrSurface, coat: CoatLayer) -> None:
    fit = fit_principled(complete(*terms_of(surface, coat)))
    assert fit.error < EXACT
    assert fit.surface.diffuse == pytest.approx(surface.diffuse * (1 - surface.specular_reflectance), abs=1e-5)
    assert fit.surface.f0 == pytest.approx(surface.f0, abs=1e-5)
    assert (fit.surface.f90, fit.surface.roughness) == pytest.approx((surface.f90, surface.roughness), abs=1e-5)
    assert (fit.coat.coat, fit.coat.coat_roughness) == pytest.approx((coat.coat, coat.coat_roughness), abs=1e-5)
    assert (*fit.coat.sheen, fit.coat.sheen_roughness) == pytest.approx((*coat.sheen, coat.sheen_roughness), abs=1e-5)


@pytest.mark.parametrize("coat", COATS.values(), ids=COATS)
def test_values_of_a_surface_are_those_of_its_terms(coat: CoatLayer) -> None:
    pairs = direction_pairs(is_isotropic=True)
    values = surface_values(PLASTIC, coat, 0.0, pairs)
    assert values == pytest.approx(term_values(terms_of(PLASTIC, coat), pairs), rel=1e-4, abs=1e-6)


def test_the_stand_in_of_an_anisotropic_highlight_is_read_with_its_error() -> None:
    for turned in (False, True):
        (lambert, highlight) = complete(*terms_of(PLASTIC, CoatLayer(anisotropy=0.6)))
        if turned:
            nu, nv = highlight["params"]["nu"], highlight["params"]["nv"]
            highlight["params"] = {**highlight["params"], "nu": nv, "nv": nu}
        fit = fit_principled([lambert, highlight])
        assert (fit.coat.anisotropy, fit.surface.roughness) == pytest.approx((0.6, 0.4), abs=1e-4)
        assert fit.turn == pytest.approx(np.pi / 2 if turned else 0)
        assert 0.2 < fit.error < 0.4


def test_terms_that_sum_to_a_principled_surface_are_fitted_exactly() -> None:
    half = {"model": "lambert", "color": [0.25, 0.15, 0.05]}
    highlight = {"model": "ggx", "color": [1, 1, 1], "params": {"roughness": 0.37, "f0": [0.05, 0.1, 0.2]}}
    fit = fit_principled(complete(half, half, highlight))
    assert fit.surface.roughness == pytest.approx(0.37, abs=0.003)
    assert fit.surface.diffuse == pytest.approx([0.5, 0.3, 0.1], abs=0.002)
    assert fit.surface.f0 == pytest.approx([0.05, 0.1, 0.2], abs=0.002)
    assert fit.error < EXACT


def test_a_drawn_curve_is_fitted() -> None:
    half_strength = {"theta_h": {"factors": [0.5] * 256, "channels": "rgb"}}
    terms = complete(LAMBERT, {"model": "ggx", "color": [1, 1, 1], "params": {"f0": 0.08}, "curves": half_strength})
    fit = fit_principled(terms)
    assert fit.surface.f0 == pytest.approx([0.04] * 3, abs=0.001)
    assert fit.surface.f90 == pytest.approx(0.5, abs=0.02)
    assert fit.error < EXACT


@pytest.mark.parametrize(
    ("model", "error"),
    [("oren_nayar", 0.17), ("ward", 0.36), ("cook_torrance", 0.21), ("schlick", 0.22), ("beard_maxwell", 0.15)],
)
def test_other_models_are_fitted_with_a_known_error(model: str, error: float) -> None:
    terms = complete(LAMBERT, {"model": model, "color": [0.5, 0.5, 0.5]})
    fit = fit_principled(terms)
    assert EXACT < fit.error < error
    pairs = direction_pairs(is_isotropic=True)
    values = surface_values(fit.surface, fit.coat, fit.turn, pairs)
    assert pairs.relative_error(values, term_values(terms, pairs)) == pytest.approx(fit.error, rel=1e-6)


def test_an_anisotropic_model_gets_an_anisotropic_highlight() -> None:
    terms = complete({"model": "ward_anisotropic", "color": [0.5] * 3, "params": {"alpha_x": 0.1, "alpha_y": 0.4}})
    fit = fit_principled(terms)
    assert fit.coat.anisotropy > 0.3
    assert fit.turn == pytest.approx(np.pi / 2)


def test_no_terms_are_black() -> None:
    fit = fit_principled([])
    assert fit.error == 0
    assert (fit.surface.diffuse.max(), fit.surface.f90) == (0, 0)
