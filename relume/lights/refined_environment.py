"""An environment that a bake was not made for, in tiles that are small where its light is.

The tiles of a bake are small where the light of its own environment is. If the environment is rotated or exchanged,
bright light lies in wide tiles, with one visibility bit each, toward where it was not. So these tiles are divided, as
for a new bake; their visibility must be traced, and that of tiles whose shadow ray misses their light.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.environments.equirect import rotate_about_y
from relume.lights.light_moments import LightTexels
from relume.lights.sphere_tiles import Tiles
from relume.lights.spherical_triangles import EnvironmentTexels, TriangleLights, integrate_environment
from relume.lights.tile_subdivision import largest_metric, refine_tiles

F32 = NDArray[np.float32]

_MORE_TILES = 0.25  # by which their number grows at most
_MIDDLE = 0.5  # of the radius of a light


class RefinedEnvironment(NamedTuple):
    """An environment in M or more tiles.

    Attributes:
        tiles: of the sphere; of the M baked ones, those that were not divided have kept their index.
        lights: light of each. unbaked: indices of tiles whose visibility is not baked, ascending.
    """

    tiles: Tiles
    lights: TriangleLights
    unbaked: Shaped[NDArray[np.intp], " K"]


def environment_metric(tiles: Tiles, environment: EnvironmentTexels) -> float:
    """Return the metric that no tile exceeds in the environment for which they were chosen; see `refine_tiles`."""
    return largest_metric(tiles, _texels_in(tiles, environment, 0.0))


def refine_environment(
    tiles: Tiles, ray_directions: Shaped[F32, "M 3"], environment: EnvironmentTexels, rotation: float, metric: float
) -> RefinedEnvironment:
    """Return an environment in refined tiles. O(texels · depth) time.

    Args:
        tiles, ray_directions: of a bake, with the directions of their shadow rays. environment: its texels.
        rotation: of the environment about +Y, degrees. metric: of the bake, see `environment_metric`.
    """
    num_more = int(_MORE_TILES * len(tiles.codes))
    refined, new = refine_tiles(tiles, _texels_in(tiles, environment, rotation), metric, num_more)
    lights = integrate_environment(refined, environment, rotation)
    is_unbaked = np.ones(lights.num_lights, np.bool_)
    is_unbaked[: len(ray_directions)] = misses_light(ray_directions, lights)
    is_unbaked[new] = True
    return RefinedEnvironment(refined, lights, np.flatnonzero(is_unbaked))


def _texels_in(tiles: Tiles, environment: EnvironmentTexels, rotation: float) -> LightTexels:
    directions = rotate_about_y(environment.directions, rotation)
    return LightTexels(tiles.locate(directions), environment.luminous, directions, environment.solid_angles)


def misses_light(ray_directions: Shaped[F32, "M 3"], lights: TriangleLights) -> Shaped[NDArray[np.bool_], " M"]:
    """Return which shadow rays of a bake miss the middle of the light in their tile, one of the first M."""
    num = len(ray_directions)
    cosine = np.einsum("mi,mi->m", ray_directions, lights.direction[:num])
    return np.asarray(np.arccos(np.clip(cosine, -1, 1)) > _MIDDLE * lights.radius[:num])
