"""Light that reaches points by reflection, by path tracing: the truth that gathered light is compared with.

    R(x) = E[ f(ωi, ωo) cos θi / p(ωi) L(y, −ωi) ],   L(y, ω) = L_direct(y, ω) + R(y, ω)

with y what ωi hits, and p the mean density of the lobes of its material: by the cosine, and by each of its highlights.
Every surface reflects by all its terms. It shares neither cells nor links with what it checks.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from relume.brdf.evaluate import eval_brdf
from relume.look import Look
from relume.reference.kinds import Terms, kinds_of
from relume.reference.lobes import Lobe
from relume.reference.local import lamps_of
from relume.reference.radiance import Points, lobes_of, reference_radiance
from relume.reference.texels import Texels
from relume.scene.model import Scene
from relume.trace.geometry import Geometry
from relume.trace.primary import Hits, trace_from
from relume.trace.surface import surface_at

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_TEXTURE_ANGLE = 1e-3
_LEAST_CHANCE = 0.05
_LEAST_DENSITY = 1e-12
_MOST_BOUNCES = 64


def reference_indirect(
    scene: Scene,
    geometry: Geometry,
    texels: Texels,
    look: Look,
    points: Points,
    material: NDArray[np.integer],
    num_bounces: int,
    num_paths: int,
    spp: int,
    seed: int = 0,
    first_bounce: int = 1,
) -> F64:
    """Radiance of points by light that surfaces have reflected onto them, `first_bounce` to `num_bounces` times.

    Args:
        scene: its materials and lamps.
        geometry: of the scene, that paths and shadow rays are traced in.
        texels: of the environment, its gain in the look included.
        look: terms and lights as they are shown.
        points: n of them, seen from one direction each. material: index into the scene's materials. (n,)
        num_paths: for each point. spp: texels drawn for each place that a path visits.
        seed: of the paths; other seeds are independent of this one.
    Returns:
        The mean over paths and its variance. (2, n, 3) float64
    Cost: O(n · num_paths · num_bounces · spp) shadow rays.
    """
    kinds = kinds_of(scene, look)
    terms = kinds.terms
    lobes, lamps = [lobes_of(of_material) for of_material in terms], lamps_of(scene, look)
    total, squares = np.zeros((2, points.num_points, 3))
    for path in range(num_paths):
        rng = np.random.default_rng((seed, path, points.num_points))
        here, of = points, kinds.of(np.asarray(material), points.roughness)
        rows, weight = np.arange(points.num_points), np.ones((points.num_points, 3))
        found = np.zeros((points.num_points, 3))
        for bounce in range(num_bounces):
            directions, share = _scattered(terms, lobes, here, of, rng)
            weight = weight * share
            hits = trace_from(geometry.embree, here.position, directions)
            hit = np.nonzero(hits.face >= 0)[0]
            here, hit_material = _places(scene, geometry, hits, directions, hit)
            of = kinds.of(hit_material, here.roughness)
            rows, weight = rows[hit], weight[hit]
            here, of, rows, weight = _survivors(here, of, rows, weight, rng)
            if bounce + 1 < first_bounce:
                continue
            arriving = np.zeros((len(rows), 3))
            for index, of_material in enumerate(terms):
                at = np.nonzero(of == index)[0]
                if not len(at):
                    continue
                drawn = (seed * num_paths + path) * _MOST_BOUNCES + bounce
                arriving[at] = reference_radiance(
                    geometry, texels, here.rows(at), [of_material], spp, pass_index=drawn, lamps=lamps
                )[0]  # fmt: skip
            np.add.at(found, rows, weight * arriving)
        total += found
        squares += found**2
    mean = total / num_paths
    return np.stack([mean, np.maximum(squares / num_paths - mean**2, 0) / max(1, num_paths - 1)])


def _survivors(
    here: Points, of: NDArray[np.int64], rows: NDArray[np.intp], weight: F64, rng: np.random.Generator
) -> tuple[Points, NDArray[np.int64], NDArray[np.intp], F64]:
    """Russian roulette: dim paths end early, and those that go on stand for them."""
    chance = np.clip(weight.max(axis=1, initial=0.0), _LEAST_CHANCE, 1.0)
    alive = np.nonzero(rng.random(len(rows)) < chance)[0]
    return here.rows(alive), of[alive], rows[alive], weight[alive] / chance[alive, None]


def _places(
    scene: Scene, geometry: Geometry, hits: Hits, directions: F32, hit: NDArray[np.intp]
) -> tuple[Points, NDArray[np.int32]]:
    """What some of the rays have hit, seen from where they come, and its materials."""
    some = hits.rows(hit)
    surface = surface_at(geometry, some, directions[hit], scene.materials, _TEXTURE_ANGLE)
    textures = {"diffuse": surface.diffuse, "specular": surface.specular}
    points = Points(*surface.points[:3], -directions[hit], textures, surface.roughness)
    return points, geometry.face_material[some.face]


def _scattered(
    terms: Sequence[Terms], lobes: Sequence[Sequence[Lobe]], points: Points, kind: NDArray[np.integer],
    rng: np.random.Generator,
) -> tuple[F32, F64]:  # fmt: skip
    """Draw a direction for each point by one of its material's lobes.

    Returns:
        World space, unit (n, 3), and f cos θi over the density of all lobes together (n, 3), nothing below the horizon.
    """
    frames = points.frames()
    wo = np.einsum("nij,nj->ni", frames, points.wo.astype(np.float64))
    wi, share = np.zeros((points.num_points, 3)), np.zeros((points.num_points, 3))
    for index, (of_material, of_lobes) in enumerate(zip(terms, lobes, strict=True)):
        at = np.nonzero(kind == index)[0]
        if not len(at):
            continue
        chosen = rng.integers(len(of_lobes), size=len(at))
        for k, lobe in enumerate(of_lobes):
            some = at[chosen == k]
            wi[some] = lobe.draw(wo[some], 1, rng)[:, 0]
        density = np.mean([lobe.density_of(wi[at, None], wo[at])[:, 0] for lobe in of_lobes], axis=0)
        cosine = np.where((wi[at, 2] > 0) & (wo[at, 2] > 0), wi[at, 2], 0.0)
        for term in of_material:
            texture = points.textures[term["texture"]][at] if term["texture"] is not None else 1.0
            value = eval_brdf(term, wi[at], wo[at])
            share[at] += texture * value * (cosine / np.maximum(density, _LEAST_DENSITY))[:, None]
    return np.einsum("nji,nj->ni", frames, wi).astype(np.float32), share
