"""Path tracing of indirect light at points: the reference for gathered light.

    R(x) = E[ f(ωi, ωo) cos θi / p(ωi) L(y, −ωi) ],   L(y, ω) = L_direct(y, ω) + R(y, ω)

with y the hit of ωi, and p the mean density of the lobes of the material: the cosine lobe, and one for each highlight.
Every surface reflects by all its terms. It uses neither the patches nor the gather hits that it checks.

As in interactive rendering, reflections in mirrors at the start of a path, at most as many as camera rays follow, do
not count as bounces.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.evaluate import eval_brdf
from relume.brdf.texture_slots import texture_channel
from relume.camera.specular_hits import MAX_MIRROR_BOUNCES
from relume.look import LightPaths, Look
from relume.raytrace.camera_rays import Hits, trace_rays
from relume.raytrace.scene_buffers import SceneBuffers
from relume.raytrace.surface_interaction import surface_at
from relume.reference.btf_surfaces import BtfSurface
from relume.reference.emitters import emitters
from relume.reference.environment_samples import EnvironmentSamples
from relume.reference.lobes import Lobe
from relume.reference.paths import MAX_BOUNCES
from relume.reference.radiance import ReferencePoints, material_lobes, reference_radiance
from relume.reference.roughness_classes import RoughnessClasses, roughness_classes
from relume.reference.textures import surface_roughness, surface_textures
from relume.scene.model import Scene
from relume.scene.roughness_levels import slope_variance

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_TEXTURE_ANGLE = 1e-3
BtfSurfaces = dict[tuple[int, int], BtfSurface]  # by roughness class and term

_MIN_SURVIVAL_PROBABILITY = 0.05
_MIN_PDF = 1e-12


class IndirectReference(NamedTuple):
    """Radiance of points by indirect light.

    Attributes:
        mean: mean over paths. variance: variance of this mean.
    """

    mean: Shaped[F64, "light_paths n 3"]
    variance: Shaped[F64, "light_paths n 3"]


def reference_indirect(
    scene: Scene,
    geometry: SceneBuffers,
    texels: EnvironmentSamples,
    look: Look,
    points: ReferencePoints,
    material: Shaped[NDArray[np.integer], " n"],
    light_paths: Sequence[LightPaths],
    num_paths: int,
    spp: int,
    seed: int = 0,
) -> IndirectReference:
    """Radiance of points by indirect light, for several selections of light paths at once.

    Args:
        scene: the scene, with its materials and lights.
        geometry: triangles of the scene.
        texels: texels of the environment, with its gain in the look.
        look: terms and lights.
        points: n points. material: index into the scene's materials.
        light_paths: selections; `direct` selects direct light in mirrors.
        num_paths: number of paths per point. spp: environment texels per path vertex.
        seed: seed of the paths; other seeds are independent.
    Cost: O(n · num_paths · bounces · spp) shadow rays, with the maximum number of bounces of all selections.
    """
    classes, local_lights = roughness_classes(scene, look), emitters(scene, geometry, look)
    lobes = [material_lobes(class_terms) for class_terms in classes.terms]
    total, sum_squares = np.zeros((2, len(light_paths), points.num_points, 3))
    first_classes = classes.classify(np.asarray(material), points)
    btf_surfaces = _sample_btf_surfaces(classes, points, first_classes, seed)
    for path in range(num_paths):
        rng = np.random.default_rng((seed, path, points.num_points))
        path_points, path_classes = points, first_classes
        rows, weight = np.arange(points.num_points), np.zeros((_STATES, points.num_points, 3))
        weight[_IN_MIRRORS] = 1.0
        path_radiance = np.zeros((len(light_paths), points.num_points, 3))
        for bounce in range(min(MAX_BOUNCES, max(map(_max_reflections, light_paths)))):
            directions, bounce_weight, specular_weight = _sample_directions(
                classes, lobes, path_points, path_classes, btf_surfaces if bounce == 0 else {}, rng
            )
            weight = _reflect_weights(weight, bounce_weight, specular_weight, bounce)
            hits = trace_rays(geometry.embree, path_points.position, directions, path_points.alpha_sample)
            hit = np.nonzero(hits.face >= 0)[0]
            alpha_sample = (
                path_points.alpha_sample if len(path_points.alpha_sample) == 1 else path_points.alpha_sample[hit]
            )
            path_points, hit_material = _hit_points(scene, geometry, look, hits, directions, hit)
            path_points = replace(path_points, alpha_sample=alpha_sample)
            path_classes = classes.classify(hit_material, path_points)
            rows, weight = rows[hit], weight[:, hit]
            counts = np.array([_counted_states(paths, bounce + 1) for paths in light_paths])
            path_points, path_classes, rows, weight = _russian_roulette(
                path_points, path_classes, rows, weight * _countable_states(light_paths, bounce + 1), rng
            )
            if not len(rows):
                break
            if not counts.any():
                continue
            draw_index = (seed * num_paths + path) * MAX_BOUNCES + bounce
            direct_radiance = np.zeros((len(rows), 3))
            for index, class_terms in enumerate(classes.terms):
                class_rows = np.nonzero(path_classes == index)[0]
                if len(class_rows):
                    direct_radiance[class_rows] = reference_radiance(
                        geometry, texels, path_points.samples_of(class_rows), [class_terms], spp,
                        pass_index=draw_index, local_lights=local_lights
                    )[0]  # fmt: skip
            path_radiance[:, rows] += np.einsum("ps,snc->pnc", counts, weight) * direct_radiance
        total += path_radiance
        sum_squares += path_radiance**2
    mean = total / num_paths
    return IndirectReference(mean, np.maximum(sum_squares / num_paths - mean**2, 0) / max(1, num_paths - 1))


# A path's weight has one component per start: only mirrors so far, or a lobe after 0, 1, … mirrors.
_IN_MIRRORS, _STATES = 0, MAX_MIRROR_BOUNCES + 2


def _max_reflections(paths: LightPaths) -> int:
    """Maximum number of reflections of the selected paths, mirrors included."""
    return MAX_MIRROR_BOUNCES + paths.last if paths.has_indirect else MAX_MIRROR_BOUNCES * paths.direct


def _counted_states(paths: LightPaths, num: int) -> F64:
    """States whose light counts after `num` reflections. (states,) of 0 and 1"""
    num_bounces = num - np.arange(MAX_MIRROR_BOUNCES + 1)
    return np.concatenate([[paths.direct], (paths.first <= num_bounces) & (num_bounces <= paths.last)]).astype(
        np.float64
    )


def _countable_states(light_paths: Sequence[LightPaths], num: int) -> F64:
    """States whose light counts after `num` or more reflections; paths in others end. (states, 1, 1) of 0 and 1"""
    last = max(paths.last if paths.has_indirect else 0 for paths in light_paths)
    is_countable = [num <= MAX_MIRROR_BOUNCES, *(num - mirrors <= last for mirrors in range(MAX_MIRROR_BOUNCES + 1))]
    return np.array(is_countable, np.float64)[:, None, None]


def _reflect_weights(weight: F64, bounce_weight: F64, specular_weight: F64, bounce: int) -> F64:
    """Weights after one more reflection. weight: (states, n, 3). specular_weight: part of `bounce_weight`. (n, 3)"""
    after = weight * bounce_weight
    if bounce < MAX_MIRROR_BOUNCES:
        after[1 + bounce] = weight[_IN_MIRRORS] * (bounce_weight - specular_weight)
        after[_IN_MIRRORS] = weight[_IN_MIRRORS] * specular_weight
    elif bounce == MAX_MIRROR_BOUNCES:
        after[1 + bounce], after[_IN_MIRRORS] = after[_IN_MIRRORS], 0.0
    return after


def _russian_roulette(
    points: ReferencePoints, classes: NDArray[np.int64], rows: NDArray[np.intp], weight: F64, rng: np.random.Generator
) -> tuple[ReferencePoints, NDArray[np.int64], NDArray[np.intp], F64]:
    """Russian roulette: paths of low weight end early, and survivors compensate. weight: (states, n, 3)"""
    size = weight.sum(axis=0).max(axis=1, initial=0.0)
    survival_probability = np.where(size > 0, np.clip(size, _MIN_SURVIVAL_PROBABILITY, 1.0), 0.0)
    alive = np.nonzero(rng.random(len(rows)) < survival_probability)[0]
    return points.samples_of(alive), classes[alive], rows[alive], weight[:, alive] / survival_probability[alive, None]


def _hit_points(
    scene: Scene, geometry: SceneBuffers, look: Look, hits: Hits, directions: F32, hit: NDArray[np.intp]
) -> tuple[ReferencePoints, NDArray[np.int32]]:
    """Points and materials of ray hits, viewed along the rays."""
    surface_hits = hits.rows(hit)
    surface = surface_at(geometry, surface_hits, directions[hit], scene.materials, _TEXTURE_ANGLE)
    material = geometry.face_material[surface_hits.face]
    textures = surface_textures(scene, look, surface, material)
    roughness = surface_roughness(scene, look, surface, material)
    variance = slope_variance(surface.normal_length)
    frame = *surface.points[:3], -directions[hit]
    return ReferencePoints(*frame, textures, roughness, slope_variance=variance), material


def _sample_btf_surfaces(
    classes: RoughnessClasses, points: ReferencePoints, class_index: NDArray[np.integer], seed: int
) -> BtfSurfaces:
    """Sample the BTFs of points, by roughness class and term."""
    rng, btf_surfaces = np.random.default_rng((seed, points.num_points)), {}
    for index, class_terms in enumerate(classes.terms):
        class_points = points.samples_of(np.nonzero(class_index == index)[0])
        for k, btf_surface in enumerate(class_points.btf_surfaces(class_terms, rng) if class_points.num_points else ()):
            if btf_surface is not None:
                btf_surfaces[index, k] = btf_surface
    return btf_surfaces


def _sample_directions(
    classes: RoughnessClasses,
    lobes: Sequence[Sequence[Lobe]],
    points: ReferencePoints,
    class_index: NDArray[np.integer],
    btf_surfaces: BtfSurfaces,
    rng: np.random.Generator,
) -> tuple[F32, F64, F64]:
    """Sample a direction for each point from one of its material's lobes.

    Args:
        classes: classes of the scene. lobes: lobes of each class. points: n points.
        class_index: class of each point. (n,)
        btf_surfaces: BTF surfaces by class and term, for all points of a class.
        rng: random number generator.
    Returns:
        World space, unit (n, 3); f cos θi over the density of all lobes together (n, 3), zero below the horizon; and
        its specular part (n, 3).
    """
    frames = points.frames()
    wo = np.einsum("nij,nj->ni", frames, points.wo.astype(np.float64))
    wi, bounce_weight, specular_weight = np.zeros((3, points.num_points, 3))
    for index, (class_terms, class_lobes) in enumerate(zip(classes.terms, lobes, strict=True)):
        class_rows = np.nonzero(class_index == index)[0]
        if not len(class_rows):
            continue
        lobe_index = rng.integers(len(class_lobes), size=len(class_rows))
        for k, lobe in enumerate(class_lobes):
            lobe_rows = class_rows[lobe_index == k]
            wi[lobe_rows] = lobe.draw(wo[lobe_rows], 1, rng)[:, 0]
        pdf = np.mean([lobe.pdf(wi[class_rows, None], wo[class_rows])[:, 0] for lobe in class_lobes], axis=0)
        cosine = np.where((wi[class_rows, 2] > 0) & (wo[class_rows, 2] > 0), wi[class_rows, 2], 0.0)
        for k, (term, mirror) in enumerate(zip(class_terms, classes.mirrors[index], strict=True)):
            channel = texture_channel(term)
            texture = 1.0 if channel is None else points.textures[channel][class_rows]
            if (btf_surface := btf_surfaces.get((index, k))) is None:
                value = eval_brdf(term, wi[class_rows], wo[class_rows]) * cosine[:, None]
            else:
                outgoing = btf_surface.evaluate(np.arange(len(class_rows)), wi[class_rows])
                value = np.where(cosine[:, None] > 0, outgoing, 0.0) * np.asarray(term["color"])
            term_weight = texture * value / np.maximum(pdf, _MIN_PDF)[:, None]
            bounce_weight[class_rows] += term_weight
            specular_weight[class_rows] += term_weight * mirror
    return np.einsum("nji,nj->ni", frames, wi).astype(np.float32), bounce_weight, specular_weight
