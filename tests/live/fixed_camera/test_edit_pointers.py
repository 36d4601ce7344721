"""JSON Pointers to values that can be edited interactively."""

import pytest

from relume.core.errors import ParameterError
from relume.live.fixed_camera.edit_pointers import (
    CurvePointer,
    EnvironmentPointer,
    LightPointer,
    ParameterPointer,
    parse_curve,
    parse_pointer,
)


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("/materials/a~1b~0c/terms/0/curves/theta_h", CurvePointer("a/b~c", 0, "theta_h")),
        ("/materials/Teapot/terms/15/params/ior", ParameterPointer("Teapot", 15, "ior")),
        ("/lights/Key ~1 2", LightPointer("Key / 2")),
        ("/environment/rotation", EnvironmentPointer("rotation")),
    ],
)
def test_a_pointer_survives_parsing_and_formatting(text, meant):
    assert parse_pointer(text) == meant
    assert str(meant) == text


@pytest.mark.parametrize(
    "text",
    [
        "",
        "/materials/Teapot",
        "/materials//terms/0/curves/theta_h",
        "/materials/Teapot/terms/01/curves/theta_h",
        "/materials/Teapot/terms/1000/curves/theta_h",
        "/materials/Teapot/terms/\u0663/curves/theta_h",
        "/materials/Teapot/terms/0/curves/theta_h\n",
        "/materials/Teapot/terms/0/textures/diffuse",
        "/lights",
        "/lights/",
        "/lights/Key/intensity",
        "/environment",
        "/environment/radius",
        "/environment/rotation/0",
    ],
)
def test_pointers_to_nothing_are_rejected(text):
    with pytest.raises(ParameterError, match="pointer"):
        parse_pointer(text)


def test_only_curves_are_recognized_as_curves():
    with pytest.raises(ParameterError, match="curve"):
        parse_curve("/lights/Key")
