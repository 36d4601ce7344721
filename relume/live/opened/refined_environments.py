"""Environments that a bake was not made for: more tiles where they have their light, with shadows of their own.

The tiles of a bake are small where the light of its own environment is. If the environment is rotated or exchanged,
bright light lies in wide tiles, with one visibility bit each, toward where it was not. So these tiles are divided, as
for a new bake, and the visibility of the new ones is traced at the displayed samples.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.environments.equirect import rotate_about_y
from relume.core.cache import Cache
from relume.lights.light_moments import LightTexels
from relume.lights.sphere_tiles import Tiles
from relume.lights.spherical_triangles import EnvironmentTexels, TriangleLights, integrate_environment
from relume.lights.tile_subdivision import largest_metric, refine_tiles
from relume.look import BAKED_ENVIRONMENT, EnvironmentKey
from relume.raytrace.new_tiles import NewTiles

F32 = NDArray[np.float32]

_MORE_TILES = 0.25  # by which their number grows at most


class RefinedEnvironment(NamedTuple):
    """An environment in tiles that are small where its light is.

    Attributes:
        tiles: of the sphere. lights: light of each. new: those that are not baked; None if all are.
    """

    tiles: Tiles
    lights: TriangleLights
    new: NewTiles | None


class TileSource(Protocol):
    """An opened bake, as far as its environments are refined."""

    @property
    def cache(self) -> Cache: ...
    @property
    def key(self) -> str: ...
    @property
    def tiles(self) -> Tiles: ...
    def environment_radiance(self, name: str | None) -> Shaped[F32, "height width 3"]:
        """See `BakedFixedViews`."""
        ...


def refine_environment(source: TileSource, environment: EnvironmentKey) -> RefinedEnvironment:
    """Return an environment that a bake was not made for, in refined tiles, cached.

    Args:
        source: the bake. environment: not its own.
    Raises:
        NotFoundError: the environment does not exist here. SceneError: its files are damaged.
    """

    baked = source.tiles

    def texels_of(key: EnvironmentKey) -> tuple[EnvironmentTexels, LightTexels]:
        texels = EnvironmentTexels.from_radiance(source.environment_radiance(key.map))
        directions = rotate_about_y(texels.directions, key.rotation)
        return texels, LightTexels(baked.locate(directions), texels.luminous, directions, texels.solid_angles)

    def refine() -> RefinedEnvironment:
        metric = source.cache.get_value(
            (source.key, "largest metric"), lambda: largest_metric(baked, texels_of(BAKED_ENVIRONMENT)[1])
        )
        texels, in_baked = texels_of(environment)
        tiles, new = refine_tiles(baked, in_baked, metric, int(_MORE_TILES * len(baked.codes)))
        lights = integrate_environment(tiles, texels, environment.rotation)
        new_tiles = NewTiles((source.key, environment), lights.num_lights, new, lights.direction[new])
        return RefinedEnvironment(tiles, lights, new_tiles if len(new) else None)

    return source.cache.get_value((source.key, "refined lights", environment), refine)
