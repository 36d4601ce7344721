"""The oracle of pictures does not believe the picture: neither its files nor its shading."""

from __future__ import annotations

import numpy as np
import pytest
from oracle import copied, exact_image
from pictures import opened, sigma
from sessions import look_of, relative_rmse

from relume.operators.shade import Shaded
from relume.picture.jobs import Shade

shaded = Shade._finished


def too_bright(*args):
    """Every image by a hundredth."""
    return Shaded(shaded(*args).image * np.float32(1.01))


def test_images_that_a_session_has_kept_are_not_read(transfer, monkeypatch):
    with copied(transfer) as shown:
        look = look_of(shown, sigma(0.31))
        with monkeypatch.context() as broken:
            broken.setattr(Shade, "_finished", too_bright)
            wrong = opened(shown, look=look).image()
        assert relative_rmse(wrong, exact_image(shown, look)) > 0.005
        np.testing.assert_array_equal(opened(shown, look=look).image(), wrong)  # which a session would read


def test_shading_that_is_wrong_everywhere_is_found(transfer, monkeypatch):
    monkeypatch.setattr(Shade, "_finished", too_bright)
    with pytest.raises(AssertionError, match="Mismatched elements"):
        exact_image(transfer, look_of(transfer))
