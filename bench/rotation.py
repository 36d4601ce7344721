"""accuracy.rotation_*: a bake whose environment is turned, against truth; the worst of the rotations and maps.

Tiles and shadow rays stay as they were baked, power and moments of the light in each tile are those of the turned map.
The context has the same for a bake that was not made for it, and for a fresh bake of the turned map.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.figure import Figure
from bench.points import Lit, lit_points, relative_rmse
from bench.scenes import LAMBERT, cook_torrance, environments, teapot_on_table
from relume.brdf.curves import curve_bands
from relume.brdf.registry import TERMS
from relume.light.tiles import MIN_LIGHTS, Tiles, choose_tiles
from relume.light.triangles import TriangleLights, weigh
from relume.look.terms import complete_term
from relume.reference import reference_radiance, texels_of
from relume.scene.model import Environment
from relume.trace.visibility import trace_visibility
from relume.transfer.shade import shade

F64 = NDArray[np.float64]

_CASES: tuple[tuple[str, dict[str, Any]], ...] = (
    ("accuracy.rotation_lambert", LAMBERT),
    ("accuracy.rotation_cook_torrance_0.2", cook_torrance(0.2)),
)
_TURNS = (0, 1 / 32, 1 / 8, 1 / 4, 1 / 2)  # whole texels of any map as wide as a multiple of 32


@dataclass(frozen=True)
class _Bake:
    """Tiles and where their shadow rays went."""

    tiles: Tiles
    towards: NDArray[np.float32]


def measure(tiny: bool) -> list[Figure]:
    """All bakes of a map share the truth."""
    num_points, num_lights = (20, 100) if tiny else (1000, 4000)
    documents = {name: complete_term(("accuracy",), dict(term), None) for name, term in _CASES}
    found: dict[str, dict[str, float]] = {name: {} for name in documents}
    for environment in environments()[: 1 if tiny else 3]:
        lit = lit_points(teapot_on_table(environment, (LAMBERT,), (LAMBERT,)), (320, 320), num_points, MIN_LIGHTS, None)
        bakes = {kind: _bake(environment, num_lights, kind == "relightable") for kind in ("relightable", "plain")}
        for turn in _TURNS:
            texels = texels_of(environment, 360 * turn)
            terms = [[document] for document in documents.values()]
            truth = reference_radiance(lit.geometry, texels, lit.points, terms, 500 if tiny else 0)
            turned = _turned(environment, turn)
            kinds = {kind: (bake, weigh(bake.tiles, turned.radiance)) for kind, bake in bakes.items()}
            fresh = _bake(turned, num_lights, False)
            kinds["fresh"] = fresh, weigh(fresh.tiles, turned.radiance)
            for kind, (bake, lights) in kinds.items():
                for (name, document), right in zip(documents.items(), truth, strict=True):
                    error = relative_rmse(_radiance(lit, bake, lights, document), right)
                    found[name][f"{kind}, {environment.name}, {360 * turn:g}°"] = error
    context = {"view_samples": num_points, "lights": num_lights}
    return [
        Figure(
            name,
            _worst(errors, "relightable"),
            "relative RMSE",
            {**context, "plain": _worst(errors, "plain"), **errors},
        )
        for name, errors in found.items()
    ]


def _worst(errors: Mapping[str, float], kind: str) -> float:
    return max(error for label, error in errors.items() if label.startswith(kind))


def _bake(environment: Environment, num_lights: int, relightable: bool) -> _Bake:
    """What the method `direct` would store of the light."""
    tiles = choose_tiles(environment.radiance, num_lights, relightable)
    centroids = tiles.centroids.astype(np.float32)
    return _Bake(tiles, centroids if relightable else weigh(tiles, environment.radiance).direction)


def _turned(environment: Environment, turn: float) -> Environment:
    """The map turned by a share of a whole turn, as an image."""
    columns = round(turn * environment.radiance.shape[1])
    return replace(environment, radiance=np.roll(environment.radiance, -columns, axis=1))


def _radiance(lit: Lit, bake: _Bake, lights: TriangleLights, document: Mapping[str, Any]) -> F64:
    points, term = lit.points, TERMS[document["model"]]
    visible = trace_visibility(lit.geometry.embree, points.position, points.normal, bake.towards).visible
    bands = {curve.name: curve_bands(document, curve) for curve in term.curves if not curve.outgoing}
    receivers = replace(lit.receivers, visible=visible)
    image = shade(term, bands, lights, receivers, lambda share: None, lambda: False).image
    radiance = image.transpose(0, 2, 1).reshape(-1, 3)[: points.num_points]
    return np.asarray(radiance.astype(np.float64) * np.asarray(document["color"]))
