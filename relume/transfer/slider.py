"""Freezing along a parameter: a term's image at any value of it, also where it moves several curves at once.

The image of a term is a linear function of the product of its curves (eq. 26, Ben-Artzi 2006). Over a parameter's range
these products lie almost in a space of few dimensions (Nguyen 2010, section 4): the operator holds the images at a few
values of the parameter that span it,

    R(p) = Σ_s c_s(p) R(p_s),

with c(p) by least squares, as many as hold the worst relative RMS of the curves over the range, by
solid angle, to 10⁻³.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.basis.pca import Nodes, choose_nodes, joint
from relume.brdf.curves import curve_bands, drawn_curves
from relume.brdf.registry import TERMS
from relume.brdf.sweep import moved_curves, slider_values, solid_angles
from relume.brdf.term import Curve, Term
from relume.errors import CancelledError
from relume.light.triangles import TriangleLights
from relume.parallel import for_ranges
from relume.transfer.frozen import tiles_of
from relume.transfer.projector import Projector, Receivers, contract

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

MAX_ERROR = 1e-3
MAX_NODES = 24
_NUM_VALUES = 97
_MAX_PRODUCT = 1 << 15  # bands of all moved curves multiplied; 0.1 GB while nodes are chosen
_SAMPLES_A_STEP = 512


@dataclass(frozen=True)
class Linearised:
    """What a parameter does to a term's curves, as a combination of what it does at a few values.

    Attributes:
        curves: those it moves. nodes: of R, G and B, equally many.
    """

    parameter: str
    curves: tuple[Curve, ...]
    nodes: tuple[Nodes, Nodes, Nodes]

    @property
    def num_nodes(self) -> int:
        """S."""
        return len(self.nodes[0].values)

    def coefficients(self, document: Mapping[str, Any]) -> F64:
        """c of the curves of a term document that differs from the one linearised in the parameter alone. (3, S)"""
        products = _product(document, self.curves)
        return np.array([nodes.coefficients(row) for nodes, row in zip(self.nodes, products, strict=True)])

    def bands(self, document: Mapping[str, Any]) -> dict[str, F64]:
        """Bands of the moved curves at all nodes. (3, S, J) each"""
        at_nodes = [
            _at(document, self.parameter, *values) for values in zip(*(n.values for n in self.nodes), strict=True)
        ]
        return {curve.name: np.stack([curve_bands(at, curve) for at in at_nodes], axis=1) for curve in self.curves}


def _at(document: Mapping[str, Any], parameter: str, *values: float) -> dict[str, Any]:
    """The document with one parameter at a value for R, G and B."""
    return {**document, "params": {**(document.get("params") or {}), parameter: [float(value) for value in values]}}


def linearise(document: Mapping[str, Any], parameter: str) -> Linearised | None:
    """Choose the nodes of a term's parameter; None where none do: no curve moves, one is drawn, or 24 are too few."""
    term: Term = TERMS[document["model"]]
    curves = moved_curves(term, parameter)
    if not curves or any(drawn_curves(document, curve) for curve in curves):
        return None
    if math.prod(curve.num_bands for curve in curves) > _MAX_PRODUCT:
        return None
    declared = term.parameter(parameter)
    values = slider_values(declared, _NUM_VALUES)
    inside, between = (
        _products(document, parameter, curves, at)
        for at in (values, slider_values(declared, _NUM_VALUES - 1, between=True))
    )
    alike = bool(np.all(inside == inside[0]))
    chosen = [choose_nodes(values, inside[c], between[c], MAX_NODES) for c in ((0,) if alike else (0, 1, 2))]
    if any(nodes.errors[-1] > MAX_ERROR for nodes in chosen):
        return None
    num = max(1 + int(np.argmax(nodes.errors <= MAX_ERROR)) for nodes in chosen)
    if any(len(nodes.values) < num for nodes in chosen):
        return None
    red, green, blue = (nodes.first(num) for nodes in (chosen * 3 if alike else chosen))
    return Linearised(parameter, curves, (red, green, blue))


def _product(document: Mapping[str, Any], curves: tuple[Curve, ...]) -> F64:
    """All curves multiplied, each band weighed by the directions it has: errors then are those of light. (3, J)"""
    weighed = [curve_bands(document, curve) * solid_angles(curve) for curve in curves]
    return np.array([joint([rows[channel] for rows in weighed]) for channel in range(3)])


def _products(document: Mapping[str, Any], parameter: str, curves: tuple[Curve, ...], values: F64) -> F64:
    """`_product` at values of a parameter. (3, n, J)"""
    products = [_product(_at(document, parameter, value, value, value), curves) for value in values]
    return np.array(products).transpose(1, 0, 2)


@dataclass(frozen=True)
class FrozenSlider:
    """The linear operator from one parameter to the image of one term; its columns are images at the nodes.

    Attributes:
        transport: laid out as `Frozen.transport`, for `stream`. (tiles, 3, S, samples) float32
    """

    linearised: Linearised
    transport: F32

    @property
    def num_bytes(self) -> int:
        """Memory it holds."""
        return self.transport.nbytes


def freeze_slider(
    document: Mapping[str, Any],
    linearised: Linearised,
    lights: TriangleLights,
    receivers: Receivers,
    progress: Callable[[float], None],
    cancelled: Callable[[], bool],
) -> FrozenSlider:
    """Contract all curves at all nodes of a parameter in one pass.

    Where the parameter moves a single curve, its nodes are combinations of that curve's bands, which are quicker to
    share light out to.

    Args:
        document: the term; its value of the parameter does not matter.
        progress: called with the share done. cancelled: asked now and then.
    Raises:
        CancelledError: `cancelled` said so.
    """
    term = TERMS[document["model"]].settled(document)
    bands = {curve.name: curve_bands(document, curve) for curve in term.curves if not curve.outgoing}
    at_nodes = linearised.bands(document)
    alone = linearised.curves[0].name if len(linearised.curves) == 1 else None
    contraction = contract(term, bands if alone else {**bands, **at_nodes}, alone)
    num_samples = len(receivers.normal)
    tiles, samples = tiles_of(num_samples)
    rows = np.zeros((tiles * samples, linearised.num_nodes, 3), np.float32)
    lock, done = threading.Lock(), [0]

    def step(start: int, stop: int) -> None:
        if cancelled():
            raise CancelledError("freezing was cancelled")
        projected = Projector(term, contraction, lights, receivers).project(start, stop)
        if alone is not None:
            matrices = at_nodes[alone].astype(np.float32)
            projected = np.stack([projected[:, :, c] @ matrices[c].T for c in range(3)], axis=2)
        rows[start:stop] = projected
        with lock:
            done[0] += stop - start
            progress(done[0] / num_samples)

    for_ranges(step, num_samples, _SAMPLES_A_STEP)
    transport = rows.reshape(tiles, samples, -1, 3).transpose(0, 3, 2, 1)
    return FrozenSlider(linearised, np.ascontiguousarray(transport))
