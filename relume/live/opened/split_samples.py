"""Samples of an open bake in whose pixels a highlight varies, split into points all over these pixels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Protocol

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.lobe_sampling import LobeSampling
from relume.core.cache import Cache
from relume.core.digest import digest
from relume.lights.spherical_triangles import TriangleLights
from relume.live.fixed_camera.illumination import Illumination
from relume.live.fixed_camera.protocols import LightQuality, LightsAndPoints, Samples
from relume.live.opened.local_lights import LocalLights
from relume.live.opened.samples import SelectedSamples
from relume.raytrace.scene_buffers import SceneBuffers
from relume.transport.split_light import SplitLight
from relume.views.split_pixels import PixelPoints, SplitLimits, choose_splits, points_in_pixels
from relume.views.view import View

F32 = NDArray[np.float32]

_LIMITS = SplitLimits(1024, 3072)  # 114,688 points
_PRIMARY = 1e-5  # of the camera's distance from the world's origin, below which a ray starts at it


class SplitSource(Protocol):
    """An opened bake, as far as its samples are split."""

    @property
    def cache(self) -> Cache: ...
    @property
    def key(self) -> str: ...
    @property
    def local(self) -> LocalLights: ...
    @property
    def shaded_geometry(self) -> SceneBuffers:
        """The triangles with their normals."""
        ...

    def direct_lights(self, light: Illumination, quality: LightQuality) -> TriangleLights:
        """Return the environment triangles for direct illumination of the image."""
        ...

    def selected_samples(
        self, view: View, material: int, sample_indices: Shaped[NDArray[np.integer], " m"], *, has_indirect: bool
    ) -> SelectedSamples:
        """See `FixedViewTransfer`."""
        ...

    def incident_light(
        self,
        samples: Samples,
        light: Illumination,
        quality: LightQuality,
        is_canceled: Callable[[], bool],
        lobe: LobeSampling | None,
        patch_light: Illumination | None,
    ) -> LightsAndPoints:
        """See `FixedViewTransfer`."""
        ...


def split_light(
    source: SplitSource,
    view: View,
    material: int,
    light: Illumination,
    lobe: LobeSampling,
    unsplit: Callable[[], Shaped[F32, "n 3"]],
    is_canceled: Callable[[], bool],
    patch_light: Illumination | None = None,
) -> SplitLight | None:
    """Return the light at samples of a term that are split. See `FixedViewTransfer.split_light`. source: the bake"""
    if view.has_normal_map(material) or not len(source.shaded_geometry.normals):
        return None
    # one choice for all looks with this lobe: an image and the operators that change it must split the same samples
    gain = light.environment_gain if light.local else (1.0, 1.0, 1.0)
    unit_light = light._replace(reflectances=(), environment_gain=gain)
    key = source.key, *view.sample_key(material), "split samples", digest(lobe.identity), unit_light
    rows, side = source.cache.get_value(key, lambda: _choose(view, material, lobe, unsplit()))
    selected = source.selected_samples(view, material, rows, has_indirect=light.paths.has_indirect)
    pixel = view.pixel[view.rows(material)][rows].astype(np.int64)
    pixel_args = view.camera, (view.width, view.height), pixel, side, selected.points.tangent
    found = points_in_pixels(source.shaded_geometry, *pixel_args, material)
    if not len(found.sample):
        return None
    points = _move(selected, found)
    incident = source.incident_light(points, light, LightQuality.PREVIEW, is_canceled, lobe, patch_light)
    return SplitLight(rows[found.sample[found.first]], found.first, *incident)


def _choose(
    view: View, material: int, lobe: LobeSampling, radiance: Shaped[F32, "n 3"]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Choose samples with narrow lobes that the camera sees directly; see `choose_splits`."""
    samples = view.rows(material)
    rows, side = choose_splits(view.pixel[samples], (view.width, view.height), radiance, _LIMITS)
    camera = view.camera.to_world[:3, 3].astype(np.float32)
    origins = np.broadcast_to(view.ray_origins(samples), radiance.shape)[rows]
    is_primary = np.abs(origins - camera).max(axis=1, initial=0) <= _PRIMARY * np.abs(camera).max(initial=1)
    levels = view.roughness_levels(material)
    is_narrow = lobe.is_narrow[levels.level[rows]] if levels.pairs else lobe.is_narrow[:1]
    return rows[is_primary & is_narrow], side[is_primary & is_narrow]


def _move(samples: SelectedSamples, found: PixelPoints) -> SelectedSamples:
    """Return points with the visibility of their samples, without gather rays."""
    parent = samples.points.subset(found.sample)
    points = found.points._replace(alpha_sample=parent.points.alpha_sample)
    mirrors = None if samples.mirror_visibility is None else samples.mirror_visibility[found.sample]
    shading_points = replace(parent, points=points, wo=found.wo)
    source = samples, found.sample
    return replace(samples, points=shading_points, stored_rays=None, mirror_visibility=mirrors, source=source)
