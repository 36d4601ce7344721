"""Step that makes a BTF, in time slices, so that other jobs can run in between."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping
from contextlib import closing
from pathlib import Path
from typing import Any

from relume.assets.btf.btf_store import BtfRecord
from relume.assets.btf.import_btf import import_btf
from relume.core.errors import CancelledError
from relume.core.filesystem import atomic_write
from relume.live.fixed_camera.jobs import CancelCheck, ProgressCallback
from relume.synthetic_btf.synthesize import MESH, SyntheticBtf, synthesize_btf
from relume_server.batch.btf_images import SandboxedViewArrays
from relume_server.batch.context import BatchContext
from relume_server.schemas.btfs import BtfRequest
from relume_worker.paths import btfs_path

UPLOAD_FILE, RESULT_FILE = (
    "images.zip",
    "found.json",
)  # a container or a mesh has the same name: checked by the first bytes
_WORK_FOLDER, _PROGRESS_FILE = "making", "reached.txt"
_GRID = 3  # samples along each side of a texel
SLICE_S = 30.0


def run_btf_slice(
    context: BatchContext,
    report: ProgressCallback,
    is_canceled: CancelCheck,
    *,
    request: Mapping[str, Any],
    folder: str,
) -> Mapping[str, Any]:
    """Render or read a BTF, compress and store it; an interrupted step saves its results.

    Args:
        context: context of the process. report, is_canceled: callbacks.
        request: body of the job. folder: its files, including uploads.
    Returns:
        `is_done`: whether the BTF is stored; otherwise the step must run again.
    """
    btf_request, job_folder = BtfRequest.model_validate(request), Path(folder)
    time_slice = _TimeSlice(report, is_canceled, job_folder / _PROGRESS_FILE)
    try:
        record = _make_record(btf_request, job_folder, context, time_slice)
    except CancelledError:
        if is_canceled():
            raise
        time_slice.report_result()
        return {"is_done": False}
    with atomic_write(job_folder / RESULT_FILE) as unfinished:
        unfinished.write_text(json.dumps({"material": record.id}))
    return {"is_done": True}


def _make_record(request: BtfRequest, job_folder: Path, context: BatchContext, time_slice: _TimeSlice) -> BtfRecord:
    btfs_folder, limits = btfs_path(context.data), context.import_limits
    if request.geometry is None:
        with closing(SandboxedViewArrays(job_folder / UPLOAD_FILE, *limits)) as images:
            options = (
                request.name,
                request.error,
                time_slice.report,
                time_slice.is_over,
                job_folder / _WORK_FOLDER,
                images,
            )
            return import_btf(btfs_folder, job_folder / UPLOAD_FILE, *options)
    mesh = job_folder / UPLOAD_FILE if request.geometry == MESH else None
    synthetic_btf = SyntheticBtf(request.geometry, request.size, _GRID, request.error, mesh, request.period)
    return synthesize_btf(
        btfs_folder, synthetic_btf, request.name, time_slice.report, time_slice.is_over, job_folder / _WORK_FOLDER
    )


class _TimeSlice:
    """Ends after a while, but not before it has made progress beyond all earlier slices.

    Args:
        report: called with the fraction done. is_canceled: polled. path: file with the progress of earlier slices.
    """

    def __init__(self, report: ProgressCallback, is_canceled: CancelCheck, path: Path) -> None:
        self._report, self._cancelled, self._path = report, is_canceled, path
        self._until_s = time.monotonic() + SLICE_S
        self._previous_fraction = float(path.read_text()) if path.exists() else 0.0
        self._fraction = 0.0

    def report(self, fraction: float) -> None:
        """Report the fraction done, over all slices."""
        self._fraction = fraction
        self._report(fraction)

    def is_over(self) -> bool:
        """True if the slice should stop: for now, or because the job is canceled."""
        return self._cancelled() or (self._fraction > self._previous_fraction and time.monotonic() > self._until_s)

    def report_result(self) -> None:
        """Store the progress."""
        with atomic_write(self._path) as unfinished:
            unfinished.write_text(str(max(self._fraction, self._previous_fraction)))
