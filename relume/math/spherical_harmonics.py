"""Real spherical harmonics up to order 5, the basis of low-frequency environment light (Müller 2004, section 5).

    Y_lm = √2 K_lm (cos mφ | sin |m|φ) P_lm(cos θ),   Y_l0 = K_l0 P_l0(cos θ),   l < 5

orthonormal over the sphere; θ is from +z.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray
from scipy.special import sph_harm_y

F64 = NDArray[np.float64]

ORDER = 5
NUM_HARMONICS = ORDER**2


def harmonics(directions: Shaped[F64, "n 3"]) -> Shaped[F64, "n 25"]:
    """Evaluate all harmonics at unit directions, ordered by l and then by m from −l to l."""
    theta = np.arccos(np.clip(directions[:, 2], -1, 1))
    phi = np.arctan2(directions[:, 1], directions[:, 0])
    columns = []
    for degree in range(ORDER):
        for order in range(-degree, degree + 1):
            value = sph_harm_y(degree, abs(order), theta, phi)
            component = value.imag if order < 0 else value.real
            columns.append(component * (np.sqrt(2) if order else 1))
    return np.stack(columns, axis=1)
