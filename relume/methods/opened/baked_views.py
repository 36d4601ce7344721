"""Bakes of fixed views, opened for freezing and frames."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from relume import environments
from relume.bake import StoreReader
from relume.code_version import image_code
from relume.environments.equirect import lookup, shrunk, turned
from relume.light.blur import blurred, reduced
from relume.light.local import num_samples
from relume.light.merged import merge, num_merged
from relume.light.tiles import Tiles
from relume.light.triangles import TriangleLights, Unturned, weigh
from relume.look import BAKED_ENVIRONMENT, EnvironmentKey, LightGeometry
from relume.memory import Memory
from relume.methods.local_lights import LocalLights, Shadows
from relume.methods.reflected import Reflected
from relume.methods.retracing import Retracing
from relume.methods.store_io import read_lights, read_tiles, read_traced_directions
from relume.methods.thrown import MoreThrown
from relume.operators.image_files import ImageFiles
from relume.picture.light import Light, leaning_as_baked
from relume.picture.transfer import Arriving, Axis, Eyes
from relume.points import Points
from relume.project.receivers import GatherRays, Rays, Receivers
from relume.project.sent import Sent
from relume.views.thinned import ThinnedStore
from relume.views.view import View, open_view

PREVIEW_WIDTH = 256
_EDITED_BYTES = 256 << 20

F32 = NDArray[np.float32]
Lights = Callable[[EnvironmentKey], TriangleLights]
"""Finds the triangles of an environment."""


@dataclass(frozen=True)
class BakedViews:
    """One bake of fixed views in which light comes straight; a `relume.picture.transfer.Transfer`.

    Attributes:
        memory: of all that is made from the bake and may be made again.
        key: path of the store; tells this bake's entries from other bakes' in the memory.
        default_look: the complete look of the scene as it was imported.
    """

    memory: Memory
    key: str
    store: StoreReader
    scene_id: str
    method: str
    num_lights: int
    default_look: dict[str, Any]
    material_names: Sequence[str]
    views: dict[str, View]

    eyes = Eyes.BAKED
    axes = frozenset((Axis.CURVE, Axis.PARAMETER, Axis.LIGHT, Axis.ENVIRONMENT))

    @cached_property
    def derived(self) -> ImageFiles:
        """Images of the default look, made once."""
        return ImageFiles(Path(self.key) / "derived", image_code())

    @cached_property
    def edited(self) -> ImageFiles:
        """Those of other looks, the newest of them, for when the same look is opened after a restart."""
        return ImageFiles(Path(self.key) / "edited", image_code(), _EDITED_BYTES)

    def has_image(self, key: Hashable) -> bool:
        """Whether the image of a term is beside the store, under the name of a job without the store's own."""
        return self.derived.has(key) or self.edited.has(key)

    @cached_property
    def local(self) -> LocalLights:
        """What local lights need."""
        return LocalLights(self.store, self.memory, self.key)

    @cached_property
    def tracer(self) -> Retracing:
        """Rays for normals that the bake did not know."""
        return Retracing(self.store, self.local, None)

    @cached_property
    def lights(self) -> TriangleLights:
        """The environment's triangles."""
        return read_lights(self.store)

    def radiance_of(self, name: str | None) -> NDArray[np.float32]:
        """Radiance of an environment, None for the scene's own. (height, width, 3) float32

        Raises:
            NotFoundError: it is not here. SceneError: its files are damaged.
        """
        return environments.find(name).radiance if name is not None else self._own_radiance()

    def _own_radiance(self) -> F32:
        def read() -> F32:
            return np.asarray(self.store.read("lights/environment"), np.float32)

        return self.memory.keep((self.key, "environment"), read)

    def lights_in(self, environment: EnvironmentKey) -> TriangleLights:
        """The triangles of an environment: the tiles of the bake, weighed again."""
        return self.lights if environment == BAKED_ENVIRONMENT else self._weighed(environment)

    def lights_of(self, light: Light) -> TriangleLights:
        """Those of them by which light comes straight to the picture."""
        return shown_of(self.lights_in(light.environment), light)

    def merged(self, light: Light) -> TriangleLights:
        """The same, merged into a few. See `Transfer`."""

        def merged() -> TriangleLights:
            return merge(self.lights_in(light.environment), self.tiles, num_merged(self.num_lights))

        return shown_of(self.memory.keep((self.key, "merged lights", light.environment), merged), light)

    def preview_lights_of(self, light: Light) -> TriangleLights:
        """The same, found quickly."""
        return shown_of(self.preview_lights_in(light.environment), light)

    def _weighed(self, environment: EnvironmentKey) -> TriangleLights:
        def weighed() -> TriangleLights:
            return weigh(self.tiles, Unturned.of(self.radiance_of(environment.map)), environment.rotation)

        return self.memory.keep((self.key, "lights", environment), weighed)

    def preview_lights_in(self, environment: EnvironmentKey) -> TriangleLights:
        """The triangles of an environment from a map of at most 256 texels' width: a large one takes seconds."""
        return self.weighed_quickly("lights", environment, self.radiance_of)

    def weighed_quickly(
        self, what: str, environment: EnvironmentKey, radiance_of: Callable[[str | None], F32]
    ) -> TriangleLights:
        """The same of a part of an environment; what stays while it is turned is kept.

        Args:
            what: of it, in words. environment: whose. radiance_of: finds the part by the environment's name.
        """
        key = self.owner_of(environment.map), f"texels of preview {what}", environment.map

        def weighed() -> TriangleLights:
            of = self.memory.keep(key, lambda: Unturned.of(shrunk(radiance_of(environment.map), PREVIEW_WIDTH)))
            return weigh(self.tiles, of, environment.rotation)

        return self.memory.passing.keep((self.key, f"preview {what}", environment), weighed)

    def owner_of(self, name: str | None) -> str:
        """Whose entries in the memory those made of an environment are: the bake's where it is its own."""
        return self.key if name is None else "environments"

    @cached_property
    def traced_directions(self) -> F32:
        """Where shadow rays went. (M, 3) float32"""
        return read_traced_directions(self.store)

    @cached_property
    def tiles(self) -> Tiles:
        """Of the sphere, that lights were chosen in."""
        return read_tiles(self.store)

    @property
    def reflected(self) -> Reflected | None:
        """Light between surfaces: none was baked."""
        return None

    def reflected_in(self, light: Light) -> Sent | None:
        """What the gather cells send; None where nothing of it comes to the picture."""
        return self.reflected.under(light) if self.reflected is not None and light.paths.reflect else None

    def trace_cells(self, light: Light, cancelled: Callable[[], bool]) -> None:
        """Trace what gather cells lack: there are none. See `Transfer`."""

    def between_surfaces(
        self, light: Light, gathered: GatherRays, thrown: NDArray[np.uint8] | None
    ) -> tuple[Rays, ...]:
        """The rays of samples that bring what surfaces send.

        Args:
            light: all that shines.
            gathered: their gather rays, of which `sent` does not count. thrown: what they see in flat mirrors.
        """
        sent = self.reflected_in(light)
        return () if sent is None else (replace(gathered, sent=sent),)

    def arriving(self, view: View, material: int, light: Light, memory: Memory) -> Arriving:
        """What arrives at a material's samples in a light; shadows that the memory lacks are traced. See `Transfer`."""
        lights = self.lights_of(light)
        receivers = view.receivers(material, is_lit=lights.num_lights > 0)
        return lights, replace(receivers, rays=self._rays(view, material, light, memory))

    def _rays(self, view: View, material: int, light: Light, memory: Memory) -> Sequence[Rays]:
        """The rays among what arrives: those of local lights."""
        if not light.local:
            return ()

        def remembered(geometry: LightGeometry, points: Points) -> Shadows:
            key = (self.key, *view.place(material), "shadows", geometry)
            num_bytes = len(points.position) * -(-num_samples(geometry, self.local.samples_of(geometry)) // 8)
            return memory.get(key, Shadows, num_bytes, lambda: self.local.shadows(geometry, points))

        return self.local.all_rays(light, view.points(material), remembered)

    def thrown_to(self, view: View, material: int) -> NDArray[np.uint8] | None:
        """The lights that a material's samples see in flat mirrors: none without gather rays. See `Transfer`."""
        return None

    def more_thrown(self, before: Light, after: Light) -> MoreThrown | None:
        """How much more flat mirrors throw after than before: nothing. See `Transfer`."""
        return None

    def some(self, view: View, material: int, chosen: NDArray[np.integer], *, reflects: bool) -> FewSamples:
        """Some of a material's samples. See `Transfer`."""
        few = view.receivers(material, is_lit=False).places(chosen)
        visible = np.asarray(view.read_some("visibility", material, chosen), np.uint8)
        return FewSamples(self, replace(few, visible=visible))

    def open_sky(self, light: Light, points: Points, *, is_preview: bool) -> Arriving:
        """What the environment brings to points, seen along their normals, if nothing hides it. See `Transfer`."""
        straight = light._replace(paths=light.paths._replace(direct=True).without_reflections())
        above = points.normal @ self.traced_directions.T > 0
        seen = np.packbits(above, axis=1, bitorder="little")
        lights = self.preview_lights_of(straight) if is_preview else self.lights_of(straight)
        return lights, Receivers(points, points.normal, seen)

    def thinned(self, view_name: str, step: int) -> Self:
        """One view of the bake with 1 / step² of its pixels. Its images are not kept: no folder is beside its key."""
        index = self.views[view_name].index
        store, key = ThinnedStore(self.store, index, step), f"{self.key}/{step}"
        return replace(self, key=key, store=store, views={view_name: open_view(store, index, self.memory, key)})

    def shines_at(self, view: View, material: int) -> NDArray[np.bool_]:
        """Whether the samples of a material that shines are seen from a side that does."""
        return self.local.shines_at(material, view.eyes(view.rows(material)), view.points(material).position)

    def background_in(self, environment: EnvironmentKey, view: View) -> NDArray[np.float32]:
        """Radiance of a view's samples of an environment. (n, 3) float32"""
        if environment == BAKED_ENVIRONMENT:
            return view.background()
        return self.seen_in(environment, view.background_directions())

    def seen_in(self, environment: EnvironmentKey, directions: NDArray[np.float64], blur: float = 0) -> F32:
        """Radiance of an environment in unit directions (n, 3), blurred by `blur` degrees. (n, 3) float32"""
        radiance = self.map_of(environment.map, blur)
        return lookup(radiance, turned(directions, -environment.rotation).astype(np.float32))

    def map_of(self, name: str | None, blur: float = 0) -> F32:
        """Radiance of an environment, None for the scene's own, blurred by `blur` degrees. (height, width, 3)"""
        return self._blurred(name, blur) if blur else self.radiance_of(name)

    def _blurred(self, name: str | None, degrees: float) -> F32:
        owner = self.owner_of(name)

        def few() -> F32:
            return reduced(self.radiance_of(name))

        def made() -> F32:
            return blurred(self.memory.keep((owner, "reduced environment", name), few), degrees)

        return self.memory.passing.keep((owner, "blurred environment", name, degrees), made)


@dataclass(frozen=True)
class FewSamples:
    """A few samples of a material, shaded at once in any light; a `relume.picture.transfer.Few`.

    Attributes:
        receivers: without any rays.
        gathered: their gather rays, where those were baked; they bring nothing yet.
        thrown: the lights that they see in flat mirrors, where those were baked. (n, bytes) uint8
    """

    transfer: BakedViews
    receivers: Receivers
    gathered: GatherRays | None = None
    thrown: NDArray[np.uint8] | None = None

    @property
    def num_bytes(self) -> int:
        """Memory they hold."""
        few, links = self.receivers, 0 if self.gathered is None else self.gathered.links.nbytes
        return int(2 * few.normal.nbytes + few.tangent.nbytes + few.wo.nbytes + few.visible.nbytes + links)

    def arriving(self, light: Light) -> Arriving:
        """What arrives at them in a light; the environment from a small map, local lights exactly, what surfaces send
        as if they leant as they were baked: tracing how they do now takes longer than a preview."""
        transfer, reflected = self.transfer, tuple[Rays, ...]()
        if self.gathered is not None:
            reflected = transfer.between_surfaces(leaning_as_baked(light), self.gathered, self.thrown)
        local = transfer.local.all_rays(light, self.receivers.points)
        return transfer.preview_lights_of(light), replace(self.receivers, rays=(*reflected, *local))


def shown_of(lights: TriangleLights, light: Light) -> TriangleLights:
    """The triangles of an environment by which light comes straight to the picture, beside local lights."""
    if not light.shows_sky:
        return lights.none()
    if light.environment_gain == (1.0, 1.0, 1.0):
        return lights
    return replace(lights, irradiance=lights.irradiance * np.array(light.environment_gain, np.float32))
