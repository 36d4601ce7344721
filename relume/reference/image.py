"""A whole picture by brute force, over the same view samples as a bake: what differs is transport, not antialiasing."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume import environments
from relume.light.environment import lookup, turned
from relume.light.tiles import MIN_LIGHTS
from relume.look import Look
from relume.reference.radiance import Points, reference_radiance
from relume.reference.texels import texels_of
from relume.scene.model import Scene
from relume.trace.geometry import merge
from relume.trace.view_samples import BACKGROUND, ViewSamples, sample_view
from relume.transfer.base import Recipe
from relume.transfer.direct import DirectMethod

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]


def reference_image(
    scene: Scene,
    view: str,
    look: Look,
    size: tuple[int, int],
    spp: int,
    progress: Callable[[float], object] = lambda share: None,
    cancelled: Callable[[], bool] = lambda: False,
    pass_index: int = 0,
) -> F32:
    """Render a look under the environment's light: direct, with shadows.

    Args:
        size: width and height in pixels.
        spp: texels of the environment for each view sample, drawn by power with a fixed seed; 0, or as many as the
            map has, for every texel.
        progress: called with the share done. cancelled: asked now and then.
        pass_index: pictures with other indices draw independently.
    Returns:
        Linear radiance, the background seen where there is no surface. (height, width, 3) float32
    Raises:
        PlanError: the scene has no such view, or a bake of this size would be refused.
        CancelledError: `cancelled` said so.
        NotFoundError: the look names an environment that is not here.
    """
    DirectMethod().plan(scene, Recipe("direct", (view,), size, MIN_LIGHTS))  # refuses what a bake refuses
    geometry = merge(scene)
    samples = sample_view(scene, geometry, view, size)
    light = scene.environment if look.environment.map is None else environments.find(look.environment.map)
    texels = texels_of(light, look.environment.rotation)
    camera = next(camera for camera in scene.cameras if camera.name == view)
    points = points_of(samples, camera.to_world[:3, 3])
    radiance = np.empty((len(samples.pixel), 3))
    bounds = np.searchsorted(samples.material, np.arange(len(scene.materials) + 1))
    for k, material in enumerate(scene.materials):
        rows, before = slice(int(bounds[k]), int(bounds[k + 1])), int(bounds[k])
        terms: list[Any] = list(look.materials[material.name].terms)

        def share_of_all(share: float, rows: slice = rows, before: int = before) -> None:
            progress((before + share * (rows.stop - rows.start)) / max(1, int(bounds[-1])))

        radiance[rows] = reference_radiance(
            geometry, texels, points.rows(rows), [terms], spp, share_of_all, cancelled, pass_index
        )[0]  # fmt: skip
    outside = samples.material == BACKGROUND
    towards = turned(samples.surface.position[outside].astype(np.float64), -look.environment.rotation)
    radiance[outside] = lookup(light.radiance, towards.astype(np.float32))
    return _resolve(samples, np.array(look.environment.gain) * radiance, size)


def points_of(samples: ViewSamples, eye: F64) -> Points:
    """View samples as points; those of the background have no surface and are not meant."""
    surface = samples.surface
    towards = eye - surface.position
    wo = (towards / np.linalg.norm(towards, axis=1, keepdims=True)).astype(np.float32)
    textures = {"diffuse": surface.diffuse, "specular": surface.specular}
    return Points(surface.position, surface.normal, surface.tangent, wo, textures)


def _resolve(samples: ViewSamples, radiance: F64, size: tuple[int, int]) -> F32:
    """Samples to pixels by their weights. (height, width, 3)"""
    width, height = size
    weighted = samples.weight[:, None] * radiance
    pixels = [np.bincount(samples.pixel, weighted[:, c], width * height) for c in range(3)]
    return np.stack(pixels, axis=-1).reshape(height, width, 3).astype(np.float32)
