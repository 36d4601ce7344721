"""Soloed lights: equal to the others switched off, without a change of the look."""

from __future__ import annotations

import pytest

from relume.live.fixed_camera.illumination import illumination_from_look, picture_gain
from relume.look import Look, default_look, validate
from relume.scene.model import Material

WHITE = Material("White", ({"model": "lambert", "color": [1.0, 1.0, 1.0]},))
POINT_LIGHT = {"kind": "point", "position": [0.0, 1.0, 0.0], "intensity": 2.0}
ENVIRONMENT = {"intensity": 0.5, "color": [1.0, 0.5, 0.25], "rotation": 20.0}


def look(has_point: bool = True, spot: bool = False, **environment: object) -> Look:
    """An enabled point light, a disabled spot light and the environment, each if requested."""
    lights = {"Lamp": {**POINT_LIGHT, "enabled": has_point}, "Spot": {"kind": "spot", "enabled": spot}}
    return validate({"lights": lights, "environment": {**ENVIRONMENT, **environment}}, default_look([WHITE]))


def shown(look_document: Look, *solo: str) -> tuple[object, object]:
    alone = frozenset(solo) or None
    return illumination_from_look(look_document, ["White"], has_bounces=True, solo=alone), picture_gain(
        look_document, alone
    )


@pytest.mark.parametrize(
    ("solo", "switched"),
    [
        ((), look()),
        (("Lamp",), look(intensity=0.0)),
        (("Spot",), look(has_point=False, spot=True, intensity=0.0)),
        (("environment",), look(has_point=False)),
        (("environment", "Spot"), look(has_point=False, spot=True)),
        (("Lamp", "Nobody"), look(intensity=0.0)),
        (("Nobody",), look()),
    ],
)
def test_solo_illumination_equals_the_others_off(solo: tuple[str, ...], switched: Look) -> None:
    assert shown(look(), *solo) == shown(switched)


def test_a_soloed_light_without_emission_is_black() -> None:
    dark = validate({"lights": {"Lamp": {**POINT_LIGHT, "intensity": 0.0}}}, default_look([WHITE]))
    light, gain = shown(dark, "Lamp")
    assert gain == (0.0, 0.0, 0.0)
    assert light == illumination_from_look(dark, ["White"], has_bounces=True)
