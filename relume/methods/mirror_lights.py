"""Virtual lights of planar mirrors: bright lights of the bake, grouped by direction, and the planes that mirror them.

A patch on a mirror reflects light in a low-degree basis, some 30° wide, even that of a small sun. The bake therefore
traces shadow rays by way of the mirrors: a sample stores which of these lights it sees in each plane.
`relume.live.opened.planar_mirror_light` gives them their light in a look.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.camera.planar_mirrors import MAX_PLANES, PlanarMirrors, find_planar_mirrors, has_planar_mirrors
from relume.core.color import luminance
from relume.core.errors import ChunkDamagedError
from relume.lights.sphere_tiles import Tiles
from relume.lights.spherical_triangles import TriangleLights
from relume.methods.store_layout import read_lights, read_tiles
from relume.raytrace.scene_buffers import SceneBuffers
from relume.scene.model import Scene
from relume.store.bake_protocol import Recipe, StoreReader
from relume.store.optional_arrays import has_array

F32 = NDArray[np.float32]

NO_PLANE = 255  # of patches
MAX_GROUPS = 128
_BRIGHT = 8.0  # times the mean radiance of the environment: gather rays suffice for dimmer light


@dataclass(frozen=True)
class MirrorLights:
    """The traced lights, grouped by direction.

    Attributes:
        lights: indices of the T traced lights of the bake. group: of each.
        direction: to the G groups. mirrors: the planes, P of them.
        plane: of each patch, `NO_PLANE` if it lies in none.
    """

    lights: Shaped[NDArray[np.int32], " T"]
    group: Shaped[NDArray[np.int32], " T"]
    direction: Shaped[F32, "G 3"]
    mirrors: PlanarMirrors
    plane: Shaped[NDArray[np.uint8], " patches"]

    @property
    def num_mirrored_lights(self) -> int:
        """Number of virtual lights in all planes, P G."""
        return self.mirrors.num_planes * len(self.direction)

    @classmethod
    def from_lights(
        cls, lights: TriangleLights, tiles: Tiles, mirrors: PlanarMirrors, plane: Shaped[NDArray[np.uint8], " patches"]
    ) -> MirrorLights:
        """Select the lights that are too bright for a low-degree basis.

        Args:
            lights: of a bake. tiles: of these lights. mirrors: of its scene. plane: of its patches.
        """
        brightness = luminance(lights.irradiance).astype(np.float64)
        bright_indices = np.flatnonzero(brightness > _BRIGHT * brightness.sum() / (4 * np.pi) * tiles.solid_angles)
        # neighbors in sequence
        bright_indices = bright_indices[np.argsort(tiles.traversal_key[bright_indices], kind="stable")]
        num_groups = min(len(bright_indices), MAX_GROUPS)
        group = np.arange(len(bright_indices)) * num_groups // max(1, len(bright_indices))
        summed_direction = np.zeros((num_groups, 3))
        np.add.at(summed_direction, group, brightness[bright_indices, None] * lights.direction[bright_indices])
        direction = (summed_direction / np.linalg.norm(summed_direction, axis=1, keepdims=True)).astype(np.float32)
        selected_groups = bright_indices.astype(np.int32), group.astype(np.int32), direction
        return cls(*selected_groups, mirrors, plane)

    @property
    def arrays(self) -> dict[str, NDArray[Any]]:
        """Arrays for a store."""
        fields = {**vars(self), **self.mirrors._asdict()}
        del fields["mirrors"]
        return {f"mirror_lights/{name}": array for name, array in fields.items()}


def max_mirror_lights(scene: Scene, recipe: Recipe) -> int:
    """Maximum number of virtual lights of a sample, P G."""
    return MAX_PLANES * min(MAX_GROUPS, recipe.num_lights) if has_planar_mirrors(scene) else 0


def make_mirror_lights(
    scene: Scene, geometry: SceneBuffers, store: StoreReader, patch_positions: Shaped[F32, "patches points 3"]
) -> dict[str, NDArray[Any]]:
    """Compute the arrays that `read_mirror_lights` reads; empty if no mirror reflects a bright light.

    Args:
        scene: that is baked. geometry: its triangles. store: with its lights. patch_positions: sample points.
    """
    if not has_planar_mirrors(scene):
        return {}
    mirrors = find_planar_mirrors(scene, geometry)
    mirror_lights = MirrorLights.from_lights(
        read_lights(store), read_tiles(store), mirrors, mirrors.containing_plane(patch_positions)
    )
    return mirror_lights.arrays if mirror_lights.num_mirrored_lights else {}


def read_mirror_lights(store: StoreReader) -> MirrorLights | None:
    """Read the mirror lights of a store; None without planar mirrors or bright lights."""
    if not has_array(store, "mirror_lights/offset"):
        return None

    def read(name: str) -> NDArray[Any]:
        return store.read(f"mirror_lights/{name}")

    mirrors = PlanarMirrors(*map(read, PlanarMirrors._fields))
    mirror_lights = MirrorLights(read("lights"), read("group"), read("direction"), mirrors, read("plane"))
    limits: list[tuple[NDArray[Any], int]] = [
        (mirror_lights.lights, store.shape("lights/irradiance")[0]),
        (mirror_lights.group, len(mirror_lights.direction)),
        (mirrors.material, len(store.attributes["materials"])),
    ]
    are_valid = all(len(indices) == 0 or 0 <= indices.min() <= indices.max() < limit for indices, limit in limits)
    if not are_valid or mirror_lights.plane.shape != store.shape("patches/material"):
        raise ChunkDamagedError("mirror_lights", "its arrays do not match the lights, materials or patches")
    return mirror_lights
