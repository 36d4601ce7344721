"""View samples of a scene as points, all or a random subset, and a frame's sums over them, without a store."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.brdf.curves import curve_bands, curve_values
from relume.brdf.registry import TERMS
from relume.camera.view_samples import BACKGROUND, sample_view
from relume.lights.spherical_triangles import TriangleLights, tessellate_environment
from relume.math.daubechies import analysis
from relume.operators.edit_basis import CurveBasis, precompute
from relume.operators.linear_operator import LinearOperator
from relume.operators.update_kernel import changed_columns, stream
from relume.raytrace.scene_buffers import SceneBuffers, build_scene_buffers
from relume.raytrace.visibility import trace_visibility
from relume.reference import ReferencePoints
from relume.reference.image import points_of_samples
from relume.scene.model import Scene
from relume.transport.shading_points import ShadingPoints


@dataclass(frozen=True)
class LitSamples:
    """Points with their visible environment triangles."""

    geometry: SceneBuffers
    surface_points: ReferencePoints
    lights: TriangleLights
    receivers: ShadingPoints


def sample_lit_surface(
    scene: Scene, size: tuple[int, int], num_positions: int, num_lights: int, material: int | None
) -> LitSamples:
    """A random subset (fixed seed, order kept) of a view's samples, with their visible environment triangles.

    Args:
        scene: its first view is used. size: width and height, pixels.
        num_positions: number of positions of the subset; all if there are fewer.
        num_lights: minimum number of environment triangles.
        material: material of the samples; None for all materials.
    """
    geometry = build_scene_buffers(scene)
    camera = scene.cameras[0]
    samples = sample_view(scene, geometry, camera.name, size)
    is_selected = samples.material != BACKGROUND if material is None else samples.material == material
    rows = np.nonzero(is_selected)[0]
    rng = np.random.default_rng(5)
    sample_rows = np.sort(rng.permutation(rows)[:num_positions])
    surface_attributes = samples.surface
    textures = {"diffuse": surface_attributes.diffuse, "specular": surface_attributes.specular}
    surface_points = points_of_samples(samples, textures, surface_attributes.roughness).samples_of(sample_rows)
    lights = tessellate_environment(scene.environment.radiance, num_lights)
    visible = trace_visibility(
        geometry.embree, surface_points.position, surface_points.normal, lights.direction
    ).visible
    return LitSamples(
        geometry,
        surface_points,
        lights,
        ShadingPoints(samples.surface.points.rows(sample_rows), surface_points.wo, visible),
    )


def freeze_for_curve(lit_samples: LitSamples, document: Mapping[str, Any], active: str) -> LinearOperator:
    """Freeze the operator of one term along one curve.

    Args:
        lit_samples: points and lights. document: the complete term.
        active: name of the free curve.
    """
    term = TERMS[document["model"]].normalized(document)
    bands = {curve.name: curve_bands(document, curve) for curve in term.curves if not curve.depends_on_view}
    basis, lights, receivers = CurveBasis.from_curve(term.curve(active)), lit_samples.lights, lit_samples.receivers
    return precompute(basis, term, bands, lights, receivers, lambda share: None, lambda: False)


def frame_radiance(lit_samples: LitSamples, document: Mapping[str, Any], active: str) -> NDArray[np.float64]:
    """R = T · c of one term, as a frame computes it, times its color and curves of the outgoing angle.

    Args:
        lit_samples: points and lights. document: the complete term.
        active: name of the free curve of T.
    Returns:
        (n, 3) float64
    """
    operator = freeze_for_curve(lit_samples, document, active)
    tiles, _, _, samples = operator.transport.shape
    image = np.zeros((tiles, 3, samples), np.float32)
    bands = curve_bands(document, TERMS[document["model"]].curve(active))
    stream(operator.transport, changed_columns(analysis(bands)), image)
    radiance = image.transpose(0, 2, 1).reshape(-1, 3)[: lit_samples.surface_points.num_points]
    factor = np.asarray(document["color"], np.float64)
    cos_theta_o = np.einsum("nc,nc->n", lit_samples.surface_points.normal, lit_samples.surface_points.wo)
    for curve in TERMS[document["model"]].curves:
        if curve.depends_on_view:
            factor = factor * curve_values(document, curve, np.arccos(np.clip(cos_theta_o, 0, 1))).T
    return np.asarray(radiance.astype(np.float64) * factor)


def relative_rmse(a: NDArray[Any], b: NDArray[Any]) -> float:
    """√mean (a − b)² / √mean b²."""
    difference = np.asarray(a, np.float64) - np.asarray(b, np.float64)
    return float(np.sqrt(np.mean(difference**2)) / np.sqrt(np.mean(np.asarray(b, np.float64) ** 2)))
