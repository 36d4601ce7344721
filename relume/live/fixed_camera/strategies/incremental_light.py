"""Incremental light updates: reference image + transport rows · ΔL + direct light of moved lights, per term.

An edit of a diffuse color or of the number of bounces changes only the outgoing radiance of patches; an edit of a local
light also changes its direct light. The rows of all terms are precomputed when such a control is prepared (after the
image has converged) or first edited. From then on each frame shows the last exact image plus the change. It is never
labeled exact: when the drag ends, everything that has changed is shaded.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import replace
from functools import partial

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.thread_pools import parallel_for_chunks
from relume.lights.spherical_triangles import NO_LIGHTS
from relume.live.fixed_camera.displayed import weighted_sum
from relume.live.fixed_camera.fidelity import Fidelity
from relume.live.fixed_camera.illumination import (
    Illumination,
    LightSource,
    direct_from,
    is_same_environment,
    single_source,
    split_for_shading,
)
from relume.live.fixed_camera.jobs import CancelCheck, Job, Priority, ProgressCallback, ignore_result
from relume.live.fixed_camera.live_term import LiveTerm
from relume.live.fixed_camera.material_image import MaterialImage
from relume.live.fixed_camera.protocols import LightQuality, RaysToSamples
from relume.live.fixed_camera.strategies import linear_mix
from relume.live.fixed_camera.strategies.shading import Shading
from relume.live.fixed_camera.strategies.strategy import Situation, Strategy, Urgency, smallest_material
from relume.live.fixed_camera.view_images import OutgoingChange, TermTarget, ViewImages
from relume.look import LightGeometry
from relume.math.haar import haar
from relume.operators.indirect import IndirectOperator, expected_light, num_channels, precompute_rows, row_bytes
from relume.operators.shade import ShadedTerm, shade_rows, shaded_bytes
from relume.raytrace.local_light_visibility import compute_irradiance
from relume.raytrace.moving_light import MovingLight
from relume.raytrace.surface_points import SurfacePoints
from relume.transport.roughness_ranges import contract_levels
from relume.transport.shading.shader import Shader
from relume.transport.shading_points import LocalRays, ShadingPoints
from relume.transport.term_contraction import contract
from relume.views.compose_terms import add_diffuse

F32 = NDArray[np.float32]


def can_follow(situation: Situation) -> bool:
    """Return whether transport rows can bring every term to the target light, and gains alone cannot."""
    light, unconverged = situation.images.light, situation.unconverged
    is_reached = all(_is_applicable(target, light) for target in unconverged)
    is_moved = any(not linear_mix.is_applicable(target, light) for target in unconverged)
    return bool(unconverged) and is_reached and is_moved and _fits_budget(situation.images)


def _is_applicable(target: TermTarget, light: Illumination) -> bool:
    """Return whether the reference image of a term differs only in local lights and indirect light."""
    reference = target.live.ready.reference
    return (
        target.live.needs_only_light()
        and reference is not None
        and reference.light is not None
        and is_same_environment(reference.light, light)
    )


def _is_ready(target: TermTarget, light: Illumination) -> bool:
    has_rows = target.images.transfer.indirect is None or _rows(target) is not None
    return has_rows and _is_applicable(target, light)


def _fits_budget(images: ViewImages) -> bool:
    """Return whether all needed rows fit half of the memory budget."""
    if images.transfer.indirect is None:
        return True
    needed = sum(row_bytes(m.num_samples, num_channels(t.term, t.target_bands)) for m, t in images.terms())
    return 2 * needed <= images.cache.budget_bytes


def _update(target: TermTarget, light: Illumination, max_coefficients: int | None) -> None:
    live, images = target.live, target.images
    reference, rows, moved_lights = live.ready.reference, _rows(target), _MovedLights(images)
    if reference is None or reference.light is None:
        return
    image = live.ready.image  # only the picture's own state refers to it
    np.copyto(image, reference.image)
    moved_lights.add_change(target, reference.light, light, image)
    if rows is not None:
        change = _outgoing_change(images, reference.light, light)
        rows.add(change.coefficients, image)
        rays = change.radiance.rays_to(images.view, target.material.index)
        if rays is not None:
            moved_lights.add_rays(target, rays, image)
    live.set_ready(replace(live.ready, image=image, fidelity=Fidelity.INCREMENTAL, bands=reference.bands, light=light))


def _outgoing_change(images: ViewImages, before: Illumination, after: Illumination) -> OutgoingChange:
    """Return the change of patch radiance, computed once a frame."""
    last = images.outgoing_change
    if last is None or (last.before, last.after) != (before, after):
        indirect = images.transfer.indirect
        assert indirect is not None
        radiance = indirect.solve_indirect(after, LightQuality.PREVIEW, start_from=before)
        coefficients = haar(radiance.mean_to_others()).astype(np.float32)
        images.outgoing_change = last = OutgoingChange(before, after, radiance, coefficients)
    return last


def _rows_key(target: TermTarget) -> tuple[Hashable, ...]:
    images, material, live = target
    return images.transfer.key, *images.view.sample_key(material.index), "rows", live.model, *live.target_rows_key


def _rows(target: TermTarget) -> IndirectOperator | None:
    return target.images.cache.get_cached(_rows_key(target), IndirectOperator)


def _rows_job(situation: Situation) -> Job | None:
    """Return the next missing rows, of the material with the fewest samples first; None if there are none.

    A term whose own curve moves would need other rows after each edit, so it is skipped.
    """
    if situation.images.transfer.indirect is None:
        return None
    extensible = (t for t in situation.targets if t.live.is_converged or t.live.needs_only_light())
    return smallest_material((t, _rows_job_of(t) if _rows(t) is None else None) for t in extensible)


def _rows_job_of(target: TermTarget) -> Job:
    """Return the job for the operator from the outgoing radiance of patches to the image of a term.

    The rows serve any similar light, so they can be precomputed before it changes.
    """
    images, material, live = target
    term, bands, light, key = live.term, live.target_bands, images.light, _rows_key(target)

    def precompute(progress: ProgressCallback, is_canceled: CancelCheck) -> IndirectOperator:
        indirect = images.transfer.indirect
        assert indirect is not None
        radiance, view = indirect.solve_indirect(light, LightQuality.PREVIEW).mean_to_others(), images.view
        receivers, rays = view.receivers(material.index, is_lit=False), view.gather_rays(material.index)
        return precompute_rows(term, bands, receivers, rays, expected_light(radiance), progress, is_canceled)

    def run(progress: ProgressCallback, is_canceled: CancelCheck) -> IndirectOperator:
        num_bytes = row_bytes(material.num_samples, num_channels(term, bands))
        return images.cache.get(key, IndirectOperator, num_bytes, lambda: precompute(progress, is_canceled))

    label = f"{target.name}, indirect light"
    return Job(("rows", *key), label, Priority.CONTROL, run, ignore_result, state="precomputing")


def _dragged_light_job(situation: Situation) -> Job | None:
    """Return the next rows if the light changes during a drag and only rows can follow it."""
    return _rows_job(situation) if situation.control.edits_light and can_follow(situation) else None


def _prefetch_job(situation: Situation) -> Job | None:
    """Return the next rows for the dragged light, or else the next image of it."""
    can_prefetch = situation.control.edits_light and _fits_budget(situation.images)
    return (_rows_job(situation) if can_prefetch else None) or _source_image_job(situation)


def _source_image_job(situation: Situation) -> Job | None:
    """Return the job for an image of the dragged light or light group, of the material with the fewest samples first.

    The direct image is subtracted when the light moves; the complete image serves changes of its gain. None if the
    light has moved already, or if the memory budget is used up.
    """
    images, targets = situation.images, situation.targets
    dragged = situation.control.dragged_light(situation.look)
    light = situation.control.dragged_group(images.groups)
    if any(source.geometry == dragged for source in images.light.local):
        light = single_source(images.light, dragged)
    if light is None:
        return None
    elements = list(split_for_shading(light))  # direct light comes first
    missing = [(e, t) for e in elements for t in targets if images.image_in(t.material, t.live, e) is None]
    num_bytes = sum(shaded_bytes(target.material.num_samples) for _, target in missing)
    if not missing or num_bytes > images.cache.budget_bytes - images.cache.used_bytes:
        return None
    element, target = min(missing, key=lambda item: (elements.index(item[0]), item[1].material.num_samples))
    return Shading.for_target(target, element).job(Priority.REFINEMENT)


class _MovedLights:
    """Direct light of local lights that were moved, evaluated each frame for the terms of one view.

    Shadows are traced for the current position of a light, for the whole view at once, and held in the transient cache.
    Diffuse terms need only irradiance; other terms need rays.
    """

    def __init__(self, images: ViewImages) -> None:
        self._images = images
        self._view_key = images.transfer.key, images.view.name, images.view.maps

    def add_change(
        self, target: TermTarget, before: Illumination, after: Illumination, out: Shaped[F32, "tiles 3 lanes"]
    ) -> None:
        """Add the direct light of new local lights to a term's samples, and subtract that of removed ones.

        Args:
            target: the term. before: light of `out`. after: target light.
            out: image of the term, float32, overwritten.
        """
        if not after.paths.direct:
            return
        _, material, live = target
        removed = [source for source in before.local if source not in after.local]
        added = [source for source in after.local if source not in before.local]
        for source in removed:
            element = direct_from(before, (LightSource(source.geometry, (1.0, 1.0, 1.0)),))
            red, green, blue = source.gain
            weighted_sum(out, [(self._static_image(material, live, element), (-red, -green, -blue))])
        if added:
            self._add_moved(material, live, added, out)

    def add_rays(self, target: TermTarget, added: RaysToSamples, out: Shaped[F32, "tiles 3 lanes"]) -> None:
        """Add light along rays to some samples of a term.

        Args:
            target, out: as in `add_change`. added: the rays.
        """
        _, material, live = target
        samples = added.sample_indices
        if len(samples):
            receivers = replace(self._images.unlit_samples(material).without_light(samples), rays=[added.rays])
            tile, offset = np.divmod(samples, out.shape[2])
            out[tile, :, offset] += self._rows(live, receivers, len(samples), None)

    def _static_image(self, material: MaterialImage, live: LiveTerm, light: Illumination) -> F32:
        """Direct light from a light before it moved, as exact as in the converged image; cached, since every frame uses
        it.

        Usually it has been prefetched (`_source_image_job`).
        """
        images = self._images
        key = images.image_key(material, live, light)

        def shaded() -> ShadedTerm:
            rays, factor = self._exact_rays(material, light), _diffuse_factor(live)
            if factor is None:
                return self._shaded(material, live, rays)
            image, points = np.zeros_like(live.ready.image), self._points().rows(images.view.rows(material.index))
            for light_rays in rays:
                irradiance = compute_irradiance(light_rays.light, light_rays.strata, points, light_rays.visible)
                add_diffuse(irradiance, factor * light_rays.gain, image)
            return ShadedTerm(image)

        return images.cache.get(key, ShadedTerm, shaded_bytes(material.num_samples), shaded).image

    def _exact_rays(self, material: MaterialImage, light: Illumination) -> list[LocalRays]:
        """Rays of a light that has only local lights, as in converged images."""
        _, points = self._images.incident_light(material, light, lambda: False)
        return [rays for rays in points.rays if isinstance(rays, LocalRays)]

    def _add_moved(self, material: MaterialImage, live: LiveTerm, added: list[LightSource], out: F32) -> None:
        factor, rows = _diffuse_factor(live), self._images.view.rows(material.index)
        lights = [(source, self._moving_light(source.geometry)) for source in added]
        if factor is not None:
            for source, light in lights:
                add_diffuse(light.irradiance[rows], factor * source.gain, out)
            return
        local = self._images.transfer.local
        rays = [local.preview_rays(source, light.visible[rows]) for source, light in lights]
        out += self._shaded(material, live, rays, ShadedTerm(out).rows(material.num_samples)).image

    def _moving_light(self, geometry: LightGeometry) -> MovingLight:
        transfer = self._images.transfer
        key = *self._view_key, "moved light", geometry
        return self._images.cache.transient.get_value(key, lambda: transfer.local.preview(geometry, self._points()))

    def _shaded(
        self, material: MaterialImage, live: LiveTerm, rays: list[LocalRays], base_radiance: F32 | None = None
    ) -> ShadedTerm:
        """Shade a term from rays, in the threads of frames. base_radiance: the current image, see `Shader`"""
        receivers = replace(self._images.unlit_samples(material), rays=rays)
        return ShadedTerm.from_rows(self._rows(live, receivers, material.num_samples, base_radiance))

    @staticmethod
    def _rows(live: LiveTerm, receivers: ShadingPoints, num_samples: int, base_radiance: F32 | None) -> F32:
        contractions = contract_levels(live.term, live.target_bands, None)
        rows, make_shader = np.empty((num_samples, 3), np.float32), partial(Shader, base_radiance=base_radiance)

        def add(start: int, stop: int) -> None:
            rows[start:stop] = shade_rows(live.term, contractions, NO_LIGHTS, receivers, start, stop, make_shader)

        parallel_for_chunks(add, len(rows))
        return rows

    def _points(self) -> SurfacePoints:
        """Surface points of the view; normals of back-facing samples are zero, so that no light arrives."""
        view = self._images.view

        def read() -> SurfacePoints:
            points = view.all_surface_points()
            cosine = np.concatenate([view.cos_theta_o(material) for material in range(len(view.bounds) - 1)])
            return points._replace(normal=points.normal * (cosine > 0)[:, None].astype(np.float32))

        return self._images.cache.get_value((*self._view_key, "points"), read)


def _diffuse_factor(live: LiveTerm) -> NDArray[np.float64] | None:
    """Factor of a diffuse term on irradiance; None if the term depends on the incident direction. (3,)"""
    if not live.term.is_lambertian:
        return None
    contraction = contract(live.term, live.target_bands, None)
    if contraction.kinds.size:
        return None
    upright = live.term.quotients(*np.array([0, 0, 1, 0, 0, 1], np.float32))
    return np.asarray(contraction.constant * upright, np.float64)


INCREMENTAL_LIGHT = Strategy(
    name="incremental light",
    needs="transport rows of all terms; the reference image",
    cost="rows · ΔL, and the moved lights at all samples",
    fidelity=Fidelity.INCREMENTAL,
    changes_light=True,
    is_ready=_is_ready,
    update=_update,
    jobs={Urgency.DRAGGED_LIGHT: _dragged_light_job, Urgency.PREFETCH: _prefetch_job},
)
