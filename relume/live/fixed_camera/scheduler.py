"""Updates a picture by the best strategies that are ready, and asks for the job that is needed most.

The strategies are the rows of `relume.live.fixed_camera.strategies.table`; the scheduler knows none of them by name.

A picture shows one light at a time. After a change of light, images of terms become ready one after another; until all
of them are in one light, the picture shows the previous light with its background, emissive surfaces and gain.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from relume.live.fixed_camera.fidelity import Fidelity
from relume.live.fixed_camera.illumination import Illumination
from relume.live.fixed_camera.jobs import Job
from relume.live.fixed_camera.strategies.strategy import ActiveControl, Situation, Strategy, Urgency
from relume.live.fixed_camera.strategies.table import STRATEGIES
from relume.live.fixed_camera.view_images import TermTarget, ViewImages
from relume.look import Look
from relume.look.model import Rgb

_TERM_STRATEGIES = tuple(strategy for strategy in STRATEGIES if not strategy.changes_light)
_LIGHT_STRATEGIES = tuple(strategy for strategy in STRATEGIES if strategy.changes_light)
_JOB_REQUESTS = tuple(
    strategy.jobs[urgency] for urgency in Urgency for strategy in STRATEGIES if urgency in strategy.jobs
)


class StrategyScheduler:
    """The scheduler of one picture.

    Attributes:
        light: the displayed illumination. gain: gain of the finished image.
    """

    def __init__(self, images: ViewImages, *, is_watched: bool) -> None:
        self._images, self._is_watched = images, is_watched
        self._previewed: tuple[Illumination, Rgb] | None = None
        self.light, self.gain = images.light, images.gain
        images.set_emission(self.light)

    def adopt(self, images: ViewImages) -> None:
        """Continue with other images of the same picture, some of whose samples are in another order."""
        self._images, self._previewed = images, None
        images.set_emission(self.light)

    def advance(self, max_coefficients: int | None) -> None:
        """Update every term as close to its target as possible now."""
        for target in self._images.targets():
            for strategy in _TERM_STRATEGIES:
                if strategy.is_ready(target, target.live.light):
                    strategy.update(target, target.live.light, max_coefficients)
        self._change_light()

    def next_job(self, control: ActiveControl, look: Look) -> Job | None:
        """Return the most urgent job; None if nothing is missing. control: the active one. look: the current one."""
        images = self._images
        situation = Situation(
            images, control, look, self._is_watched, self.light, self._can_reach_target, self._on_preview
        )
        job = next((job for request in _JOB_REQUESTS if (job := request(situation)) is not None), None)
        return None if job is None else replace(job, apply=lambda result: self._apply(job, result))

    def _apply(self, job: Job, result: object) -> None:
        job.apply(result)
        self._change_light()

    def _on_preview(self, light: Illumination, gain: Rgb) -> None:
        self._previewed = light, gain

    def _change_light(self) -> None:
        """Update terms to the target light if all can be updated; else update those that can to the preview's light."""
        target_light, targets = self._images.light, list(self._images.targets())
        unconverged = [target for target in targets if not target.live.is_converged]
        outdated = [t for t in unconverged if not t.live.latest.is_empty and t.live.ready.light != target_light]
        if all(self._can_reach_target(target) for target in outdated):
            self._update_to(target_light, unconverged)
        elif self._previewed is not None and any(t.live.ready.light == self._previewed[0] for t in unconverged):
            self._update_to(self._previewed[0], unconverged)
        self._display_latest(targets)

    def _update_to(self, light: Illumination, targets: Iterable[TermTarget]) -> None:
        for target in targets:
            strategy, ready = self._best_strategy(target, light), target.live.ready
            is_outdated = ready.light != light or bool(ready.changed_curves(target.live.target_bands))
            if strategy is not None and (is_outdated or ready.fidelity < strategy.fidelity):
                strategy.update(target, light, None)

    def _can_reach_target(self, target: TermTarget) -> bool:
        """Return whether a strategy leads a term to the target light at once."""
        return self._best_strategy(target, self._images.light) is not None

    def _best_strategy(self, target: TermTarget, light: Illumination) -> Strategy | None:
        """Return the best strategy that leads a term to a light at once; None if its curves would not be exact."""
        is_target = light == self._images.light
        allowed = (s for s in _LIGHT_STRATEGIES if is_target or s.fidelity < Fidelity.NEAR_EXACT)
        return next((strategy for strategy in allowed if strategy.is_ready(target, light)), None)

    def _display_latest(self, targets: Sequence[TermTarget]) -> None:
        """Display every term's newest image, if all images are in one light; empty terms do not count."""
        images, before = self._images, self.light
        latest = (target.live.latest for target in targets)
        lights = {image.light for image in latest if not image.is_empty}
        if lights <= {images.light}:
            self.light, self.gain, self._previewed = images.light, images.gain, None
        elif self._previewed is not None and lights == {self._previewed[0]}:
            self.light, self.gain = self._previewed
        else:
            return
        for target in targets:
            target.live.display_ready()
        if self.light != before:
            images.set_emission(self.light)
