"""User actions in a session: random edits, and waiting for exact pictures."""

from __future__ import annotations

import copy

import numpy as np
from analytic_terms import ANALYTIC

from relume.brdf.registry import TERMS
from relume.brdf.term import VIEW
from relume.core.cache import Cache
from relume.live.fixed_camera.protocols import EditAxis
from relume.live.opened.openers import open_transfer
from relume.look import validate
from relume.methods.registry import METHODS
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process

BUDGET = 1 << 28


def bake_corner_scene(scene, method, folder):
    """A bake of the view "front" in 40×30 under 400 lights, opened."""
    recipe = Recipe(method, ("front",), (40, 30), 400)
    return open_transfer(bake_in_process(METHODS[method], scene, recipe, folder / f"{method}.zarr"), Cache(1 << 30))


def make_look(transfer, change=lambda document: None):
    """The default look after `change` has edited a copy of its document."""
    document = copy.deepcopy(transfer.default_look)
    change(document)
    return validate(document, transfer.default_look)


def run_until_exact(picture):
    """Freeze and advance until the picture is exact and nothing is pending."""
    for _ in range(200):
        advance = picture.advance(None)
        if picture.next_job() is None and advance.exact:
            return picture
        picture.run_next_job(lambda fraction: None, lambda: False)
    raise AssertionError(f"the picture still waits for {picture.next_job()}")


def run_next_job(picture):
    """Run the pending job and return it."""
    need = picture.next_job()
    need.apply(need.run(lambda fraction: None, lambda: False))
    return need


def kind_of(job):
    """The kind of a job; None for no job."""
    return None if job is None else job.kind


def task_of(job):
    """The target that a job's `run` is a method of."""
    return job.run.__self__


def has_pending_job(picture):
    """True if a job is pending, for the look or for prepared edits."""
    return picture.next_job() is not None


def has_bounces(transfer):
    """True if indirect light was baked."""
    return EditAxis.BOUNCES in transfer.axes


def relative_rmse(values, expected):
    """Root mean square error relative to the root mean square of the expected values."""
    return np.sqrt(np.mean((values - expected) ** 2) / np.mean(expected**2))


def make_random_term(rng):
    """A term of any model with random parameters."""
    model = list(ANALYTIC)[rng.integers(len(ANALYTIC))]
    term = {"model": model, "color": rng.uniform(0, 1, 3).round(3).tolist(), "params": {}, "curves": {}}
    fixed = TERMS[model].fixed
    return term | {"params": {p.name: make_random_value(rng, p, p.name in fixed) for p in TERMS[model].parameters}}


def make_random_value(rng, parameter, is_fixed):
    """A number or, for parameters that vary by channel, three, away from the ends of the parameter's range."""
    low, high = parameter.minimum, parameter.maximum
    at = rng.uniform(0.1, 0.9, 3 if rng.random() < 0.2 and not is_fixed else 1)
    values = np.exp(np.log(low) + at * np.log(high / low)) if parameter.scale == "log" else low + at * (high - low)
    return values.tolist() if len(values) == 3 else float(values[0])


def make_random_curve(rng, num_bands):
    """A drawn curve, as points or bands, in one channel or several."""
    angles = np.sort(rng.choice(np.arange(1, 90), rng.integers(2, 7), replace=False))
    control_points = [
        [float(angle), float(value)] for angle, value in zip(angles, rng.uniform(0, 2, len(angles)), strict=True)
    ]
    drawn = {"points": control_points} if rng.random() < 0.7 else {"bands": rng.uniform(0, 2, num_bands).tolist()}
    return drawn | ({"channels": "rgb"[rng.integers(3)]} if rng.random() < 0.3 else {})


def apply_random_edit(rng, document):
    """Edit a complete look document in place at random; return a description."""
    name = list(document["materials"])[rng.integers(len(document["materials"]))]
    terms = document["materials"][name]["terms"]
    kind = rng.choice(
        ["params", "curve", "color", "reset", "model", "add", "remove", "intensity", "texture"],
        p=[0.35, 0.25, 0.1, 0.05, 0.05, 0.05, 0.05, 0.05, 0.05],
    )
    if kind == "intensity":
        document["environment"]["intensity"] = float(rng.uniform(0, 3))
        document["environment"]["color"] = rng.uniform(0, 1, 3).tolist()
        return kind
    if kind == "add" and len(terms) < 3:
        terms.append(make_random_term(rng))
        return kind
    if kind == "remove" and len(terms) > 1:
        del terms[rng.integers(len(terms))]
        return kind
    k = int(rng.integers(len(terms)))
    term, declared = terms[k], TERMS[terms[k]["model"]]
    if kind == "params" and declared.parameters:
        parameter = declared.parameters[rng.integers(len(declared.parameters))]
        term["params"] = {
            **term["params"],
            parameter.name: make_random_value(rng, parameter, parameter.name in declared.fixed),
        }
    elif kind == "curve":
        curves = [curve for curve in declared.curves if curve is not VIEW]  # it only multiplies finished samples
        curve = curves[rng.integers(len(curves))]
        term["curves"] = {**term["curves"], curve.name: make_random_curve(rng, curve.num_bands)}
    elif kind == "reset":
        term["curves"] = {}
    elif kind == "model":
        terms[k] = make_random_term(rng)
    elif kind == "texture":
        term["texture"] = [None, "diffuse", "specular"][rng.integers(3)]
    else:
        term["color"] = rng.uniform(0, 1, 3).tolist()
    return kind
