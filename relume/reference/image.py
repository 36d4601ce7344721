"""A whole picture by brute force, over the same view samples as a bake: what differs is transport, not antialiasing."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume import environments
from relume.errors import CancelledError
from relume.light.environment import lookup, turned
from relume.light.tiles import MIN_LIGHTS
from relume.look import Look, Paths
from relume.reference.indirect import reference_indirect
from relume.reference.local import emission_of, lamps_of
from relume.reference.radiance import Points, reference_radiance
from relume.reference.texels import texels_of
from relume.scene.model import Scene
from relume.trace.geometry import merge
from relume.trace.view_samples import BACKGROUND, ViewSamples, sample_view
from relume.transfer.base import Recipe
from relume.transfer.direct import DirectMethod

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_SPP_A_PATH = 16  # texels drawn for every place on a path
_POINTS_A_BLOCK = 4096
_STRAIGHT_SHARE = 0.2  # of the time, where there are other paths


def reference_image(
    scene: Scene,
    view: str,
    look: Look,
    size: tuple[int, int],
    spp: int,
    progress: Callable[[float], object] = lambda share: None,
    cancelled: Callable[[], bool] = lambda: False,
    pass_index: int = 0,
    *,
    reflects: bool = False,
) -> F32:
    """Render a look under all its lights, with shadows, by the light paths that its `transport` names.

    Args:
        size: width and height in pixels.
        spp: texels of the environment for each view sample, drawn by power with a fixed seed, and places of each local
            light that has an extent; 0, or as many as the map has, for every texel.
        progress: called with the share done. cancelled: asked now and then.
        pass_index: pictures with other indices draw independently.
        reflects: whether there is light between surfaces, as method `gather` has it; one path for every
            `_SPP_A_PATH` of `spp`.
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
    texels, lamps = texels_of(light, look.environment.rotation).times(look.environment.gain), lamps_of(scene, look)
    paths = look.transport.paths if reflects else look.transport.paths.without_reflections()
    camera = next(camera for camera in scene.cameras if camera.name == view)
    eye = camera.to_world[:3, 3]
    points = points_of(samples, eye)
    radiance = np.zeros((len(samples.pixel), 3))
    straight = _STRAIGHT_SHARE if paths.reflect else 1.0
    bounds = np.searchsorted(samples.material, np.arange(len(scene.materials) + 1))
    for k, material in enumerate(scene.materials if paths.direct else ()):
        rows, before = slice(int(bounds[k]), int(bounds[k + 1])), int(bounds[k])
        terms: list[Any] = list(look.materials[material.name].terms)

        def share_of_all(share: float, rows: slice = rows, before: int = before) -> None:
            progress(straight * (before + share * (rows.stop - rows.start)) / max(1, int(bounds[-1])))

        radiance[rows] = reference_radiance(
            geometry, texels, points.rows(rows), [terms], spp, share_of_all, cancelled, pass_index, lamps
        )[0]  # fmt: skip
        if (emission := emission_of(lamps, material.name)).any():
            front = geometry.is_front(eye.astype(np.float32), points.position[rows])
            radiance[rows] += emission * (front | material.double_sided)[:, None]
    if paths.reflect:
        on_surface = slice(0, int(bounds[-1]))
        truth = partial(reference_indirect, scene, geometry, texels, look)
        radiance[on_surface] += _reflected(
            truth, points.rows(on_surface), samples.material[on_surface], paths, spp, pass_index, cancelled,
            lambda share: progress(straight + (1 - straight) * share),
        )  # fmt: skip
    if paths.direct:
        outside = samples.material == BACKGROUND
        towards = turned(samples.surface.position[outside].astype(np.float64), -look.environment.rotation)
        radiance[outside] = np.array(look.environment.gain) * lookup(light.radiance, towards.astype(np.float32))
    return _resolve(samples, radiance, size)


def _reflected(
    truth: Callable[..., F64],
    points: Points,
    material: NDArray[np.integer],
    paths: Paths,
    spp: int,
    pass_index: int,
    cancelled: Callable[[], bool],
    progress: Callable[[float], object],
) -> F64:
    """Radiance of points by way of other surfaces, block by block. truth: `reference_indirect` of a look. (n, 3)"""
    num_blocks, num_paths = -(-points.num_points // _POINTS_A_BLOCK), max(1, spp // _SPP_A_PATH)
    found = np.empty((points.num_points, 3))
    for block in range(num_blocks):
        if cancelled():
            raise CancelledError("the reference was cancelled")
        rows = slice(block * _POINTS_A_BLOCK, (block + 1) * _POINTS_A_BLOCK)
        found[rows], _ = truth(
            points.rows(rows), material[rows], paths.last, num_paths, _SPP_A_PATH,
            seed=pass_index * num_blocks + block, first_bounce=paths.first,
        )  # fmt: skip
        progress((block + 1) / num_blocks)
    return found


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
