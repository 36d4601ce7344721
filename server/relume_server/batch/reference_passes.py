"""Passes of comparisons: the frame, then reference passes; sums and images are files.

A comparison stores its frame and the sums of its passes in its folder, so that it resumes with the next pass, or under
other code with the first. Passes are summed twice, for all light paths and for those of the bake's method, if both are
requested. From the second pass on there are errors and images: `error` and `reference` for the requested paths,
`method-error` and `method-reference` for the method's; before that only `reference` images, because their noise is
unknown: small ones first, which are ready soon.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image

from relume import look as looks
from relume.core.errors import CancelledError
from relume.core.filesystem import atomic_write
from relume.core.source_hash import comparison_code
from relume.image_io.write_image import write_image
from relume.live.fixed_camera.jobs import CancelCheck, ProgressCallback
from relume.live.fixed_camera.protocols import CameraMode, EditAxis, OpenBake
from relume.methods.view_stages import MIN_SIDE
from relume.reference.comparison import Comparison, Estimate, compare, error_map
from relume_server.batch.context import BatchContext
from relume_server.batch.frame_sequence import comparison_camera
from relume_server.runtime.protocols import F32
from relume_server.schemas.bodies import ComparisonRequest
from relume_worker.jobs.step_timer import estimate_seconds
from relume_worker.paths import scene_path

if TYPE_CHECKING:
    from relume.reference import ReferenceImage

SPP = 64
FIGURES = "figures.json"
_FIRST_DOWNSCALE, _FIRST_SPP = 4, 16  # the whole image has this multiple of the first images' width
_TIMING_DOWNSCALE = 8  # the image has this multiple of the width of its timing sample
_Estimates = dict[str, Estimate]  # by path set: "all", "method"


def make_frame(
    context: BatchContext,
    report: ProgressCallback,
    is_canceled: CancelCheck,
    *,
    request: Mapping[str, Any],
    folder: str,
) -> Mapping[str, Any]:
    """Render the frame to compare, and a first reference image, if they are missing.

    Args:
        context: context of the process. report, is_canceled: callbacks.
        request: body of the comparison. folder: its files.
    Returns:
        `passes`: number of finished passes.
    """
    comparison, job_folder = ComparisonRequest.model_validate(request), Path(folder)
    frame_and_estimates = _load(job_folder)
    if frame_and_estimates is None:
        transfer = context.transfer(comparison.bake)
        camera_and_size = comparison_camera(comparison, transfer) if transfer.camera_mode is CameraMode.FREE else None
        frame = context.library.render(
            transfer,
            comparison.view,
            _look(comparison, transfer),
            is_canceled=is_canceled,
            camera_and_size=camera_and_size,
        )
        frame_and_estimates = (
            frame,
            {paths: Estimate.empty(*frame.shape[:2]) for paths in dict.fromkeys((comparison.paths, "method"))},
        )
        _write_first(context, job_folder, transfer, comparison, frame_and_estimates[0], is_canceled)
        _save(job_folder, *frame_and_estimates)
    return {"passes": frame_and_estimates[1]["method"].passes}


def _write_first(
    context: BatchContext,
    folder: Path,
    transfer: OpenBake,
    request: ComparisonRequest,
    frame: F32,
    is_canceled: CancelCheck,
) -> None:
    """Write small reference images with few samples, because a pass may take minutes."""
    look, small = _look(request, transfer), _smaller(_FIRST_DOWNSCALE, frame.shape[1], frame.shape[0])
    reference = _render_pass(
        context, transfer, request, look, small, 0, lambda share: None, is_canceled, spp=_FIRST_SPP
    )
    for paths in dict.fromkeys((request.paths, "method")):
        estimate = Estimate.empty(*reference.pictures[paths].shape[:2]).add(reference.pictures[paths])
        _write_reference(folder, estimate, paths != request.paths, look.display)


def make_pass(
    context: BatchContext,
    report: ProgressCallback,
    is_canceled: CancelCheck,
    *,
    request: Mapping[str, Any],
    folder: str,
) -> Mapping[str, Any]:
    """Add one pass.

    Args:
        context: context of the process. report, is_canceled: callbacks.
        request: body of the comparison. folder: its files, from `make_frame`.
    Returns:
        `passes`: number of finished passes.
    """
    comparison, job_folder = ComparisonRequest.model_validate(request), Path(folder)
    frame_and_estimates = _load(job_folder)
    if frame_and_estimates is None:  # the files were deleted
        raise FileNotFoundError(job_folder)
    frame, old_estimates = frame_and_estimates
    transfer = context.transfer(comparison.bake)
    look, size = _look(comparison, transfer), (frame.shape[1], frame.shape[0])
    reference = _render_pass(
        context, transfer, comparison, look, size, old_estimates["method"].passes, report, is_canceled
    )
    if is_canceled():  # the reference does not poll at its end, and the sums may belong to another server by now
        raise CancelledError("the pass was canceled")
    new_estimates = {paths: estimate.add(reference.pictures[paths]) for paths, estimate in old_estimates.items()}
    _save(job_folder, frame, new_estimates)
    _write_figures(job_folder, frame, new_estimates, comparison.paths, reference, look.display)
    return {"passes": new_estimates["method"].passes}


def time_pass(
    context: BatchContext, report: ProgressCallback, is_canceled: CancelCheck, *, request: Mapping[str, Any]
) -> Mapping[str, Any]:
    """Measure the time of a pass with a small image.

    Args:
        context: context of the process. report, is_canceled: callbacks. request: body of the comparison.
    Returns:
        `seconds` per pass.
    """
    comparison = ComparisonRequest.model_validate(request)
    transfer = context.transfer(comparison.bake)
    look, (_, (width, height)) = _look(comparison, transfer), comparison_camera(comparison, transfer)
    size = _smaller(_TIMING_DOWNSCALE, width, height)
    scale = width * height / (size[0] * size[1])
    return {
        "seconds": estimate_seconds(
            lambda progress: _render_pass(context, transfer, comparison, look, size, 0, progress, is_canceled), scale
        )
    }


def _smaller(factor: int, width: int, height: int) -> tuple[int, int]:
    factor = max(1, min(factor, width // MIN_SIDE, height // MIN_SIDE))
    return width // factor, height // factor


def _look(request: ComparisonRequest, transfer: OpenBake) -> Any:
    return looks.validate(request.look, transfer.default_look).without_compositing()


def _render_pass(
    context: BatchContext, transfer: OpenBake, request: ComparisonRequest, look: Any, size: tuple[int, int],
    index: int, report: Any, is_canceled: Any, spp: int = SPP,
) -> ReferenceImage:  # fmt: skip
    return context.library.reference(
        scene_path(context.data, transfer.scene_id), comparison_camera(request, transfer)[0], look, size, spp, report,
        is_canceled, index, reflects=EditAxis.BOUNCES in transfer.axes, is_whole=request.paths == "all",
    )  # fmt: skip


def _load(folder: Path) -> tuple[F32, _Estimates] | None:
    """Load the frame and the sums of earlier passes; None if they are missing or outdated."""
    path = folder / "passes.npz"
    if not path.exists():
        return None
    with np.load(path, allow_pickle=False) as archive:
        if "code" not in archive or str(archive["code"]) != comparison_code():  # by other code: start again
            return None
        sums = {name.removeprefix("sums_"): archive[name] for name in archive if name.startswith("sums_")}
        return archive["frame"], {
            paths: Estimate(path_sums, int(archive["passes"])) for paths, path_sums in sums.items()
        }


def _save(folder: Path, frame: F32, estimates: _Estimates) -> None:
    """Save frame and sums before reporting them; what is lost later is derived from them again."""
    metadata = {"passes": np.array(estimates["method"].passes), "code": np.array(comparison_code())}
    sums = {f"sums_{paths}": estimate.sums for paths, estimate in estimates.items()}
    with atomic_write(folder / "passes.npz") as unfinished:
        np.savez(unfinished, allow_pickle=False, frame=frame, **sums, **metadata)


def _write_figures(
    folder: Path, frame: F32, estimates: _Estimates, requested_paths: str, reference: ReferenceImage, display: Any
) -> None:
    """Write errors and images of all passes so far."""
    figures: dict[str, Any] = {
        "omitted_paths": reference.omitted_paths,
        "unsupported_paths": reference.unsupported_paths,
    }
    if estimates["method"].passes >= 2:
        comparisons = {
            paths: _write_comparison(folder, frame, path_estimate, paths != requested_paths, display)
            for paths, path_estimate in estimates.items()
        }
        figures |= {f"error_{paths}_paths": asdict(comparison) for paths, comparison in comparisons.items()}
    else:
        for paths, estimate in estimates.items():
            _write_reference(folder, estimate, paths != requested_paths, display)
    with atomic_write(folder / FIGURES) as unfinished:
        unfinished.write_text(json.dumps(figures))


def _write_comparison(folder: Path, frame: F32, estimate: Estimate, is_method_only: bool, display: Any) -> Comparison:
    """Write the images of a comparison, and return it. is_method_only: for the light paths of the method."""
    comparison, differs = compare(frame, estimate)
    _write_reference(folder, estimate, is_method_only, display)
    with atomic_write(folder / f"{_prefix(is_method_only)}error.png") as unfinished:
        Image.fromarray(error_map(frame, estimate, differs)).save(unfinished)
    return comparison


def _write_reference(folder: Path, estimate: Estimate, is_method_only: bool, display: Any) -> None:
    path = folder / f"{_prefix(is_method_only)}reference.png"
    write_image(path, estimate.mean, display.transform)


def _prefix(is_method_only: bool) -> str:
    return "method-" if is_method_only else ""
