"""Quadrature over the hemisphere: the reference of integrals with the cosine."""

from __future__ import annotations

import numpy as np


def hemisphere(radii=24, turns=48):
    """Directions (n, 3) and weights cos θ dω (n,): Gauss–Legendre in r² = sin² θ, uniform in φ."""
    nodes, weights = np.polynomial.legendre.leggauss(radii)
    r2, phi = np.repeat((nodes + 1) / 2, turns), np.tile(np.arange(turns) * (2 * np.pi / turns), radii)
    wi = np.stack([np.sqrt(r2) * np.cos(phi), np.sqrt(r2) * np.sin(phi), np.sqrt(1 - r2)], axis=-1)
    return wi, np.repeat(weights / 4, turns) * (2 * np.pi / turns)
