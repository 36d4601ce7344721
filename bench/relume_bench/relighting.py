"""Bakes with replaced light, in tiles refined for it as in a picture."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.assets.environments.environment import Environment
from relume.brdf.curves import curve_bands
from relume.brdf.registry import TERMS
from relume.brdf.term_validation import complete_term
from relume.core.jackknife import JackknifeEstimate
from relume.lights.refined_environment import RefinedEnvironment, environment_metric, refine_environment
from relume.lights.sphere_tiles import Tiles
from relume.lights.spherical_triangles import EnvironmentTexels, integrate_environment
from relume.lights.tile_subdivision import choose_tiles
from relume.operators.shade import shade
from relume.raytrace.visibility import trace_visibility
from relume.reference import environment_texels, reference_radiance
from relume_bench.figure import Figure
from relume_bench.points import LitSamples
from relume_bench.scenes import LAMBERT, cook_torrance
from relume_bench.standard_error import estimate_point_error

F64 = NDArray[np.float64]


def documents(kind: str) -> dict[str, dict[str, Any]]:
    """Complete terms to compare, by name of their figure."""
    terms = {"lambert": LAMBERT, "cook_torrance_0.2": cook_torrance(0.2)}
    return {f"accuracy.{kind}_{name}": complete_term(("accuracy",), dict(term), None) for name, term in terms.items()}


@dataclass(frozen=True)
class Bake:
    """Tiles, the directions of their shadow rays, and their metric, see `environment_metric`."""

    tiles: Tiles
    ray_directions: NDArray[np.float32]
    metric: float


def bake(environment: Environment, num_lights: int, relightable: bool) -> Bake:
    """Tiles and shadow rays of a bake of this environment.

    Args:
        environment: to bake. num_lights: minimum number of tiles.
        relightable: tiles are independent of the light, and shadow rays go to their centers.
    """
    texels = EnvironmentTexels.from_radiance(environment.radiance)
    own = tiles = choose_tiles(environment.radiance, num_lights, relightable)
    directions = integrate_environment(tiles, texels).direction
    if relightable:
        own, directions = choose_tiles(environment.radiance, num_lights), tiles.centroids.astype(np.float32)
    return Bake(tiles, directions, environment_metric(own, texels))


def compare(
    lit_samples: LitSamples,
    bakes: Mapping[str, Bake],
    light: Environment,
    terms: Mapping[str, Mapping[str, Any]],
    spp: int,
) -> dict[tuple[str, str], JackknifeEstimate]:
    """Relative RMSE of each term in each bake, at the same points under one light.

    Args:
        lit_samples: the points; visibility is traced anew for each bake.
        bakes: by name.
        light: the map to show.
        terms: complete ones, by name of their figures.
        spp: texels of the reference at each point; 0 for every texel.
    Returns:
        By the names of term and bake.
    """
    documents = [[dict(document)] for document in terms.values()]
    reference = reference_radiance(
        lit_samples.geometry, environment_texels(light), lit_samples.surface_points, documents, spp
    )
    errors = {}
    for kind, baked in bakes.items():
        texels = EnvironmentTexels.from_radiance(light.radiance)
        refined = refine_environment(baked.tiles, baked.ray_directions, texels, 0.0, baked.metric)
        for (name, document), right in zip(terms.items(), reference, strict=True):
            errors[name, kind] = estimate_point_error(_radiance(lit_samples, baked, refined, document), right)
    return errors


def _radiance(lit_samples: LitSamples, baked: Bake, refined: RefinedEnvironment, document: Mapping[str, Any]) -> F64:
    """Radiance of the points under an environment in a bake's tiles, as far as they are not refined. (n, 3)"""
    surface_points, term, lights = lit_samples.surface_points, TERMS[document["model"]], refined.lights
    directions = lights.direction.copy()
    directions[: len(baked.ray_directions)] = baked.ray_directions
    directions[refined.unbaked] = lights.direction[refined.unbaked]
    visible = trace_visibility(
        lit_samples.geometry.embree, surface_points.position, surface_points.normal, directions
    ).visible
    bands = {curve.name: curve_bands(document, curve) for curve in term.curves if not curve.depends_on_view}
    receivers = replace(lit_samples.receivers, visible=visible)
    image = shade(term, bands, lights, receivers, lambda share: None, lambda: False).image
    radiance = image.transpose(0, 2, 1).reshape(-1, 3)[: surface_points.num_points]
    return np.asarray(radiance.astype(np.float64) * np.asarray(document["color"]))


def figures(errors_by_name: Mapping[str, Mapping[str, JackknifeEstimate]], context: Mapping[str, Any]) -> list[Figure]:
    """Each figure's worst error of a plain bake; all errors, labeled "kind, …", in the context."""
    results = []
    for name, errors in errors_by_name.items():
        worst, relightable = _worst(errors, "plain"), _worst(errors, "relightable")
        details = {"relightable": relightable.value, "relightable_standard_error": relightable.standard_error}
        values_by_label = {label: error.value for label, error in errors.items()}
        results.append(
            Figure(name, worst.value, "relative RMSE", {**context, **details, **values_by_label}, worst.standard_error)
        )
    return results


def _worst(errors: Mapping[str, JackknifeEstimate], kind: str) -> JackknifeEstimate:
    return max(error for label, error in errors.items() if label.startswith(kind))
