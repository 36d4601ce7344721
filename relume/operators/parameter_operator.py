"""Operators of a parameter: a term's image at any value of it, even if it changes several curves.

The image of a term is a linear function of the product of its curves (eq. 26, Ben-Artzi 2006). Over a parameter's range
these products lie close to a space of few dimensions (Nguyen 2010, section 4): the operator holds the images at a few
values of the parameter that span it,

    R(p) = Σ_s c_s(p) R(p_s),

as many as represent every band of the product to `MAX_ERROR`, and hence every pixel
(docs/direct-light.md#algorithm).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.curve_edits import drawn_curves
from relume.brdf.curves import curve_bands
from relume.brdf.parameter_sweep import curves_of_parameter, slider_values, solid_angles
from relume.brdf.registry import TERMS
from relume.brdf.term import Curve, Term
from relume.lights.spherical_triangles import TriangleLights
from relume.math.curve_nodes import CurveNodes, choose_nodes
from relume.math.pca import joint
from relume.transport.roughness_ranges import at_roughness, num_levels, project_levels, without_free_curves
from relume.transport.shading_points import ShadingPoints
from relume.transport.term_contraction import contract

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
ParameterSettings = tuple[tuple[str, float | tuple[float, ...]], ...]

MAX_ERROR = 2e-2
MAX_NODES = 36
_TARGET_ERROR = 0.9 * MAX_ERROR  # at the checked values; between these it is a little larger
_NUM_VALUES = 97
_MAX_SECONDARY_BANDS = 12  # of each affected curve but the first: those are smooth, and a full product is large


@dataclass(frozen=True)
class ParameterOperator:
    """A basis of a parameter's curves at a few values of it; an `EditBasis`.

    Attributes:
        fixed_settings: other parameters of the same curves, with their values.
        curves: affected by the parameter.
        nodes: nodes of R, G and B, equally many; products of the affected curves (`_product`).
    """

    model: str
    parameter: str
    fixed_settings: ParameterSettings
    curves: tuple[Curve, ...] = field(compare=False)
    nodes: tuple[CurveNodes, CurveNodes, CurveNodes] = field(compare=False)

    is_complete = False

    @property
    def label(self) -> str:
        """Label for users."""
        return TERMS[self.model].parameter(self.parameter).label

    @property
    def affected_curves(self) -> tuple[str, ...]:
        """Names of the affected curves."""
        return tuple(curve.name for curve in self.curves)

    @property
    def num_columns(self) -> int:
        """Number of nodes S."""
        return len(self.nodes[0].values)

    def is_valid_for(self, document: Mapping[str, Any]) -> bool:
        """Return True if the curves of a term document differ from the linearized one by the parameter alone."""
        return document["model"] == self.model and _fixed_settings(document, self.parameter) == self.fixed_settings

    def coefficients(self, bands: Mapping[str, F64]) -> Shaped[F64, "*levels 3 S"]:
        """Return the coefficients c of a term's curves, (3, J) each; one set per level if a curve depends on it."""
        moved_bands = {name: bands[name] for name in self.affected_curves}
        num_of_levels = num_levels(moved_bands)
        return (
            self._coefficients_at_level(moved_bands)
            if num_of_levels == 1
            else np.stack(
                [self._coefficients_at_level(at_roughness(moved_bands, level)) for level in range(num_of_levels)]
            )
        )

    def _coefficients_at_level(self, bands: Mapping[str, F64]) -> F64:
        """Return c at one level. (3, S)"""
        moved_rows = [bands[curve.name] for curve in self.curves]
        if all(np.all(rows == rows[0]) for rows in moved_rows) and self.nodes[0] is self.nodes[1] is self.nodes[2]:
            return np.tile(self.nodes[0].coefficients(_product([rows[0] for rows in moved_rows])), (3, 1))
        products = [_product([rows[channel] for rows in moved_rows]) for channel in range(3)]
        return np.array([nodes.coefficients(curve) for nodes, curve in zip(self.nodes, products, strict=True)])

    def node_bands(self) -> dict[str, F64]:
        """Return the bands of the affected curves at all nodes. (3, S, J) each"""
        documents = [
            _document_at(self.model, self.fixed_settings, self.parameter, values)
            for values in zip(*(n.values for n in self.nodes), strict=True)
        ]
        return {
            curve.name: np.stack([curve_bands(document, curve) for document in documents], axis=1)
            for curve in self.curves
        }

    def columns(
        self, term: Term, bands: Mapping[str, F64], lights: TriangleLights, receivers: ShadingPoints
    ) -> Callable[[int, int], Shaped[F32, "3 samples columns"]]:
        """Return the images at all nodes, in one pass. See `EditBasis`.

        If the parameter affects a single curve, its nodes are combinations of that curve's bands, which are faster to
        project.
        """
        node_bands = self.node_bands()
        single_curve = self.affected_curves[0] if len(self.affected_curves) == 1 else None
        fixed_bands = without_free_curves(bands, self.affected_curves)  # nodes are the same at all levels
        fixed_by_level = [at_roughness(fixed_bands, level) for level in range(num_levels(fixed_bands))]
        contractions = [
            contract(term, b if single_curve else {**b, **node_bands}, single_curve) for b in fixed_by_level
        ]
        matrices = None if single_curve is None else node_bands[single_curve].astype(np.float32)

        def columns(start: int, stop: int) -> F32:
            projected = project_levels(term, contractions, lights, receivers, start, stop)
            if matrices is not None:
                return np.stack([projected[:, :, c] @ matrices[c].T for c in range(3)])
            return np.ascontiguousarray(projected.transpose(2, 0, 1))

        return columns


def linearize(document: Mapping[str, Any], parameter: str) -> ParameterOperator | None:
    """Choose nodes of a parameter; None if it affects no curve, one is drawn, or `MAX_NODES` are too few."""
    fixed_settings = _fixed_settings(document, parameter)
    return None if fixed_settings is None else _linearize_cached(document["model"], parameter, fixed_settings)


def _fixed_settings(document: Mapping[str, Any], parameter: str) -> ParameterSettings | None:
    """Return the other settings of the curves that a parameter affects; None if it affects none, or one is drawn."""
    term = TERMS[document["model"]]
    curves = curves_of_parameter(term, parameter)
    if not curves or any(drawn_curves(document, curve) for curve in curves):
        return None
    parameter_names = sorted({name for curve in curves for name in curve.parameters} - {parameter})
    settings = document.get("params") or {}
    values = ((name, settings.get(name, term.parameter(name).default)) for name in parameter_names)
    return tuple((name, tuple(value) if isinstance(value, list | tuple) else float(value)) for name, value in values)


@lru_cache(maxsize=64)
def _linearize_cached(model: str, parameter: str, fixed_settings: ParameterSettings) -> ParameterOperator | None:
    term = TERMS[model]
    description, curves = term.parameter(parameter), curves_of_parameter(term, parameter)
    values = slider_values(description, _NUM_VALUES)
    midpoints = slider_values(description, _NUM_VALUES - 1, at_midpoints=True)
    documents = [
        _document_at(model, fixed_settings, parameter, (value, value, value)) for value in (*values, *midpoints)
    ]
    # (n, 3, J) per curve
    curve_rows = [np.array([curve_bands(document, curve) for document in documents]) for curve in curves]
    weights = _product([solid_angles(curve) for curve in curves])
    is_gray = all(bool(np.all(rows == rows[:, :1])) for rows in curve_rows)
    channel_nodes = _choose_channel_nodes(1 if is_gray else 3, values, curve_rows, weights)
    if channel_nodes is None:
        return None
    red, green, blue = channel_nodes * 3 if is_gray else channel_nodes
    return ParameterOperator(model, parameter, fixed_settings, curves, (red, green, blue))


def _choose_channel_nodes(num: int, values: F64, rows: Sequence[F64], weights: F64) -> list[CurveNodes] | None:
    """Choose nodes per channel, as few as suffice and equally many; None if `MAX_NODES` do not suffice.

    Args:
        rows: rows of each curve, at the values and between them. (2 n − 1, 3, J) each
    """
    products = [np.array([_product(bands) for bands in zip(*(r[:, c] for r in rows), strict=True)]) for c in range(num)]

    def choose(max_error: float, max_nodes: int) -> list[CurveNodes]:
        num_values = len(values)
        return [
            choose_nodes(values, curves[:num_values], curves[num_values:], weights, max_nodes, max_error)
            for curves in products
        ]

    channel_nodes = choose(_TARGET_ERROR, MAX_NODES)
    if any(nodes.error > _TARGET_ERROR for nodes in channel_nodes):
        return None
    max_nodes = max(len(nodes.values) for nodes in channel_nodes)
    if any(len(nodes.values) < max_nodes for nodes in channel_nodes):
        channel_nodes = choose(0.0, max_nodes)
    return channel_nodes


def _document_at(
    model: str, fixed_settings: ParameterSettings, parameter: str, values: Sequence[float]
) -> dict[str, Any]:
    """Return a document with one parameter set to a value for R, G and B."""
    return {"model": model, "params": {**dict(fixed_settings), parameter: [float(value) for value in values]}}


def _product(bands: Sequence[F64]) -> F64:
    """Return products of bands of the affected curves: all of the first, some of each other. (J_1,), … -> (J,)"""
    first, *secondary = bands
    return joint([first, *(rows[_secondary_bands(len(rows))] for rows in secondary)])


def _secondary_bands(num: int) -> NDArray[np.intp]:
    """Select bands, denser toward grazing angles, where masking varies."""
    return num - np.unique(np.geomspace(1, num, _MAX_SECONDARY_BANDS).astype(np.intp))
