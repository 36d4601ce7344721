"""Light that reaches points by reflection, by path tracing: the truth that gathered light is compared with.

    R(x) = E[ f(ωi, ωo) cos θi / p(ωi) L(y, −ωi) ],   L(y, ω) = L_direct(y, ω) + R(y, ω)

with y what ωi hits, and p the mean density of the lobes of its material: by the cosine, and by each of its highlights.
Every surface reflects by all its terms. It shares neither cells nor links with what it checks.

What is seen in a mirror counts as what it is there, as in pictures: the first reflections of a path, as long as they
are a mirror's and no more than eyes follow, are none between surfaces.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.brdf.channels import channel_of
from relume.brdf.evaluate import eval_brdf
from relume.eye.mirrors import MOST_MIRRORS
from relume.look import Look, Paths
from relume.reference.covers import Cover
from relume.reference.images import roughness_at, textures_of
from relume.reference.kinds import Kinds, kinds_of
from relume.reference.lobes import Lobe
from relume.reference.local import lamps_of
from relume.reference.paths import MOST_BOUNCES
from relume.reference.radiance import Points, lobes_of, reference_radiance
from relume.reference.texels import Texels
from relume.scene.model import Scene
from relume.trace.geometry import Geometry
from relume.trace.primary import Hits, trace_from
from relume.trace.surface import surface_at

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_TEXTURE_ANGLE = 1e-3
Covers = dict[tuple[int, int], Cover]  # by kinds of surfaces, and terms of these

_LEAST_CHANCE = 0.05
_LEAST_DENSITY = 1e-12


class Reflected(NamedTuple):
    """Radiance of points by light that surfaces have reflected.

    Attributes:
        mean, variance: over paths, the second of the mean. (paths asked for, n, 3) float64
    """

    mean: F64
    variance: F64


def reference_indirect(
    scene: Scene,
    geometry: Geometry,
    texels: Texels,
    look: Look,
    points: Points,
    material: NDArray[np.integer],
    wanted: Sequence[Paths],
    num_paths: int,
    spp: int,
    seed: int = 0,
) -> Reflected:
    """Radiance of points by light that surfaces have reflected onto them, by several choices of paths at once.

    Args:
        scene: its materials and lamps.
        geometry: of the scene, that paths and shadow rays are traced in.
        texels: of the environment, its gain in the look included.
        look: terms and lights as they are shown.
        points: n of them, seen from one direction each. material: index into the scene's materials. (n,)
        wanted: which paths count; direct ones are those that are seen in mirrors.
        num_paths: for each point. spp: texels drawn for each place that a path visits.
        seed: of the paths; other seeds are independent of this one.
    Cost: O(n · num_paths · bounces · spp) shadow rays, bounces as many as any choice has.
    """
    kinds, lamps = kinds_of(scene, look), lamps_of(scene, look)
    lobes = [lobes_of(of_material) for of_material in kinds.terms]
    total, squares = np.zeros((2, len(wanted), points.num_points, 3))
    seen = kinds.of(np.asarray(material), points.roughness)
    covers = _covers(kinds, points, seen, seed)
    for path in range(num_paths):
        rng = np.random.default_rng((seed, path, points.num_points))
        here, of = points, seen
        rows, weight = np.arange(points.num_points), np.zeros((_STATES, points.num_points, 3))
        weight[_IN_MIRRORS] = 1.0
        found = np.zeros((len(wanted), points.num_points, 3))
        for bounce in range(min(MOST_BOUNCES, max(map(_longest, wanted)))):
            directions, share, mirrored = _scattered(kinds, lobes, here, of, covers if bounce == 0 else {}, rng)
            weight = _reflected(weight, share, mirrored, bounce)
            hits = trace_from(geometry.embree, here.position, directions, here.chance)
            hit = np.nonzero(hits.face >= 0)[0]
            chance = here.chance if len(here.chance) == 1 else here.chance[hit]
            here, hit_material = _places(scene, geometry, look, hits, directions, hit)
            here = replace(here, chance=chance)
            of = kinds.of(hit_material, here.roughness)
            rows, weight = rows[hit], weight[:, hit]
            counts = np.array([_counting(paths, bounce + 1) for paths in wanted])
            here, of, rows, weight = _survivors(here, of, rows, weight * _may_count(wanted, bounce + 1), rng)
            if not len(rows):
                break
            if not counts.any():
                continue
            drawn = (seed * num_paths + path) * MOST_BOUNCES + bounce
            arriving = np.zeros((len(rows), 3))
            for index, of_material in enumerate(kinds.terms):
                at = np.nonzero(of == index)[0]
                if len(at):
                    arriving[at] = reference_radiance(
                        geometry, texels, here.rows(at), [of_material], spp, pass_index=drawn, lamps=lamps
                    )[0]  # fmt: skip
            found[:, rows] += np.einsum("ps,snc->pnc", counts, weight) * arriving
        total += found
        squares += found**2
    mean = total / num_paths
    return Reflected(mean, np.maximum(squares / num_paths - mean**2, 0) / max(1, num_paths - 1))


# A path's weight is told apart by how it began: all of it in mirrors so far, or after so many of them by a lobe.
_IN_MIRRORS, _STATES = 0, MOST_MIRRORS + 2


def _longest(paths: Paths) -> int:
    """Reflections of the longest path that counts, those in mirrors included."""
    return MOST_MIRRORS + paths.last if paths.reflect else MOST_MIRRORS * paths.direct


def _counting(paths: Paths, num: int) -> F64:
    """Which states count at the end of `num` reflections. (states,) of 0 and 1"""
    between = num - np.arange(MOST_MIRRORS + 1)
    return np.concatenate([[paths.direct], (paths.first <= between) & (between <= paths.last)]).astype(np.float64)


def _may_count(wanted: Sequence[Paths], num: int) -> F64:
    """Which states count after `num` reflections, or may after more: paths in others end. (states, 1, 1) of 0 and 1"""
    last = max(paths.last if paths.reflect else 0 for paths in wanted)
    may = [num <= MOST_MIRRORS, *(num - mirrors <= last for mirrors in range(MOST_MIRRORS + 1))]
    return np.array(may, np.float64)[:, None, None]


def _reflected(weight: F64, share: F64, mirrored: F64, bounce: int) -> F64:
    """Weights after one more reflection. weight: (states, n, 3). share, of it mirrored: (n, 3)"""
    after = weight * share
    if bounce < MOST_MIRRORS:
        after[1 + bounce] = weight[_IN_MIRRORS] * (share - mirrored)
        after[_IN_MIRRORS] = weight[_IN_MIRRORS] * mirrored
    elif bounce == MOST_MIRRORS:
        after[1 + bounce], after[_IN_MIRRORS] = after[_IN_MIRRORS], 0.0
    return after


def _survivors(
    here: Points, of: NDArray[np.int64], rows: NDArray[np.intp], weight: F64, rng: np.random.Generator
) -> tuple[Points, NDArray[np.int64], NDArray[np.intp], F64]:
    """Russian roulette: dim paths end early, and those that go on stand for them. weight: (states, n, 3)"""
    size = weight.sum(axis=0).max(axis=1, initial=0.0)
    chance = np.where(size > 0, np.clip(size, _LEAST_CHANCE, 1.0), 0.0)
    alive = np.nonzero(rng.random(len(rows)) < chance)[0]
    return here.rows(alive), of[alive], rows[alive], weight[:, alive] / chance[alive, None]


def _places(
    scene: Scene, geometry: Geometry, look: Look, hits: Hits, directions: F32, hit: NDArray[np.intp]
) -> tuple[Points, NDArray[np.int32]]:
    """What some of the rays have hit, seen from where they come, and its materials."""
    some = hits.rows(hit)
    surface = surface_at(geometry, some, directions[hit], scene.materials, _TEXTURE_ANGLE)
    material = geometry.face_material[some.face]
    textures = textures_of(scene, look, surface, material)
    roughness = roughness_at(scene, look, surface, material)
    return Points(*surface.points[:3], -directions[hit], textures, roughness), material


def _covers(kinds: Kinds, points: Points, kind: NDArray[np.integer], seed: int) -> Covers:
    """What covers the points that are seen, by their kinds and the terms of these."""
    rng, found = np.random.default_rng((seed, points.num_points)), {}
    for index, of_material in enumerate(kinds.terms):
        rows = points.rows(np.nonzero(kind == index)[0])
        for k, one in enumerate(rows.covers(of_material, rng) if rows.num_points else ()):
            if one is not None:
                found[index, k] = one
    return found


def _scattered(
    kinds: Kinds,
    lobes: Sequence[Sequence[Lobe]],
    points: Points,
    kind: NDArray[np.integer],
    covers: Covers,
    rng: np.random.Generator,
) -> tuple[F32, F64, F64]:
    """Draw a direction for each point by one of its material's lobes.

    Args:
        kinds: there are. lobes: of each. points: n of them. kind: of each. (n,)
        covers: of points that are all there are of their kind.
        rng: draws.
    Returns:
        World space, unit (n, 3); f cos θi over the density of all lobes together (n, 3), nothing below the horizon; and
        how much of that a mirror sends on (n, 3).
    """
    frames = points.frames()
    wo = np.einsum("nij,nj->ni", frames, points.wo.astype(np.float64))
    wi, share, mirrored = np.zeros((3, points.num_points, 3))
    for index, (of_material, of_lobes) in enumerate(zip(kinds.terms, lobes, strict=True)):
        at = np.nonzero(kind == index)[0]
        if not len(at):
            continue
        chosen = rng.integers(len(of_lobes), size=len(at))
        for k, lobe in enumerate(of_lobes):
            some = at[chosen == k]
            wi[some] = lobe.draw(wo[some], 1, rng)[:, 0]
        density = np.mean([lobe.density_of(wi[at, None], wo[at])[:, 0] for lobe in of_lobes], axis=0)
        cosine = np.where((wi[at, 2] > 0) & (wo[at, 2] > 0), wi[at, 2], 0.0)
        for k, (term, mirror) in enumerate(zip(of_material, kinds.mirrors[index], strict=True)):
            channel = channel_of(term)
            texture = 1.0 if channel is None else points.textures[channel][at]
            if (covered := covers.get((index, k))) is None:
                value = eval_brdf(term, wi[at], wo[at]) * cosine[:, None]
            else:
                sent = covered.sent(np.arange(len(at)), wi[at])
                value = np.where(cosine[:, None] > 0, sent, 0.0) * np.asarray(term["color"])
            of_term = texture * value / np.maximum(density, _LEAST_DENSITY)[:, None]
            share[at] += of_term
            mirrored[at] += of_term * mirror
    return np.einsum("nji,nj->ni", frames, wi).astype(np.float32), share, mirrored
