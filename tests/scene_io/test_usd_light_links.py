"""Collections of UsdLux become links of lights."""

from __future__ import annotations

from typing import Any
from unittest.mock import patch

import pytest
from usd_text import imported, quad, usda

from relume.look import default_look
from relume.scene.model import Scene
from relume.scene_io.usd import stage_reader

pytest.importorskip("pxr.Usd")

TRANSLATE = 'double3 xformOp:translate = (9, 0, 0)\nuniform token[] xformOpOrder = ["xformOp:translate"]'
ROOM = f"""
def Xform "Room" {{
    {quad("Wall")}
    {quad("Door", TRANSLATE)}
}}
{quad("Chair")}
"""


def lit(collections: str, kind: str = "SphereLight") -> Scene:
    """Two quads in a group, one outside, and a light."""
    return imported(usda(ROOM + f'def {kind} "Key" {{\n{collections}\n}}'))


def links(scene: Scene) -> dict[str, Any]:
    """Links of the light, whose look is valid."""
    look = default_look(scene.materials, scene.lights)["lights"]["Key"]
    return {field: look[field] for field in ("link", "shadow_link") if look[field] is not None}


@pytest.mark.parametrize(
    ("collections", "expected"),
    [
        ("", {}),
        ("rel collection:lightLink:excludes = </Chair>", {"link": {"exclude": {"objects": ["Chair"]}}}),
        (
            "uniform bool collection:lightLink:includeRoot = 0\nrel collection:lightLink:includes = </Chair>",
            {"link": {"include": {"objects": ["Chair"]}}},
        ),
        ("rel collection:shadowLink:excludes = </Room>", {"shadow_link": {"include": {"objects": ["Chair"]}}}),
        (
            "rel collection:shadowLink:excludes = [</Room/Door>, </Gone>]",
            {"shadow_link": {"exclude": {"objects": ["Door"]}}},
        ),
        ("uniform bool collection:lightLink:includeRoot = 0", {"link": {"include": {"objects": []}}}),
        ("uniform bool collection:lightLink:includeRoot = 1", {}),
        ("rel collection:lightLink:includes = [</Room>, </Chair>]", {}),
        (
            "uniform bool collection:lightLink:includeRoot = 0\nrel collection:lightLink:includes = </Room>\n"
            "rel collection:lightLink:excludes = </Room/Wall>",
            {"link": {"include": {"objects": ["Door"]}}},
        ),
    ],
)
def test_collections_become_links(collections: str, expected: dict[str, Any]) -> None:
    scene = lit(collections)
    assert links(scene) == expected
    assert not [warning for warning in scene.warnings if "links" in warning]


def test_links_of_a_dome_are_a_warning() -> None:
    scene = lit("rel collection:lightLink:excludes = </Chair>", "DomeLight")
    assert ["link the environment" in warning for warning in scene.warnings] == [True]


def test_links_of_merged_objects_are_a_warning() -> None:
    with patch.object(stage_reader, "_MAX_SEPARATE_MESHES", 2):
        scene = lit("rel collection:lightLink:excludes = </Chair>")
    assert links(scene) == {}
    assert ["too many for links" in warning for warning in scene.warnings if "Key" in warning].count(True) == 1
