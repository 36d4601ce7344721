"""Bakes whose light is weighed again: tiles and shadow rays as they were, power and moments those of another map."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.figure import Figure
from bench.points import Lit, relative_rmse
from bench.scenes import LAMBERT, cook_torrance
from relume.brdf.curves import curve_bands
from relume.brdf.registry import TERMS
from relume.light.tiles import Tiles, choose_tiles
from relume.light.triangles import TriangleLights, weigh
from relume.look.terms import complete_term
from relume.reference import reference_radiance, texels_of
from relume.scene.model import Environment
from relume.trace.visibility import trace_visibility
from relume.transfer.shade import shade

F64 = NDArray[np.float64]


def documents(kind: str) -> dict[str, dict[str, Any]]:
    """Complete terms that are compared, by the name of their figure."""
    terms = {"lambert": LAMBERT, "cook_torrance_0.2": cook_torrance(0.2)}
    return {f"accuracy.{kind}_{name}": complete_term(("accuracy",), dict(term), None) for name, term in terms.items()}


@dataclass(frozen=True)
class Bake:
    """Tiles and where their shadow rays went."""

    tiles: Tiles
    towards: NDArray[np.float32]


def bake(environment: Environment, num_lights: int, relightable: bool) -> Bake:
    """What a bake of this environment keeps."""
    tiles = choose_tiles(environment.radiance, num_lights, relightable)
    centroids = tiles.centroids.astype(np.float32)
    return Bake(tiles, centroids if relightable else weigh(tiles, environment.radiance).direction)


def compare(
    lit: Lit, bakes: Mapping[str, Bake], light: Environment, terms: Mapping[str, Mapping[str, Any]], spp: int
) -> dict[tuple[str, str], float]:
    """Relative RMSE of each term, by name, in each bake, by name, of the same points under one light.

    Args:
        spp: of the truth; 0 for every texel.
    """
    documents = [[dict(document)] for document in terms.values()]
    truth = reference_radiance(lit.geometry, texels_of(light), lit.points, documents, spp)
    errors = {}
    for kind, baked in bakes.items():
        lights = weigh(baked.tiles, light.radiance)
        for (name, document), right in zip(terms.items(), truth, strict=True):
            errors[name, kind] = relative_rmse(_radiance(lit, baked, lights, document), right)
    return errors


def _radiance(lit: Lit, baked: Bake, lights: TriangleLights, document: Mapping[str, Any]) -> F64:
    """Of the points under the lights in a bake's tiles. (n, 3)"""
    points, term = lit.points, TERMS[document["model"]]
    visible = trace_visibility(lit.geometry.embree, points.position, points.normal, baked.towards).visible
    bands = {curve.name: curve_bands(document, curve) for curve in term.curves if not curve.outgoing}
    receivers = replace(lit.receivers, visible=visible)
    image = shade(term, bands, lights, receivers, lambda share: None, lambda: False).image
    found = image.transpose(0, 2, 1).reshape(-1, 3)[: points.num_points]
    return np.asarray(found.astype(np.float64) * np.asarray(document["color"]))


def figures(found: Mapping[str, Mapping[str, float]], context: Mapping[str, Any]) -> list[Figure]:
    """Each figure's worst error of a relightable bake; all errors, labelled "kind, …", beside it."""
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
