"""Tone maps against NumPy, and their values for black, gray and white."""

from __future__ import annotations

from typing import get_args

import numpy as np
import pytest

from relume.core.color import srgb_encode
from relume.core.errors import ParameterError, ShapeMismatchError
from relume.image_io.tone_mapping import TONE_MAPS, tone_map
from relume.look.model import ToneMap

AGX_INSET = np.array(
    [
        [0.842479062253094, 0.0784335999999992, 0.0792237451477643],
        [0.0423282422610123, 0.878468636469772, 0.0791661274605434],
        [0.0423756549057051, 0.0784336, 0.879142973793104],
    ]
)
AGX_POLYNOMIAL = [15.5, -40.14, 31.96, -6.868, 0.4298, 0.1191, -0.00232]


def agx_numpy(rgb):
    ev = np.log2(np.maximum(rgb @ AGX_INSET.T, 1e-10))
    encoded = (np.clip(ev, -12.47393, 4.026069) + 12.47393) / (4.026069 + 12.47393)
    # the published outset is the inverse of the inset
    return np.clip(np.polyval(AGX_POLYNOMIAL, encoded) @ np.linalg.inv(AGX_INSET).T, 0, 1)


def filmic_numpy(x):
    return srgb_encode(x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14))


REFERENCES = {"agx": agx_numpy, "filmic": filmic_numpy, "none": srgb_encode}


def test_names_are_those_of_look_documents():
    assert set(TONE_MAPS) == set(get_args(ToneMap)) == set(REFERENCES)


@pytest.mark.parametrize("name", TONE_MAPS)
@pytest.mark.parametrize("exposure", [0.0, -2.0, 3.5])
def test_tone_map_equals_numpy(name, exposure):
    rng = np.random.default_rng(3)
    image = np.exp(rng.normal(size=(300, 200, 3)) * 3).astype(np.float32)  # more rows than one range of a kernel
    shown = tone_map(image, exposure, name)
    assert shown.dtype == np.float32
    assert shown.shape == image.shape
    np.testing.assert_allclose(shown, REFERENCES[name](image.astype(np.float64) * 2**exposure), atol=2e-5)


@pytest.mark.parametrize("name", TONE_MAPS)
def test_grays_stay_gray_and_monotonic(name):
    gray = np.geomspace(1e-4, 100, 200, dtype=np.float32)
    shown = tone_map(np.repeat(gray[None, :, None], 3, axis=2), 0.0, name)[0]
    np.testing.assert_allclose(shown - shown[:, :1], 0, atol=1e-3)
    assert (np.diff(shown[:, 0]) >= 0).all()
    assert shown[0, 0] < 0.03
    assert shown[-1, 0] > 0.97


@pytest.mark.parametrize("name", TONE_MAPS)
def test_invalid_radiance_still_gives_an_image(name):
    image = np.float32([[[np.nan] * 3, [np.inf] * 3, [-5.0] * 3, [3e38] * 3]])
    shown = tone_map(image, 20.0, name)[0]
    assert (shown >= 0).all()
    assert (shown <= 1).all()
    np.testing.assert_array_equal(shown[0], shown[2])
    assert shown[0].max() < 0.01
    assert shown[[1, 3]].min() > 0.97


def test_unknown_map_and_wrong_shape_are_rejected():
    with pytest.raises(ParameterError, match="agx"):
        tone_map(np.zeros((2, 2, 3), np.float32), 0.0, "reinhard")
    with pytest.raises(ShapeMismatchError):
        tone_map(np.zeros((2, 2), np.float32), 0.0, "agx")
