"""shade.pairs_per_s_vs_limit and shade.vs_operator_sums: speed of shading a term without an operator.

17,700 view samples of the teapot × 4,000 environment triangles; pairs are those of a sample and a visible light. The
limit: as many pairs whose angles at three nodes, one per curve, are computed from contiguous arrays by the same
threads: arithmetic alone, without lists, lookups or weights. `shade.vs_operator_sums`: the time of the sums that make
operators (`Projector` without a free curve), over that of `shade`. The smallest of three terms counts.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.brdf.angles import compute_angles
from relume.brdf.curves import curve_bands
from relume.brdf.registry import TERMS
from relume.brdf.term_validation import complete_term
from relume.core.thread_pools import for_ranges, num_threads
from relume.operators.shade import shade
from relume.transport.projector import Projector
from relume.transport.term_contraction import contract
from relume_bench.curve_switch import lit_teapot
from relume_bench.figure import Figure
from relume_bench.points import LitSamples
from relume_bench.scenes import cook_torrance
from relume_bench.timing import time_interleaved

_TERMS: tuple[dict[str, Any], ...] = (
    {"model": "blinn_phong", "color": [1, 1, 1]},
    cook_torrance(0.2),
    {"model": "ggx", "color": [1, 1, 1], "params": {"roughness": 0.4}},
)
_NODES, _ROW = 3, 256
_NUM_POINTS_PER_STEP = 512


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _angles(angle_types, wi, num_pairs, gamma):  # type: ignore[no-untyped-def]
    """Compute angles of curves at nodes, for a row of pairs repeatedly. wi: (3, row), gamma: (row,)"""
    for _ in range(num_pairs // wi.shape[1]):
        for kind in angle_types:
            for _ in range(_NODES):
                compute_angles(
                    kind, np.float32(100), wi[0], wi[1], wi[2],
                    np.float32(0.3), np.float32(0.2), np.float32(0.93), gamma,
                )  # fmt: skip


def measure(tiny: bool) -> list[Figure]:
    """Shade, sum for operators, and compute angles alone, alternating."""
    documents = [complete_term(("shade",), dict(term), None) for term in _TERMS]
    lit_samples = lit_teapot(documents[0], tiny)
    num_pairs = int(np.bitwise_count(lit_samples.receivers.visible).sum())
    limit_by_model: dict[str, float] = {}
    subdivision_by_model: dict[str, float] = {}
    context: dict[str, float] = {"pairs": num_pairs, "threads": num_threads()}
    for document in documents:
        model, angle_types = document["model"], _angle_types(document)
        calls: list[Callable[[], object]] = [
            partial(_shade, lit_samples, document),
            partial(_sum_operator, lit_samples, document),
            partial(_limit, angle_types, num_pairs),
        ]
        shaded, summed, limit = (min(times) for times in time_interleaved(calls, 1 if tiny else 5))
        limit_by_model[model], subdivision_by_model[model] = limit / shaded, summed / shaded
        context |= {
            f"{model}_Mpairs_per_s": num_pairs / shaded / 1e6,
            f"{model}_difference": _difference(lit_samples, document),
        }
    return [
        Figure("shade.pairs_per_s_vs_limit", min(limit_by_model.values()), "×", {**limit_by_model, **context}),
        Figure("shade.vs_operator_sums", min(subdivision_by_model.values()), "×", {**subdivision_by_model, **context}),
    ]


def _bands(document: dict[str, Any]) -> dict[str, NDArray[np.float64]]:
    term = TERMS[document["model"]]
    return {curve.name: curve_bands(document, curve) for curve in term.curves if not curve.depends_on_view}


def _angle_types(document: dict[str, Any]) -> NDArray[np.int64]:
    return np.array([int(c.angle) for c in TERMS[document["model"]].curves if not c.depends_on_view], np.int64)


def _shade(lit_samples: LitSamples, document: dict[str, Any]) -> NDArray[np.float32]:
    term = TERMS[document["model"]]
    radiance = shade(
        term, _bands(document), lit_samples.lights, lit_samples.receivers, lambda share: None, lambda: False
    )
    return radiance.rows(lit_samples.surface_points.num_points)


def _sum_operator(lit_samples: LitSamples, document: dict[str, Any]) -> NDArray[np.float32]:
    term = TERMS[document["model"]]
    contraction = contract(term, _bands(document), None)
    rows = np.empty((lit_samples.surface_points.num_points, 3), np.float32)

    def step(start: int, stop: int) -> None:
        rows[start:stop] = Projector(term, contraction, lit_samples.lights, lit_samples.receivers).project(start, stop)[
            :, 0
        ]

    for_ranges(step, len(rows), _NUM_POINTS_PER_STEP)
    return rows


def _limit(angle_types: NDArray[np.int64], num_pairs: int) -> None:
    wi = np.full((3, _ROW), 3**-0.5, np.float32)
    for_ranges(
        lambda start, stop: _angles(angle_types, wi, stop - start, np.empty(_ROW, np.float32)),
        num_pairs,
        num_pairs // 64 + 1,
    )


def _difference(lit_samples: LitSamples, document: dict[str, Any]) -> float:
    """Relative RMSE of the two images."""
    shaded, summed = _shade(lit_samples, document).astype(float), _sum_operator(lit_samples, document).astype(float)
    return float(np.sqrt(np.square(shaded - summed).mean() / np.square(summed).mean()))
