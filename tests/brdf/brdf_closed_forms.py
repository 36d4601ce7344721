"""The BRDFs written down a second time, straight from their papers, with no curve and no quotient in them."""

from __future__ import annotations

import numpy as np


def directions(rng, count, min_cosine=0.02):
    """Uniform unit vectors of the upper hemisphere. (count, 3)"""
    z = rng.uniform(min_cosine, 1.0, count)
    phi = rng.uniform(0, 2 * np.pi, count)
    s = np.sqrt(1 - z * z)
    return np.stack([s * np.cos(phi), s * np.sin(phi), z], axis=-1)


def dot(a, b):
    return np.sum(a * b, axis=-1)


def half_vector(wi, wo):
    h = wi + wo
    return h / np.linalg.norm(h, axis=-1, keepdims=True)


def complex_fresnel(cos_theta, ior, extinction):
    """|r_s|² and |r_p|² averaged, from the complex amplitudes of a boundary to index η + ik."""
    index = ior + 1j * extinction
    cos_t = np.sqrt(1 - (1 - cos_theta**2) / index**2 + 0j)
    r_s = (cos_theta - index * cos_t) / (cos_theta + index * cos_t)
    r_p = (index * cos_theta - cos_t) / (index * cos_theta + cos_t)
    return 0.5 * (np.abs(r_s) ** 2 + np.abs(r_p) ** 2)


def schlick_fresnel(cos_theta, f0):
    return f0 + (1 - f0) * (1 - cos_theta) ** 5


def lambert(wi, wo):
    return np.full(wi.shape[:-1], 1 / np.pi)


def blinn_phong(wi, wo, exponent):
    return (exponent + 2) / (2 * np.pi) * half_vector(wi, wo)[..., 2] ** exponent


def cook_torrance(wi, wo, sigma, ior, extinction):
    """Cook & Torrance 1982 with the factor of Ben-Artzi 2006, eq. 10."""
    h = half_vector(wi, wo)
    nh, nl, nv, vh = h[..., 2], wi[..., 2], wo[..., 2], dot(wo, h)
    beckmann = np.exp(-(np.tan(np.arccos(nh)) ** 2) / sigma**2) / (sigma**2 * nh**4)
    geometry = np.minimum(1, np.minimum(2 * nh * nv / vh, 2 * nh * nl / vh))
    return complex_fresnel(vh, ior, extinction) * beckmann * geometry / (4 * np.pi * nl * nv)


def ggx(wi, wo, roughness, f0):
    """Walter 2007, eqs. 20, 33, 34."""
    alpha = roughness**2
    h = half_vector(wi, wo)
    tan2 = (1 - h[..., 2] ** 2) / h[..., 2] ** 2
    distribution = alpha**2 / (np.pi * h[..., 2] ** 4 * (alpha**2 + tan2) ** 2)

    def smith(w):
        return 2 / (1 + np.sqrt(1 + alpha**2 * (1 - w[..., 2] ** 2) / w[..., 2] ** 2))

    fresnel = schlick_fresnel(dot(wi, h), f0)
    return distribution * fresnel * smith(wi) * smith(wo) / (4 * wi[..., 2] * wo[..., 2])


def ashikhmin_shirley(wi, wo, nu, nv, f0):
    """Ashikhmin & Shirley 2000, eq. 4, with its exponent in half-vector components."""
    h = half_vector(wi, wo)
    exponent = (nu * h[..., 0] ** 2 + nv * h[..., 1] ** 2) / (1 - h[..., 2] ** 2)
    lobe = np.sqrt((nu + 1) * (nv + 1)) / (8 * np.pi) * h[..., 2] ** exponent
    return lobe / (dot(wo, h) * np.maximum(wi[..., 2], wo[..., 2])) * schlick_fresnel(dot(wo, h), f0)


CLOSED_FORMS = {f.__name__: f for f in (lambert, blinn_phong, cook_torrance, ggx, ashikhmin_shirley)}
