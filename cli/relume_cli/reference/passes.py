"""Trace the reference pass by pass, and measure the error of a bake's frame."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from relume_cli.options import parse_size, read_camera, read_look

if TYPE_CHECKING:
    from relume.look import Look
    from relume.reference.comparison import Comparison, Estimate
    from relume.scene.model import Scene
    from relume_worker.service import BakeService

_SPP_PER_PASS, _MIN_PASSES = 64, 4
_AGAINST = {"all": "all light paths", "method": "the light paths of its method"}


@dataclass(frozen=True)
class ComparisonSubject:
    """A view of a scene with a look, and optionally a frame to compare.

    Attributes:
        scene, view, look, size: as for `relume.reference.render_reference`.
        has_indirect: whether the method has indirect illumination.
        frame: linear radiance to compare, (height, width, 3); None: no comparison.
    """

    scene: Scene
    view: str
    look: Look
    size: tuple[int, int]
    has_indirect: bool
    frame: Any = None


@dataclass(frozen=True)
class ReferencePasses:
    """Reference estimates by path set, "all" or "method", and sentences on omitted and unsupported light paths."""

    estimates: dict[str, Estimate]
    omitted_paths: tuple[str, ...]
    unsupported_paths: tuple[str, ...]


def find_reference_subject(
    data: Path | None, name: str, look: Path | None, view: str | None, camera: Path | None, size: str | None,
    method: str | None, *, needs_bake: bool,
) -> ComparisonSubject:  # fmt: skip
    """Find the scene, view and look that the command line names. Raises NotFoundError, ParameterError, OSError.

    Args:
        data, name, look, view, camera, size, method: as given on the command line.
        needs_bake: without a method, take that of the scene's finest bake.
    """
    from relume.core.errors import NotFoundError
    from relume.look import default_look
    from relume.scene.custom_camera import with_cameras
    from relume_cli.data_folder import complete_look, find_bake, find_scene
    from relume_worker.presets import PRESETS
    from relume_worker.tasks import load_registered_scene

    partial, pixels = read_look(look), parse_size(size) if size else PRESETS["good"].size
    with _service(data) as service:
        record = find_scene(service.ledger, name)
        if needs_bake and method is None:
            method = find_bake(service, record, None)[0].recipe.method
    if view is not None and view not in record.views:
        raise NotFoundError(f"the scene has no view {view[:80]!r}; its views are {', '.join(record.views)[:400]}")
    scene, view_name = load_registered_scene(service.data_dir, record.id), view or record.views[0]
    if camera is not None:
        custom_camera = read_camera(camera)
        scene, view_name = with_cameras(scene, [custom_camera.camera]), custom_camera.name
    document = complete_look(partial, default_look(scene.materials, scene.lights))
    return ComparisonSubject(scene, view_name, document, pixels, has_indirect=method not in (None, "direct"))


def find_bake_comparison(data: Path | None, name: str, look: Path | None, view: str | None) -> ComparisonSubject:
    """Open the finest bake of a scene, and render its frame. Raises NotFoundError, ParameterError, OSError.

    Args:
        data, name, look, view: as given on the command line.
    """
    from relume.core.cache import Cache
    from relume.live.fixed_camera.protocols import EditAxis
    from relume.live.opened.openers import open_bake
    from relume.live.opened.static_view import StaticViewBuilder
    from relume.output.render_image import render_image
    from relume.scene.custom_camera import with_cameras
    from relume_cli.data_folder import complete_look, find_bake, find_scene
    from relume_worker.storage import open_cached
    from relume_worker.tasks import load_registered_scene

    partial = read_look(look)
    with _service(data) as service:
        record = find_scene(service.ledger, name)
        bake, view_name = find_bake(service, record, view)
        transfer = open_cached(service.store_path(bake.id), lambda store: open_bake(store, Cache(4 << 30)))
        scene = load_registered_scene(service.data_dir, record.id)
        document = complete_look(partial, transfer.default_look).without_compositing()
        static_views = StaticViewBuilder.from_bake(transfer, scene)
        frame = render_image(transfer, view_name, document, static_views=static_views)
    scene = with_cameras(scene, [transfer.views[view_name].camera])
    size = frame.shape[1], frame.shape[0]
    return ComparisonSubject(scene, view_name, document, size, EditAxis.BOUNCES in transfer.axes, frame)


def compare_passes(
    subject: ComparisonSubject, spp: int, paths: str, progress: Callable[[float], object]
) -> ReferencePasses:
    """Trace a subject in one pass; for a comparison in several, which separate noise from error.

    Args:
        subject: view and look. spp: samples per pixel, in all passes together.
        paths: "all" or "method"; a comparison traces both.
        progress: called with the fraction done.
    """
    from relume.reference import render_reference
    from relume.reference.comparison import Estimate

    has_frame = subject.frame is not None
    num_passes = max(_MIN_PASSES, spp // _SPP_PER_PASS) if has_frame else 1
    path_sets = ("all", "method") if has_frame else (paths,)
    estimates = {name: Estimate.empty(*subject.size[::-1]) for name in path_sets}
    for k in range(num_passes):
        reference_image = render_reference(
            subject.scene, subject.view, subject.look, subject.size, -(-spp // num_passes),
            lambda share, k=k: progress((k + share) / num_passes),  # type: ignore[misc]
            pass_index=k, reflects=subject.has_indirect, is_whole="all" in path_sets,
        )  # fmt: skip
        estimates = {name: estimate.add(reference_image.pictures[name]) for name, estimate in estimates.items()}
    return ReferencePasses(estimates, reference_image.omitted_paths, reference_image.unsupported_paths)


def report_lines(subject: ComparisonSubject, passes: ReferencePasses, paths: str) -> Iterator[str]:
    """Errors of the frame and omitted light paths, one line each.

    Args:
        subject: with the frame to compare, if any. passes: its reference passes.
        paths: path set to report without a comparison.
    """
    from relume.reference.comparison import compare

    if subject.frame is not None:
        for name, estimate in passes.estimates.items():
            yield f"against {_AGAINST[name]}: {_error_text(compare(subject.frame, estimate)[0])}"
    if subject.frame is not None or paths == "method":
        yield from (f"not simulated by the method: {sentence}" for sentence in passes.omitted_paths)
    yield from (f"not in the reference either: {sentence}" for sentence in passes.unsupported_paths)


def document(subject: ComparisonSubject, passes: ReferencePasses, paths: str) -> dict[str, Any]:
    """Return the report as JSON, with the field names of a comparison in REST.

    Args:
        subject: with the frame to compare, if any. passes: its reference passes.
        paths: path set to report without a comparison.
    """
    from dataclasses import asdict

    from relume.reference.comparison import compare

    estimates = {} if subject.frame is None else passes.estimates
    errors = {name: asdict(compare(subject.frame, estimate)[0]) for name, estimate in estimates.items()}
    reports_method = subject.frame is not None or paths == "method"
    return {
        "view": subject.view,
        "size": list(subject.size),
        "omitted_paths": list(passes.omitted_paths) if reports_method else [],
        "unsupported_paths": list(passes.unsupported_paths),
        "error_all_paths": errors.get("all"),
        "error_method_paths": errors.get("method"),
    }


def _error_text(comparison: Comparison) -> str:
    noise = f"noise of the reference {percent(comparison.noise)}"
    if comparison.error is None or comparison.standard_error is None:
        return f"no error above the noise, below {percent(comparison.error_upper_bound)} (relative RMSE); {noise}"
    return f"error {percent(comparison.error, comparison.standard_error)} (relative RMSE); {noise}"


def percent(fraction: float, error: float | None = None) -> str:
    """Format a fraction in percent, with the digits that its standard error justifies.

    Args:
        fraction: fraction of one. error: its standard error; None: two digits.
    """
    from math import floor, log10

    size = 100 * (fraction if error is None else error)
    digits = max(0, (1 if error is None else 0) - floor(log10(size))) if size > 0 else 2
    digits = min(digits, 4)
    error_text = "" if error is None else f" ± {100 * error:.{digits}f}"
    return f"{100 * fraction:.{digits}f}{error_text} %"


@contextmanager
def _service(data: Path | None) -> Iterator[BakeService]:
    """Open the bake service of a data directory, and close it afterwards."""
    from relume_cli.data_folder import open_bakes, open_settings

    service = open_bakes(open_settings(data))
    try:
        yield service
    finally:
        service.close()
