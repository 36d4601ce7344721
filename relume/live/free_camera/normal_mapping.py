"""Normal mapping for the free camera: outgoing radiance changes as pixel normals deviate from those of probes.

A surface with a slightly perturbed normal receives the same lights with other cosines,

    E(n') = Σ_s w_s n'·ω_s = n' · D,   D = Σ_s w_s ω_s

exact if no light lies between the two horizons. The tangential components of D are integrals of incident light times x
and y; incident coefficients include the cosine, so x / z and y / z are projected onto the basis. Broad terms are
multiplied by n'·D / n·D, with D of luminance; narrow lobes are evaluated for the perturbed normal.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.color import LUMINANCE
from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import parallel_for_chunks
from relume.math.zernike import basis_functions
from relume.probes.stored_scene import StoredScene
from relume.raytrace.texture_kernels import sample_texture

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_NUM_QUADRATURE_NODES = 64  # of quadrature along each of θ and φ; exact for these integrands
_MAX_RATIO = np.float32(4)  # limits the ratio at grazing light
_EPSILON = np.float32(1e-12)


@lru_cache(maxsize=1)
def basis_gradients() -> Shaped[F32, "3 K"]:
    """Project x / z, y / z and 1: their inner products with incident coefficients are D in the local frame."""
    node, weight = np.polynomial.legendre.leggauss(_NUM_QUADRATURE_NODES)
    theta, phi = (node + 1) * np.pi / 4, np.arange(_NUM_QUADRATURE_NODES) * 2 * np.pi / _NUM_QUADRATURE_NODES
    azimuth_vectors = np.stack([np.cos(phi), np.sin(phi), np.ones(_NUM_QUADRATURE_NODES)])
    wi = np.sin(theta)[:, None, None] * azimuth_vectors.T
    wi[..., 2] = np.cos(theta)[:, None]
    # the basis is orthonormal in dx dy = cos θ dω, so x / z leaves x dω
    solid_angle = np.sin(theta) * weight * np.pi / 4 * (2 * np.pi / _NUM_QUADRATURE_NODES)
    return np.asarray(np.einsum("tpi,tpk,t->ik", wi, basis_functions(wi), solid_angle), np.float32)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _light_gradient(gradients, luminance, normal, tangent, vectors, is_needed, start, stop, out):  # type: ignore[no-untyped-def]
    """Compute D of probes [start, stop)."""
    for p in range(start, stop):
        if not is_needed[p]:
            continue
        x = y = z = np.float32(0)
        for channel in range(3):
            for k in range(vectors.shape[2]):
                value = luminance[channel] * vectors[p, channel, k]
                x, y, z = x + gradients[0, k] * value, y + gradients[1, k] * value, z + gradients[2, k] * value
        n, t = normal[p], tangent[p]
        out[p, 0] = x * t[0] + y * (n[1] * t[2] - n[2] * t[1]) + z * n[0]
        out[p, 1] = x * t[1] + y * (n[2] * t[0] - n[0] * t[2]) + z * n[1]
        out[p, 2] = x * t[2] + y * (n[0] * t[1] - n[1] * t[0]) + z * n[2]


def light_gradient(
    stored_scene: StoredScene, vectors: Shaped[F32, "probes 3 K"], is_needed: Shaped[NDArray[np.uint8], " probes"]
) -> Shaped[F32, "probes 3"]:
    """Return D of probes, the mean light vector; its length is the irradiance if light comes from one side.

    Args:
        stored_scene: the scene. vectors: t of each probe.
        is_needed: nonzero for probes to evaluate; the others get zero.
    Returns:
        World space, luminance.
    """
    out = np.zeros((len(vectors), 3), np.float32)
    probes = stored_scene.probes
    args = (basis_gradients(), np.array(LUMINANCE, np.float32), probes.normal, probes.tangent, vectors, is_needed)
    parallel_for_chunks(lambda start, stop: _light_gradient(*args, start, stop, out), len(vectors))
    return out


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def normalize(vector):  # type: ignore[no-untyped-def]
    """Normalize a vector, a tuple of three."""
    x, y, z = vector
    scale = np.float32(1) / math.sqrt(max(x * x + y * y + z * z, _EPSILON))
    return np.float32(scale * x), np.float32(scale * y), np.float32(scale * z)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def normal_tilt(textures, texture, texture_uv, footprint, n, t, handedness, outward, scratch):  # type: ignore[no-untyped-def]
    """Sample a mapped normal. See `relume.raytrace.surface_interaction` for fixed views.

    Args:
        textures: all of them. texture: index of the map. texture_uv, footprint: u and v, and see `sample_texture`.
        n: the normal, unit. t: tangent, not yet orthogonal to it.
        handedness: handedness of the bitangent; its sign counts.
        outward: the face normal on the visible side. scratch: (3,)
    Returns:
        The unit normal; n itself if the mapped normal points below the face.
    """
    sample_texture(textures, texture, texture_uv[0], texture_uv[1], footprint, scratch)
    tangent_dot_normal = t[0] * n[0] + t[1] * n[1] + t[2] * n[2]
    tx, ty, tz = normalize(
        (t[0] - tangent_dot_normal * n[0], t[1] - tangent_dot_normal * n[1], t[2] - tangent_dot_normal * n[2])
    )
    sign = np.float32(-1) if handedness < 0 else np.float32(1)
    bx, by, bz = n[1] * tz - n[2] * ty, n[2] * tx - n[0] * tz, n[0] * ty - n[1] * tx
    a, b, c = scratch[0], sign * scratch[1], scratch[2]
    x, y, z = normalize((a * tx + b * bx + c * n[0], a * ty + b * by + c * n[1], a * tz + b * bz + c * n[2]))
    if x * outward[0] + y * outward[1] + z * outward[2] <= 0:
        return n[0], n[1], n[2]
    return x, y, z


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def shading_ratio(gradient, n, perturbed):  # type: ignore[no-untyped-def]
    """Return n'·D / n·D, clamped.

    Args:
        gradient: D, a tuple of three. n: the surface's normal. perturbed: n', the perturbed normal.
    """
    irradiance = gradient[0] * n[0] + gradient[1] * n[1] + gradient[2] * n[2]
    perturbed_irradiance = gradient[0] * perturbed[0] + gradient[1] * perturbed[1] + gradient[2] * perturbed[2]
    return min(max(perturbed_irradiance, np.float32(0)) / max(irradiance, _EPSILON), _MAX_RATIO)
