"""Jobs of pictures: found in the picture's thread, run in any thread, applied in the picture's thread."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from enum import Enum
from typing import Any, Literal

ProgressCallback = Callable[[float], None]
CancelCheck = Callable[[], bool]


class Priority(Enum):
    """When a job starts, and whether another job may replace it.

    - UPDATE: follows a drag. It starts at once, is never canceled for a newer look, and is not reported.
    - IMAGE: a missing image. It starts at once and is not canceled for a newer look: an image of an older look is
      useful if there is none.
    - CONTROL: precomputes for a control. It starts at once, and is canceled if another job is requested.
    - REFINEMENT: the picture is close to its look without it. It starts when nobody edits, and is canceled if another
      job is requested.
    """

    UPDATE = "update"
    IMAGE = "image"
    CONTROL = "control"
    REFINEMENT = "refinement"


@dataclass(frozen=True, eq=False)
class Job:
    """A computation that a picture needs, of a fixed or a free camera.

    All input of `run` is fixed when the job is found, since the picture may change while it runs. `apply` checks
    whether the result is still needed.

    Attributes:
        key: equal keys are the same job; the first element is its kind, for example "operator".
        label: text for the user.
        priority: when it starts.
        run: computes the result, or returns it from the cache; a `ResultUnavailableError` as the result is reported to
            the user. It raises CancelledError if its `CancelCheck`, polled regularly, returned true.
        apply: uses the result of `run`.
        state: status while it runs.
        is_resumable: a partial result is cached if it is canceled.
    """

    key: tuple[Hashable, ...]
    label: str
    priority: Priority
    run: Callable[[ProgressCallback, CancelCheck], Any]
    apply: Callable[[Any], None]
    state: Literal["precomputing", "shading"] = "shading"
    is_resumable: bool = False

    @property
    def kind(self) -> Hashable:
        """The kind of computation, for example "operator"."""
        return self.key[0]

    @property
    def is_refinement(self) -> bool:
        """True if it waits until nobody edits."""
        return self.priority is Priority.REFINEMENT


def ignore_result(result: object) -> None:
    """Apply nothing: the result is in the cache."""
