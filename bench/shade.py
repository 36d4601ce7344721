"""shade.pairs_per_s_vs_limit and shade.vs_leaves: how fast a term's picture is made without an operator.

17,700 view samples of the teapot × 4,000 light triangles; pairs are those of a sample and a light that it sees. The
limit: as many pairs whose angles at three nodes, one for each curve, are computed from arrays in a row by the same
threads: arithmetic alone, nothing listed, looked up or weighed. `shade.vs_leaves`: the time of the sums that operators
are made by (`Projector` with no curve free), over that of `shade`. The smallest of three terms counts.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numba as nb
import numpy as np
from numpy.typing import NDArray

from bench.curve_switch import lit_teapot
from bench.figure import Figure
from bench.points import Lit
from bench.scenes import cook_torrance
from bench.timing import in_turn
from relume.brdf.angles import angles_into
from relume.brdf.curves import curve_bands
from relume.brdf.document import complete_term
from relume.brdf.registry import TERMS
from relume.operators.shade import shade
from relume.parallel import for_ranges, num_threads
from relume.project.contraction import contract
from relume.project.projector import Projector

_TERMS: tuple[dict[str, Any], ...] = (
    {"model": "blinn_phong", "color": [1, 1, 1]},
    cook_torrance(0.2),
    {"model": "ggx", "color": [1, 1, 1], "params": {"roughness": 0.4}},
)
_NODES, _ROW = 3, 256
_POINTS_A_STEP = 512


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _angles(kinds, wi, num_pairs, gamma):  # type: ignore[no-untyped-def]
    """Compute angles of curves at nodes, of a row of pairs again and again. wi: (3, row), gamma: (row,)"""
    for _ in range(num_pairs // wi.shape[1]):
        for kind in kinds:
            for _ in range(_NODES):
                angles_into(
                    kind, np.float32(100), wi[0], wi[1], wi[2],
                    np.float32(0.3), np.float32(0.2), np.float32(0.93), gamma,
                )  # fmt: skip


def measure(tiny: bool) -> list[Figure]:
    """Shade, sum by leaves, and compute angles alone, in turn."""
    documents = [complete_term(("shade",), dict(term), None) for term in _TERMS]
    lit = lit_teapot(documents[0], tiny)
    num_pairs = int(np.bitwise_count(lit.receivers.visible).sum())
    of_limit: dict[str, float] = {}
    of_leaves: dict[str, float] = {}
    context: dict[str, float] = {"pairs": num_pairs, "threads": num_threads()}
    for document in documents:
        model, kinds = document["model"], _kinds(document)
        calls: list[Callable[[], object]] = [
            partial(_shaded, lit, document),
            partial(_summed, lit, document),
            partial(_limit, kinds, num_pairs),
        ]
        shaded, summed, limit = (min(times) for times in in_turn(calls, 1 if tiny else 5))
        of_limit[model], of_leaves[model] = limit / shaded, summed / shaded
        context |= {
            f"{model}_Mpairs_per_s": num_pairs / shaded / 1e6,
            f"{model}_difference": _difference(lit, document),
        }
    return [
        Figure("shade.pairs_per_s_vs_limit", min(of_limit.values()), "×", {**of_limit, **context}),
        Figure("shade.vs_leaves", min(of_leaves.values()), "×", {**of_leaves, **context}),
    ]


def _bands(document: dict[str, Any]) -> dict[str, NDArray[np.float64]]:
    term = TERMS[document["model"]]
    return {curve.name: curve_bands(document, curve) for curve in term.curves if not curve.outgoing}


def _kinds(document: dict[str, Any]) -> NDArray[np.int64]:
    return np.array([int(c.angle) for c in TERMS[document["model"]].curves if not c.outgoing], np.int64)


def _shaded(lit: Lit, document: dict[str, Any]) -> NDArray[np.float32]:
    term = TERMS[document["model"]]
    made = shade(term, _bands(document), lit.lights, lit.receivers, lambda share: None, lambda: False)
    return made.rows(lit.points.num_points)


def _summed(lit: Lit, document: dict[str, Any]) -> NDArray[np.float32]:
    term = TERMS[document["model"]]
    contraction = contract(term, _bands(document), None)
    rows = np.empty((lit.points.num_points, 3), np.float32)

    def step(start: int, stop: int) -> None:
        rows[start:stop] = Projector(term, contraction, lit.lights, lit.receivers).project(start, stop)[:, 0]

    for_ranges(step, len(rows), _POINTS_A_STEP)
    return rows


def _limit(kinds: NDArray[np.int64], num_pairs: int) -> None:
    wi = np.full((3, _ROW), 3**-0.5, np.float32)
    for_ranges(
        lambda start, stop: _angles(kinds, wi, stop - start, np.empty(_ROW, np.float32)), num_pairs, num_pairs // 64 + 1
    )


def _difference(lit: Lit, document: dict[str, Any]) -> float:
    """Relative RMSE of the two pictures."""
    shaded, summed = _shaded(lit, document).astype(float), _summed(lit, document).astype(float)
    return float(np.sqrt(np.square(shaded - summed).mean() / np.square(summed).mean()))
