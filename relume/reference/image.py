"""A whole picture by brute force, over the same view samples as a bake: what differs is transport, not antialiasing.

By all light paths that there are, and by those that a method follows: of one draw, so that the two differ by what the
method leaves out alone.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relume import environments
from relume.bake import Recipe
from relume.environments.equirect import lookup, turned
from relume.environments.model import Environment
from relume.errors import CancelledError
from relume.eye.mirrors import are_mirrors
from relume.eye.view_samples import BACKGROUND, ViewSamples, sample_view
from relume.light.tiles import MIN_LIGHTS
from relume.look import Look, Paths
from relume.methods.direct import DirectMethod
from relume.points import ALIKE
from relume.reference.images import roughness_at, textures_of, wearing
from relume.reference.indirect import reference_indirect
from relume.reference.kinds import kinds_of
from relume.reference.local import LocalLamp, emission_of, lamps_of
from relume.reference.paths import left_out, untraced, whole_paths
from relume.reference.radiance import Points, reference_radiance
from relume.reference.texels import Texels, texels_of
from relume.scene.model import Scene
from relume.trace.geometry import Geometry, merge

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_SPP_A_PATH = 16  # texels drawn for every place on a path
_POINTS_A_BLOCK = 4096
_DIRECT_SHARE = 0.2  # of the time, where there are other paths


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
    """Render a look under all its lights, with shadows, by the light paths that a method follows.

    Args:
        scene, view, look, size, spp, progress, cancelled, pass_index: as of `reference_truth`.
        reflects: whether the method has light between surfaces, as the look's `transport` names it.
    Returns:
        Linear radiance, the background seen where there is no surface. (height, width, 3) float32
    """
    wanted = [look.transport.followed(reflects=reflects)]
    return _images(scene, view, look, size, _Draw(spp, pass_index, cancelled), wanted, progress)[0]


@dataclass(frozen=True)
class Truth:
    """Pictures of one pass of brute force, (height, width, 3) float32 each.

    Attributes:
        whole: by all light paths; None where they were not asked for.
        followed: by those that the method follows.
        left_out: of the whole, by the method; untraced: by brute force, too. In sentences.
    """

    whole: F32 | None
    followed: F32
    left_out: tuple[str, ...]
    untraced: tuple[str, ...]

    @property
    def pictures(self) -> dict[str, F32]:
        """By whose paths they are: "method", and "all" where they were asked for."""
        return {"method": self.followed} | ({} if self.whole is None else {"all": self.whole})


def reference_truth(
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
    is_whole: bool = True,
) -> Truth:
    """Render a look by all light paths and by those that a method follows, which share what is drawn.

    Args:
        scene: whose light it is. view: one of its cameras. look: that is shown.
        size: width and height in pixels.
        spp: texels of the environment for each view sample, drawn by power with a fixed seed, and places of each local
            light that has an extent; 0, or as many as the map has, for every texel. One path between surfaces for every
            `_SPP_A_PATH` of them.
        progress: called with the share done. cancelled: asked now and then.
        pass_index: pictures with other indices draw independently.
        reflects: whether the method has light between surfaces.
        is_whole: whether all paths are asked for.
    Raises:
        PlanError: the scene has no such view, or a bake of this size would be refused.
        CancelledError: `cancelled` said so.
        NotFoundError: the look names an environment that is not here.
    """
    wanted = [look.transport.followed(reflects=reflects), *([whole_paths(look)] if is_whole else [])]
    images = _images(scene, view, look, size, _Draw(spp, pass_index, cancelled), wanted, progress)
    return Truth(images[1] if is_whole else None, images[0], left_out(look, reflects=reflects), untraced(scene))


def _images(
    scene: Scene, view: str, look: Look, size: tuple[int, int], draw: _Draw, wanted: Sequence[Paths],
    progress: Callable[[float], object],
) -> list[F32]:  # fmt: skip
    """One picture for each choice of paths."""
    DirectMethod().plan(scene, Recipe("direct", (view,), size, MIN_LIGHTS))  # refuses what a bake refuses
    shot = _shoot(wearing(scene, look), view, look, size)
    is_direct = np.array([paths.direct for paths in wanted], np.float64)
    has_others = any(paths.reflect for paths in wanted) or (is_direct.any() and are_mirrors(scene.materials).any())
    direct = _DIRECT_SHARE if has_others else 1.0
    radiance = np.zeros((len(wanted), len(shot.samples.pixel), 3))
    if is_direct.any():
        straight = np.zeros(radiance.shape[1:])
        _add_direct(straight, shot, draw, lambda share: progress(direct * share))
        _add_background(straight, shot)
        radiance += is_direct[:, None, None] * straight
    if has_others:
        _add_reflected(radiance, shot, wanted, draw, lambda share: progress(direct + (1 - direct) * share))
    return [_resolve(shot.samples, of_paths, size) for of_paths in radiance]


@dataclass(frozen=True)
class _Shot:
    """What a view sees of a scene, and by which light.

    Attributes:
        points: those of `samples`, which are sorted by material.
        light: the environment that the look names; texels: it as the look turns and weighs it.
    """

    scene: Scene
    geometry: Geometry
    look: Look
    samples: ViewSamples
    points: Points
    light: Environment
    texels: Texels
    lamps: Sequence[LocalLamp]

    def rows(self, material: int) -> slice:
        """The samples that see a material, by its number."""
        first, last = np.searchsorted(self.samples.material, (material, material + 1))
        return slice(int(first), int(last))

    @property
    def on_surface(self) -> slice:
        """The samples that see a surface; they come before those of the background."""
        return slice(0, int(np.searchsorted(self.samples.material, len(self.scene.materials))))


@dataclass(frozen=True)
class _Draw:
    """How much is drawn, with which seed, and who may end it."""

    spp: int
    pass_index: int
    cancelled: Callable[[], bool]


def _shoot(scene: Scene, view: str, look: Look, size: tuple[int, int]) -> _Shot:
    """Trace a view's samples and find the look's light."""
    geometry = merge(scene)
    # here mirrors are lobes like others, and light through tinted glass is traced, not told by a mean
    samples = sample_view(scene, geometry, view, size, follows_mirrors=False, by_channel=True)
    light = scene.environment if look.environment.map is None else environments.find(look.environment.map)
    texels = texels_of(light, look.environment.rotation).times(look.environment.gain)
    of_look = scene, look, samples.surface, samples.material
    points = points_of(samples, textures_of(*of_look), roughness_at(*of_look))
    return _Shot(scene, geometry, look, samples, points, light, texels, lamps_of(scene, look))


def _add_direct(radiance: F64, shot: _Shot, draw: _Draw, progress: Callable[[float], object]) -> None:
    """Add light that comes directly from lights, and that of surfaces which shine themselves."""
    num_samples, kinds = max(1, shot.on_surface.stop), kinds_of(shot.scene, shot.look)
    kind = kinds.of(shot.samples.material[shot.on_surface], shot.points.roughness[shot.on_surface])
    done = 0
    for number, terms in enumerate(kinds.terms):
        of_kind = np.flatnonzero(kind == number)

        def share_of_all(share: float, before: int = done, num: int = len(of_kind)) -> None:
            progress((before + share * num) / num_samples)

        radiance[of_kind] += reference_radiance(
            shot.geometry, shot.texels, shot.points.rows(of_kind), [terms], draw.spp,
            share_of_all, draw.cancelled, draw.pass_index, shot.lamps,
        )[0]  # fmt: skip
        done += len(of_kind)
    for number, material in enumerate(shot.scene.materials):
        rows = shot.rows(number)
        if (emission := emission_of(shot.lamps, material.name)).any():
            front = shot.geometry.is_front(shot.samples.eye[rows], shot.points.position[rows])
            shown = (front | material.double_sided)[:, None]
            radiance[rows] += emission * shown * shot.samples.surface.emission[rows]


def _add_background(radiance: F64, shot: _Shot) -> None:
    """Add the environment where there is no surface."""
    environment, outside = shot.look.environment, shot.samples.material == BACKGROUND
    towards = turned(shot.samples.surface.points.position[outside].astype(np.float64), -environment.rotation)
    radiance[outside] += np.array(environment.gain) * lookup(shot.light.radiance, towards.astype(np.float32))


def _add_reflected(
    radiance: F64, shot: _Shot, wanted: Sequence[Paths], draw: _Draw, progress: Callable[[float], object]
) -> None:
    """Add light by way of other surfaces and of mirrors, block by block. radiance: (paths wanted, samples, 3)"""
    num_points = shot.on_surface.stop
    num_blocks, num_paths = -(-num_points // _POINTS_A_BLOCK), max(1, draw.spp // _SPP_A_PATH)
    for block in range(num_blocks):
        if draw.cancelled():
            raise CancelledError("the reference was cancelled")
        rows = slice(block * _POINTS_A_BLOCK, min((block + 1) * _POINTS_A_BLOCK, num_points))
        found = reference_indirect(
            shot.scene, shot.geometry, shot.texels, shot.look, shot.points.rows(rows), shot.samples.material[rows],
            wanted, num_paths, _SPP_A_PATH, seed=draw.pass_index * num_blocks + block,
        )  # fmt: skip
        radiance[:, rows] += found.mean
        progress((block + 1) / num_blocks)


def points_of(samples: ViewSamples, textures: Mapping[str, F32], roughness: F32) -> Points:
    """View samples as points; those of the background have no surface and are not meant.

    samples: of a view. textures, roughness: there, see `Points`.
    """
    points = samples.surface.points
    towards = samples.eye.astype(np.float64) - points.position
    wo = (towards / np.linalg.norm(towards, axis=1, keepdims=True)).astype(np.float32)
    chance = samples.chance if samples.chance.any() else ALIKE
    return Points(points.position, points.normal, points.tangent, wo, textures, roughness, samples.surface.uv, chance)


def _resolve(samples: ViewSamples, radiance: F64, size: tuple[int, int]) -> F32:
    """Samples to pixels by their weights. (height, width, 3)"""
    width, height = size
    weighted = samples.gains * radiance
    pixels = [np.bincount(samples.pixel, weighted[:, c], width * height) for c in range(3)]
    return np.stack(pixels, axis=-1).reshape(height, width, 3).astype(np.float32)
