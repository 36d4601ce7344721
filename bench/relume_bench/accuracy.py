"""accuracy.*: error of a frame against the reference, a teapot on a table, three environments; the worst of the three.

Frame: 4,000 environment triangles, one shadow ray each, T · c along the edited curve. Reference:
`relume.reference.reference_radiance`, all texels of the map with a shadow ray each, at the same view samples. The
context also has the error without shadows, to which shadow rays do not contribute.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from relume.assets.environments.environment import Environment
from relume.brdf.term_validation import complete_term
from relume.core.jackknife import JackknifeEstimate
from relume.raytrace.embree import EmbreeScene
from relume.raytrace.visibility import trace_visibility
from relume.reference import environment_texels, reference_radiance
from relume_bench.figure import Figure
from relume_bench.points import LitSamples, frame_radiance, sample_lit_surface
from relume_bench.scenes import LAMBERT, cook_torrance, environments, teapot_on_table
from relume_bench.standard_error import estimate_point_error

Case = tuple[str, dict[str, Any], str]

CASES: tuple[Case, ...] = (
    ("accuracy.lambert", LAMBERT, "theta_i"),
    ("accuracy.cook_torrance_0.2", cook_torrance(0.2), "theta_h"),
    ("accuracy.cook_torrance_0.05", cook_torrance(0.05), "theta_h"),
)


def measure(tiny: bool) -> list[Figure]:
    """Measure the three terms that have targets."""
    return compare(CASES, 20 if tiny else 2000, tiny, environments())


def compare(cases: tuple[Case, ...], num_positions: int, tiny: bool, maps: list[Environment]) -> list[Figure]:
    """Measure a figure for each case; all share shadow rays.

    Args:
        cases: figure's name, term of pot and table, and free curve of each.
        num_positions: view samples.
        tiny: few lights, one environment, few texels.
        maps: the environments.
    Returns:
        Worst error over the environments, and its standard error over the view samples.
    """
    num_lights = 200 if tiny else 4000
    errors: dict[str, dict[str, JackknifeEstimate]] = {name: {} for name, _, _ in cases}
    documents = {name: complete_term(("accuracy",), dict(term), None) for name, term, _ in cases}
    for environment in maps[: 1 if tiny else 3]:
        scene = teapot_on_table(environment, (LAMBERT,), (LAMBERT,))
        lit_samples = sample_lit_surface(scene, (320, 320), num_positions, num_lights, None)
        texels, spp = environment_texels(environment), 500 if tiny else 0
        for label, variant in (
            (environment.name, lit_samples),
            (f"{environment.name} without shadows", _without_shadows(lit_samples)),
        ):
            terms = [[documents[name]] for name, _, _ in cases]
            reference = reference_radiance(variant.geometry, texels, variant.surface_points, terms, spp)
            for (name, _, curve), right in zip(cases, reference, strict=True):
                errors[name][label] = estimate_point_error(frame_radiance(variant, documents[name], curve), right)
    context = {"view_samples": num_positions, "lights": num_lights}
    figures = []
    for name, error_by_label in errors.items():
        worst = max(error for label, error in error_by_label.items() if "without" not in label)
        values_by_label = {label: error.value for label, error in error_by_label.items()}
        figures.append(Figure(name, worst.value, "relative RMSE", {**context, **values_by_label}, worst.standard_error))
    return figures


def _without_shadows(lit_samples: LitSamples) -> LitSamples:
    """Move the points apart, so that nothing casts a shadow."""
    corners = np.array([[1e6, 1e6, 1e6], [1e6 + 1, 1e6, 1e6], [1e6, 1e6 + 1, 1e6]], np.float32)
    geometry = replace(lit_samples.geometry, embree=EmbreeScene.build(corners, np.array([[0, 1, 2]], np.uint32)))
    surface_points = lit_samples.surface_points
    visible = trace_visibility(
        geometry.embree, surface_points.position, surface_points.normal, lit_samples.lights.direction
    ).visible
    return replace(lit_samples, geometry=geometry, receivers=replace(lit_samples.receivers, visible=visible))
