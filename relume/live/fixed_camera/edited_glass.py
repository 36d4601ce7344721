"""Edits of glass in a picture: previewed by color, and traced anew when nobody edits.

Glass decides where camera rays and shadow rays end, so samples and their rays depend on it. The color that glass gives
to what is behind it is a factor, which a picture shows at once; its shadows, its roughness and its refraction follow
when the view has been traced with the edited glass (docs/direct-light.md#glass-mirrors-shadow-catchers).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeVar

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.fresnel import normal_reflectance
from relume.camera.glass_passages import GlassPassages
from relume.core.errors import CancelledError, RelumeError, ResultUnavailableError
from relume.live.fixed_camera.jobs import CancelCheck, Job, Priority, ProgressCallback
from relume.live.fixed_camera.protocols import FixedViewTransfer, StaticViewFactory
from relume.look.glass import GlassOfLook
from relume.look.model import GlassLook
from relume.views.view import View

F32 = NDArray[np.float32]
Painted = TypeVar("Painted")

_MIN_TRANSMITTANCE = 1e-3  # darker glass is no measure of the light behind it
_MAX_RATIO, _MAX_EXPONENT = 100.0, 20.0


class TracedView(NamedTuple):
    """A view of an open bake; its rays have met the glass `transfer.glass`."""

    transfer: FixedViewTransfer
    name: str

    @property
    def view(self) -> View:
        """The view."""
        return self.transfer.views[self.name]


class EditedGlass:
    """Glass of one picture.

    Args:
        traced: the view of the bake. make_static_view: traces the view with edited glass; None: it cannot be edited.

    Attributes:
        traced: the view that the picture shows.
    """

    def __init__(self, traced: TracedView, make_static_view: StaticViewFactory | None) -> None:
        self._baked, self._make_static_view = traced, make_static_view
        self.traced, self._target = traced, traced.transfer.glass
        self._passages: GlassPassages | None = None
        self._has_failed = False  # to trace the target
        self._preview: tuple[GlassOfLook, View, F32] | None = None

    def check(self, glass: GlassOfLook) -> None:
        """Raise ResultUnavailableError if this picture cannot show a look's glass."""
        if self._make_static_view is None and glass != self.traced.transfer.glass:
            raise ResultUnavailableError("edited glass is traced in the scene, which is not available to this image")

    @property
    def target(self) -> GlassOfLook:
        """Glass of the look."""
        return self._target

    @target.setter
    def target(self, glass: GlassOfLook) -> None:
        self._has_failed &= glass == self._target
        self._target = glass

    @property
    def is_exact(self) -> bool:
        """True if the view has been traced with the target's glass."""
        return self.target == self.traced.transfer.glass

    def show(self, traced: TracedView) -> None:
        """Show another traced view."""
        self.traced, self._passages, self._preview = traced, None, None

    def preview(self, view: View) -> Shaped[F32, "n 3"] | None:
        """Return factors of the samples for the target's colors, in the order of `View.throughput`; None for 1.

        Args:
            view: the traced view, perhaps with overridden maps.
        """
        if self.is_exact or self._passages is None:
            return None
        if self._preview is None or self._preview[0] != self.target or self._preview[1] is not view:
            names = self.traced.transfer.material_names
            change = color_change(self._passages, self.traced.transfer.glass, self.target, names)
            self._preview = self.target, view, _factors(view, change)
        return self._preview[2]

    def passage_job(self) -> Job | None:
        """Return the job that a preview needs; None if it has run, or there is nothing to preview."""
        if self.is_exact or self._passages is not None:
            return None
        transfer, traced = self.traced.transfer, self.traced

        def apply(passages: GlassPassages) -> None:
            if self.traced is traced:
                self._passages = passages

        return Job(
            ("glass passages", transfer.key, traced.name),
            "glass in front of the camera",
            Priority.UPDATE,
            lambda progress, is_canceled: transfer.glass_passages(traced.view),
            apply,
        )

    def trace_job(
        self,
        paint: Callable[[TracedView, ProgressCallback, CancelCheck], Painted],
        apply: Callable[[TracedView, Painted], None],
    ) -> Job | None:
        """Return the job that traces the view with the target's glass; None if it shows that, or it is impossible.

        Args:
            paint: makes the exact picture of a traced view with the look, whose glass is the target.
            apply: receives the view and that picture.
        """
        target = self.target
        if self.is_exact or self._has_failed:
            return None

        def run(progress: ProgressCallback, is_canceled: CancelCheck) -> tuple[TracedView, Painted] | RelumeError:
            try:
                traced = self._trace(target, lambda share: progress(0.5 * share), is_canceled)
                return traced, paint(traced, lambda share: progress(0.5 + 0.5 * share), is_canceled)
            except CancelledError:
                raise
            except RelumeError as error:  # the scene is gone, or it needs more memory than there is
                return ResultUnavailableError(f"this glass is not available: {error}")

        def apply_result(result: tuple[TracedView, Painted] | RelumeError) -> None:
            if target != self.target:
                return
            if isinstance(result, RelumeError):
                self._has_failed = True
            else:
                apply(*result)

        label = "light through the edited glass"
        return Job(("edited glass", target), label, Priority.REFINEMENT, run, apply_result, is_resumable=True)

    def _trace(self, glass: GlassOfLook, progress: ProgressCallback, is_canceled: CancelCheck) -> TracedView:
        if glass == self._baked.transfer.glass:
            return self._baked
        assert self._make_static_view is not None  # `check` has rejected other glass
        view = self._baked.view
        size = view.width, view.height
        # with indirect light, which later looks may show
        transfer = self._make_static_view(view.camera, size, True, progress, is_canceled, glass=glass)
        return TracedView(transfer, next(iter(transfer.views)))


def color_change(
    passages: GlassPassages, before: GlassOfLook, after: GlassOfLook, names: Sequence[str]
) -> Shaped[F32, "pixels 3"]:
    """Return the factor (t' / t)^n e^(-(a' - a) s) of the light behind glass after an edit of it.

    Args:
        passages: glass in front of each pixel, n and s. before, after: glass of the same materials, with transmittances
            t and t' of a surface at normal incidence and absorption a and a'. names: names of the scene's materials.
    """
    out, edited = np.ones((len(next(iter(passages.num_surfaces.values()), ())), 3)), dict(after)
    for name, glass in before:
        index = names.index(name)
        if index in passages.num_surfaces and edited[name] != glass:
            ratio = _transmittance(edited[name]) / np.maximum(_transmittance(glass), _MIN_TRANSMITTANCE)
            more = np.subtract(edited[name].absorption, glass.absorption)
            optical_depth = more * passages.length[index][:, None]
            out *= ratio ** passages.num_surfaces[index][:, None] * np.exp(np.minimum(-optical_depth, _MAX_EXPONENT))
    return np.clip(out, 0, _MAX_RATIO).astype(np.float32)


def _transmittance(glass: GlassLook) -> Shaped[NDArray[np.float64], " 3"]:
    """Transmittance of a surface at normal incidence."""
    return (1 - normal_reflectance(glass.ior)) * np.array(glass.color)


def _factors(view: View, change: Shaped[F32, "pixels 3"]) -> Shaped[F32, "n 3"]:
    """Return the factor of each sample, in the order of the view's pixels.

    Samples are behind glass if that attenuates them: what white glass without refraction shows is not previewed.

    Args:
        view: the view. change: factor of what is behind glass.
    """
    transmittance = view.store.read(f"views/{view.index}/transmittance")[view.order]
    is_behind = (transmittance != 1).any(axis=1)
    pixel = np.repeat(np.arange(len(view.first) - 1), np.diff(view.first))
    return np.where(is_behind[:, None], change[pixel], np.float32(1))
