"""Environments of an open bake in tiles that are small where their light is, with the visibility that these need.

See docs/adr/0035-refined-environments.md.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.cache import Cache
from relume.lights.refined_environment import RefinedEnvironment, environment_metric, misses_light, refine_environment
from relume.lights.sphere_tiles import Tiles
from relume.lights.spherical_triangles import EnvironmentTexels, TriangleLights
from relume.lights.tile_subdivision import choose_tiles
from relume.live.fixed_camera.protocols import LightQuality
from relume.look import BAKED_ENVIRONMENT, EnvironmentKey
from relume.raytrace.new_tiles import NewTiles
from relume.store.bake_protocol import StoreReader

F32 = NDArray[np.float32]

_NUM_STRONG, _STRONG = 4, 0.02  # tiles whose shadows a preview traces, with this part of all light
_PREVIEW_METRIC = 32  # times that of exact images: fewer tiles, which the brightest lights of a preview are


class TiledBake(Protocol):
    """An open bake, as far as its environments need it."""

    @property
    def cache(self) -> Cache:
        """Cache of results computed from the bake."""
        ...

    @property
    def key(self) -> str:
        """Key of the bake in it."""
        ...

    @property
    def store(self) -> StoreReader:
        """The bake."""
        ...

    @property
    def tiles(self) -> Tiles:
        """Spherical tiles of the lights."""
        ...

    @property
    def lights(self) -> TriangleLights:
        """The triangles of the baked environment."""
        ...

    @property
    def shadow_ray_directions(self) -> Shaped[F32, "M 3"]:
        """Directions of the baked shadow rays."""
        ...

    def environment_radiance(self, name: str | None) -> Shaped[F32, "height width 3"]:
        """Return the radiance of an environment, None for the scene's own."""
        ...

    def coarse_texels(self, name: str | None) -> EnvironmentTexels:
        """Return the texels of a small map of an environment, before any rotation."""
        ...

    def environment_lights(self, environment: EnvironmentKey, quality: LightQuality) -> TriangleLights:
        """Return the triangles of an environment: the tiles of the bake with new weights."""
        ...


class LightsOfHighlights(NamedTuple):
    """Triangles of an environment for the highlights of a preview.

    Attributes:
        lights: the triangles. baked: tile of the bake that each is in, whose visibility it has.
    """

    lights: TriangleLights
    baked: Shaped[NDArray[np.intp], " M"]


class RefinedEnvironments:
    """Environments of a bake in refined tiles; thread-safe.

    Args:
        bake: the bake.
    """

    def __init__(self, bake: TiledBake) -> None:
        self._bake = bake

    def exact(self, environment: EnvironmentKey) -> RefinedEnvironment:
        """Return an environment in the tiles in which samples show it exactly.

        Raises:
            NotFoundError: the environment does not exist here. SceneError: its files are damaged.
        """
        bake = self._bake
        if self._is_as_baked(environment):
            return RefinedEnvironment(bake.tiles, bake.lights, np.empty(0, np.intp))

        def refine() -> RefinedEnvironment:
            texels = EnvironmentTexels.from_radiance(bake.environment_radiance(environment.map))
            return self._refine(texels, environment.rotation, self._metric)

        return bake.cache.get_value((bake.key, "refined environment", environment), refine)

    def new_tiles(self, environment: EnvironmentKey) -> NewTiles | None:
        """Return the tiles of an environment whose visibility is not baked; None if there are none."""
        _, lights, unbaked = self.exact(environment)
        key = self._bake.key, environment
        return NewTiles(key, lights.num_lights, unbaked, lights.direction[unbaked]) if len(unbaked) else None

    def strong_tiles(self, environment: EnvironmentKey) -> NewTiles | None:
        """Return the tiles with most light in a preview whose shadow rays miss it: a sun's shadow follows the sun."""
        if environment == BAKED_ENVIRONMENT:
            return None
        lights = self._bake.environment_lights(environment, LightQuality.PREVIEW)
        power = lights.irradiance.sum(axis=1) * misses_light(self._bake.shadow_ray_directions, lights)
        strong = np.sort(np.argsort(-power, kind="stable")[:_NUM_STRONG])
        strong = strong[power[strong] > _STRONG * lights.irradiance.sum()]
        key = self._bake.key, "strong tiles", environment
        return NewTiles(key, lights.num_lights, strong, lights.direction[strong]) if len(strong) else None

    def of_highlights(self, environment: EnvironmentKey) -> LightsOfHighlights:
        """Return an environment for the highlights of a preview: in wide tiles they would have another shape.

        Raises:
            NotFoundError: the environment does not exist here. SceneError: its files are damaged.
        """
        bake = self._bake
        if self._is_as_baked(environment):
            return LightsOfHighlights(bake.lights, np.arange(bake.lights.num_lights))

        def refine() -> LightsOfHighlights:
            texels, metric = bake.coarse_texels(environment.map), _PREVIEW_METRIC * self._metric
            lights = self._refine(texels, environment.rotation, metric).lights
            return LightsOfHighlights(lights, bake.tiles.locate(lights.direction.astype(np.float64)).astype(np.intp))

        return bake.cache.transient.get_value((bake.key, "lights of highlights", environment), refine)

    def _refine(self, texels: EnvironmentTexels, rotation: float, metric: float) -> RefinedEnvironment:
        return refine_environment(self._bake.tiles, self._bake.shadow_ray_directions, texels, rotation, metric)

    @property
    def _metric(self) -> float:
        """Largest metric of a tile in the environment of the bake, cached."""

        def find() -> float:
            radiance = self._bake.environment_radiance(None)
            tiles = choose_tiles(radiance, len(self._bake.tiles.codes)) if self._is_relightable else self._bake.tiles
            return environment_metric(tiles, EnvironmentTexels.from_radiance(radiance))

        return self._bake.cache.get_value((self._bake.key, "metric of tiles"), find)

    def _is_as_baked(self, environment: EnvironmentKey) -> bool:
        return environment == BAKED_ENVIRONMENT and not self._is_relightable

    @property
    def _is_relightable(self) -> bool:
        """The tiles were chosen for any environment: none is exact in them alone."""
        return bool(self._bake.store.attributes["relightable"])
