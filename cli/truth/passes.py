"""Brute force from the command line: what is traced, pass by pass, and what it says of a bake's frame."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cli.options import parse_size, read_camera, read_look

if TYPE_CHECKING:
    from relume.look import Look
    from relume.reference.truth import Comparison, Estimate
    from relume.scene.model import Scene
    from worker.service import BakeService

_SPP_A_PASS, _FEWEST_PASSES = 64, 4
_AGAINST = {"all": "all light paths", "method": "the light paths of its method"}


@dataclass(frozen=True)
class Subject:
    """What is traced.

    Attributes:
        scene, view, look, size: as of `relume.reference.reference_truth`.
        reflects: whether the method whose paths are told apart has light between surfaces.
        frame: that is compared, (height, width, 3); None where none is.
    """

    scene: Scene
    view: str
    look: Look
    size: tuple[int, int]
    reflects: bool
    frame: Any = None


@dataclass(frozen=True)
class Traced:
    """Passes of brute force by whose paths they are, "all" or "method"; and what is left out, in sentences."""

    estimates: dict[str, Estimate]
    left_out: tuple[str, ...]
    untraced: tuple[str, ...]


def find_subject(
    data: Path | None, name: str, look: Path | None, view: str | None, camera: Path | None, size: str | None,
    method: str | None, *, needs_bake: bool,
) -> Subject:  # fmt: skip
    """A scene as it is asked for. Raises NotFoundError, ParameterError, OSError.

    Args:
        data, name, look, view, camera, size, method: as given on the command line.
        needs_bake: the method is that of the scene's finest bake, where none is given.
    """
    from cli.data_folder import complete_look, find_bake, find_scene
    from relume.errors import NotFoundError
    from relume.look import default_look
    from relume.scene.placed_camera import with_cameras
    from worker.presets import PRESETS
    from worker.tasks import scene_of

    partial, pixels = read_look(look), parse_size(size) if size else PRESETS["good"].size
    with _service(data) as service:
        record = find_scene(service.ledger, name)
        if needs_bake and method is None:
            method = find_bake(service, record, None)[0].recipe.method
    if view is not None and view not in record.views:
        raise NotFoundError(f"the scene has no view {view[:80]!r}; its views are {', '.join(record.views)[:400]}")
    scene, seen_from = scene_of(service.data_dir, record.id), view or record.views[0]
    if camera is not None:
        placed = read_camera(camera)
        scene, seen_from = with_cameras(scene, [placed.camera]), placed.name
    document = complete_look(partial, default_look(scene.materials, scene.lights))
    return Subject(scene, seen_from, document, pixels, reflects=method not in (None, "direct"))


def find_baked(data: Path | None, name: str, look: Path | None, view: str | None) -> Subject:
    """The finest bake of a scene, and its frame of a look. Raises NotFoundError, ParameterError, OSError.

    Args:
        data, name, look, view: as given on the command line.
    """
    from cli.data_folder import complete_look, find_bake, find_scene
    from relume.memory import Memory
    from relume.methods.moving_views import MovingViews
    from relume.methods.registry import open_bake
    from relume.methods.stills import Stills
    from relume.picture.transfer import Axis
    from relume.render.image import render_image
    from relume.scene.placed_camera import with_cameras
    from worker.storage import open_kept
    from worker.tasks import scene_of

    partial = read_look(look)
    with _service(data) as service:
        record = find_scene(service.ledger, name)
        bake, seen_from = find_bake(service, record, view)
        transfer = open_kept(service.store_path(bake.id), lambda store: open_bake(store, Memory(4 << 30)))
        scene = scene_of(service.data_dir, record.id)
        document = complete_look(partial, transfer.default_look).on_the_map()
        stills = Stills(transfer.lit, scene) if isinstance(transfer, MovingViews) else None
        frame = render_image(transfer, seen_from, document, stills=stills)
    scene = with_cameras(scene, [transfer.views[seen_from].camera])
    size = frame.shape[1], frame.shape[0]
    return Subject(scene, seen_from, document, size, Axis.BOUNCES in transfer.axes, frame)


def traced(subject: Subject, spp: int, paths: str, progress: Callable[[float], object]) -> Traced:
    """Trace a subject: in one pass, or where a frame is compared in as many as tell noise from error.

    Args:
        subject: what is traced. spp: samples a pixel, in all passes together.
        paths: "all" or "method"; where a frame is compared both are traced.
        progress: called with the share done.
    """
    from relume.reference import reference_truth
    from relume.reference.truth import Estimate

    compares = subject.frame is not None
    num = max(_FEWEST_PASSES, spp // _SPP_A_PASS) if compares else 1
    asked = ("all", "method") if compares else (paths,)
    estimates = {name: Estimate.nothing(*subject.size[::-1]) for name in asked}
    for k in range(num):
        truth = reference_truth(
            subject.scene, subject.view, subject.look, subject.size, -(-spp // num),
            lambda share, k=k: progress((k + share) / num),  # type: ignore[misc]
            pass_index=k, reflects=subject.reflects, is_whole="all" in asked,
        )  # fmt: skip
        estimates = {name: estimate.add(truth.pictures[name]) for name, estimate in estimates.items()}
    return Traced(estimates, truth.left_out, truth.untraced)


def sentences(subject: Subject, truth: Traced, paths: str) -> Iterator[str]:
    """What was traced, what is left out, and how far the frame is from it, a line each.

    Args:
        subject: with the frame, where one is compared. truth: passes of it.
        paths: whose are asked for, where none is.
    """
    from relume.reference.truth import compare

    if subject.frame is not None:
        for name, estimate in truth.estimates.items():
            yield f"against {_AGAINST[name]}: {_found(compare(subject.frame, estimate)[0])}"
    if subject.frame is not None or paths == "method":
        yield from (f"left out by the method: {what}" for what in truth.left_out)
    yield from (f"left out by brute force, too: {what}" for what in truth.untraced)


def document(subject: Subject, truth: Traced, paths: str) -> dict[str, Any]:
    """What `sentences` says as JSON, by the names that REST has in a comparison.

    Args:
        subject: with the frame, where one is compared. truth: passes of it.
        paths: whose are asked for, where none is.
    """
    from dataclasses import asdict

    from relume.reference.truth import compare

    estimates = {} if subject.frame is None else truth.estimates
    found = {name: asdict(compare(subject.frame, estimate)[0]) for name, estimate in estimates.items()}
    is_told = subject.frame is not None or paths == "method"
    return {
        "view": subject.view,
        "size": list(subject.size),
        "left_out": list(truth.left_out) if is_told else [],
        "untraced": list(truth.untraced),
        "found": found.get("all"),
        "found_of_method": found.get("method"),
    }


def _found(found: Comparison) -> str:
    noise = f"noise of brute force {percent(found.noise)}"
    if found.error is None or found.standard_error is None:
        return f"no error beyond the noise, below {percent(found.limit)} (relative RMSE); {noise}"
    return f"errs by {percent(found.error, found.standard_error)} (relative RMSE); {noise}"


def percent(share: float, error: float | None = None) -> str:
    """A share, with as many digits as its standard error lets it have.

    Args:
        share: of one. error: its standard error; None: two digits.
    """
    from math import floor, log10

    size = 100 * (share if error is None else error)
    digits = max(0, (1 if error is None else 0) - floor(log10(size))) if size > 0 else 2
    digits = min(digits, 4)
    more = "" if error is None else f" ± {100 * error:.{digits}f}"
    return f"{100 * share:.{digits}f}{more} %"


@contextmanager
def _service(data: Path | None) -> Iterator[BakeService]:
    """The bake service of a data folder, while it is needed."""
    from cli.data_folder import open_bakes, open_settings

    service = open_bakes(open_settings(data))
    try:
        yield service
    finally:
        service.close()
