"""frame.incremental_rmse: remaining error of 500 incremental edits after the drag.

A live image follows random edits (parameter jumps, drawn curves, colors; now and then another curve, term or material)
with 30 coefficients per step and never enough steps to become exact. Then it converges through `advance` alone. It is
compared with T · c of the last look in float64, from newly frozen operators.
"""

from __future__ import annotations

import copy
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.assets.environments.studio import studio
from relume.brdf.curves import curve_bands, curve_values
from relume.brdf.registry import TERMS
from relume.core.cache import Cache
from relume.live.fixed_camera.picture import Picture
from relume.live.fixed_camera.protocols import FixedViewTransfer
from relume.live.opened.openers import open_transfer
from relume.look import Look, validate
from relume.math.daubechies import analysis
from relume.methods.direct import DirectMethod
from relume.methods.store_layout import read_lights
from relume.operators.edit_basis import CurveBasis, precompute
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process
from relume_bench.figure import Figure
from relume_bench.points import relative_rmse
from relume_bench.scenes import LAMBERT, cook_torrance, teapot_on_table

F64 = NDArray[np.float64]

_BUDGET = 30
_STRETCH = 25  # edits of one curve before switching to another
_TARGETS = (("Teapot", 1, "theta_h", "sigma"), ("Table", 1, "theta_h", "roughness"), ("Teapot", 1, "theta_d", "ior"))
_RANGES = {"sigma": (0.02, 0.8), "roughness": (0.1, 0.9), "ior": (1.1, 3.0)}


def measure(tiny: bool) -> list[Figure]:
    """Edit, converge, compare."""
    size, num_lights, num_edits = ((40, 40), 100, 20) if tiny else ((256, 256), 1000, 500)
    glossy = {"model": "ggx", "color": [0.5, 0.5, 0.5], "params": {"roughness": 0.4, "f0": 0.1}}
    scene = teapot_on_table(studio(), (LAMBERT, cook_torrance(0.2)), (LAMBERT, glossy))
    with tempfile.TemporaryDirectory() as folder:
        path = bake_in_process(
            DirectMethod(), scene, Recipe("direct", ("front",), size, num_lights), Path(folder) / "s.zarr"
        )
        transfer = open_transfer(path, Cache(4 << 30))
        picture = Picture(transfer, "front", Cache(4 << 30))
        _run_until_exact(picture)
        look, inexact = _edit(picture, transfer, num_edits)
        _run_until_exact(picture)
        error = relative_rmse(picture.image(), _full_image(transfer, look))
    context = {"edits": num_edits, "shown_inexactly": inexact, "size": list(size), "coefficients_a_step": _BUDGET}
    return [Figure("frame.incremental_rmse", error, "relative RMSE", context)]


def _run_until_exact(picture: Picture) -> None:
    while not picture.advance(_BUDGET).exact or picture.next_job() is not None:
        if picture.next_job() is not None:
            picture.run_next_job(lambda share: None, lambda: False)


def _edit(picture: Picture, transfer: FixedViewTransfer, num_edits: int) -> tuple[Look, int]:
    """Apply random edits; return the last look and the number of edits that were not exact when the next one came."""
    rng, inexact = np.random.default_rng(29), 0
    document = copy.deepcopy(transfer.default_look)
    look = validate(document, transfer.default_look)
    for k in range(num_edits):
        material, index, curve, parameter = _TARGETS[k // _STRETCH % len(_TARGETS)]
        term = document["materials"][material]["terms"][index]
        if k % _STRETCH == 0:
            _run_until_exact(picture)  # the drag pauses before another curve is opened
            picture.prepare(f"/materials/{material}/terms/{index}/curves/{curve}")
        _change(rng, term, curve, parameter)
        look = validate(copy.deepcopy(document), transfer.default_look)
        picture.set_look(look)
        while (need := picture.next_job()) is not None and not need.is_refinement:
            picture.run_next_job(lambda share: None, lambda: False)
        inexact += not picture.advance(_BUDGET).exact
    return look, inexact


def _change(rng: np.random.Generator, term: dict[str, Any], curve: str, parameter: str) -> None:
    """Let a parameter jump, draw a curve (in some channels), or change a color."""
    kind = rng.integers(4)
    if kind == 0:
        term["color"] = rng.uniform(0, 2, 3).tolist()
    elif kind == 1:
        angles = np.unique(np.concatenate([[0.0], np.round(rng.uniform(1, 89, 6), 2), [90.0]]))
        values = rng.uniform(0, 20, len(angles)) * np.exp(-angles / 20)
        channels = ("rgb", "rg", "b")[rng.integers(3)]
        term["curves"][curve] = {"points": np.stack([angles, values], 1).tolist(), "channels": channels}
    else:
        term["curves"].pop(curve, None)
        low, high = _RANGES[parameter]
        term["params"][parameter] = float(rng.uniform(low, high))


def _full_image(transfer: FixedViewTransfer, look: Look) -> F64:
    """Σ over terms of color · texture · outgoing curves · T · c, all in float64 except T. (height, width, 3)"""
    view = transfer.views["front"]
    radiance = np.zeros((view.num_view_samples, 3))
    radiance[view.num_surface_samples :] = view.background()
    for k, name in enumerate(transfer.material_names):
        rows = view.rows(k)
        for document in look.materials[name].terms:
            radiance[rows] += _full_term(transfer, view.receivers(k), dict(document), view.cos_theta_o(k))
    weighted = np.empty((view.width * view.height, 3))
    pixel_index = np.repeat(np.arange(view.width * view.height), np.diff(view.first))
    for c in range(3):
        weighted[:, c] = np.bincount(pixel_index, view.throughput[:, 0] * radiance[view.order, c], len(weighted))
    return np.array(look.environment.gain) * weighted.reshape(view.height, view.width, 3)


def _full_term(transfer: FixedViewTransfer, receivers: Any, document: dict[str, Any], cos_theta_o: F64) -> F64:
    term = TERMS[document["model"]].normalized(document)
    bands = {curve.name: curve_bands(document, curve) for curve in term.curves if not curve.depends_on_view}
    active = max(bands, key=lambda name: bands[name].shape[1])
    basis, lights = CurveBasis.from_curve(term.curve(active)), read_lights(transfer.store)
    operator = precompute(basis, term, bands, lights, receivers, lambda share: None, lambda: False)
    sums = np.einsum("tcjs,cj->tsc", operator.transport.astype(np.float64), analysis(bands[active]), optimize=True)
    radiance = sums.reshape(-1, 3)[: len(cos_theta_o)] * np.asarray(document["color"])
    for curve in term.curves:
        if curve.depends_on_view:
            radiance = radiance * curve_values(document, curve, np.arccos(cos_theta_o)).T
    return np.asarray(radiance)
