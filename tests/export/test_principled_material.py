"""Principled parameters and terms: one is read from the other, and imports make the same terms."""

from __future__ import annotations

from dataclasses import asdict, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from glb_builder import Glb

from relume.brdf.term_validation import complete_term
from relume.core.errors import ParameterError
from relume.export.principled_material import (
    EXACT,
    PrincipledMaterial,
    complete_parameters,
    principled_terms,
    read_principled,
    texture_means,
)
from relume.scene.model import Material, Texture
from relume.scene_io.import_scene import import_scene

BROWN = (0.7, 0.3, 0.1)
COAT = {"coat_weight": 0.6, "coat_roughness": 0.2}
SHEEN = {"sheen_weight": 0.5, "sheen_color": (1.0, 0.5, 0.2), "sheen_roughness": 0.4}
GLASS = {"color": [1.0, 1.0, 1.0], "roughness": 0.0, "ior": 1.5}


def complete(*terms: Any) -> list[dict[str, Any]]:
    return [complete_term(("terms", k), term, None) for k, term in enumerate(terms)]


def assert_same(actual: PrincipledMaterial, expected: PrincipledMaterial) -> None:
    for name, value in asdict(expected).items():
        assert getattr(actual, name) == pytest.approx(value, abs=2e-4), name


@pytest.mark.parametrize("layers", [{}, COAT, SHEEN, {**COAT, **SHEEN}], ids=["bare", "coat", "sheen", "both"])
def test_parameters_are_read_from_their_terms(layers: dict[str, Any]) -> None:
    dielectrics = [
        PrincipledMaterial(BROWN, metallic, 0.3, specular, ior=ior, **layers)
        for metallic, specular, ior in product([0.0, 0.4], [0.3, 1.0], [1.3, 2.0])
    ]
    grays = [PrincipledMaterial((gray,) * 3, 0.0, 0.01, **layers) for gray in (0.0, 0.5)]
    metals = [PrincipledMaterial(base, 1.0, 1.0, **layers) for base in (BROWN, (0.9, 0.9, 0.9))]
    for expected in dielectrics + grays + metals:
        terms, glass = principled_terms(expected, [])
        reading = read_principled(terms)
        assert (reading.reason, glass) == (None, None)
        assert reading.error < EXACT
        assert_same(reading.parameters, expected)


def test_a_specular_color_and_an_anisotropic_highlight_are_read() -> None:
    for change in ({"specular_color": (1.0, 0.6, 0.3), "base_color": (0.5, 0.5, 0.5)}, {"anisotropy": 0.6}):
        expected = replace(PrincipledMaterial(BROWN, 0.0, 0.4), **change)
        reading = read_principled(principled_terms(expected, [])[0])
        assert reading.reason is None
        made = principled_terms(reading.parameters, [])[0]
        assert made[0]["color"] == pytest.approx(principled_terms(expected, [])[0][0]["color"], abs=1e-5)
        assert reading.parameters.anisotropy == pytest.approx(expected.anisotropy, abs=1e-4)


def test_a_gray_blend_has_the_same_terms_again() -> None:
    """Other parameters make the same terms, so those that are read need not be the ones that made them."""
    terms, _ = principled_terms(PrincipledMaterial((0.5, 0.5, 0.5), 0.3, 0.4), [])
    reading = read_principled(terms)
    assert reading.reason is None
    assert reading.terms[0]["color"] == pytest.approx(terms[0]["color"], abs=1e-5)
    assert reading.terms[1]["params"]["f0"] == pytest.approx(terms[1]["params"]["f0"], abs=1e-5)


def test_terms_are_those_of_an_import(tmp_path: Path) -> None:
    """The view's material and the same one of a glTF file have equal terms, and so equal images."""
    material = {
        "name": "Car",
        "pbrMetallicRoughness": {"baseColorFactor": [*BROWN, 1], "metallicFactor": 0.4, "roughnessFactor": 0.3},
        "extensions": {
            "KHR_materials_ior": {"ior": 1.7},
            "KHR_materials_specular": {"specularFactor": 0.8},
            "KHR_materials_clearcoat": {"clearcoatFactor": 0.6, "clearcoatRoughnessFactor": 0.2},
            "KHR_materials_sheen": {"sheenColorFactor": [0.5, 0.25, 0.1], "sheenRoughnessFactor": 0.4},
        },
    }
    path = tmp_path / "car.glb"
    path.write_bytes(Glb().quad(material).bytes())
    parameters = PrincipledMaterial(BROWN, 0.4, 0.3, 0.8, ior=1.7, **COAT, **SHEEN)
    imported = complete(*import_scene(path, "car.glb").materials[0].terms)
    assert principled_terms(parameters, imported)[0] == imported
    assert_same(read_principled(imported).parameters, parameters)


def test_glass_follows_the_parameters() -> None:
    expected = PrincipledMaterial((0.9, 0.5, 0.5), 0.0, 0.2, ior=1.4, transmission=0.75)
    terms, glass = principled_terms(expected, [], {**GLASS, "absorption": [1.0, 2.0, 3.0]})
    assert glass is not None
    assert glass["color"] == pytest.approx([0.675, 0.375, 0.375])
    assert (glass["roughness"], glass["ior"], glass["absorption"]) == (0.2, 1.4, [1.0, 2.0, 3.0])
    assert_same(read_principled(terms, glass).parameters, expected)
    reading = read_principled(terms, {**glass, "roughness": 0.5})
    assert reading.reason == "Its glass has another roughness than its highlight."
    assert principled_terms(expected, [])[0][0]["color"] != terms[0]["color"]  # opaque: nothing is transmitted
    assert principled_terms(replace(expected, transmission=0), terms, glass)[1] == {**glass, "color": [0, 0, 0]}


def test_textures_stay_and_parameters_are_those_at_their_mean() -> None:
    half = Texture(np.full((2, 2, 3), 0.5, np.float32))
    black = Texture(np.zeros((2, 2, 3), np.float32))
    texture = {"texture": "diffuse"}
    plastic = complete(
        {"model": "lambert", "color": [0.6, 0.4, 0.2], **texture},
        {
            "model": "ggx",
            "color": [1, 1, 1],
            "params": {"roughness": 0.3},
            "texture": None,
            "roughness_map": "roughness",
        },
    )
    means = texture_means(Material("a", (), {"diffuse": half}), plastic)
    reading = read_principled(plastic, None, means)
    assert reading.reason is None
    reflectance = 0.04 + 0.96 * 0.0036845
    assert reading.parameters.base_color == pytest.approx(np.array([0.3, 0.2, 0.1]) / (1 - reflectance), abs=1e-5)
    doubled = replace(reading.parameters, base_color=tuple(2 * c for c in reading.parameters.base_color))
    made, _ = principled_terms(doubled, plastic, None, means)
    assert made[0]["color"] == pytest.approx([1.2, 0.8, 0.4], abs=1e-5)
    assert (made[0]["texture"], made[1]["roughness_map"]) == ("diffuse", "roughness")
    metal = complete(
        {"model": "lambert", "color": [1, 1, 1], **texture},
        {"model": "ggx", "color": [1, 1, 1], "params": {"f0": [0.9, 0.6, 0.3]}, "texture": "specular"},
    )
    means = texture_means(Material("a", (), {"diffuse": black, "specular": half}), metal)
    assert means == ((0.0, 0.0, 0.0), (0.5, 0.5, 0.5))
    reading = read_principled(metal, None, (means[0], (1.0, 1.0, 1.0)))
    assert (reading.reason, reading.parameters.metallic) == (None, 1.0)
    assert reading.parameters.base_color == pytest.approx((0.9, 0.6, 0.3))


@pytest.mark.parametrize(
    ("terms", "reason"),
    [
        ([{"model": "blinn_phong", "color": [0.5, 0.5, 0.5]}], "It has layers of other models."),
        (
            [{"model": "lambert", "curves": {"theta_i": {"points": [[0, 1], [90, 0]]}}}],
            "It has curves drawn by hand.",
        ),
        ([{"model": "lambert", "color": [2.0, 2.0, 2.0], "texture": None}], "Its layers are combined in another way."),
    ],
)
def test_other_terms_have_a_reason_and_a_closest_material(terms: list[dict[str, Any]], reason: str) -> None:
    reading = read_principled(complete(*terms))
    assert reading.reason == reason
    assert 0.01 < reading.error < 1
    again = read_principled(reading.terms)
    assert (again.reason, again.error < EXACT) == (None, True)


def test_invalid_parameters_are_rejected() -> None:
    assert complete_parameters(("p",), {"base_color": [0.1, 0.2, 0.3]}) == PrincipledMaterial((0.1, 0.2, 0.3))
    for given in ({"metal": 1}, {"metallic": 1.5}, {"base_color": 0.5}, {"ior": "1"}, {"roughness": float("nan")}, 3):
        with pytest.raises(ParameterError):
            complete_parameters(("p",), given)
