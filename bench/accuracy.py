"""accuracy.*: frame against truth, a teapot on a table, three environments; the worst of the three.

Frame: 4,000 light triangles, one shadow ray each, T · c along the curve that a user drags. Truth:
`relume.reference.reference_radiance`, every texel of the map with a shadow ray of its own, at the same view samples.
"""

from __future__ import annotations

from typing import Any

from bench.figure import Figure
from bench.points import frame_radiance, lit_points, relative_rmse
from bench.scenes import LAMBERT, cook_torrance, environments, teapot_on_table
from relume.look.terms import complete_term
from relume.reference import reference_radiance, texels_of

_CASES: tuple[tuple[str, dict[str, Any], str], ...] = (
    ("accuracy.lambert", LAMBERT, "theta_i"),
    ("accuracy.cook_torrance_0.2", cook_torrance(0.2), "theta_h"),
    ("accuracy.cook_torrance_0.05", cook_torrance(0.05), "theta_h"),
)


def measure(tiny: bool) -> list[Figure]:
    """All three terms share the shadow rays of an environment."""
    num_points, num_lights = (20, 200) if tiny else (2000, 4000)
    errors: dict[str, dict[str, float]] = {name: {} for name, _, _ in _CASES}
    documents = {name: complete_term(("accuracy",), dict(term), None) for name, term, _ in _CASES}
    for environment in environments()[: 1 if tiny else 3]:
        scene = teapot_on_table(environment, (LAMBERT,), (LAMBERT,))
        lit = lit_points(scene, (320, 320), num_points, num_lights, None)
        terms = [[documents[name]] for name, _, _ in _CASES]
        truth = reference_radiance(lit.geometry, texels_of(environment), lit.points, terms, 500 if tiny else 0)
        for (name, _, curve), right in zip(_CASES, truth, strict=True):
            errors[name][environment.name] = relative_rmse(frame_radiance(lit, documents[name], curve), right)
    context = {"view_samples": num_points, "lights": num_lights}
    return [
        Figure(name, max(of_maps.values()), "relative RMSE", {**context, **of_maps}) for name, of_maps in errors.items()
    ]
