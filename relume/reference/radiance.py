"""Outgoing radiance of points by brute force: R = Σ V · L ΔΩ · f(ωi, ωo) cos θi over texels and samples of local
lights, with f the sum of a look's terms."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.curve_edits import drawn_curves
from relume.brdf.curves import CHANNELS, curve_values
from relume.brdf.frozen_term import FrozenTerm
from relume.brdf.registry import TERMS
from relume.brdf.term import Curve, Term
from relume.brdf.texture_slots import texture_channel
from relume.core.cache import asset_cached
from relume.core.thread_pools import parallel_for_cancellable
from relume.math.angle_bands import MAX_ANGLE
from relume.raytrace.scene_buffers import SceneBuffers
from relume.raytrace.surface_points import FIXED_ALPHA_SAMPLE
from relume.raytrace.visibility import trace_visibility
from relume.reference.btf_surfaces import BtfSurface, sample_btf_surface
from relume.reference.emitters import LocalLightSamples, ReferenceEmitter, hit_distance
from relume.reference.environment_samples import EnvironmentSamples
from relume.reference.kernel import add_lights, list_visible
from relume.reference.links import lit_points
from relume.reference.lobes import Lobe, cosine_lobe, curve_lobe

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
Document = Mapping[str, Any]

_STEPS = 1 << 16  # with linear interpolation, the narrowest highlight (σ = 0.005) has an error below 1e-5 of its peak
_POINTS_PER_PACKET = 16  # neighbors that Embree traces together; they share sampled texels
_TEXELS_PER_BATCH = 8192
_MAX_LIGHT_SAMPLES = 4096  # points of a local light, if every texel is requested
_SEED = 2006
# numbers of directions sampled in addition by the cosine lobe and by all other lobes, relative to the sampled texels
_COSINE_FRACTION, _LOBE_FRACTION = 1 / 8, 1 / 4


@dataclass(frozen=True)
class ReferencePoints:
    """Points on surfaces with one view direction each; successive points should be neighbors.

    Attributes:
        position: positions, offset from the surface. normal, tangent: shading frame. wo: toward the viewer.
        textures: factors of terms by channel, "diffuse" and "specular". (n, 3) float32 each
        roughness: see `relume.raytrace.surface_interaction.SurfaceInteraction`.
        uv: see `SurfaceInteraction`; None to use the mean of BTFs.
        alpha_sample: alpha sample for shadow rays at blended surfaces; see
            `relume.raytrace.surface_points.SurfacePoints`.
        slope_variance: of normals within the pixel, or one for all.
    """

    position: Shaped[F32, "n 3"]
    normal: Shaped[F32, "n 3"]
    tangent: Shaped[F32, "n 3"]
    wo: Shaped[F32, "n 3"]
    textures: Mapping[str, F32]
    roughness: Shaped[F32, " n"]
    uv: Shaped[F32, "n uv"] | None = None
    alpha_sample: Shaped[F32, " #n"] = field(default_factory=lambda: FIXED_ALPHA_SAMPLE)
    slope_variance: Shaped[F32, " #n"] = field(default_factory=lambda: np.zeros(1, np.float32))

    @property
    def num_points(self) -> int:
        """Number of points n."""
        return len(self.position)

    def frames(self) -> Shaped[F64, "n 3 3"]:
        """Rotation matrices to the local frames, z = normal, x = tangent."""
        normal = self.normal / np.linalg.norm(self.normal.astype(np.float64), axis=1, keepdims=True)
        tangent = self.tangent / np.linalg.norm(self.tangent.astype(np.float64), axis=1, keepdims=True)
        return np.stack([tangent, np.cross(normal, tangent), normal], axis=1)

    def samples_of(self, index: slice | NDArray[np.intp]) -> ReferencePoints:
        """Select points."""
        textures = {name: values[index] for name, values in self.textures.items()}
        frame = self.normal[index], self.tangent[index], self.wo[index]
        uv = None if self.uv is None else self.uv[index]
        alpha_sample = self.alpha_sample if len(self.alpha_sample) == 1 else self.alpha_sample[index]
        variance = self.slope_variance if len(self.slope_variance) == 1 else self.slope_variance[index]
        return ReferencePoints(
            self.position[index], *frame, textures, self.roughness[index], uv, alpha_sample, variance
        )

    def btf_surfaces(self, terms: Sequence[Document], rng: np.random.Generator) -> list[BtfSurface | None]:
        """Sample the BTF of each term at the points; None for other terms. rng: chooses positions in footprints"""
        btf_surfaces: list[BtfSurface | None] = []
        for document in terms:
            texels = TERMS[document["model"]].normalized(document).texels
            if texels is None or self.uv is None:
                btf_surfaces.append(None)
                continue
            wo = np.einsum("nij,nj->ni", self.frames(), self.wo.astype(np.float64))
            btf_surfaces.append(
                sample_btf_surface(texels, self.uv, wo / np.linalg.norm(wo, axis=1, keepdims=True), rng)
            )
        return btf_surfaces


@dataclass(frozen=True)
class _Tables:
    """A term with the curves that depend on wi tabulated; see `relume.reference.kernel.add_lights`."""

    document: Document
    term: Term
    angles: NDArray[np.int64]
    axes: F64
    values: F64
    is_stepped: NDArray[np.bool_]
    is_gray: NDArray[np.bool_]
    btf_surface: BtfSurface | None = None


def _tabulate(document: Document) -> _Tables:
    return _build_tables(FrozenTerm.from_document(document))


@asset_cached("tables of brute force")
def _build_tables(frozen_term: FrozenTerm) -> _Tables:
    """Tabulate a term; cached, because paths need all terms of all roughness classes at every bounce; some MB."""
    document = frozen_term.document
    term = TERMS[document["model"]].normalized(document)
    curves = [curve for curve in term.curves if not curve.depends_on_view]
    gamma = np.linspace(0.0, MAX_ANGLE, _STEPS + 1)
    values = np.array([curve_values(document, curve, gamma) for curve in curves]).reshape(len(curves), 3, _STEPS + 1)
    is_stepped = np.array([_stepped_channels(document, curve) for curve in curves], np.bool_).reshape(-1, 3)
    is_gray = np.array([bool(np.all(value == value[0])) for value in values], np.bool_)
    angles = np.array([int(curve.angle) for curve in curves], np.int64)
    axes = np.array([curve.axes for curve in curves]).reshape(-1, 3)
    return _Tables(document, term, angles, axes, values, is_stepped, is_gray)


def _stepped_channels(document: Document, curve: Curve) -> list[bool]:
    """Per channel, true if the curve was given as bands: it has steps, at entries of the table."""
    stepped = [False] * 3
    for drawn_curve in drawn_curves(document, curve):
        for channel in drawn_curve.get("channels", CHANNELS):
            stepped[CHANNELS.index(channel)] = "bands" in drawn_curve
    return stepped


def reference_radiance(
    geometry: SceneBuffers,
    texels: EnvironmentSamples,
    points: ReferencePoints,
    materials: Sequence[Sequence[Document]],
    spp: int = 0,
    progress: Callable[[float], object] = lambda share: None,
    is_canceled: Callable[[], bool] = lambda: False,
    pass_index: int = 0,
    local_lights: Sequence[ReferenceEmitter] = (),
) -> Shaped[F64, "materials n 3"]:
    """Radiance of all points with each of several materials, which share their shadow rays.

    Args:
        geometry: the occluding triangles.
        texels: texels of the environment, with their radiance and solid angles.
        points: n points.
        materials: terms of each material, from a complete look.
        spp: texels sampled by power per point, plus some directions sampled by the materials' lobes, and points per
            area light; 0, or as many as there are, for all texels at their centers.
        progress: called with the finished fraction of points, in [0, 1].
        is_canceled: called between packets of points.
        pass_index: passes with other indices have independent samples.
        local_lights: local lights, which are added.
    Raises:
        CancelledError: `is_canceled` returned true.
    Cost: O(n · min(spp, texels) · (log triangles + terms)) time; some MB of memory per thread.
    """
    tables = [[_tabulate(document) for document in terms] for terms in materials]
    lobes = _lobe_counts(tables, spp) if 0 < spp < texels.num_texels else []
    radiance = np.zeros((len(materials), points.num_points, 3))

    def packet(start: int, stop: int) -> None:
        packet_points = points.samples_of(slice(start, stop))
        packet_tables = _with_btf_surfaces(tables, packet_points, np.random.default_rng((_SEED, pass_index, start, 2)))
        from_environment = np.zeros((len(materials), stop - start, 3))
        if lobes:
            rng = np.random.default_rng((_SEED, pass_index, start))
            _add_environment_samples(geometry, texels, spp, lobes, packet_points, packet_tables, rng, from_environment)
        for first in range(0, 0 if lobes else texels.num_texels, _TEXELS_PER_BATCH):
            rows = slice(first, first + _TEXELS_PER_BATCH)
            _add_texels(
                geometry,
                texels.direction[rows],
                texels.power[rows],
                packet_points,
                packet_tables,
                from_environment,
            )
        frame = packet_points.position, packet_points.normal
        radiance[:, start:stop] += from_environment * lit_points(geometry, *frame, texels.lit_meshes)[:, None]
        rng = np.random.default_rng((_SEED, pass_index, start, 1))
        for local_light in local_lights:
            position, num = packet_points.position.astype(np.float64), spp or _MAX_LIGHT_SAMPLES
            light_samples = local_light.sample(position, num, rng, packet_points.alpha_sample)
            light_samples.power[~lit_points(geometry, *frame, local_light.lit_meshes)] = 0
            _add_light_samples(light_samples, packet_points, packet_tables, radiance[:, start:stop])

    parallel_for_cancellable(packet, points.num_points, _POINTS_PER_PACKET, progress, is_canceled, "the reference")
    return radiance


def _with_btf_surfaces(
    tables: Sequence[Sequence[_Tables]], points: ReferencePoints, rng: np.random.Generator
) -> Sequence[Sequence[_Tables]]:
    """Add the BTFs at a packet of points to the tables of their terms."""
    if points.uv is None or not any(table.term.texels is not None for terms in tables for table in terms):
        return tables
    packet_tables = []
    for terms in tables:
        btf_surfaces = points.btf_surfaces([table.document for table in terms], rng)
        packet_tables.append(
            [replace(table, btf_surface=btf_surface) for table, btf_surface in zip(terms, btf_surfaces, strict=True)]
        )
    return packet_tables


def _add_texels(
    geometry: SceneBuffers,
    direction: F64,
    power: F64,
    points: ReferencePoints,
    tables: Sequence[Sequence[_Tables]],
    out: F64,
) -> None:
    """Add the light of some texels to a packet of points. out: (materials, points, 3)"""
    towards = np.ascontiguousarray(direction, np.float32)
    visible = trace_visibility(geometry.embree, points.position, points.normal, towards, points.alpha_sample).visible
    for p in range(points.num_points):
        _add_lights(points, p, direction, power, visible[p], tables, out[:, p])


def _lobe_counts(tables: Sequence[Sequence[_Tables]], spp: int) -> list[tuple[Lobe, int]]:
    """Lobes of the materials, and the number of directions sampled from each."""
    curve_lobes = [lobe for terms in tables for table in terms for lobe in _curve_lobes(table)]
    num_directions = max(1, round(_LOBE_FRACTION * spp / max(1, len(curve_lobes))))
    return [(cosine_lobe(), max(1, round(_COSINE_FRACTION * spp))), *((lobe, num_directions) for lobe in curve_lobes)]


def _curve_lobes(table: _Tables) -> list[Lobe]:
    curves = [curve for curve in table.term.curves if not curve.depends_on_view]
    curve_lobes = (
        curve_lobe(curve.angle, curve.axes, values.mean(axis=0))
        for curve, values in zip(curves, table.values, strict=True)
    )
    return [lobe for lobe in curve_lobes if lobe is not None]


def material_lobes(terms: Sequence[Document]) -> list[Lobe]:
    """Lobes of a material: the cosine lobe, then each lobe of its terms.

    Args:
        terms: terms of a complete look.
    """
    return [cosine_lobe(), *(lobe for document in terms for lobe in _curve_lobes(_tabulate(document)))]


def _add_environment_samples(
    geometry: SceneBuffers,
    texels: EnvironmentSamples,
    spp: int,
    lobes: Sequence[tuple[Lobe, int]],
    points: ReferencePoints,
    tables: Sequence[Sequence[_Tables]],
    rng: np.random.Generator,
    out: F64,
) -> None:
    """Add the environment's light to a packet of points: directions sampled by power, shared by the points, and
    directions sampled from lobes for each point, weighted by the balance heuristic. out: (materials, points, 3)
    """
    frames = points.frames()
    wo = np.einsum("nij,nj->ni", frames, points.wo.astype(np.float64))
    environment_directions = texels.sample_directions(spp, rng)
    towards = environment_directions.astype(np.float32)
    visible = trace_visibility(geometry.embree, points.position, points.normal, towards, points.alpha_sample).visible
    is_visible = np.unpackbits(visible, axis=1, count=spp, bitorder="little").astype(bool)
    lobe_directions = np.concatenate([lobe.draw(wo, num, rng) for lobe, num in lobes], axis=1)
    wi = np.concatenate([np.einsum("nij,mj->nmi", frames, environment_directions), lobe_directions], axis=1)
    lobe_directions = np.einsum("nji,nmj->nmi", frames, lobe_directions)
    num = lobe_directions.shape[1]
    origins, alpha_sample = np.repeat(points.position, num, axis=0), points.alpha_sample
    alpha_sample = alpha_sample if len(alpha_sample) == 1 else np.repeat(alpha_sample, num)
    ray_length = hit_distance(
        geometry, origins, lobe_directions.reshape(-1, 3).astype(np.float32), alpha_sample
    ).reshape(lobe_directions.shape[:2])
    is_unoccluded = np.concatenate([is_visible, np.isinf(ray_length)], axis=1)
    direction = np.concatenate(
        [np.broadcast_to(environment_directions, (points.num_points, *environment_directions.shape)), lobe_directions],
        axis=1,
    )
    radiance, pdf = texels.radiance(direction)
    expected_density = spp * pdf + sum(num * lobe.pdf(wi, wo) for lobe, num in lobes)
    power = radiance * (is_unoccluded / np.maximum(expected_density, 1e-300))[..., None]
    _add_light_samples(LocalLightSamples(direction, power), points, tables, out)


def _add_light_samples(
    light_samples: LocalLightSamples, points: ReferencePoints, tables: Sequence[Sequence[_Tables]], out: F64
) -> None:
    """Add the light of light samples to a packet of points. out: (materials, points, 3)"""
    visible = np.packbits(light_samples.power.any(axis=2), axis=1, bitorder="little")
    for p in range(points.num_points):
        _add_lights(points, p, light_samples.direction[p], light_samples.power[p], visible[p], tables, out[:, p])


def _add_lights(
    points: ReferencePoints,
    p: int,
    direction: F64,
    power: F64,
    visible: NDArray[np.uint8],
    tables: Sequence[Sequence[_Tables]],
    out: F64,
) -> None:
    """Add light from directions (m, 3) to one point. power: (m, 3). visible: bits. out: (materials, 3)"""
    wi, light = np.empty((3, len(direction))), np.empty(len(direction), np.int64)
    frame = np.stack([points.normal[p], points.tangent[p], points.wo[p]]).astype(np.float64)
    normal, tangent, wo = frame / np.linalg.norm(frame, axis=1, keepdims=True)
    num, ox, oy, oz = list_visible(normal, tangent, wo, visible, direction, wi, light)
    if num == 0:
        return
    x, y, z = wi[:, :num]
    for m, terms in enumerate(tables):
        for table in terms:
            if table.btf_surface is None:
                shading = table.term.quotients(x, y, z, ox, oy, oz) * z
            else:
                shading = np.ascontiguousarray(table.btf_surface.evaluate(np.full(num, p), wi[:, :num].T).T)
            total = np.zeros(3)
            add_lights(
                table.angles, table.axes, table.values, table.is_stepped, table.is_gray,
                light, num, wi, ox, oy, oz, shading, power, total,
            )  # fmt: skip
            out[m] += total * _factor(table, points, p, oz)


def _factor(table: _Tables, points: ReferencePoints, p: int, cos_theta_o: float) -> F64:
    """Product of color, texture and view-angle curves. (3,)"""
    factor = np.asarray(table.document["color"], np.float64)
    channel = texture_channel(table.document)
    if channel is not None:
        factor = factor * points.textures[channel][p]
    theta_o = np.arccos(np.clip(np.array([cos_theta_o]), 0.0, 1.0))
    for curve in table.term.active_curves(table.document):
        if curve.depends_on_view:
            factor = factor * curve_values(table.document, curve, theta_o)[:, 0]
    return factor
