"""Freezing along a parameter: a term's image at any value of it, also where it moves several curves at once.

The image of a term is a linear function of the product of its curves (eq. 26, Ben-Artzi 2006). Over a parameter's range
these products lie almost in a space of few dimensions (Nguyen 2010, section 4): the operator holds the images at a few
values of the parameter that span it,

    R(p) = Σ_s c_s(p) R(p_s),

with as many as hold every band of the product to `MAX_ERROR`, and so every pixel
(docs/adr/0032-nodes-that-hold-every-pixel.md).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.basis.nodes import Nodes, choose_nodes
from relume.basis.pca import joint
from relume.brdf.curves import curve_bands, drawn_curves
from relume.brdf.registry import TERMS
from relume.brdf.sweep import moved_curves, slider_values, solid_angles
from relume.brdf.term import Curve, Term
from relume.light.triangles import TriangleLights
from relume.operators.frozen import Frozen, lay_out, level_bounds
from relume.operators.packed import Packed
from relume.project.contraction import contract
from relume.project.levels import at_level, freed, num_levels, project_levels
from relume.project.receivers import Receivers

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
Settings = tuple[tuple[str, float | tuple[float, ...]], ...]

MAX_ERROR = 2e-2
MAX_NODES = 36
_ENOUGH = 0.9 * MAX_ERROR  # at the values that are looked at; between them it is a little more
_NUM_VALUES = 97
_BANDS_BESIDE = 12  # of every moved curve but the first, at most: those are smooth, and a product with all is large


@dataclass(frozen=True)
class Linearised:
    """What a parameter does to a term's curves, as a combination of what it does at a few values; an `EditBasis`.

    Attributes:
        others: parameters that move the same curves, with their values.
        curves: those it moves.
        nodes: of R, G and B, equally many; their curves are products of those moved (`_product`).
    """

    model: str
    parameter: str
    others: Settings
    curves: tuple[Curve, ...] = field(compare=False)
    nodes: tuple[Nodes, Nodes, Nodes] = field(compare=False)

    is_complete = False

    @property
    def label(self) -> str:
        """What people read."""
        return TERMS[self.model].parameter(self.parameter).label

    @property
    def moves(self) -> tuple[str, ...]:
        """Names of the curves it moves."""
        return tuple(curve.name for curve in self.curves)

    @property
    def num_columns(self) -> int:
        """S, the number of nodes."""
        return len(self.nodes[0].values)

    def holds_for(self, document: Mapping[str, Any]) -> bool:
        """Whether a term document differs from the one linearised in the parameter alone, as far as its curves go."""
        return document["model"] == self.model and _others(document, self.parameter) == self.others

    def coefficients(self, bands: Mapping[str, F64]) -> F64:
        """c of a term's curves, (3, J) each. (3, S); (L, 3, S) where moved curves differ from level to level"""
        moved = {name: bands[name] for name in self.moves}
        num = num_levels(moved)
        return self._at(moved) if num == 1 else np.stack([self._at(at_level(moved, level)) for level in range(num)])

    def _at(self, bands: Mapping[str, F64]) -> F64:
        """c at one level. (3, S)"""
        moved = [bands[curve.name] for curve in self.curves]
        if all(np.all(rows == rows[0]) for rows in moved) and self.nodes[0] is self.nodes[1] is self.nodes[2]:
            return np.tile(self.nodes[0].coefficients(_product([rows[0] for rows in moved])), (3, 1))
        products = [_product([rows[channel] for rows in moved]) for channel in range(3)]
        return np.array([nodes.coefficients(curve) for nodes, curve in zip(self.nodes, products, strict=True)])

    def bands_at_nodes(self) -> dict[str, F64]:
        """Bands of the moved curves at all nodes. (3, S, J) each"""
        documents = [
            _at(self.model, self.others, self.parameter, values)
            for values in zip(*(n.values for n in self.nodes), strict=True)
        ]
        return {
            curve.name: np.stack([curve_bands(document, curve) for document in documents], axis=1)
            for curve in self.curves
        }

    def freeze(
        self,
        term: Term,
        bands: Mapping[str, F64],
        lights: TriangleLights,
        receivers: Receivers,
        progress: Callable[[float], None],
        cancelled: Callable[[], bool],
        *,
        is_packed: bool = False,
    ) -> Frozen | Packed:
        """Contract all curves at all nodes in one pass: the columns are the images there.

        Where the parameter moves a single curve, its nodes are combinations of that curve's bands, which are quicker to
        share light out to.

        Args:
            bands: of all the term's curves, (3, J) each; the moved ones' values do not matter.
            lights, receivers: what arrives, and where.
            progress: called with the share done. cancelled: asked now and then.
            is_packed: whether the operator is packed.
        Raises:
            CancelledError: `cancelled` said so.
        """
        at_nodes = self.bands_at_nodes()
        alone = self.moves[0] if len(self.moves) == 1 else None
        held = freed(bands, self.moves)  # nodes are the same at all levels
        dormant = [at_level(held, level) for level in range(num_levels(held))]
        contractions = [contract(term, b if alone else {**b, **at_nodes}, alone) for b in dormant]
        bounds = level_bounds(receivers, bands, self.moves)
        matrices = None if alone is None else at_nodes[alone].astype(np.float32)

        def rows(begin: int, end: int) -> F32:
            projected = project_levels(term, contractions, lights, receivers, begin, end)
            if matrices is not None:
                return np.stack([projected[:, :, c] @ matrices[c].T for c in range(3)])
            return np.ascontiguousarray(projected.transpose(2, 0, 1))

        return lay_out(rows, self.num_columns, receivers, bounds, progress, cancelled, is_packed=is_packed)


def linearise(document: Mapping[str, Any], parameter: str) -> Linearised | None:
    """The nodes of a term's parameter; None where none do: no curve moves, one is drawn, or `MAX_NODES` are too few."""
    others = _others(document, parameter)
    return None if others is None else _linearised(document["model"], parameter, others)


def _others(document: Mapping[str, Any], parameter: str) -> Settings | None:
    """What else the curves that a parameter moves are made from; None where it moves none, or one is drawn."""
    term = TERMS[document["model"]]
    curves = moved_curves(term, parameter)
    if not curves or any(drawn_curves(document, curve) for curve in curves):
        return None
    read = sorted({name for curve in curves for name in curve.parameters} - {parameter})
    given = document.get("params") or {}
    values = ((name, given.get(name, term.parameter(name).default)) for name in read)
    return tuple((name, tuple(value) if isinstance(value, list | tuple) else float(value)) for name, value in values)


@lru_cache(maxsize=64)
def _linearised(model: str, parameter: str, others: Settings) -> Linearised | None:
    term = TERMS[model]
    declared, curves = term.parameter(parameter), moved_curves(term, parameter)
    values = slider_values(declared, _NUM_VALUES)
    between = slider_values(declared, _NUM_VALUES - 1, between=True)
    documents = [_at(model, others, parameter, (value, value, value)) for value in (*values, *between)]
    # (n, 3, J) of each curve
    rows = [np.array([curve_bands(document, curve) for document in documents]) for curve in curves]
    weights = _product([solid_angles(curve) for curve in curves])
    alike = all(bool(np.all(of_curve == of_curve[:, :1])) for of_curve in rows)
    found = _nodes_of_channels(1 if alike else 3, values, rows, weights)
    if found is None:
        return None
    red, green, blue = found * 3 if alike else found
    return Linearised(model, parameter, others, curves, (red, green, blue))


def _nodes_of_channels(num: int, values: F64, rows: Sequence[F64], weights: F64) -> list[Nodes] | None:
    """Equally many nodes of each channel, as few as are enough; None where `MAX_NODES` are not.

    Args:
        rows: of each curve, at the values and between them. (2 n − 1, 3, J) each
    """
    products = [np.array([_product(bands) for bands in zip(*(r[:, c] for r in rows), strict=True)]) for c in range(num)]

    def chosen(enough: float, most: int) -> list[Nodes]:
        n = len(values)
        return [choose_nodes(values, curves[:n], curves[n:], weights, most, enough) for curves in products]

    found = chosen(_ENOUGH, MAX_NODES)
    if any(nodes.error > _ENOUGH for nodes in found):
        return None
    most = max(len(nodes.values) for nodes in found)
    if any(len(nodes.values) < most for nodes in found):
        found = chosen(0.0, most)
    return found


def _at(model: str, others: Settings, parameter: str, values: Sequence[float]) -> dict[str, Any]:
    """A document with one parameter at a value for R, G and B."""
    return {"model": model, "params": {**dict(others), parameter: [float(value) for value in values]}}


def _product(bands: Sequence[F64]) -> F64:
    """Products of bands of all moved curves: all of the first, some of each other. (J_1,), … -> (J,)"""
    first, *beside = bands
    return joint([first, *(rows[_bands_beside(len(rows))] for rows in beside)])


def _bands_beside(num: int) -> NDArray[np.intp]:
    """Some of so many bands, denser towards the horizon, where masking turns."""
    return num - np.unique(np.geomspace(1, num, _BANDS_BESIDE).astype(np.intp))
