"""HDR-FLIP against the values that its authors' program gives, flip-evaluator 1.7."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from relume_bench.hdr_flip import exposure_range, hdr_flip, ldr_flip, without_noise


def pictures() -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(1)
    reference = np.exp(12 * gaussian_filter(random.standard_normal((48, 64, 3)), (3, 3, 0))).astype(np.float32)
    image = (reference * (1 + 0.1 * random.standard_normal(reference.shape))).astype(np.float32).clip(0)
    image[10:20, 10:20] *= 1.5
    return image, reference


def test_values_are_those_of_the_authors() -> None:
    image, reference = pictures()
    assert exposure_range(reference) == pytest.approx((-4.267627, 0.796677), abs=1e-3)
    assert hdr_flip(image, reference).mean() == pytest.approx(0.0905714, rel=1e-4)
    displayed = [(picture / reference.max()).clip(0, 1).astype(np.float64) for picture in (image, reference)]
    assert ldr_flip(*displayed).mean() == pytest.approx(0.0376452, rel=1e-4)


def test_equal_images_have_no_error() -> None:
    _, reference = pictures()
    assert hdr_flip(reference, reference).max() == 0


def test_black_images_are_finite() -> None:
    assert np.isfinite(hdr_flip(np.zeros((8, 8, 3)), np.zeros((8, 8, 3)))).all()


@pytest.mark.parametrize("noise", [0.05, 0.1])
def test_noise_of_the_reference_is_removed(noise: float) -> None:
    """An image with a smooth error of about 2 %, against reference images that are noisier than that."""
    _, reference = pictures()
    random = np.random.default_rng(2)
    image = reference * (1 + 0.1 * gaussian_filter(random.standard_normal(reference.shape), (2, 2, 0)))
    halves = [reference * (1 + noise * random.standard_normal(reference.shape)) for _ in range(2)]
    noisy = hdr_flip(image, np.mean(halves, axis=0)).mean()
    noisier = np.mean([hdr_flip(image, half).mean() for half in halves])
    error = hdr_flip(image, reference).mean()
    assert noisy > 1.1 * error
    assert without_noise(noisy, noisier) == pytest.approx(error, rel=0.1)
    assert without_noise(error, error) == pytest.approx(error)
