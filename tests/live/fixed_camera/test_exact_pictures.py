"""Exact pictures do not depend on the picture under test: neither on its files nor on its shading."""

from __future__ import annotations

import numpy as np
import pytest
from exact_pictures import exact_image, open_copy
from picture_edits import open_exact_picture, set_sigma
from session_edits import make_look, relative_rmse

from relume.live.fixed_camera.strategies.shading import Shading
from relume.operators.shade import ShadedTerm

shaded = Shading._complete_image


def too_bright(*args):
    """Every image 1 % too bright."""
    return ShadedTerm(shaded(*args).image * np.float32(1.01))


def test_stored_images_of_a_session_are_not_read(transfer, monkeypatch):
    with open_copy(transfer) as shown:
        look = make_look(shown, set_sigma(0.31))
        with monkeypatch.context() as broken:
            broken.setattr(Shading, "_complete_image", too_bright)
            wrong = open_exact_picture(shown, look=look).image()
        assert relative_rmse(wrong, exact_image(shown, look)) > 0.005
        np.testing.assert_array_equal(open_exact_picture(shown, look=look).image(), wrong)  # a session would read it


def test_a_common_shading_error_is_detected(transfer, monkeypatch):
    monkeypatch.setattr(Shading, "_complete_image", too_bright)
    with pytest.raises(AssertionError, match="Mismatched elements"):
        exact_image(transfer, make_look(transfer))
