"""Looks as objects: names, completion, changes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from relume_client import Look
from relume_client.looks import Change

GGX: dict[str, Any] = {"model": "ggx", "color": [1.0, 1.0, 1.0], "params": {"roughness": 0.5, "f0": 0.04}}
LAMBERT: dict[str, Any] = {"model": "lambert", "color": [0.2, 0.4, 0.6], "params": {}}
LIGHT: dict[str, Any] = {"kind": "point", "intensity": 2.0, "position": [0, 1, 0]}


def document() -> dict[str, Any]:
    return {
        "materials": {
            "Teapot": {"terms": [LAMBERT, GGX]},
            "a/b~c": {"terms": [GGX, GGX]},
            "Panel": {"terms": [LAMBERT]},
        },
        "lights": {"Key": LIGHT, "Panel": LIGHT},
        "environment": {"rotation": 0.0, "intensity": 1.0},
    }


@pytest.fixture
def changes() -> list[Change]:
    return []


@pytest.fixture
def look(changes: list[Change]) -> Look:
    return Look(document(), changes.extend)


def test_parameters_colors_and_lights_by_name(look: Look, changes: list[Change]) -> None:
    look["Teapot"].roughness = 0.3
    look["Teapot"].lambert.color = np.array([1, 0.5, 0], np.float32)
    look["Key"].intensity = np.float64(3)
    look.environment.rotation += 90
    look["Teapot"].terms[-1].params["f0"] = 0.1
    assert changes == [
        (("materials", "Teapot", "terms", 1, "params", "roughness"), 0.3),
        (("materials", "Teapot", "terms", 0, "color"), [1.0, 0.5, 0.0]),
        (("lights", "Key", "intensity"), 3.0),
        (("environment", "rotation"), 90.0),
        (("materials", "Teapot", "terms", 1, "params", "f0"), 0.1),
    ]
    assert look["Teapot"].roughness == 0.3
    assert look["Teapot"].lambert.color == (1.0, 0.5, 0.0)
    assert look.materials["Teapot"].terms[1].f0 == 0.1
    assert look.copy().document == look.document


def test_a_copy_and_former_documents_stay(look: Look) -> None:
    copy, before = look.copy(), look.to_document()
    look["Teapot"].roughness = 0.3
    assert copy.document == before == document()
    copy["Teapot"].roughness = 0.1
    assert look["Teapot"].roughness == 0.3


def test_a_term_is_replaced(look: Look) -> None:
    look["Teapot"].terms[1] = LAMBERT
    assert look.document["materials"]["Teapot"]["terms"] == [LAMBERT, LAMBERT]
    look.materials["Panel"].terms = [GGX]
    assert look.materials["Panel"].roughness == 0.5


def test_optional_fields_can_be_set(look: Look) -> None:
    assert look["Teapot"].normal_map is None
    look["Teapot"].shadow_catcher = True
    look["Teapot"].ggx.roughness_map = "image:0123"
    assert look.document["materials"]["Teapot"]["shadow_catcher"] is True
    assert look["Teapot"].ggx.roughness_map == "image:0123"


def test_unknown_names_list_what_there_is(look: Look) -> None:
    with pytest.raises(AttributeError, match=r"/materials/Teapot has no 'rougness'; did you mean 'roughness'\? It"):
        look["Teapot"].rougness = 0.3
    with pytest.raises(KeyError, match="the look has no 'teapot'; did you mean 'Teapot'"):
        look["teapot"]
    with pytest.raises(IndexError):
        look["Teapot"].terms[2]


def test_ambiguous_names_are_refused(look: Look) -> None:
    with pytest.raises(AttributeError, match=r"several terms of 'Teapot' have 'color'; say which by the model"):
        look["Teapot"].color = 1, 1, 1
    with pytest.raises(AttributeError, match=r"terms\[0\] to terms\[1\]"):
        look["a/b~c"].roughness = 0.1
    look["a/b~c"].terms[1].roughness = 0.1
    assert [term.roughness for term in look["a/b~c"].terms] == [0.5, 0.1]
    with pytest.raises(KeyError, match="the look has no 'Panel'"):  # a material and a light
        look["Panel"]


def test_completion_names_materials_terms_and_parameters(look: Look) -> None:
    assert {"Teapot", "Key", "environment", "materials"} <= set(dir(look))
    assert {"lambert", "ggx", "roughness", "f0", "terms", "glass"} <= set(dir(look["Teapot"]))
    assert "a/b~c" in look._ipython_key_completions_()
    assert {"color", "roughness", "model"} <= set(dir(look["Teapot"].ggx))


@pytest.mark.parametrize("value", [np.nan, [1, np.inf, 1], {"a": float("nan")}])
def test_numbers_are_finite(look: Look, value: object, changes: list[Change]) -> None:
    with pytest.raises(ValueError, match="not JSON compliant"):
        look["Teapot"].roughness = value
    with pytest.raises(TypeError, match="cannot be part of a look"):
        look["Teapot"].roughness = object()
    assert changes == []


def test_update_is_one_edit_of_what_differs(changes: list[Change]) -> None:
    edits = list[int]()
    look = Look(document(), lambda new: (changes.extend(new), edits.append(1)))  # type: ignore[func-returns-value]
    other = look.copy()
    other["Teapot"].roughness, other["Key"].intensity = 0.1, 5
    look.update(other)
    terms = [LAMBERT, {**GGX, "params": {"roughness": 0.1, "f0": 0.04}}]
    assert changes == [(("materials", "Teapot", "terms"), terms), (("lights", "Key", "intensity"), 5)]
    assert len(edits) == 1
    assert look.document == other.document
    look.update({"lights": {"Key": {"intensity": 5}}})  # nothing new
    assert len(edits) == 1
