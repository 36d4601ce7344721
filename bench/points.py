"""View samples of a scene as points, all or a random subset, and the frame's own sums over them, without a store."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.basis.daubechies import analysis
from relume.brdf.curves import curve_bands, curve_values
from relume.brdf.registry import TERMS
from relume.eye.view_samples import BACKGROUND, sample_view
from relume.light.triangles import TriangleLights, subdivide
from relume.operators.frozen import Frozen, freeze
from relume.operators.stream import columns_of, stream
from relume.project.receivers import Receivers
from relume.reference import Points
from relume.reference.image import points_of
from relume.scene.model import Scene
from relume.trace.geometry import Geometry, merge
from relume.trace.visibility import trace_visibility


@dataclass(frozen=True)
class Lit:
    """Points with the light triangles that they see."""

    geometry: Geometry
    points: Points
    lights: TriangleLights
    receivers: Receivers


def lit_points(scene: Scene, size: tuple[int, int], num_points: int, num_lights: int, material: int | None) -> Lit:
    """A random subset (fixed seed, order kept) of a view's samples, with the light triangles that they see.

    Args:
        scene: its first view is taken. size: width and height, pixels.
        num_points: of the subset; all where there are fewer.
        num_lights: triangles that the environment is divided into, at least.
        material: whose samples are taken; None for those on any surface.
    """
    geometry = merge(scene)
    camera = scene.cameras[0]
    samples = sample_view(scene, geometry, camera.name, size)
    wanted = samples.material != BACKGROUND if material is None else samples.material == material
    rows = np.nonzero(wanted)[0]
    rng = np.random.default_rng(5)
    chosen = np.sort(rng.permutation(rows)[:num_points])
    of_surface = samples.surface
    textures = {"diffuse": of_surface.diffuse, "specular": of_surface.specular}
    points = points_of(samples, textures, of_surface.roughness).rows(chosen)
    lights = subdivide(scene.environment.radiance, num_lights)
    visible = trace_visibility(geometry.embree, points.position, points.normal, lights.direction).visible
    return Lit(geometry, points, lights, Receivers(samples.surface.points.rows(chosen), points.wo, visible))


def freeze_along(lit: Lit, document: Mapping[str, Any], active: str) -> Frozen:
    """The operator of one term along one curve.

    Args:
        lit: points and lights. document: the complete term.
        active: name of the curve that stays free.
    """
    term = TERMS[document["model"]].settled(document)
    bands = {curve.name: curve_bands(document, curve) for curve in term.curves if not curve.outgoing}
    frozen = freeze(term, bands, active, lit.lights, lit.receivers, lambda share: None, lambda: False)
    assert isinstance(frozen, Frozen)
    return frozen


def frame_radiance(lit: Lit, document: Mapping[str, Any], active: str) -> NDArray[np.float64]:
    """R = T · c of one term, as a frame computes it, times its colour and curves of the outgoing angle.

    Args:
        lit: points and lights. document: the complete term.
        active: name of the curve that T is frozen along.
    Returns:
        (n, 3) float64
    """
    frozen = freeze_along(lit, document, active)
    tiles, _, _, samples = frozen.transport.shape
    image = np.zeros((tiles, 3, samples), np.float32)
    bands = curve_bands(document, TERMS[document["model"]].curve(active))
    stream(frozen.transport, columns_of(analysis(bands)), image)
    radiance = image.transpose(0, 2, 1).reshape(-1, 3)[: lit.points.num_points]
    factor = np.asarray(document["color"], np.float64)
    cos_theta_o = np.einsum("nc,nc->n", lit.points.normal, lit.points.wo)
    for curve in TERMS[document["model"]].curves:
        if curve.outgoing:
            factor = factor * curve_values(document, curve, np.arccos(np.clip(cos_theta_o, 0, 1))).T
    return np.asarray(radiance.astype(np.float64) * factor)


def relative_rmse(a: NDArray[Any], b: NDArray[Any]) -> float:
    """√mean (a − b)² / √mean b²."""
    difference = np.asarray(a, np.float64) - np.asarray(b, np.float64)
    return float(np.sqrt(np.mean(difference**2)) / np.sqrt(np.mean(np.asarray(b, np.float64) ** 2)))
