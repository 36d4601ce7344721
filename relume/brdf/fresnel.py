"""Fresnel reflectance, unpolarized: the exact equations for dielectrics and conductors, and Schlick's approximation."""

from __future__ import annotations

import numpy as np

from relume.brdf.term import F64


def fresnel(cos_theta_d: F64, ior: float | F64, extinction: float) -> F64:
    """Mean Fresnel reflectance, in [0, 1], of both polarizations for light from vacuum.

    The exact equations for a conductor as collected by Lagarde 2013 (Memo on Fresnel equations); they
    reduce to those of a dielectric for zero extinction.

    Args:
        cos_theta_d: cosine between light and half vector, in [0, 1]. (...)
        ior: index of refraction η; one, or one per angle. extinction: k; both relative to the outside.
    """
    cos2 = np.square(cos_theta_d)
    sin2 = 1.0 - cos2
    t0 = ior * ior - 1.0 - extinction * extinction + cos2  # η² - k² - sin², without the cancellation at η = 1
    a2_plus_b2 = np.sqrt(t0 * t0 + 4.0 * ior * ior * extinction * extinction)
    t1 = a2_plus_b2 + cos2
    a = np.sqrt(np.maximum(0.5 * (a2_plus_b2 + t0), 0.0))  # may round to below zero if k is 0
    t2 = 2.0 * cos_theta_d * a
    # at the horizon of a boundary without contrast (η = 1, k = 0) both are zero: nothing is reflected
    r_perpendicular = np.divide(t1 - t2, t1 + t2, out=np.zeros_like(t1), where=t1 + t2 > 0)
    t3 = cos2 * a2_plus_b2 + sin2 * sin2
    t4 = t2 * sin2
    r_parallel = r_perpendicular * np.divide(t3 - t4, t3 + t4, out=np.zeros_like(t3), where=t3 + t4 > 0)
    return np.asarray(np.clip(0.5 * (r_perpendicular + r_parallel), 0.0, 1.0))


def schlick(cos_theta_d: F64, f0: float | F64) -> F64:
    """Schlick's reflectance f0 + (1 - f0)(1 - cos θd)^5 (eq. 15, Schlick 1994); f0: at normal incidence, in [0, 1]."""
    return f0 + (1.0 - f0) * (1.0 - cos_theta_d) ** 5


def normal_reflectance(ior: float) -> float:
    """Reflectance ((η - 1) / (η + 1))² of a dielectric at normal incidence. ior: index of refraction η"""
    return ((ior - 1) / (ior + 1)) ** 2
