"""estimators.*: light on view samples by final-gather rays, and by connecting gather cells to every sample.

The second is Nguyen's, E(x) = Σ_g V(x, g) L_g cos θx cos θg A_g / max(r², A_g / π), one shadow ray a cell, areas by
points spread evenly on the triangles. Cells are merged along their tree to as many as there are gather rays, or as many
as their visibility bits take the store of the links, or not at all. Both see the same light on the same cells; truth is
the mean of many gather rays. Relative RMSE of the irradiance of samples all over the picture, none shared.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.figure import Figure
from bench.gather import bake, recipe_of
from bench.standard_error import over_points
from relume.light.gather_rays import make_pattern
from relume.look import validate
from relume.memory import Memory
from relume.methods.opened.bounced_views import BouncedViews
from relume.methods.registry import open_transfer
from relume.methods.store_io import read_tree
from relume.picture.light import light_of
from relume.points import Points
from relume.scene.cornell import cornell_box
from relume.trace.cell_tree import NO_CELL, CellTree
from relume.trace.geometry import Geometry, merge
from relume.trace.links import trace_links
from relume.trace.primary import trace_from
from relume.trace.tangents import any_tangent

F64 = NDArray[np.float64]
_NAMES = (
    "estimators.final_gather", "estimators.connect_equal_rays",
    "estimators.connect_equal_store", "estimators.connect_all",
)  # fmt: skip
_UNIT = "relative RMSE"
_SEED = 11


def measure(tiny: bool) -> list[Figure]:
    """Compare some samples of one bake in all three ways."""
    scene, num_samples, num_truth = cornell_box(), 40 if tiny else 1200, 512 if tiny else 4096
    geometry = merge(scene)
    with tempfile.TemporaryDirectory() as folder:
        transfer = open_transfer(bake(scene, recipe_of(tiny), Path(folder) / "gather.zarr").path, Memory(4 << 30))
        store, tree = transfer.store, read_tree(transfer.store)
        light = light_of(
            validate(transfer.default_look, transfer.default_look), transfer.material_names, has_bounces=True
        )
        assert isinstance(transfer, BouncedViews)
        radiance = transfer.reflected.under(light).even
        num_rays = store.shape("views/0/links")[1]
        chosen = np.linspace(0, store.shape("views/0/links")[0] - 1, num_samples).astype(np.int64)
        position, normal = (store.read(f"views/0/{name}")[chosen] for name in ("position", "normal"))
        points = Points(position, normal, any_tangent(normal), 64 * np.arange(num_samples, dtype=np.uint32))
        cell_at, cell_normal = (store.read(f"cells/{name}")[:, 0] for name in ("position", "normal"))

    def gathered(count: int) -> F64:
        links = trace_links(geometry, tree, points, points.normal, make_pattern(count, 0, _SEED))
        return np.asarray(np.pi * radiance[links.cell].mean(axis=1, dtype=np.float64))

    truth, num_cells = gathered(num_truth), len(cell_at)
    areas = _areas(geometry, tree, num_cells, 1 << (14 if tiny else 21))
    cells = (cell_at, cell_normal, areas, radiance[:num_cells].astype(np.float64))
    counts = [min(count, num_cells) for count in (num_rays, 16 * num_rays, num_cells)]
    found = [gathered(num_rays), *(_connected(geometry, points, _merged(*cells, count)) for count in counts)]
    return [
        Figure(name, over_points(irradiance, truth).value, _UNIT, {
            "rays_or_cells": count, "samples": num_samples,
            "without_the_worst_percent": _without_the_worst(irradiance, truth),
        }, over_points(irradiance, truth).standard_error)
        for name, irradiance, count in zip(_NAMES, found, [num_rays, *counts], strict=True)
    ]  # fmt: skip


def _without_the_worst(found: F64, truth: F64) -> float:
    """Relative RMSE over all but the hundredth of samples that are furthest off."""
    squares = np.sort(((found - truth) ** 2).mean(axis=1))[: round(0.99 * len(truth))]
    return float(np.sqrt(squares.mean() / np.mean(truth**2)))


def _areas(geometry: Geometry, tree: CellTree, num_cells: int, num_points: int) -> F64:
    """Of every cell, m². (C,)"""
    rng = np.random.default_rng(_SEED)
    a, b, c = geometry.positions[geometry.faces].astype(np.float64).transpose(1, 0, 2)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    face = rng.choice(len(area), num_points, p=area / area.sum())
    u, v = rng.random((2, num_points))
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    normal = geometry.face_normals[face]
    place = a[face] + u[:, None] * (b - a)[face] + v[:, None] * (c - a)[face] + geometry.epsilon * normal
    keys, node = np.concatenate([place, normal], axis=1), tree.roots[2 * geometry.face_mesh[face]].astype(np.int64)
    while np.any(inner := (node >= 0) & (node < len(tree.axis))):
        at = node[inner]
        second = keys[inner, tree.axis[at]] >= tree.value[at]
        node[inner] = tree.children[at, second.astype(np.int64)]
    cell = -1 - node
    counts = np.bincount(cell[(cell >= 0) & (cell < min(num_cells, NO_CELL))], minlength=num_cells)
    return np.asarray(counts * (area.sum() / num_points))


def _merged(position: Any, normal: Any, area: F64, radiance: F64, count: int) -> tuple[Any, Any, F64, F64]:
    """Neighbours in the tree as one: the place of the middle one, all their area and power."""
    bounds = np.linspace(0, len(area), count + 1).astype(np.int64)
    middle, total = (bounds[:-1] + bounds[1:]) // 2, np.add.reduceat(area, bounds[:-1])
    power = np.add.reduceat(area[:, None] * radiance, bounds[:-1])
    return position[middle], normal[middle], total, power / np.maximum(total, 1e-30)[:, None]


def _connected(geometry: Geometry, points: Points, cells: tuple[Any, Any, F64, F64]) -> F64:
    """E of points. (n, 3)"""
    position, normal, area, radiance = cells
    out = np.zeros((len(points.position), 3))
    for p, (x, n) in enumerate(zip(points.position, points.normal, strict=True)):
        away = (position - x).astype(np.float64)
        distance = np.maximum(np.linalg.norm(away, axis=1), 1e-9)
        towards = away / distance[:, None]
        hits = trace_from(geometry.embree, x, towards.astype(np.float32))
        sees = hits.distance >= distance * (1 - 1e-3)
        cosines = np.maximum(towards @ n, 0) * np.maximum(-np.einsum("gc,gc->g", towards, normal), 0)
        out[p] = (sees * cosines * area / np.maximum(distance**2, area / np.pi)) @ radiance
    return out
