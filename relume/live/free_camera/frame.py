"""Renders a frame of the free camera: probes, lattice nodes, pixels, background."""

from __future__ import annotations

import operator
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Self

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.texture_slots import EmissionImage, NormalMap, user_images
from relume.live.fixed_camera.illumination import Illumination, material_emissions
from relume.live.free_camera.antialiasing import resolve
from relume.live.free_camera.background import ShadowCatcher, background_radiance, composite_over
from relume.live.free_camera.basis.highlight_lobes import Lobes, build_lobes
from relume.live.free_camera.basis.material_tables import Tables, build_tables
from relume.live.free_camera.environment_lookup import rotation_of
from relume.live.free_camera.glass import adjust_alpha, composite_glass
from relume.live.free_camera.highlights.environment_lobe_lookup import PrefilteredEnvironment
from relume.live.free_camera.highlights.interpolated_highlights import ProbeHighlights, add_environment_highlights
from relume.live.free_camera.highlights.light_sum_kernel import sum_lights
from relume.live.free_camera.highlights.lobe_gradients import gradients_along_lobe
from relume.live.free_camera.highlights.lobe_light_lists import MAX_BRIGHT_LIGHTS, lobe_widths
from relume.live.free_camera.highlights.lobe_visibility import trace_lobe_visibility
from relume.live.free_camera.incident_light import IncidentCoefficients
from relume.live.free_camera.incremental_frame import DirtyPixels, DirtyRegion, resolve_subset
from relume.live.free_camera.lobe_terms import TracedLobe, split_terms
from relume.live.free_camera.normal_mapping import light_gradient
from relume.live.free_camera.primary_visibility import GBuffer, interpolate_to_nodes
from relume.live.free_camera.protocol import FreeCameraTransfer
from relume.live.free_camera.shade_hard_shadows import add_direct_sharp
from relume.live.free_camera.shade_lobe_rays import add_lobe_rays
from relume.live.free_camera.shade_pixels import InterpolatedProbes, MirrorData, shade_pixels
from relume.live.free_camera.shade_probes import ProbeRadiance, shade_probes
from relume.live.free_camera.texel_brdf.shade_texels import IncidentTexelLight, TextureFootprint, shade_texels
from relume.live.free_camera.texel_brdf.texel_tables import BtfMaterials, find_btf_materials
from relume.live.free_camera.texel_brdf.texture_frame_light import TexelLight, TexelSource
from relume.live.free_camera.texture_overrides import ProbeMapOverrides
from relume.look import Look
from relume.math.uv_transform import UvTransform
from relume.probes.stored_scene import StoredScene, ViewedProbes
from relume.scene.model import Camera
from relume.transport.lobe_scene import LobeScene
from relume.views.resolve import pack_pixels

F32 = NDArray[np.float32]


class ProjectedMaterial(NamedTuple):
    """The terms of one material, projected to the basis and to lobes.

    Attributes:
        terms: all of them. degree: chosen degree of the basis, see `build_tables`; None: as high as they need.
        traces_lobes: narrow ones are not projected.
        traced: narrow ones, for lobe rays; None for none.
    """

    terms: Sequence[Mapping[str, Any]]
    degree: int | None
    traces_lobes: bool
    tables: Tables
    lobes: Lobes
    traced: TracedLobe | None


def _project_terms(
    terms: Sequence[Mapping[str, Any]], degree: int | None, cached: ProjectedMaterial | None, traces_lobes: bool
) -> ProjectedMaterial:
    """Project the terms of a material.

    Args:
        terms: of a complete look. degree: chosen for the basis; None: automatic. cached: its previous projection.
        traces_lobes: narrow terms are traced.
    """
    if cached is not None and (cached.terms, cached.degree, cached.traces_lobes) == (terms, degree, traces_lobes):
        return cached
    if degree is not None:  # nothing but the sum over the basis
        return ProjectedMaterial(terms, degree, traces_lobes, build_tables([terms], [degree]), build_lobes([[]]), None)
    traced, stored = split_terms(terms) if traces_lobes else (None, terms)
    return ProjectedMaterial(terms, None, traces_lobes, build_tables([stored]), build_lobes([stored]), traced)


class MaterialState(NamedTuple):
    """The materials of a look, projected.

    Attributes:
        tables: outgoing coefficients. lobes: lobes of narrow terms.
        is_reflective: a material reflects any light by a group of terms.
        btf_materials: materials with a BTF.
        projected: the terms of each, projected.
        overrides: map overrides of each.
    """

    tables: Tables
    lobes: Lobes
    is_reflective: Shaped[NDArray[np.bool_], "materials groups"]
    btf_materials: BtfMaterials
    projected: Sequence[ProjectedMaterial]
    overrides: tuple[ProbeMapOverrides, ...]

    @classmethod
    def from_terms(
        cls,
        terms: Sequence[Sequence[Mapping[str, Any]]],
        previous: Self | None = None,
        normals: Sequence[NormalMap | None] | None = None,
        emission: Sequence[EmissionImage | None] | None = None,
        uv: Sequence[UvTransform | None] | None = None,
        degrees: Sequence[int | None] | None = None,
        *,
        is_blocking: bool = True,
        traces_lobes: bool = False,
    ) -> Self:
        """Project the terms of each material, of a complete look.

        Args:
            terms: terms of each. previous: an earlier state, to reuse what has not changed.
            normals: normal-map overrides of each; None: none.
            emission: emitted image of each; None: none. uv: transform of texture coordinates of each; None: none.
            degrees: chosen degree of each, see `build_tables`; None: all are automatic.
            is_blocking: see `find_btf_materials`. traces_lobes: narrow terms are left to lobe rays.
        """
        none = [None] * len(terms)
        overrides = tuple(
            ProbeMapOverrides(user_images(material_terms), normal_map, image, transform)
            for material_terms, normal_map, image, transform in zip(
                terms, normals or none, emission or none, uv or none, strict=True
            )
        )
        cached = previous.projected if previous is not None else [None] * len(terms)
        projected = [
            _project_terms(each, degree, item, traces_lobes)
            for each, degree, item in zip(terms, degrees or none, cached, strict=True)
        ]
        btf_materials = find_btf_materials(
            terms, previous.btf_materials.available if previous is not None else (), is_blocking=is_blocking
        )
        if previous is not None and all(map(operator.is_, projected, previous.projected)):
            is_btf_unchanged = len(btf_materials.missing) == len(previous.btf_materials.missing)
            if previous.overrides == overrides and is_btf_unchanged:
                return previous
            return previous._replace(
                overrides=overrides, btf_materials=previous.btf_materials if is_btf_unchanged else btf_materials
            )
        tables, lobes = (
            Tables.joined([item.tables for item in projected]),
            Lobes.joined([item.lobes for item in projected]),
        )
        is_reflective, has_lobe = np.asarray((tables.table_index >= 0).any(axis=2)), lobes.lobe_index >= 0
        is_reflective[has_lobe] |= np.asarray(lobes.albedo.any(axis=(1, 3)))[lobes.lobe_index[has_lobe]]
        return cls(tables, lobes, is_reflective, btf_materials, projected, overrides)


class FrameRequestState(NamedTuple):
    """The target of a frame.

    Attributes:
        look: its materials and background are used. light: the illumination.
        gain: gain of the finished image, per channel.
        incident: incident radiance coefficients of that light. is_coarse: they are approximate.
        lobe_scene: that lobe rays meet; None if they are not traced. texel_light: cached incident light of BTF texels.
        is_fine: pixels use two lobes like probes, and highlight edges are antialiased
            (`relume.live.free_camera.highlight_edges`).
    """

    look: Look
    materials: MaterialState
    light: Illumination
    gain: Shaped[F32, " 3"]
    incident: IncidentCoefficients
    is_coarse: bool
    lobe_scene: LobeScene | None
    texel_light: TexelLight
    is_fine: bool


class ShadingBuffers(NamedTuple):
    """Intermediate results of a frame.

    Attributes:
        lobe_visibility: lobe visibility of probes along their lobes. outgoing: radiance of probes.
        gradients: gradients of probes, from `relume.live.free_camera.highlights.lobe_gradients`.
        node_values: outgoing radiance, lobe visibility and gradients of lattice nodes.
        light_gradient: light gradient of lattice nodes, see `InterpolatedProbes`.
        radiance: along the rays.
    """

    lobe_visibility: Shaped[F32, "probes 3"]
    outgoing: ProbeRadiance
    gradients: Shaped[F32, "probes 4"]
    node_values: tuple[F32, F32, F32]
    light_gradient: F32
    radiance: Shaped[F32, "rays 3"]


class Frame(NamedTuple):
    """A finished frame.

    Attributes:
        image: linear radiance.
        coverage: alpha if the background is transparent, else None.
        buffers: intermediate results.
    """

    image: Shaped[F32, "height width 3"]
    coverage: Shaped[F32, "height width"] | None
    buffers: ShadingBuffers


def render_frame(
    transfer: FreeCameraTransfer,
    state: FrameRequestState,
    gbuffer: GBuffer,
    camera: Camera,
    size: tuple[int, int],
    shadow_visibility: Sequence[F32] = (),
) -> Frame:
    """Render a frame without antialiasing of highlight edges.

    Args:
        transfer: transfer of the bake. state: the target.
        gbuffer: G-buffer of the camera's rays. size: width and height in pixels.
        shadow_visibility: shadow visibility of each hard-shadow light along the rays. (rays,) float32 each
    """
    width, height = size
    final_frame = finish_rays(transfer, state, gbuffer, camera, size, shadow_visibility)
    image = resolve(final_frame.radiance, gbuffer.owner, width * height).reshape(height, width, 3)
    if state.look.background.kind != "transparent":
        return Frame(image, None, final_frame.buffers)
    return Frame(
        image, resolve(final_frame.coverage, gbuffer.owner, width * height).reshape(height, width), final_frame.buffers
    )


class FinalFrame(NamedTuple):
    """Radiance of rays.

    Attributes:
        radiance: with the background. coverage: alpha.
        buffers: intermediate results.
    """

    radiance: Shaped[F32, "rays 3"]
    coverage: Shaped[F32, " rays"]
    buffers: ShadingBuffers


def finish_rays(
    transfer: FreeCameraTransfer,
    state: FrameRequestState,
    gbuffer: GBuffer,
    camera: Camera,
    size: tuple[int, int],
    shadow_visibility: Sequence[F32] = (),
) -> FinalFrame:
    """Return the radiance of rays, with glass and background.

    Args:
        transfer, state, gbuffer, camera, size, shadow_visibility: as in `render_frame`; rays beyond the pixels of the
            image are not neighbors.
    """
    stored_scene, light, height = transfer.stored_scene, state.light, size[1]
    buffers = _shade(transfer, state, gbuffer, DirtyRegion(gbuffer.is_needed, gbuffer.is_visible, None), camera, height)
    out = buffers.radiance
    _add_hard_shadow_lights(transfer, state, gbuffer, camera, height, shadow_visibility, None, out)
    _shade_btf_texels(transfer, state, gbuffer, camera, height, shadow_visibility, out)
    _add_lobe_rays(transfer, state, gbuffer, camera, size, None, out)
    if (state.gain != 1).any():
        out *= state.gain
    shadow_catcher = _shadow_catcher(transfer, state, gbuffer)
    background = background_radiance(
        transfer, state.look.background, light, state.gain, gbuffer, shadow_catcher.is_shadow_catcher
    )
    coverage = composite_over(
        stored_scene, gbuffer, background, shadow_catcher, state.gain, is_direct=light.paths.direct, out=out
    )
    return FinalFrame(composite_glass(gbuffer.glass, out), adjust_alpha(gbuffer.glass, coverage), buffers)


def only_materials_differ(before: FrameRequestState, after: FrameRequestState) -> bool:
    """Return whether two frames of one camera differ only in materials, not in catchers or normal-map overrides."""
    first, second = before.look, after.look
    catchers = (material.shadow_catcher for look in (first, second) for material in look.materials.values())
    return (
        before.incident is after.incident
        and before.lobe_scene is after.lobe_scene
        and [(first.normals, first.uv) for first in before.materials.overrides]
        == [(first.normals, first.uv) for first in after.materials.overrides]
        and before.light._replace(reflectances=after.light.reflectances) == after.light
        and np.array_equal(before.gain, after.gain)
        and first.background == second.background
        and not any(catchers)
        and _same_btf_materials(before.materials, after.materials)
    )


def _same_btf_materials(before: MaterialState, after: MaterialState) -> bool:
    """Return whether both states have the same BTFs on the same, unedited materials."""
    first, second = before.btf_materials.available, after.btf_materials.available
    return len(first) == len(second) and all(
        a.material == b.material
        and a.tables is b.tables
        and before.projected[a.material] is after.projected[b.material]
        for a, b in zip(first, second, strict=True)
    )


def shows_btf(transfer: FreeCameraTransfer, materials: MaterialState, gbuffer: GBuffer, region: DirtyRegion) -> bool:
    """Return whether any ray of a region hits a material with a BTF.

    Args:
        transfer: transfer of the bake. materials: materials of the look. gbuffer: G-buffer of the image's rays.
        region: region of the image.
    """
    if not materials.btf_materials.available:
        return False
    face = gbuffer.hits.face if region.rays is None else gbuffer.hits.face[region.rays]
    btf_indices = [btf_material.material for btf_material in materials.btf_materials.available]
    return bool(np.isin(transfer.stored_scene.face_material[face[face >= 0]], btf_indices).any())


def update_for_materials(
    transfer: FreeCameraTransfer,
    state: FrameRequestState,
    gbuffer: GBuffer,
    camera: Camera,
    frame: Frame,
    dirty: DirtyPixels,
    rgb9e5: Shaped[NDArray[np.uint32], " pixels"],
    shadow_visibility: Sequence[F32] = (),
) -> None:
    """Update a frame to edited materials, if `only_materials_differ` and the region `shows_btf` of no BTF.

    Args:
        transfer, gbuffer, camera, shadow_visibility: as in `render_frame`. state: the target.
        frame: overwritten. rgb9e5: its packed pixels; overwritten.
        dirty: region that shows the edited materials.
    """
    (height, width, _), radiance, rays = frame.image.shape, frame.buffers.radiance, dirty.region.rays
    _shade(transfer, state, gbuffer, dirty.region, camera, height, frame.buffers)
    _add_hard_shadow_lights(transfer, state, gbuffer, camera, height, shadow_visibility, rays, radiance)
    _add_lobe_rays(transfer, state, gbuffer, camera, (width, height), rays, radiance)
    if (state.gain != 1).any():
        radiance[rays] *= state.gain
    resolve_subset(radiance, gbuffer.owner, dirty, frame.image.reshape(-1, 3), rgb9e5)


def _shade(
    transfer: FreeCameraTransfer,
    state: FrameRequestState,
    gbuffer: GBuffer,
    region: DirtyRegion,
    camera: Camera,
    height: int,
    buffers: ShadingBuffers | None = None,
) -> ShadingBuffers:
    """Return the radiance of surfaces along the rays of a region, with intermediate results. buffers: overwritten;
    None: new.
    """
    materials, incident = state.materials, state.incident
    stored_scene = transfer.stored_scene_with(materials.overrides)
    lobes, camera_position, (probe_mask, node_mask, rays) = materials.lobes, camera.to_world[:3, 3], region
    lobe_visibility, outgoing, gradients, node_values, light_gradient, out = buffers or (
        None,
        None,
        None,
        (None,) * 3,
        None,
        None,
    )
    viewed = stored_scene.viewed_from(camera_position, probe_mask)
    lobe_visibility = _lobe_visibility(transfer, state, viewed, lobe_visibility)
    environment = _prefiltered_environment(transfer, state.light)
    outgoing = shade_probes(viewed, incident.total, incident.non_environment, materials.tables, outgoing)
    highlights = ProbeHighlights(lobe_visibility, _highlight_light_sums(transfer, state, viewed))
    add_environment_highlights(
        viewed, lobes, environment, highlights, stored_scene.normal_variation, outgoing, is_fine=state.is_fine
    )
    gradients = gradients_along_lobe(viewed, incident.non_environment, materials.tables, lobes, gradients)
    probe_values = outgoing.radiance, lobe_visibility, gradients
    node_radiance, node_visibility, node_gradients = (
        interpolate_to_nodes(stored_scene, node_mask, *values) for values in zip(probe_values, node_values, strict=True)
    )
    light_gradient = _node_light_gradient(stored_scene, incident, gbuffer) if light_gradient is None else light_gradient
    emission = material_emissions(state.light, transfer.material_names, is_visible=True)
    pixel_angle, interpolated_probes = (
        camera.yfov / height,
        InterpolatedProbes(node_radiance, materials.is_reflective, light_gradient),
    )
    mirror_data = MirrorData(lobes, environment, node_visibility, node_gradients, state.is_fine)
    out = shade_pixels(stored_scene, gbuffer, pixel_angle, interpolated_probes, emission, mirror_data, rays, out)
    return ShadingBuffers(
        lobe_visibility, outgoing, gradients, (node_radiance, node_visibility, node_gradients), light_gradient, out
    )


def _lobe_visibility(
    transfer: FreeCameraTransfer, state: FrameRequestState, viewed: ViewedProbes, out: F32 | None
) -> F32:
    """Return the visibility of probes along their lobes. out: overwritten; None: new."""
    lobes, light = state.materials.lobes, state.light
    widths = lobe_widths(lobes) if light.has_direct_environment else ()
    if not widths:
        return np.zeros((len(viewed.material), 1 + MAX_BRIGHT_LIGHTS), np.float32) if out is None else out
    lobe_lights = transfer.lobe_lights(light.environment, widths)
    visible = transfer.light_visibility_bits(light.environment.link)
    return trace_lobe_visibility(viewed, visible, lobe_lights, lobes, out)


def _highlight_light_sums(transfer: FreeCameraTransfer, state: FrameRequestState, viewed: ViewedProbes) -> F32:
    """Return the highlights of probes, summed over visible environment lights."""
    lobes, light = state.materials.lobes, state.light
    if not (lobes.max_ratio == 1).any() or not light.has_direct_environment:
        return np.zeros((len(viewed.material), 3), np.float32)
    lights = transfer.environment_lights(light.environment, is_preview=state.is_coarse)
    return sum_lights(viewed, transfer.light_visibility_bits(light.environment.link), lights, lobes)


def _add_hard_shadow_lights(
    transfer: FreeCameraTransfer,
    state: FrameRequestState,
    gbuffer: GBuffer,
    camera: Camera,
    height: int,
    shadow_visibility: Sequence[F32],
    rays: NDArray[np.int32] | None,
    out: F32,
) -> None:
    """Add the direct light of hard-shadow lights along some rays, None for all. out: added to. (rays, 3)"""
    if not state.incident.hard_shadow_lights:
        return
    hard_shadow_lights, environment = state.incident.hard_shadow_lights, _prefiltered_environment(transfer, state.light)
    camera_args = gbuffer, camera, camera.yfov / height
    add_direct_sharp(
        hard_shadow_lights,
        shadow_visibility,
        transfer.stored_scene_with(state.materials.overrides),
        *camera_args,
        state.materials,
        environment,
        rays,
        out,
    )


def _shade_btf_texels(
    transfer: FreeCameraTransfer,
    state: FrameRequestState,
    gbuffer: GBuffer,
    camera: Camera,
    height: int,
    shadow_visibility: Sequence[F32],
    out: F32,
) -> None:
    """Replace mean texels of BTFs by texels, in all light that probes and hard-shadow lights give. out: (rays, 3)"""
    sources = [TexelSource(state.incident.total)]
    for light, visibility in zip(state.incident.hard_shadow_lights, shadow_visibility, strict=True):
        sources.append(TexelSource(light.vectors, tuple(light.gain.tolist()), visibility))
    camera_position = camera.to_world[:3, 3].astype(np.float32)
    footprint = TextureFootprint(camera_position, camera.yfov / height, gbuffer)
    incident, available = IncidentTexelLight(sources, state.texel_light), state.materials.btf_materials.available
    shade_texels(available, transfer.stored_scene, transfer.positions, footprint, incident, out)


def _add_lobe_rays(
    transfer: FreeCameraTransfer,
    state: FrameRequestState,
    gbuffer: GBuffer,
    camera: Camera,
    size: tuple[int, int],
    rays: NDArray[np.int32] | None,
    out: F32,
) -> None:
    """Add the reflections of narrow lobes along some rays, None for all. out: added to. (rays, 3)"""
    if state.lobe_scene is None:
        return
    lobes = [material.traced for material in state.materials.projected]
    environment = _prefiltered_environment(transfer, state.light)
    environment = environment._replace(gain=np.array(state.light.environment_gain, np.float32))
    stored_scene = transfer.stored_scene_with(state.materials.overrides)
    scene_args = transfer, stored_scene, state.lobe_scene, lobes, state.light, environment
    add_lobe_rays(*scene_args, gbuffer, camera, size, rays, out)


def _node_light_gradient(stored_scene: StoredScene, incident: IncidentCoefficients, gbuffer: GBuffer) -> F32:
    """Mean direction of light at lattice nodes, needed only for normal maps. (nodes or 0, 3)"""
    if not len(stored_scene.tangents):
        return np.empty((0, 3), np.float32)
    return interpolate_to_nodes(
        stored_scene, gbuffer.is_visible, light_gradient(stored_scene, incident.total, gbuffer.is_needed)
    )


def _prefiltered_environment(transfer: FreeCameraTransfer, light: Illumination) -> PrefilteredEnvironment:
    """The environment in lobes, with rotation and gain; gain 0 if its direct light is not shown."""
    gain = np.array(light.environment_gain if light.has_direct_environment else (0.0, 0.0, 0.0), np.float32)
    environment, bright_lights = transfer.prefiltered(light.environment.map), transfer.bright_lights(light.environment)
    return PrefilteredEnvironment(environment, bright_lights, rotation_of(light.environment.rotation), gain)


def _shadow_catcher(transfer: FreeCameraTransfer, state: FrameRequestState, gbuffer: GBuffer) -> ShadowCatcher:
    """Return the unoccluded radiance of shadow catchers."""
    is_shadow_catcher = np.array([state.look.materials[name].shadow_catcher for name in transfer.material_names])
    if not is_shadow_catcher.any():
        return ShadowCatcher(is_shadow_catcher, np.empty((0, 3), np.float32))
    unoccluded = np.zeros((transfer.stored_scene.probes.num_points, 3), np.float32)
    for material in np.flatnonzero(is_shadow_catcher):
        unoccluded += transfer.unoccluded(state.light, int(material), is_preview=state.is_coarse)
    return ShadowCatcher(is_shadow_catcher, interpolate_to_nodes(transfer.stored_scene, gbuffer.is_visible, unoccluded))


@dataclass
class PreviousImage:
    """The last rendered image.

    Attributes:
        state: its target. gbuffer: of its rays. frame: the finished frame.
        shadow_visibility: of hard-shadow lights along its rays. has_highlight_edges: its highlight edges are
            antialiased.
        rgb9e5: its pixels, encoded as RGB9_E5; None until requested.
    """

    state: FrameRequestState
    gbuffer: GBuffer
    frame: Frame
    shadow_visibility: Sequence[F32]
    has_highlight_edges: bool
    rgb9e5: Shaped[NDArray[np.uint32], " pixels"] | None = None

    def to_rgb9e5(self) -> Shaped[NDArray[np.uint32], " pixels"]:
        """Return its pixels encoded as RGB9_E5; cached."""
        if self.rgb9e5 is None:
            self.rgb9e5 = pack_pixels(self.frame.image.reshape(-1, 3))
        return self.rgb9e5
