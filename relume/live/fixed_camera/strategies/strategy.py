"""A strategy: one way to bring the image of a term to its target, and what it knows of the picture."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import NamedTuple

from relume.live.fixed_camera.edit_pointers import (
    ROTATION,
    ColorPointer,
    LightGroupPointer,
    LightPointer,
    Pointer,
    TransportPointer,
)
from relume.live.fixed_camera.fidelity import Fidelity
from relume.live.fixed_camera.illumination import Illumination
from relume.live.fixed_camera.jobs import Job
from relume.live.fixed_camera.live_term import LiveTerm
from relume.live.fixed_camera.view_images import TermTarget, ViewImages
from relume.look import LightGeometry, Look
from relume.look.model import Rgb
from relume.operators.edit_basis import EditBasis


class Urgency(IntEnum):
    """Why a job is needed, most urgent first."""

    DRAGGED_LIGHT = 0  # only this job can follow the drag
    PREVIEW = 1  # nothing of the target is shown
    LIGHT_SOURCE = 2  # the image of one source
    IMAGE = 3  # the image of the target
    PREPARED_CONTROL = 4  # the next edit
    BETTER_OPERATOR = 5  # a drag continues more exactly
    REFINEMENT = 6  # the image is nearly exact
    PREFETCH = 7  # a later edit


class HeldControl(NamedTuple):
    """A curve or a parameter that the user edits.

    Attributes:
        basis: the free coefficients of the edit; None if no operator depends on it.
    """

    target: TermTarget
    basis: EditBasis | None


class ActiveControl(NamedTuple):
    """The active control in the current look.

    Attributes:
        prepared_control: the curve that the user opened, or the parameter that was prepared last.
        edited_control: the curve or the parameter that the last edit changed.
        pointer: target of the last edit, or of a later prepare message.
    """

    prepared_control: HeldControl | None = None
    edited_control: HeldControl | None = None
    pointer: Pointer | None = None

    def edit_basis(self, live: LiveTerm, curves: set[str]) -> EditBasis | None:
        """Return the basis of the active edit of a term: one that covers all changed curves if there is one."""
        bases = [
            control.basis
            for control in (self.edited_control, self.prepared_control)
            if control is not None and control.target.live is live
        ]
        matching = [basis for basis in bases if basis is not None and not curves.isdisjoint(basis.affected_curves)]
        return next(
            (basis for basis in matching if curves <= set(basis.affected_curves)), matching[-1] if matching else None
        )

    @property
    def edits_light(self) -> bool:
        """True if it changes the light from local lights or surfaces: a light, a color, the number of bounces."""
        return isinstance(self.pointer, ColorPointer | LightPointer | LightGroupPointer | TransportPointer)

    @property
    def rotates_environment(self) -> bool:
        """True if it rotates the environment."""
        return self.pointer == ROTATION

    def dragged_group(self, groups: Mapping[str, Illumination]) -> Illumination | None:
        """Return the light of the group whose fader is dragged; None if none is. groups: see `ViewImages`"""
        return groups.get(self.pointer.name) if isinstance(self.pointer, LightGroupPointer) else None

    def dragged_light(self, look: Look) -> LightGeometry | None:
        """Return the geometry of the local light that is dragged, as in a look; None if no light is."""
        light = look.lights.get(self.pointer.name) if isinstance(self.pointer, LightPointer) else None
        return None if light is None else light.geometry


@dataclass(frozen=True)
class Situation:
    """Input of strategies that ask for a job.

    Attributes:
        images: the terms. control: the active control. look: the target.
        is_watched: a user waits for the picture. displayed_light: the light that it shows.
        can_reach: a strategy brings a term to the target light without a job.
        on_preview: called with the light and gain of an applied preview.
    """

    images: ViewImages
    control: ActiveControl
    look: Look
    is_watched: bool
    displayed_light: Illumination
    can_reach: Callable[[TermTarget], bool]
    on_preview: Callable[[Illumination, Rgb], None]

    @property
    def targets(self) -> list[TermTarget]:
        """All terms that are visible in this view."""
        return list(self.images.targets())

    @property
    def unconverged(self) -> list[TermTarget]:
        """Terms without a converged image in the target light."""
        return [target for target in self.targets if not target.live.is_converged]

    @property
    def is_opening(self) -> bool:
        """True if the picture shows nothing yet."""
        return all(target.live.latest.is_empty for target in self.targets)


JobRequest = Callable[[Situation], Job | None]


def _never(target: TermTarget, light: Illumination) -> bool:
    return False


def _no_update(target: TermTarget, light: Illumination, max_coefficients: int | None) -> None:
    """Leave the image to the strategy's jobs."""


@dataclass(frozen=True)
class Strategy:
    """One way to bring the image of a term to its target; a row of `table.STRATEGIES`.

    Attributes:
        name: as in docs/frame-terms.md. needs: what it needs. cost: of a frame.
        fidelity: of its best image.
        changes_light: it leads from the reference image to another light. Such strategies update all terms together,
            so that a picture shows one light; the others update each term by itself.
        is_ready: whether it can update a term to a light at once.
        update: updates the image in place, with at most some coefficients per channel, None for all.
        jobs: for each urgency, returns the next job that it needs, or None.
    """

    name: str
    needs: str
    cost: str
    fidelity: Fidelity
    changes_light: bool = False
    is_ready: Callable[[TermTarget, Illumination], bool] = _never
    update: Callable[[TermTarget, Illumination, int | None], None] = _no_update
    jobs: Mapping[Urgency, JobRequest] = field(default_factory=dict)


def smallest_material(jobs: Iterable[tuple[TermTarget, Job | None]]) -> Job | None:
    """Return the job of the material with the fewest samples; None if there is none.

    Args:
        jobs: of each term, its job or None.
    """
    missing = [(target, job) for target, job in jobs if job is not None]
    return min(missing, key=lambda item: item[0].material.num_samples)[1] if missing else None
