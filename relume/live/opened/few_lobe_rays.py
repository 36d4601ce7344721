"""Few lobe rays for each sample of a fixed view: the image of a narrow term while its width is dragged."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, Self

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import parallel_for_chunks
from relume.live.fixed_camera.illumination import Illumination
from relume.live.fixed_camera.jobs import CancelCheck
from relume.live.fixed_camera.protocols import LightQuality, Samples
from relume.live.free_camera.basis.table_index import MIN_COSINE, table_row
from relume.live.free_camera.environment_lookup import rotation_of
from relume.live.free_camera.highlights.environment_lobe_lookup import PrefilteredEnvironment
from relume.live.free_camera.lobe_lights import LobeLight
from relume.live.free_camera.lobe_terms import split_terms
from relume.live.free_camera.shared_lobe_rays import MAX_RAYS, ImagePoints, PixelSource, lobe_radiance
from relume.live.opened.prefiltered_environments import EnvironmentSource, PrefilteredEnvironments
from relume.transport.lobe_scene import LobeScene
from relume.transport.outgoing_patch_light import OutgoingLight
from relume.transport.shading_points import ShadingPoints
from relume.views.view import View

F32 = NDArray[np.float32]


class LobeSource(EnvironmentSource, Protocol):
    """An opened bake, as far as lobe rays need it."""

    def lobe_scene(
        self, light: Illumination, is_canceled: CancelCheck, outgoing: OutgoingLight | None = None
    ) -> LobeScene:
        """Return the surfaces that lobe rays meet, with their light.

        Args:
            light: the illumination. is_canceled: polled. outgoing: light of the patches; None: that of `light`.
        """
        ...

    def patch_light(self, light: Illumination, is_canceled: CancelCheck, quality: LightQuality) -> OutgoingLight:
        """Return the outgoing light of patches.

        Args:
            light: the illumination. is_canceled: polled. quality: of the light.
        """
        ...

    def local_lobe_lights(self, light: Illumination) -> Sequence[LobeLight]:
        """Return the local lights as narrow lobes see them. light: the illumination"""
        ...


@dataclass(frozen=True)
class FewLobeRays:
    """Shades narrow terms of an opened bake by few rays a sample. See `relume.live.free_camera.lobe_radiance`.

    Attributes:
        light_transport: the bake. light: the illumination. outgoing: of patches in that light.
        environment: behind the scene.
    """

    light_transport: LobeSource
    light: Illumination
    outgoing: OutgoingLight
    environment: PrefilteredEnvironment

    @classmethod
    def prepare(
        cls, light_transport: LobeSource, light: Illumination, is_canceled: CancelCheck, quality: LightQuality
    ) -> Self:
        """Compute all that takes longer than a frame.

        Args:
            light_transport: the bake. light: the illumination. is_canceled: polled. quality: of the light of patches.
        Raises:
            CancelledError: `is_canceled` returned true.
        """
        environments, key = PrefilteredEnvironments(light_transport), light.environment
        lookup, bright_lights = environments.environment_lookup(key.map), environments.bright_lights(key)
        gain = np.array(light.environment_gain, np.float32)
        environment = PrefilteredEnvironment(lookup, bright_lights, rotation_of(key.rotation), gain)
        return cls(light_transport, light, light_transport.patch_light(light, is_canceled, quality), environment)

    def shade(
        self,
        samples: Samples,
        receivers: ShadingPoints,
        view: View,
        material: int,
        light: Illumination,
        document: Mapping[str, Any],
    ) -> Shaped[F32, "n 3"] | None:
        """Return the radiance of samples for a white term; None if its lobe is wide. See `LobeShader`."""
        traced, _ = split_terms([{**document, "color": [1.0] * 3, "texture": None}])
        if traced is None:
            return None
        image = self._image_points(view, material)
        footprint, local_lights = samples.pixel_footprint(receivers), self.light_transport.local_lobe_lights(light)
        scene = self.light_transport.lobe_scene(light, lambda: False, self.outgoing)
        light_args = scene, self.environment, receivers, footprint
        ray_args = traced, image, MAX_RAYS / max(image.num_pixels, 1), local_lights
        radiance = lobe_radiance(*light_args, *ray_args, is_direct=light.paths.direct)
        args = receivers.normal, receivers.wo, np.ascontiguousarray(traced.albedo[:, 0])
        parallel_for_chunks(lambda start, stop: _scale_by_albedo(*args, start, stop, radiance), len(radiance))
        return radiance

    def _image_points(self, view: View, material: int) -> ImagePoints:
        """Return the samples of a material as points of their image, cached."""
        transport = self.light_transport

        def compute() -> ImagePoints:
            pixel = view.pixel[view.rows(material)].astype(np.int32)
            source = None if view.has_normal_map(material) else PixelSource(view.camera, material)
            return ImagePoints.from_pixels(pixel, (view.width, view.height), source)

        key = transport.key, *view.sample_key(material), "points of the image"
        return transport.cache.transient.get_value(key, compute)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _scale_by_albedo(normal, wo, albedo, start, stop, radiance):  # type: ignore[no-untyped-def]
    """Multiply L̄ of samples [start, stop) by the directional albedo, in place. albedo: over θo. (rows, 3)"""
    for p in range(start, stop):
        cosine = normal[p, 0] * wo[p, 0] + normal[p, 1] * wo[p, 1] + normal[p, 2] * wo[p, 2]
        row, fraction = table_row(min(max(cosine, MIN_COSINE), np.float32(1)))
        for channel in range(3):
            lower, upper = albedo[row, channel], albedo[row + 1, channel]
            radiance[p, channel] *= lower + fraction * (upper - lower)
