"""slider.*: dragging one slider, along the parameter and along a curve alone.

320×320, the teapot on a table; its highlight, `ggx`, is dragged from roughness 0.15 to 0.75. Error: the worst relative
RMSE of a displayed frame over the pixels of the teapot, only its highlight lit, against the same look made exact, frame
by frame. Time: look → updated image, median. `one_curve` is the same drag with the operator of θh alone and 64
coefficients per frame. In the context of the error: both drags, the second a slider that changes one curve (σ of
`cook_torrance`), by nodes and by wavelets. `slider.freeze_ratio`: making the operator along the parameter ÷ along its
θh, medians, alternating.
"""

from __future__ import annotations

import copy
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.assets.environments.studio import studio
from relume.brdf.curves import curve_bands
from relume.brdf.registry import TERMS
from relume.brdf.term_validation import complete_term
from relume.core.cache import Cache
from relume.live.fixed_camera.picture import Picture
from relume.live.fixed_camera.protocols import FixedViewTransfer
from relume.live.opened.openers import open_transfer
from relume.look import Look, validate
from relume.methods.direct import DirectMethod
from relume.operators.edit_basis import precompute
from relume.operators.parameter_operator import linearize
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process
from relume_bench.figure import Figure
from relume_bench.points import freeze_for_curve, relative_rmse, sample_lit_surface
from relume_bench.scenes import LAMBERT, cook_torrance, teapot_on_table
from relume_bench.timing import time_interleaved
from relume_bench.until_exact import run_until_exact

_NAMES = ("slider.drag_error", "slider.frame_ms", "slider.freeze_ratio")
_TERM = "/materials/Teapot/terms/1"
_BUDGETS = (16, 64, None)


@dataclass(frozen=True)
class _Drag:
    """A slider, and the looks of its drag."""

    model: str
    parameter: str
    values: NDArray[np.float64]

    @property
    def document(self) -> dict[str, Any]:
        return {"model": self.model, "color": [0.9, 0.9, 0.9], "params": {self.parameter: float(self.values[0])}}

    def looks(self, transfer: FixedViewTransfer) -> list[Look]:
        """Looks with the highlight alone, so that errors are relative to the change."""
        looks = []
        for value in self.values:
            document = copy.deepcopy(transfer.default_look)
            terms = document["materials"]["Teapot"]["terms"]
            terms[0]["color"] = [0.0, 0.0, 0.0]
            terms[1] = {**self.document, "params": {self.parameter: float(value)}}
            looks.append(validate(document, transfer.default_look))
        return looks


def measure(tiny: bool) -> list[Figure]:
    """Measure both drags, and both freezes."""
    size, num_lights, num_frames = ((32, 32), 60, 4) if tiny else ((320, 320), 500, 12)
    multi_curve_drag = _Drag("ggx", "roughness", np.linspace(0.15, 0.75, num_frames))
    single_curve_drag = _Drag("cook_torrance", "sigma", np.geomspace(0.05, 0.5, num_frames))
    terms = (LAMBERT, cook_torrance(0.2))
    scene = teapot_on_table(studio(), terms, terms)
    with tempfile.TemporaryDirectory() as folder:
        recipe = Recipe("direct", ("front",), size, num_lights)
        transfer = open_transfer(
            bake_in_process(DirectMethod(), scene, recipe, Path(folder) / "s.zarr"), Cache(4 << 30)
        )
        results = {
            f"{drag.model}.{drag.parameter}": _measure_strategies(transfer, drag)
            for drag in (multi_curve_drag, single_curve_drag)
        }
    node_result, before = results["ggx.roughness"]["nodes"], results["ggx.roughness"]["θh alone, 64"]
    ratio, freezes = _freezes(tiny, multi_curve_drag, single_curve_drag)
    return [
        Figure(
            _NAMES[0],
            node_result["error"],
            "relative RMSE",
            {"one_curve": before["error"], "size": list(size), **results},
        ),
        Figure(_NAMES[1], node_result["ms"], "ms", {"one_curve": before["ms"], "size": list(size)}),
        Figure(_NAMES[2], ratio, "ratio", freezes),
    ]


def _measure_strategies(transfer: FixedViewTransfer, drag: _Drag) -> dict[str, dict[str, float]]:
    """Drag with nodes, and with the wavelets of θh, a limited number per frame."""
    exact = _exact(transfer, drag)
    results = {"nodes": _measure_drag(transfer, drag, "params/" + drag.parameter, None, exact)}
    for budget in _BUDGETS:
        name = f"θh alone, {'all' if budget is None else budget}"
        results[name] = _measure_drag(transfer, drag, "curves/theta_h", budget, exact)
    return results


def _exact(transfer: FixedViewTransfer, drag: _Drag) -> list[NDArray[np.float32]]:
    """Images of the drag, each shaded."""
    pictures = []
    for look in drag.looks(transfer):
        picture = Picture(transfer, "front", Cache(4 << 30))
        picture.set_look(look)
        run_until_exact(picture)
        pictures.append(picture.image())
    return pictures


def _measure_drag(
    transfer: FixedViewTransfer, drag: _Drag, touched: str, budget: int | None, exact: list[NDArray[np.float32]]
) -> dict[str, float]:
    """Drag with the precomputed operator and without other jobs."""
    looks, is_edited = drag.looks(transfer), transfer.views["front"].material_ids() == 0
    picture = Picture(transfer, "front", Cache(4 << 30))
    picture.set_look(looks[0])
    run_until_exact(picture)
    picture.prepare(f"{_TERM}/{touched}")
    while picture.next_job() is not None:  # a merged-light operator may come first
        picture.run_next_job(lambda share: None, lambda: False)
    errors, durations = [], []
    for look, right in zip(looks[1:], exact[1:], strict=True):
        start_time = time.perf_counter()
        picture.set_look(look)
        picture.advance(budget)
        durations.append(time.perf_counter() - start_time)
        errors.append(relative_rmse(picture.image()[is_edited], right[is_edited]))
    return {"error": max(errors), "error_median": float(np.median(errors)), "ms": 1e3 * float(np.median(durations))}


def _freezes(tiny: bool, *drags: _Drag) -> tuple[float, dict[str, Any]]:
    """Seconds along each parameter and along θh; the ratio is of the first."""
    num_positions, num_lights, size = (60, 80, (32, 32)) if tiny else (6000, 2000, (320, 320))
    documents = [complete_term(("slider",), drag.document, None) for drag in drags]
    scene = teapot_on_table(studio(), (documents[0],), (documents[0],))
    lit_samples = sample_lit_surface(scene, size, num_positions, num_lights, material=0)
    calls: dict[str, Callable[[], object]] = {}
    for drag, document in zip(drags, documents, strict=True):
        term, along = TERMS[drag.model], linearize(document, drag.parameter)
        if along is None:
            raise ValueError(f"{drag.parameter} of {drag.model} has no nodes")
        bands = {curve.name: curve_bands(document, curve) for curve in term.curves if not curve.depends_on_view}
        freeze_arguments = (lit_samples.lights, lit_samples.receivers, lambda share: None, lambda: False)
        calls[f"{drag.model}.{drag.parameter}, {along.num_columns} nodes"] = partial(
            precompute, along, term, bands, *freeze_arguments
        )
        calls[f"{drag.model}, θh"] = partial(freeze_for_curve, lit_samples, document, "theta_h")
    durations = [float(np.median(times)) for times in time_interleaved(list(calls.values()), 2 if tiny else 5)]
    return durations[0] / durations[1], {**dict(zip(calls, durations, strict=True)), "view_samples": num_positions}
