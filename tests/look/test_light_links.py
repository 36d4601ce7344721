"""Links of lights in looks: forms, names, and how looks change them."""

from __future__ import annotations

import copy
from typing import Any

import pytest
from example_look import LIGHTS, MATERIALS

from relume.core.digest import digest
from relume.core.errors import ParameterError
from relume.look import apply_patch, complete, default_look, validate
from relume.look.difference import diff_looks
from relume.look.interpolate import interpolate_looks
from relume.look.light_mix import make_light_mix
from relume.look.link_validation import MAX_LINKED_NAMES

POINT = {"kind": "point"}
DEFAULT = default_look(MATERIALS, LIGHTS)
MATERIAL = "Teapot"
LINK = {"include": {"materials": [MATERIAL], "objects": ["Chair"]}}


def linked(link: Any, shadow_link: Any = None, environment: Any = None) -> dict[str, Any]:
    return {
        "lights": {"Key light": {**POINT, "link": link, "shadow_link": shadow_link}},
        "environment": {"link": environment},
    }


def test_lights_and_environment_light_all_surfaces_by_default() -> None:
    look = validate({"lights": {"Key light": POINT}}, DEFAULT)
    assert (look.lights["Key light"].link, look.lights["Key light"].shadow_link, look.environment.link) == (
        None,
        None,
        None,
    )
    document = complete({"lights": {"Key light": POINT}}, DEFAULT)
    assert (document["lights"]["Key light"]["link"], document["environment"]["link"]) == (None, None)


def test_looks_of_older_stores_have_no_links() -> None:
    older = copy.deepcopy(DEFAULT)
    del older["environment"]["link"]
    for light in older["lights"].values():
        del light["link"], light["shadow_link"]
    look = validate({}, older)
    assert look.environment.link is None
    assert all(light.link is None for light in look.lights.values())


@pytest.mark.parametrize("mode", ["include", "exclude"])
def test_equal_sets_of_names_are_equal_keys(mode: str) -> None:
    """A link is part of the geometry of its light: order and repetition of its names change no cache key."""
    links = [{mode: {"objects": ["b", "a", "b"]}}, {mode: {"objects": ["a", "b"], "materials": []}}]
    first, second = (validate(linked(link, link, link), DEFAULT) for link in links)
    geometry = first.lights["Key light"].geometry
    assert geometry == second.lights["Key light"].geometry
    assert hash(geometry) == hash(second.lights["Key light"].geometry)
    assert digest(geometry) == digest(second.lights["Key light"].geometry)
    assert first.environment.key == second.environment.key
    other = validate(linked(None, links[0]), DEFAULT).lights["Key light"].geometry
    assert digest(geometry) != digest(other)


def test_a_link_to_nothing_is_allowed() -> None:
    look = validate(linked({"include": {}}), DEFAULT)
    assert look.lights["Key light"].link is not None


@pytest.mark.parametrize(
    ("link", "pointer"),
    [
        ("Chair", ""),
        ([], ""),
        ({}, ""),
        ({"only": {}}, ""),
        ({"include": {}, "exclude": {}}, ""),
        ({"include": ["Chair"]}, "/include"),
        ({"include": {"meshes": []}}, "/include/meshes"),
        ({"include": {"materials": "Chair"}}, "/include/materials"),
        ({"exclude": {"objects": [3]}}, "/exclude/objects/0"),
        ({"exclude": {"objects": ["x" * 1001]}}, "/exclude/objects/0"),
        ({"exclude": {"objects": ["x"] * (MAX_LINKED_NAMES + 1)}}, "/exclude/objects"),
        ({"exclude": {"materials": ["Gone", MATERIAL, "Lost"]}}, "/exclude/materials"),
    ],
)
@pytest.mark.parametrize("field", ["/lights/Key light/link", "/lights/Key light/shadow_link", "/environment/link"])
def test_invalid_links_are_rejected(link: Any, pointer: str, field: str) -> None:
    arguments = [
        link if field == name else None for name in ("/lights/Key light/link", "/lights/Key light/shadow_link")
    ]
    with pytest.raises(ParameterError) as error:
        validate(linked(*arguments, link if field == "/environment/link" else None), DEFAULT)
    assert str(error.value).startswith(field + pointer)


def test_all_missing_materials_are_named() -> None:
    with pytest.raises(ParameterError, match="'Gone', 'Lost'"):
        validate(linked({"exclude": {"materials": ["Gone", MATERIAL, "Lost"]}}), DEFAULT)


def test_environment_has_no_shadow_link() -> None:
    with pytest.raises(ParameterError, match="/environment/shadow_link"):
        validate({"environment": {"shadow_link": None}}, DEFAULT)


def test_patches_and_differences_carry_links() -> None:
    before = complete({"lights": {"Key light": POINT}}, DEFAULT)
    after = complete(linked(LINK, environment=LINK), DEFAULT)
    patched = apply_patch(before, diff_looks(before, after), DEFAULT)
    assert patched == after


def test_links_switch_half_way_between_keyframes() -> None:
    looks = [complete(linked(link), DEFAULT) for link in (LINK, {"exclude": {"materials": [], "objects": ["Table"]}})]
    links = [interpolate_looks(looks, fraction)["lights"]["Key light"]["link"] for fraction in (0.4, 0.6)]
    assert links == [look["lights"]["Key light"]["link"] for look in looks]


def test_light_mixes_have_no_links() -> None:
    """They hold brightness and color alone, for scenes with other objects."""
    mix = make_light_mix(validate(linked(LINK, LINK, LINK), DEFAULT), "scene")
    assert not {"link", "shadow_link"} & (mix["lights"]["Key light"].keys() | mix["environment"].keys())
