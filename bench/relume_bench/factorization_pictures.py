"""factorization.picture_rmse: pictures of a ball of Phong's exponent 30 with K terms against the exact picture.

As Figs. 3, 6 and 8 of Mahajan 2008, who predict 75 terms for 99 % of the energy, that is 10 %. An unoccluded ball in
three environments, seen from afar, cosine included. `svd` are the optimal factors of this BRDF, `zernike` the first K
functions of the product's basis, up to a degree; both see the same directions of light, so nothing else differs. Errors
are RMS relative to the RMS of the picture, mean over environments; the figure is the one of 75 optimal terms.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import eval_jacobi

from relume.assets.environments.equirect import halve_to_width, lookup
from relume_bench.brdf_svd import Zenith, factorize, fourier_rows, gauss_zenith, phong
from relume_bench.figure import Figure
from relume_bench.scenes import environments

F64 = NDArray[np.float64]

_EXPONENT = 30.0
SVD_TERMS, ZERNIKE_FUNCTIONS = (1, 4, 12, 36, 75), (1, 3, 10, 36, 78)
_MAP_WIDTH = 64


def measure(tiny: bool) -> list[Figure]:
    """Compare pictures in all environments."""
    size, pixels = (12, 6) if tiny else (48, 32)
    maps = [halve_to_width(environment.radiance, _MAP_WIDTH) for environment in environments()]
    errors: dict[str, list[list[float]]] = {"svd": [], "zernike": []}
    for radiance in maps:
        exact, svd, zernike = pictures(radiance, size, pixels)
        for name, images in (("svd", svd), ("zernike", zernike)):
            errors[name].append([float(np.linalg.norm(image - exact) / np.linalg.norm(exact)) for image in images])
    svd_errors, zernike_errors = (100 * np.mean(errors[name], axis=0) for name in ("svd", "zernike"))
    context = {
        "exponent": _EXPONENT,
        "environments": len(maps),
        "pixels": f"{pixels}×{pixels}",
        "svd": dict(zip(map(str, SVD_TERMS), svd_errors.tolist(), strict=True)),
        "zernike": dict(zip(map(str, ZERNIKE_FUNCTIONS), zernike_errors.tolist(), strict=True)),
    }
    return [Figure("factorization.picture_rmse", float(svd_errors[-1]), "%", context)]


def pictures(radiance: NDArray[np.float32], size: int, pixels: int) -> tuple[F64, list[F64], list[F64]]:
    """Return pictures of a ball, (ball pixels, 3): exact, with `SVD_TERMS`, with `ZERNIKE_FUNCTIONS`.

    Args:
        radiance: environment map. size: zenith angles of the quadrature. pixels: across the ball.
    """
    zenith, num_azimuths = gauss_zenith(size), 2 * size
    normals, cosine = ball_normals(pixels)
    light = _light_spectra(radiance, normals, cosine, zenith, num_azimuths)
    rows = fourier_rows(phong(_EXPONENT), cosine, zenith, num_azimuths // 2)
    svd, zernike = _svd_bases(zenith, num_azimuths // 2), _zernike_bases(zenith)
    exact = _reflected(rows, light, zenith, None)
    return (
        exact,
        [_reflected(rows, light, zenith, svd[count]) for count in SVD_TERMS],
        [_reflected(rows, light, zenith, zernike[count]) for count in ZERNIKE_FUNCTIONS],
    )


def ball_normals(pixels: int) -> tuple[F64, F64]:
    """Return the normals of a ball's pixels, seen along −z, and cos θo."""
    x = (2 * np.arange(pixels) + 1 - pixels) / pixels
    x, y = np.meshgrid(x, -x)
    inside = x**2 + y**2 < 0.99
    z = np.sqrt(1 - x[inside] ** 2 - y[inside] ** 2)
    return np.stack([x[inside], y[inside], z], axis=-1), z


def _light_spectra(radiance: NDArray[np.float32], normals: F64, cosine: F64, zenith: Zenith, num_azimuths: int) -> F64:
    """Return ∫ L cos mφ dφ over φ = φi − φo, for each pixel. (pixels, zenith, frequencies, 3)"""
    view = np.array([0.0, 0.0, 1.0])
    tangent = view - cosine[:, None] * normals  # φo = 0
    length = np.linalg.norm(tangent, axis=1, keepdims=True)
    tangent = np.where(length > 1e-9, tangent / np.maximum(length, 1e-9), [1.0, 0.0, 0.0])
    bitangent = np.cross(normals, tangent)
    azimuth = 2 * np.pi * (np.arange(num_azimuths) + 0.5) / num_azimuths
    sine = np.sqrt(1 - zenith.cosine**2)
    m = np.arange(min(num_azimuths // 2, len(zenith.cosine)))
    waves = np.cos(np.outer(azimuth, m)) * (2 * np.pi / num_azimuths)
    out = np.empty((len(normals), len(zenith.cosine), len(m), 3))
    for p, (n, t, b) in enumerate(zip(normals, tangent, bitangent, strict=True)):
        around = np.cos(azimuth)[:, None] * t + np.sin(azimuth)[:, None] * b
        directions = sine[:, None, None] * around + zenith.cosine[:, None, None] * n
        samples = lookup(radiance, directions.reshape(-1, 3).astype(np.float32)).reshape(len(sine), num_azimuths, 3)
        out[p] = np.einsum("tac,am->tmc", samples.astype(np.float64), waves, optimize=True)
    return out


def _reflected(rows: F64, light: F64, zenith: Zenith, bases: list[F64] | None) -> F64:
    """Return radiance of pixels with the BRDF projected to a basis of each frequency; None: the whole BRDF.

    Args:
        rows: from `fourier_rows` at cos θo of the pixels. light: from `_light_spectra`.
        bases: for each frequency, orthonormal under cos θ. (zenith, functions)
    """
    weight = zenith.weight * zenith.cosine
    out = np.zeros((len(rows), 3))
    for m in range(rows.shape[2]):
        row, share = rows[..., m], (1 if m == 0 else 2) / (2 * np.pi)
        if bases is not None:
            row = (row * weight) @ bases[m] @ bases[m].T
        out += share * np.einsum("pt,ptc->pc", row * weight, light[:, :, m])
    return out


def _svd_bases(zenith: Zenith, num_azimuths: int) -> dict[int, list[F64]]:
    """Return the first K factors g_k of ρ √(cos θi cos θo), by frequency; pairs of cosine and sine are not split."""
    weighted = Zenith(zenith.cosine, zenith.weight * zenith.cosine)
    factors = factorize(phong(_EXPONENT), weighted, num_azimuths)
    order = sorted((-value, each.m, k) for each in factors for k, value in enumerate(each.values))
    out = {}
    for count in SVD_TERMS:
        used = np.zeros(len(factors), np.int64)
        num = 0
        for _, m, _ in order:
            num += 1 if m == 0 else 2
            if num > count:
                break
            used[m] += 1
        out[count] = [each.incident[:, : used[each.m]] for each in factors]
    return out


def _zernike_bases(zenith: Zenith) -> dict[int, list[F64]]:
    """Return the radial Zernike polynomials up to a degree, by frequency."""
    radius = np.sqrt(1 - zenith.cosine**2)
    out = {}
    for count in ZERNIKE_FUNCTIONS:
        degree = int((np.sqrt(8 * count + 1) - 3) / 2)
        bases = []
        for m in range(len(zenith.cosine)):
            functions = [
                np.sqrt(2 * n + 2) * radius**m * eval_jacobi((n - m) // 2, 0, m, 2 * radius**2 - 1)
                for n in range(m, degree + 1, 2)
            ]
            bases.append(np.reshape(functions, (len(functions), len(radius))).T)
        out[count] = bases
    return out
