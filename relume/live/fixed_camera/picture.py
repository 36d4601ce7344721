"""The image of a view whose look changes interactively."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.btf.btf_memory import check_btfs_fit
from relume.brdf.curves import curve_bands, generated_bands
from relume.core.cache import Cache
from relume.core.errors import CancelledError, ParameterError
from relume.live.fixed_camera.background import Background
from relume.live.fixed_camera.edit_pointers import CurvePointer, ParameterPointer, Pointer, parse_curve, parse_pointer
from relume.live.fixed_camera.edited_glass import EditedGlass, TracedView
from relume.live.fixed_camera.fidelity import Fidelity, ImageError
from relume.live.fixed_camera.illumination import Solo
from relume.live.fixed_camera.jobs import CancelCheck, Job, ProgressCallback
from relume.live.fixed_camera.pixel_probe import highlight_pixels, probe
from relume.live.fixed_camera.protocols import FixedViewTransfer, StaticViewFactory
from relume.live.fixed_camera.scheduler import StrategyScheduler
from relume.live.fixed_camera.strategies.strategy import ActiveControl, HeldControl
from relume.live.fixed_camera.view_images import TermTarget, ViewImages, material_documents
from relume.look import Look
from relume.look.glass import glass_of
from relume.look.object_materials import ObjectMaterials, object_materials_of
from relume.operators.shade import shaded_bytes
from relume.views.resolve import encode, encode_coverage, resolve
from relume.views.view import Tile

F32 = NDArray[np.float32]


@dataclass(frozen=True)
class Progress:
    """The result of one step.

    Attributes:
        tiles: x, y, width, height of the updated tiles. exact: the picture shows its look exactly.
        fidelity: fidelity of the visible region. complete: every term has an image.
        free_camera_error: error of the image of the moving camera, with the first exact image that replaces it.
        traces_lobes: a free camera traces rays along narrow lobes, which a browser cannot draw.
    """

    tiles: list[Tile]
    exact: bool
    fidelity: Fidelity
    complete: bool
    free_camera_error: ImageError | None = None
    traces_lobes: bool = False

    @property
    def changed(self) -> bool:
        """True if any pixel may have changed."""
        return bool(self.tiles)


class Picture:
    """The image of one session; used from one thread at a time, while a `Job` may run in another.

    Args:
        is_watched: a user waits for it, so that previews are shown first if better images take long.
        make_static_view: traces the view with edited glass; None: looks cannot edit glass.
    """

    def __init__(
        self,
        transfer: FixedViewTransfer,
        view_name: str,
        cache: Cache,
        *,
        is_watched: bool = False,
        make_static_view: StaticViewFactory | None = None,
    ) -> None:
        self._transfer, self._view_name, self._make_static_view = transfer, view_name, make_static_view
        self._images = ViewImages(transfer, view_name, cache)
        self._view = self._images.view
        self._look = self._images.default
        self._radiance = np.zeros((3, self._view.num_view_samples), np.float32)
        self._gain = np.full(3, -1.0)  # invalid: nothing is shown yet
        self._background = Background(self._images)
        self._prepared_pointer: CurvePointer | ParameterPointer | None = None
        self._edited_pointer: CurvePointer | ParameterPointer | None = None
        self._active_pointer: Pointer | None = None
        self._is_watched = is_watched
        self._scheduler = StrategyScheduler(self._images, is_watched=is_watched)
        self._solo: Solo = None
        self._glass = EditedGlass(TracedView(transfer, view_name), make_static_view)

    def check(self, look: Look) -> None:
        """Check that a look can be shown, without changing the picture.

        Raises:
            MemoryBudgetError: the images of its terms, or its BTFs, exceed the memory budget.
            ResultUnavailableError: its glass must be traced, and the scene is not available.
        """
        self._glass.check(glass_of(look))
        check_btfs_fit(term for material in look.materials.values() for term in material.terms)
        # an image for other object materials has about as many samples
        images = ((name, material) for name, material in self._images.by_name.items() if name in look.materials)
        samples = ((material.num_samples, len(material_documents(look, name))) for name, material in images)
        self._images.cache.check(sum(shaded_bytes(num) * terms for num, terms in samples if num))

    def set_look(self, look: Look, *, active_pointer: str | None = None, solo: Solo = None) -> None:
        """Set a new target; nothing is computed yet.

        Args:
            active_pointer: pointer to the control whose edit made this look, see `parse_pointer`; None if unknown, for
                example after an undo.
            solo: names of the only light sources to show, see `illumination_from_look`; None: all.
        Raises:
            ParameterError: `active_pointer` does not point to an editable control. NotFoundError, SceneError: the
                environment or an image is not available. StoreError: the bake is too old for images.
                ResultUnavailableError: see `check`. The picture is unchanged.
        """
        if object_materials_of(look) != self.object_materials:
            self._assign_objects(look, active_pointer, solo)
            return
        self._glass.check(glass_of(look))
        edited = None if active_pointer is None else parse_pointer(active_pointer)
        before, images = self._images.light, self._images.view_with_overrides(look)
        images.set_look(look, solo)
        if images is not self._images:
            self._switch_images(images)
        self._edited_pointer = edited if isinstance(edited, CurvePointer | ParameterPointer) else None
        self._active_pointer = edited or self._active_pointer
        if (images.light.environment, images.light.local) != (before.environment, before.local):
            self._prepared_pointer = None  # the user edits a light now
        self._look, self._solo, self._glass.target = look, solo, glass_of(look)

    def _assign_objects(self, look: Look, active_pointer: str | None, solo: Solo) -> None:
        """Show a look with other object materials, whose samples are sorted anew; it has no images yet."""
        materials, make_static_view = object_materials_of(look), self._make_static_view
        if make_static_view is not None:
            make_static_view = partial(make_static_view, object_materials=materials)
        args = self._transfer.with_object_materials(materials), self._view_name, self._images.cache
        picture = Picture(*args, is_watched=self._is_watched, make_static_view=make_static_view)
        picture.set_look(look, active_pointer=active_pointer, solo=solo)
        picture.look_at(self._images.region)
        self._glass, self._look, self._solo = picture._glass, look, solo
        self._prepared_pointer, self._edited_pointer = None, picture._edited_pointer
        self._active_pointer = picture._active_pointer
        self._adopt(picture)

    def _switch_images(self, images: ViewImages) -> None:
        """Replace the images with others of the same view."""
        self._images, self._view = images, images.view
        for material in images.by_name.values():
            material.set_view(images.view)
        self._background = Background(images)
        self._scheduler.adopt(images)

    @property
    def object_materials(self) -> ObjectMaterials:
        """Object materials of the displayed bake."""
        return self._images.transfer.object_materials

    def look_at(self, region: Tile | None) -> None:
        """Set the visible region, which becomes exact first: x, y, width, height in pixels; None: all."""
        self._images.region = region

    def prepare(self, pointer: str) -> None:
        """Prepare a control before its first edit.

        Args:
            pointer: e.g. "/materials/Teapot/terms/1/curves/theta_h"; see `parse_pointer`.
        Raises:
            ParameterError: there is no such curve or parameter in this look.
        """
        prepared = parse_pointer(pointer)
        if isinstance(prepared, CurvePointer | ParameterPointer):
            self._images.material_term(prepared)
            self._prepared_pointer = prepared
        self._active_pointer = prepared

    def next_job(self) -> Job | None:
        """Return the next job for the look or for the prepared control; None if nothing is missing.

        The picture may advance while the job runs: everything that does not depend on it follows the look. Its result
        is ignored if the look has changed so that it is no longer needed.
        """
        if (passage_job := self._glass.passage_job()) is not None:
            return passage_job
        job = self._scheduler.next_job(self._active_control(), self._look)
        if job is None or job.is_refinement:  # of samples that edited glass replaces
            job = self._glass.trace_job(partial(self._paint, self._look, self._solo), self._show) or job
        return None if job is None else replace(job, apply=lambda result: self._apply(job, result))

    def _paint(
        self, look: Look, solo: Solo, traced: TracedView, progress: ProgressCallback, is_canceled: CancelCheck
    ) -> Picture:
        """Make the exact picture of a look in a traced view. Raises CancelledError if `is_canceled` returned true."""
        picture = Picture(*traced, self._images.cache, is_watched=self._is_watched)
        picture.set_look(look, solo=solo)
        render_exact(picture, look, progress, is_canceled)
        return picture

    def _show(self, traced: TracedView, picture: Picture) -> None:
        """Show another picture of the same look's glass instead, and continue with it."""
        if traced.transfer.object_materials != self.object_materials:  # assigned since the view was requested
            return
        picture.set_look(self._look, solo=self._solo)
        picture.look_at(self._images.region)
        self._glass.show(traced)
        self._adopt(picture)

    def _adopt(self, picture: Picture) -> None:
        """Continue with the images of another picture."""
        self._images, self._view, self._radiance = picture._images, picture._view, picture._radiance
        self._background, self._scheduler = picture._background, picture._scheduler
        self._gain = np.full(3, -1.0)  # every pixel is new

    def _apply(self, job: Job, result: Any) -> None:
        """Apply a result; if it activates the operator of another control, the user edits that one now."""
        prepared = self._active_control().prepared_control
        active = None if prepared is None else prepared.target.live.ready.basis
        job.apply(result)
        if prepared is not None and prepared.target.live.ready.basis not in (None, active, prepared.basis):
            self._prepared_pointer = None

    def run_next_job(self, progress: ProgressCallback, is_canceled: CancelCheck) -> None:
        """Run the next job and apply its result.

        Raises:
            CancelledError: `is_canceled` returned true; the picture is unchanged.
            MemoryBudgetError: the result is larger than the cache.
        """
        job = self.next_job()
        if job is not None:
            job.apply(job.run(progress, is_canceled))

    def advance(self, max_coefficients: int | None) -> Progress:
        """Update the image toward its look: R += T · Δc with the most important coefficients, None for all."""
        images, scheduler = self._images, self._scheduler
        scheduler.advance(max_coefficients)
        tiles: set[Tile] = set()
        light, gain = scheduler.light, self._background.clamped_gain(scheduler.gain, self._look.background)
        is_background_new = self._background.update(self._look, light, gain, self._radiance)
        emitter_radiance = images.mirrors.mirror_emitters(light, images.transfer.local)
        for index, material in enumerate(images.by_name.values()):
            material.set_mirror_emission(emitter_radiance)
            if material.num_samples and material.compose(self._radiance):
                tiles.update(self._view.material_tiles[index])
        for index in images.update_mirrors(self._look):
            tiles.update(self._view.material_tiles[index])
        glass_factors = self._glass.preview(self._view)
        is_glass_new, images.glass_factors = glass_factors is not images.glass_factors, glass_factors
        if is_background_new or is_glass_new or not np.array_equal(self._gain, gain):
            self._gain = gain
            tiles.update(self._view.all_tiles)
        targets = list(images.targets())
        exact = all(target.live.fidelity == Fidelity.EXACT for target in targets)
        fidelity = min((target.fidelity_in(images.region) for target in targets), default=Fidelity.EXACT)
        complete = not any(target.live.latest.is_empty for target in targets)
        if not self._glass.is_exact:
            exact, fidelity = False, min(fidelity, Fidelity.APPROXIMATE)
        in_order = sorted(tiles, key=lambda tile: (tile[1], tile[0]))
        return Progress(in_order, exact, fidelity, complete)

    def all_tiles(self) -> list[Tile]:
        """Return the tiles that cover the image."""
        return self._view.all_tiles

    def encode(self, tiles: Sequence[Tile], form: str) -> bytes:
        """Return the payload of a frame, "rgb9e5" or "f32": the tiles in order, row-major."""
        return encode(self._view, self._radiance, tiles, form, self._gain, self._images.throughput)

    def encode_alpha(self, tiles: Sequence[Tile]) -> bytes | None:
        """Return the alpha of each pixel in tiles over display values, one byte each; None if the image is opaque."""
        if not self._background.is_transparent:
            return None
        alpha = self._background.alpha(for_display=True)
        return encode_coverage(alpha, tiles)

    def alpha(self, *, for_display: bool) -> Shaped[F32, "height width"] | None:
        """Return the alpha of the whole image over display values or linear radiance, float32; None if it is opaque."""
        return self._background.alpha(for_display=for_display) if self._background.is_transparent else None

    def image(self) -> Shaped[F32, "height width 3"]:
        """Return linear radiance, zero where the image is transparent."""
        whole = [(0, 0, self._view.width, self._view.height)]
        pixels = resolve(self._view, self._radiance, whole, self._gain, self._images.throughput)
        return pixels.reshape(self._view.height, self._view.width, 3)

    def curve(self, pointer: str) -> tuple[Shaped[NDArray[np.float64], "3 J"], Shaped[NDArray[np.float64], "3 J"]]:
        """Return the displayed bands of a curve, and the bands that its parameters alone generate."""
        curve_pointer = parse_curve(pointer)
        _, term = self._images.material_term(curve_pointer)
        declared = term.term.curve(curve_pointer.name)
        return curve_bands(term.document, declared), generated_bands(term.document, declared)

    def inspect(self, x: int, y: int) -> dict[str, Any]:
        """Probe a pixel: its radiance and surface; see `relume.live.fixed_camera.pixel_probe.probe`."""
        return probe(self._images, self._radiance, self._gain, self._prepared_pointer, x, y)

    def highlight_pixels(self, pointer: str, from_deg: float, to_deg: float) -> Shaped[F32, "height width"]:
        """Return the pixels lit by a range of a curve. See `relume.live.fixed_camera.pixel_probe.highlight_pixels`."""
        return highlight_pixels(self._images, self._radiance, parse_curve(pointer), from_deg, to_deg)

    def _active_control(self) -> ActiveControl:
        """Return the active control in the current look."""
        return ActiveControl(
            self._resolve_control(self._prepared_pointer),
            self._resolve_control(self._edited_pointer),
            self._active_pointer,
        )

    def _resolve_control(self, pointer: CurvePointer | ParameterPointer | None) -> HeldControl | None:
        """Resolve a pointer in the current look; None if an edit has removed its target."""
        if pointer is None:
            return None
        try:
            return HeldControl(
                TermTarget(self._images, *self._images.material_term(pointer)), self._images.basis(pointer)
            )
        except ParameterError:
            return None


def render_exact(picture: Picture, look: Look, progress: ProgressCallback, is_canceled: CancelCheck) -> None:
    """Run all jobs of a picture until it shows its look exactly.

    Args:
        picture: its look has been set. look: the same look.
        progress: called with the approximate fraction done. is_canceled: polled regularly.
    Raises:
        CancelledError: `is_canceled` returned true.
    """
    num_terms, num_images = sum(len(material.terms) for material in look.materials.values()), 0
    while True:
        if is_canceled():
            raise CancelledError("the picture was canceled")
        exact = picture.advance(None).exact
        if picture.next_job() is None and exact:
            progress(1.0)
            return

        def report_overall(fraction: float, num_images: int = num_images) -> None:
            # most looks need at most one image per term
            progress(min(num_images + fraction, num_terms) / max(1, num_terms))

        picture.run_next_job(report_overall, is_canceled)
        num_images += 1
