"""The background of a look and shadow catchers: checked, completed, ignored by the reference."""

from __future__ import annotations

import pytest

from relume.core.errors import ParameterError
from relume.look import apply_patch, complete, default_look, validate
from relume.scene.model import Material

PLAIN = Material("Ball", ({"model": "lambert"},))
GROUND = Material("Ground", ({"model": "lambert"},), shadow_catcher=True)
DEFAULT = default_look([PLAIN, GROUND])


def test_the_default_shows_the_map_and_the_ground_is_a_shadow_catcher():
    assert DEFAULT["background"]["kind"] == "map"
    assert DEFAULT["materials"]["Ground"]["shadow_catcher"] is True
    assert "shadow_catcher" not in DEFAULT["materials"]["Ball"]


def test_older_looks_and_stores_get_a_background():
    old = {name: value for name, value in DEFAULT.items() if name != "background"}
    assert complete({"background": {"kind": "color"}}, complete({}, old))["background"]["kind"] == "color"
    assert validate(old, DEFAULT).background.kind == "map"


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("kind", "sky"),
        ("kind", ["map"]),
        ("color", [0, 0]),
        ("color", [0, 0, -1]),
        ("color", [0, 0, float("nan")]),
        ("blur", 0),
        ("blur", 61),
        ("blur", True),
        ("radius", 1),
    ],
)
def test_invalid_backgrounds_are_rejected(field, value):
    with pytest.raises(ParameterError, match=f"/background/{field}"):
        complete({"background": {field: value}}, DEFAULT)


def test_only_a_ground_can_be_a_shadow_catcher():
    patch = [{"op": "replace", "path": "/materials/Ground/shadow_catcher", "value": False}]
    changed = apply_patch(DEFAULT, patch, DEFAULT)
    assert validate(changed, DEFAULT).materials["Ground"].shadow_catcher is False
    assert changed["materials"]["Ball"] is DEFAULT["materials"]["Ball"]
    with pytest.raises(ParameterError, match="/materials/Ball/shadow_catcher"):
        complete({"materials": {"Ball": {"shadow_catcher": True}}}, DEFAULT)
    with pytest.raises(ParameterError, match="/materials/Ground/shadow_catcher"):
        complete({"materials": {"Ground": {"shadow_catcher": 1}}}, DEFAULT)


def test_the_reference_ignores_background_and_catcher():
    look = validate({"background": {"kind": "transparent"}}, DEFAULT).without_compositing()
    assert look.background.kind == "map"
    assert not look.materials["Ground"].shadow_catcher
