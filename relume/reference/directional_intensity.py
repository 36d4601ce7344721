"""Intensity of point and spot lights of the reference over directions, without the table of interactive rendering."""

from __future__ import annotations

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray
from scipy.interpolate import RegularGridInterpolator

from relume.assets.ies.ies_store import load_web
from relume.images.image_store import load_gobo
from relume.look.model import PointLook, SpotLook
from relume.raytrace.texture import MipMap

F64 = NDArray[np.float64]


def directional_intensity(light: PointLook | SpotLook, direction: Shaped[F64, "n m 3"]) -> Shaped[F64, "n m c"]:
    """Intensity over the emission, without the falloff of a cone; of one channel, or of three with a gobo.

    direction: away from the light, unit.
    """
    nadir, across, up = _frame(light)
    x, y, z = direction @ across, direction @ up, direction @ nadir
    intensity = np.ones((*x.shape, 1))
    if light.profile is not None:
        intensity = intensity * _web_intensity(light.profile, x, -y, z)[..., None]
    if isinstance(light, SpotLook) and light.gobo is not None:
        # on a plane at distance 1, the image is a square about the circle that the cone cuts out
        half_side = np.tan(np.radians(light.cone[1]))
        depth = np.where(z > 0, z, np.inf)
        uv = np.stack([0.5 - x / depth / (2 * half_side), 0.5 - y / depth / (2 * half_side)], axis=-1)
        flat = np.clip(uv, 0, 1).reshape(-1, 2).astype(np.float32)
        texels = MipMap.for_texture(load_gobo(light.gobo)).sample(flat, np.zeros(len(flat), np.float32))
        intensity = intensity * texels.reshape(*x.shape, 3)
    return np.asarray(intensity, np.float64)


def _web_intensity(profile: str, x: F64, y: F64, z: F64) -> F64:
    web = load_web(profile).astype(np.float64)
    polar = np.degrees(np.arccos(np.clip(z, -1, 1)))
    if web.shape[1] == 1:
        return np.asarray(np.interp(polar, np.linspace(0, 180, len(web)), web[:, 0]))
    angles = np.linspace(0, 180, web.shape[0]), np.linspace(0, 360, web.shape[1])
    azimuth = np.degrees(np.angle(x + 1j * y)) % 360
    return np.asarray(RegularGridInterpolator(angles, web)(np.stack([polar, azimuth], axis=-1)))


def _frame(light: PointLook | SpotLook) -> tuple[F64, F64, F64]:
    """Direction, and the axes of azimuths 0° and 270° of a web, which are the left and the top of a gobo."""
    nadir = np.array(light.direction) / np.linalg.norm(light.direction)
    reference = (0.0, 1.0, 0.0) if np.hypot(nadir[0], nadir[2]) > 1e-3 else (0.0, 0.0, 1.0)
    across = np.cross(reference, nadir)
    across /= np.linalg.norm(across)
    rotation = np.exp(1j * np.radians(light.rotation))
    across = rotation.real * across + rotation.imag * np.cross(nadir, across)
    return nadir, across, np.cross(nadir, across)
