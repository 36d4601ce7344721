"""Bakes whose light is weighed again: tiles and shadow rays as they were, power and moments those of another map."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.figure import Figure
from bench.points import Lit
from bench.scenes import LAMBERT, cook_torrance
from bench.standard_error import over_points
from relume.brdf.curves import curve_bands
from relume.brdf.document import complete_term
from relume.brdf.registry import TERMS
from relume.environments.model import Environment
from relume.estimated import Estimated
from relume.light.tiles import Tiles, choose_tiles
from relume.light.triangles import TriangleLights, Unturned, weigh
from relume.operators.shade import shade
from relume.reference import reference_radiance, texels_of
from relume.trace.visibility import trace_visibility

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
    """What a bake of this environment keeps.

    Args:
        num_lights: tiles into which the sphere is divided, at least.
        relightable: tiles do not depend on where the light is, and shadow rays go to their middles.
    """
    tiles = choose_tiles(environment.radiance, num_lights, relightable)
    centroids = tiles.centroids.astype(np.float32)
    return Bake(tiles, centroids if relightable else weigh(tiles, Unturned.of(environment.radiance)).direction)


def compare(
    lit: Lit, bakes: Mapping[str, Bake], light: Environment, terms: Mapping[str, Mapping[str, Any]], spp: int
) -> dict[tuple[str, str], Estimated]:
    """Relative RMSE of each term in each bake, of the same points under one light.

    Args:
        lit: the points; what they see is traced anew for each bake.
        bakes: by a name for each.
        light: the map that is shown.
        terms: complete ones, by the names of their figures.
        spp: texels of the truth at each point; 0 for every texel.
    Returns:
        By the names of term and bake.
    """
    documents = [[dict(document)] for document in terms.values()]
    truth = reference_radiance(lit.geometry, texels_of(light), lit.points, documents, spp)
    errors = {}
    for kind, baked in bakes.items():
        lights = weigh(baked.tiles, Unturned.of(light.radiance))
        for (name, document), right in zip(terms.items(), truth, strict=True):
            errors[name, kind] = over_points(_radiance(lit, baked, lights, document), right)
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


def figures(found: Mapping[str, Mapping[str, Estimated]], context: Mapping[str, Any]) -> list[Figure]:
    """Each figure's worst error of a relightable bake; all errors, labelled "kind, …", beside it."""
    made = []
    for name, errors in found.items():
        worst, plain = _worst(errors, "relightable"), _worst(errors, "plain")
        about = {"plain": plain.value, "plain_standard_error": plain.standard_error}
        parts = {label: error.value for label, error in errors.items()}
        made.append(Figure(name, worst.value, "relative RMSE", {**context, **about, **parts}, worst.standard_error))
    return made


def _worst(errors: Mapping[str, Estimated], kind: str) -> Estimated:
    return max(error for label, error in errors.items() if label.startswith(kind))
