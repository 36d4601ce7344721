"""Looks with lights rotated about a vertical axis, against the geometry of their lights."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from relume.lights.local_lights import rectangle
from relume.look import complete, validate
from relume.look.rotate import rotated_environment, rotated_lights

CENTER = [1.0, 2.0, -3.0]
PANEL = {"kind": "rectangle", "position": [2.0, 3.0, 1.0], "rotation": 25.0, "size": [0.5, 1.5]}


@pytest.mark.parametrize("direction", [[0.3, -1.0, 0.2], [0.0, -1.0, 0.0], [0.0, 2.0, 0.0], [1.0, 0.0, 0.0]], ids=str)
@pytest.mark.parametrize("degrees", [70.0, 500.0, -30.0])
def test_an_area_light_is_rotated_rigidly(default, direction, degrees):
    document = complete({"lights": {"Sheet": {**PANEL, "direction": direction}}}, default)
    lit, rotated = (
        validate(look_document, default) for look_document in (document, rotated_lights(document, degrees, CENTER))
    )
    before, after = (rectangle(look.lights["Sheet"].geometry) for look in (lit, rotated))
    turn = Rotation.from_euler("y", degrees, degrees=True)
    np.testing.assert_allclose(after[0], CENTER + turn.apply(before[0] - CENTER), atol=1e-9)
    np.testing.assert_allclose(after[1], turn.apply(before[1]), atol=1e-9)
    assert -180 <= rotated.environment.rotation < 180
    assert rotated.environment.key.rotation == pytest.approx(degrees % 360)


def test_an_environment_rotation_is_added(default):
    document = complete({"environment": {"rotation": 350.0}}, default)
    rotated = validate(rotated_environment(document, 30.0), default)
    assert rotated.environment.rotation == pytest.approx(20)
    assert rotated.lights == validate(document, default).lights
