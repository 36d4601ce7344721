"""The BRDFs written a second time, directly from their papers, without curves and quotients."""

from __future__ import annotations

import numpy as np
from scipy.integrate import quad


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


def phong(wi, wo, exponent):
    """Mahajan 2008, eq. 5."""
    mirrored = wo * [-1, -1, 1]
    return (exponent + 1) / (2 * np.pi) * np.maximum(dot(wi, mirrored), 0) ** exponent


def lafortune(wi, wo, exponent, c_x, c_y, c_z):
    """Lafortune 1997 with the normalization of Nguyen 2010."""
    c = np.array([c_x, c_y, c_z])
    cosine = dot(c * wi, wo) / np.abs(c).max()
    return (exponent + 2) / (2 * np.pi) * np.maximum(cosine, 0) ** exponent


def ward(wi, wo, alpha):
    return ward_anisotropic(wi, wo, alpha, alpha)


def ward_duer(wi, wo, alpha):
    return ward(wi, wo, alpha) / np.sqrt(wi[..., 2] * wo[..., 2])


def ward_anisotropic(wi, wo, alpha_x, alpha_y):
    """Ward 1992, eq. 5a, its exponent by the azimuth."""
    h = half_vector(wi, wo)
    tan2 = 1 / h[..., 2] ** 2 - 1
    phi = np.arctan2(h[..., 1], h[..., 0])
    exponent = tan2 * (np.cos(phi) ** 2 / alpha_x**2 + np.sin(phi) ** 2 / alpha_y**2)
    return np.exp(-exponent) / (4 * np.pi * alpha_x * alpha_y * np.sqrt(wi[..., 2] * wo[..., 2]))


def schlick(wi, wo, roughness, f0):
    """Schlick 1994: Z F / (4π cos θi cos θo)."""
    h = half_vector(wi, wo)
    t = h[..., 2]
    zenith = roughness / (1 + roughness * t**2 - t**2) ** 2
    return zenith * schlick_fresnel(dot(wo, h), f0) / (4 * np.pi * wi[..., 2] * wo[..., 2])


def beard_maxwell(wi, wo, sigma, ior, extinction, tau, omega):
    """Maxwell 1973, first surface; the normalization of the slopes by quadrature."""
    h = half_vector(wi, wo)
    tan2 = 1 / h[..., 2] ** 2 - 1
    integral, _ = quad(lambda theta: np.sin(theta) / (sigma**2 + np.tan(theta) ** 2), 0, np.pi / 2, epsrel=1e-12)
    total = 2 * np.pi * integral
    slopes = 1 / (total * h[..., 2] * (sigma**2 + tan2))
    tilt = np.degrees(np.arccos(h[..., 2])) / omega
    shadows = (1 + tilt * np.exp(-2 * np.degrees(np.arccos(dot(wo, h))) / tau)) / (1 + tilt)
    return complex_fresnel(dot(wo, h), ior, extinction) * slopes * shadows / (4 * wi[..., 2] * wo[..., 2])


def oren_nayar(wi, wo, sigma, albedo):
    """Oren & Nayar 1994, full, in angles and azimuths."""
    theta = np.arccos(np.stack([wi[..., 2], wo[..., 2]]))
    alpha, beta = theta.max(axis=0), theta.min(axis=0)
    cosine = np.cos(np.arctan2(wi[..., 1], wi[..., 0]) - np.arctan2(wo[..., 1], wo[..., 0]))
    s2 = sigma**2
    c1 = 1 - 0.5 * s2 / (s2 + 0.33)
    c2 = 0.45 * s2 / (s2 + 0.09) * (np.sin(alpha) - np.where(cosine >= 0, 0, (2 * beta / np.pi) ** 3))
    c3 = 0.125 * s2 / (s2 + 0.09) * (4 * alpha * beta / np.pi**2) ** 2
    single_bounce = c1 + cosine * c2 * np.tan(beta) + (1 - np.abs(cosine)) * c3 * np.tan((alpha + beta) / 2)
    double_bounce = 0.17 * albedo * s2 / (s2 + 0.13) * (1 - cosine * (2 * beta / np.pi) ** 2)
    return np.maximum(single_bounce + double_bounce, 0) / np.pi


def sheen(wi, wo, roughness):
    """KHR_materials_sheen, D and V as the specification's appendix writes them."""
    alpha = roughness**2
    sine2 = 1 - half_vector(wi, wo)[..., 2] ** 2
    fibers = (2 + 1 / alpha) * sine2 ** (0.5 / alpha) / (2 * np.pi)

    def exponent(x):
        smooth_fit, rough_fit = (
            (25.3245, 3.32435, 0.16801, -1.27393, -4.85967),
            (21.5473, 3.82987, 0.19823, -1.97760, -4.32054),
        )
        a, b, c, d, e = (1 - (1 - alpha) ** 2) * np.array(rough_fit) + (1 - alpha) ** 2 * np.array(smooth_fit)
        return a / (1 + b * x**c) + d * x + e

    def shadowing_lambda(cosine):
        return np.where(cosine < 0.5, np.exp(exponent(cosine)), np.exp(2 * exponent(0.5) - exponent(1 - cosine)))

    return fibers / ((1 + shadowing_lambda(wi[..., 2]) + shadowing_lambda(wo[..., 2])) * 4 * wi[..., 2] * wo[..., 2])


CLOSED_FORMS = {
    f.__name__: f
    for f in (
        lambert, oren_nayar, phong, blinn_phong, lafortune, ward, ward_duer, ward_anisotropic, ashikhmin_shirley,
        cook_torrance, schlick, beard_maxwell, ggx, sheen,
    )
}  # fmt: skip
