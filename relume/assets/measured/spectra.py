"""Linear Rec. 709 of reflectance spectra: their color under daylight D65 for the CIE 1931 observer."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.color import TO_XYZ

F64 = NDArray[np.float64]

_TABLE = Path(__file__).with_name("cie_1931_d65.csv")  # every 10 nm: color matching functions x, y, z, and D65
_STEP_NM = 1.0


def rec709_weights(wavelengths: Shaped[F64, " n"]) -> Shaped[F64, "n 3"]:
    """Weights of the samples of a reflectance spectrum in linear Rec. 709; the weights of each channel sum to one.

    R = Σ_k w_k ρ_k is the integral of ρ(λ), linear between samples and constant beyond the first and last, times D65
    and the observer. A white surface is (1, 1, 1); saturated colors have negative channels.

    Args:
        wavelengths: nanometers, ascending.
    """
    nanometers, x, y, z, illuminant = np.loadtxt(_TABLE, delimiter=",", skiprows=1, unpack=True)
    fine = np.arange(nanometers[0], nanometers[-1] + _STEP_NM / 2, _STEP_NM)
    xyz = np.stack([np.interp(fine, nanometers, curve * illuminant) for curve in (x, y, z)], axis=-1)
    hats = np.stack([np.interp(fine, wavelengths, hat) for hat in np.eye(len(wavelengths))])
    weights = hats @ xyz @ np.linalg.inv(TO_XYZ).T
    return np.asarray(weights / weights.sum(axis=0))
