"""Light that flat mirrors throw: of the lights whose way over a plane was traced to view samples, exact and sharp.

A gather cell on a mirror sends what comes to it as few functions have it, some 30° wide, a small sun as all else. Of
lights that were traced it sends nothing to samples that know which of them they see: these get

    E m c F(θ)   in the direction v = d − 2 (d · n) n,   cos θ = |d · n|,

with the irradiance E of lights that lie together in direction d, and what the mirror sends on in the look
(`relume.brdf.mirror`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.bake import Recipe, StoreReader
from relume.basis.zernike import SENT_DEGREE
from relume.brdf.albedo import Reflectances, mirrors_in, reflectances_of
from relume.brdf.mirror import mirrored, mirrored_part
from relume.color import luminance
from relume.errors import ChunkDamagedError, StoreError
from relume.eye.flat_mirrors import MOST_PLANES, FlatMirrors, flat_mirrors, has_flat_mirrors, seen_in
from relume.light.tiles import Tiles
from relume.light.triangles import TriangleLights
from relume.look import EnvironmentKey
from relume.memory import Memory
from relume.methods.cells.cell_light import CellLight
from relume.methods.cells.in_lobes import Coming, sent_in_lobes
from relume.methods.cells.leaving import Leaving, sent_once
from relume.methods.cells.reflecting import Arrived, Reflecting
from relume.methods.store_io import read_lights, read_tiles
from relume.picture.light import Light
from relume.project.receivers import ThrownRays
from relume.scene.model import Scene
from relume.trace.geometry import Geometry

F32 = NDArray[np.float32]

NO_PLANE = 255  # of cells
MOST_GROUPS = 128
_BRIGHT = 8.0  # times the mean radiance of the sky: gather rays find what is dimmer


@dataclass(frozen=True)
class Thrown:
    """What was traced: bright lights, those that lie together as one.

    Attributes:
        lights: which of the bake's. (T,) int32. group: that each is in. (T,) int32
        direction: to the groups. (G, 3) float32
        mirrors: the planes, P of them.
        plane: that each gather cell lies in, `NO_PLANE` where in none. (C,) uint8
    """

    lights: NDArray[np.int32]
    group: NDArray[np.int32]
    direction: F32
    mirrors: FlatMirrors
    plane: NDArray[np.uint8]

    @property
    def num_seen(self) -> int:
        """Groups in all planes together, P G."""
        return self.mirrors.num_planes * len(self.direction)

    @classmethod
    def of(cls, lights: TriangleLights, tiles: Tiles, mirrors: FlatMirrors, plane: NDArray[np.uint8]) -> Thrown:
        """Choose the lights that are too bright for few functions.

        Args:
            lights: of a bake. tiles: that they lie in. mirrors: of its scene. plane: of its cells.
        """
        light = luminance(lights.irradiance).astype(np.float64)
        bright = np.flatnonzero(light > _BRIGHT * light.sum() / (4 * np.pi) * tiles.solid_angles)
        bright = bright[np.argsort(tiles.along[bright], kind="stable")]  # neighbours beside each other
        num_groups = min(len(bright), MOST_GROUPS)
        group = np.arange(len(bright)) * num_groups // max(1, len(bright))
        towards = np.zeros((num_groups, 3))
        np.add.at(towards, group, light[bright, None] * lights.direction[bright])
        direction = (towards / np.linalg.norm(towards, axis=1, keepdims=True)).astype(np.float32)
        chosen = bright.astype(np.int32), group.astype(np.int32), direction
        return cls(*chosen, mirrors, plane)

    @property
    def arrays(self) -> dict[str, NDArray[Any]]:
        """As a store keeps them."""
        fields = {**vars(self), **self.mirrors._asdict()}
        del fields["mirrors"]
        return {f"thrown/{name}": array for name, array in fields.items()}


def most_seen(scene: Scene, recipe: Recipe) -> int:
    """The most lights that a sample may see in flat mirrors, P G."""
    return MOST_PLANES * min(MOST_GROUPS, recipe.num_lights) if has_flat_mirrors(scene) else 0


def make_thrown(scene: Scene, geometry: Geometry, store: StoreReader, cells: F32) -> dict[str, NDArray[Any]]:
    """Find the arrays of a store from which `read_thrown` reads; none where nothing is thrown.

    Args:
        scene: that is baked. geometry: its triangles. store: with its lights.
        cells: where the points of gather cells are. (C, points, 3)
    """
    if not has_flat_mirrors(scene):
        return {}
    mirrors = flat_mirrors(scene, geometry)
    found = Thrown.of(read_lights(store), read_tiles(store), mirrors, mirrors.holding(cells, geometry.epsilon))
    return found.arrays if found.num_seen else {}


def read_thrown(store: StoreReader) -> Thrown | None:
    """What a store knows of flat mirrors; None where there is none, or no bright light."""
    try:
        store.shape("thrown/offset")
    except StoreError:
        return None

    def read(name: str) -> NDArray[Any]:
        return store.read(f"thrown/{name}")

    mirrors = FlatMirrors(*map(read, FlatMirrors._fields))
    found = Thrown(read("lights"), read("group"), read("direction"), mirrors, read("plane"))
    limits: list[tuple[NDArray[Any], int]] = [
        (found.lights, store.shape("lights/power")[0]),
        (found.group, len(found.direction)),
        (mirrors.material, len(store.attributes["materials"])),
    ]
    are_known = all(len(numbers) == 0 or 0 <= numbers.min() <= numbers.max() < limit for numbers, limit in limits)
    if not are_known or found.plane.shape != store.shape("cells/material"):
        raise ChunkDamagedError("thrown", "it does not fit the lights, materials and cells of the bake")
    return found


@dataclass(frozen=True)
class MoreThrown:
    """How much more flat mirrors throw in one light than in another; a `relume.picture.transfer.MoreThrown`.

    Attributes:
        direction: of what is thrown. (K, 3) float32 across: what comes across it. (K, 3) float32
        by_cells: what other cells see of the same in the mean, which is no part of what samples get. (C, 3) float32
    """

    direction: F32
    across: F32
    by_cells: F32

    def rays(self, visible: NDArray[np.uint8]) -> ThrownRays:
        """What comes to samples. visible: of the lights by the planes. (n, bytes) uint8"""
        return ThrownRays(self.direction, self.across, visible)


class ThrownLight:
    """Of one bake, in any look; safe to use from several threads.

    Args:
        thrown: what was traced. cells: that have sent it. lights_in: finds the triangles of an environment.
        memory: of all that is made from the bake. key: of the bake in it.
    """

    def __init__(
        self,
        thrown: Thrown,
        cells: CellLight,
        lights_in: Callable[[EnvironmentKey], TriangleLights],
        memory: Memory,
        key: str,
    ) -> None:
        self._thrown, self._cells, self._lights_in = thrown, cells, lights_in
        self._memory, self._key = memory, key
        self._directions = seen_in(thrown.mirrors.normal, thrown.direction).reshape(-1, 3)

    @staticmethod
    def is_in(light: Light) -> bool:
        """Whether anything of it may be in a light: it is reflected once before it comes."""
        return light.paths.reflect and light.paths.first == 1 and light.is_environment_lit

    def rays(self, light: Light, visible: NDArray[np.uint8]) -> ThrownRays:
        """What comes to samples.

        Args:
            light: that `is_in` says has any. visible: see `relume.eye.flat_mirrors.Seen`. (n, bytes) uint8
        """
        return ThrownRays(self._directions, self._sent(light), visible)

    def more(self, before: Light, after: Light) -> MoreThrown | None:
        """What changes of it where surfaces do, as when a hand drags a mirror's colour; None for nothing.

        Args:
            before, after: in the same environment.
        """
        here, there = (self._sent(light) if self.is_in(light) else np.float32(0) for light in (before, after))
        change = np.asarray(there - here, np.float32)
        if not change.any():
            return None
        taken = [self._taken_quickly(light).seen(self._cells) if self.is_in(light) else 0 for light in (before, after)]
        return MoreThrown(self._directions, change, np.asarray(taken[1] - taken[0], np.float32))

    def _sent(self, light: Light) -> F32:
        """What each group sends by each plane, across its way. (P G, 3) float32"""
        thrown, gain = self._thrown, np.array(light.environment_gain)
        arriving = np.zeros((len(thrown.direction), 3))
        np.add.at(arriving, thrown.group, gain * self._lights_in(light.environment).irradiance[thrown.lights])
        cosine, tints = np.abs(thrown.mirrors.normal @ thrown.direction.T), self._cells.textures[1]
        sent = np.zeros((*cosine.shape, 3))
        for p, material in enumerate(thrown.mirrors.material):
            on_plane = thrown.plane == p
            tint = tints[on_plane].mean(axis=0) if on_plane.any() else np.ones(3)
            terms = mirrors_in(light.reflectances[material])
            sent[p] = mirrored(terms, cosine[p], np.broadcast_to(tint, (len(cosine[p]), 3)))
        return np.asarray((sent * arriving).reshape(-1, 3), np.float32)

    def taken(self, light: Light) -> Leaving:
        """What cells in the planes send of the same lights, as exact pictures have it."""
        alone, lights = _mirrors_alone(light.reflectances), self._bright_in(light.environment)
        reflecting, arrived = self._taking(light, alone)
        lobes = self._cells.lobes(alone, reflecting)
        lights = replace(lights, irradiance=np.array(light.environment_gain, np.float32) * lights.irradiance)
        coming = Coming(lights, self._cells.seen_by(lobes.rows, self._among))
        return sent_once(reflecting, arrived, (lobes, sent_in_lobes(self._cells, lobes, coming)))

    def _taken_quickly(self, light: Light) -> Leaving:
        """The same as functions have it."""
        return sent_once(*self._taking(light, _mirrors_alone(light.reflectances)))

    def _taking(self, light: Light, alone: Reflectances) -> tuple[Reflecting, Arrived]:
        """What cells in the planes make of light, and what comes to them. alone: what mirrors reflect"""
        whole = self._cells.reflecting(alone)
        is_among = self._thrown.plane[whole.rows] != NO_PLANE
        rows = whole.rows[is_among]
        arrived, gain = self._arrived(light.environment, rows), np.array(light.environment_gain, np.float32)
        reflectance = whole.reflectance * (self._thrown.plane != NO_PLANE)[:, None]
        some = replace(whole, reflectance=reflectance, rows=rows, shares=whole.shares[:, is_among])
        return some, Arrived(gain * arrived.irradiance, gain[:, None] * arrived.vectors)

    @property
    def _among(self) -> NDArray[np.intp]:
        return self._thrown.lights.astype(np.intp)

    def _bright_in(self, environment: EnvironmentKey) -> TriangleLights:
        """The lights that were traced, in an environment."""
        whole = self._lights_in(environment)
        return whole.some(self._among, whole.irradiance[self._among])

    def _arrived(self, environment: EnvironmentKey, rows: NDArray[np.intp]) -> Arrived:
        def found() -> Arrived:
            among, cells, some = self._among, self._cells, self._bright_in(environment)
            return Arrived(cells.irradiance(some, among), cells.vectors(rows, some, SENT_DEGREE, among))

        return self._memory.keep((self._key, "thrown light on cells", environment, rows.tobytes()), found)


def _mirrors_alone(reflectances: Reflectances) -> Reflectances:
    """Of materials as far as they are mirrors."""
    return tuple(reflectances_of(list(map(mirrored_part, mirrors_in(one)))) for one in reflectances)
