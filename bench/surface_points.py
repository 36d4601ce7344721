"""surface.points_rmse: what light vectors tell of single points, nothing interpolated, against brute force.

Points of the Cornell box that the eye sees, their radiance towards it by all paths, against path tracing whose noise is
taken off (`bench.standard_error.over_passes`): of the scene's own diffuse surfaces, and in the context of such with a
wide highlight; `direct` is irradiance of all points straight from the sky, against every texel of the map traced.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.figure import Figure
from bench.moving_scene import MovingScene
from bench.standard_error import NoiseFree, over_passes
from relume.environments.equirect import texel_directions, texel_solid_angles
from relume.look import Look
from relume.moving.basis.tables import tables_of
from relume.moving.evaluate import send
from relume.moving.vectors.arriving import wholly
from relume.picture.light import light_of
from relume.picture.view_images import documents_of
from relume.reference import Points, reference_radiance, texels_of
from relume.reference.indirect import reference_indirect
from relume.trace.geometry import merge
from relume.trace.primary import trace_from
from relume.trace.visibility import trace_visibility

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
Change = Callable[[dict[str, Any]], None]

PASSES = 8
_FEWER = 8  # paths where the error is not told apart so finely
_COPIES = 8  # of each point, whose paths are traced together
_TEXELS_A_PLACE = 4


def measure(tiny: bool) -> list[Figure]:
    """Bake the box, trace its points."""
    num, paths = (4, 64) if tiny else (400, 4096)
    with tempfile.TemporaryDirectory() as folder:
        box = MovingScene("cornell_box", Path(folder), (60, 60) if tiny else (400, 400), tiny)
        found, glossy = whole_rmse(box, num, paths), whole_rmse(box, num, paths // _FEWER, _wide)
        direct = 100 * direct_rmse(box, num)
        about = {"glossy": glossy.said, "direct": direct, "points": num, "of": box.num_points, "paths": paths}
        context = {**found.context, **about, **box.sizes}
    return [Figure("surface.points_rmse", 100 * found.error.value, "%", context, 100 * found.error.standard_error)]


def _wide(document: dict[str, Any]) -> None:
    highlight = {"model": "ggx", "color": [0.5, 0.5, 0.5], "params": {"roughness": 0.6, "f0": 0.7}, "texture": None}
    for material in document["materials"].values():
        material["terms"] = [{"model": "lambert", "color": [0.3, 0.3, 0.3], "texture": None}, highlight]


def direct_rmse(of: MovingScene, num: int) -> float:
    """Irradiance of some points straight from the sky, against every texel of the map traced."""
    some, chosen = _some(of, num)
    radiance = np.asarray(of.scene.environment.radiance, np.float64)
    height, width, _ = radiance.shape
    directions = texel_directions(height, width).reshape(-1, 3).astype(np.float32)
    light = (radiance * texel_solid_angles(height, width)[:, None, None]).reshape(-1, 3)
    seen = trace_visibility(of.moving.embree, some.position, some.normal, directions).visible
    truth = np.empty((num, 3))
    for k in range(num):
        free = np.unpackbits(seen[k], count=len(directions), bitorder="little")
        cosine = np.maximum(directions @ some.normal[k], 0).astype(np.float64)
        truth[k] = (free * cosine) @ light

    def direct(document: dict[str, Any]) -> None:
        document["transport"]["show"] = "direct"

    shown = light_of(of.look(direct), of.moving.material_names, has_bounces=True)
    found = np.sqrt(np.pi) * wholly(of.moving, shown).total[chosen, :, 0].astype(np.float64)
    return float(np.sqrt(np.mean((found - truth) ** 2) / np.mean(truth**2)))


def whole_rmse(of: MovingScene, num: int, num_paths: int, change: Change = lambda document: None) -> NoiseFree:
    """Radiance of some points towards the eye by all paths, against path tracing; of a look whose terms are broad.

    Args:
        of: the scene, without textures. num: of points that the eye sees. num_paths: of each. change: of its look.
    """
    look, moving, eye = of.look(change), of.moving, of.scene.cameras[0].to_world[:3, 3]
    seen = _seen_by(of, eye)
    chosen = seen[np.linspace(0, len(seen) - 1, num).astype(np.int64)]
    is_needed = np.zeros(moving.surface.points.num_points, np.uint8)
    is_needed[chosen] = 1
    arriving = wholly(moving, light_of(look, moving.material_names, has_bounces=True))
    tables = tables_of([documents_of(look, name) for name in moving.material_names])
    of_highlights = tables._replace(of=tables.of[..., [2, 3, 4, 5, 4, 5]])  # what the in-basis tells of all light
    ours = sum(
        send(moving.surface, arriving.total, None, part, eye.astype(np.float32), is_needed).radiance[chosen].sum(axis=1)
        for part in (tables, of_highlights)
    )
    truth = _traced(of, look, chosen, num_paths)
    return over_passes(ours.astype(np.float64)[None], truth[:, None].astype(np.float32))


def _seen_by(of: MovingScene, eye: F64) -> NDArray[np.intp]:
    """Points that an eye sees: the insides of solids are lit by nothing real."""
    points = of.moving.surface.points
    towards = eye - points.position
    distance = np.linalg.norm(towards, axis=1)
    wo = (towards / distance[:, None]).astype(np.float32)
    hits = trace_from(of.moving.embree, points.position, wo)
    is_free = (hits.face < 0) | (hits.distance > distance)
    return np.flatnonzero(is_free & (np.einsum("nc,nc->n", wo, points.normal) > 0))


def _some(of: MovingScene, num: int) -> tuple[Any, NDArray[np.int64]]:
    points = of.moving.surface.points
    chosen = np.linspace(0, points.num_points - 1, num).astype(np.int64)
    return points.rows(chosen), chosen


def _traced(of: MovingScene, look: Look, chosen: NDArray[np.intp], num_paths: int) -> F64:
    """Radiance of points towards the eye, in independent passes that share their direct light. (passes, points, 3)"""
    scene, geometry, surface = of.scene, merge(of.scene), of.moving.surface
    some, material = surface.points.rows(chosen), surface.material[chosen]
    texels = texels_of(scene.environment, look.environment.rotation).times(look.environment.gain)
    white = {name: np.ones((len(chosen), 3), np.float32) for name in ("diffuse", "specular")}
    towards = scene.cameras[0].to_world[:3, 3] - some.position
    wo = (towards / np.linalg.norm(towards, axis=1, keepdims=True)).astype(np.float32)
    points = Points(some.position, some.normal, some.tangent, wo, white, np.ones(len(chosen), np.float32))
    direct = np.empty((len(chosen), 3))
    for number, name in enumerate(of.moving.material_names):
        mine = np.flatnonzero(material == number)
        if len(mine):
            direct[mine] = reference_radiance(geometry, texels, points.rows(mine), [documents_of(look, name)])[0]
    copied, paths = np.repeat(np.arange(len(chosen)), _COPIES), max(1, num_paths // (_COPIES * PASSES))
    out = np.empty((PASSES, len(chosen), 3))
    for k in range(PASSES):
        reflected = reference_indirect(
            scene, geometry, texels, look, points.rows(copied), material[copied],
            [look.transport.paths.without_direct()], paths, _TEXELS_A_PLACE, seed=k,
        )  # fmt: skip
        out[k] = direct + reflected.mean[0].reshape(len(chosen), _COPIES, 3).mean(axis=1)
    return out
