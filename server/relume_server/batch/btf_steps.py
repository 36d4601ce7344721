"""The step that makes a BTF, or goes on with it for a while: others have their turns meanwhile."""

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
from relume_server.settings import Settings
from relume_worker.paths import btfs_path

UPLOAD_FILE, RESULT_FILE = "images.zip", "found.json"  # a container or a mesh has the same name: the first bytes tell
_WORK_FOLDER, _PROGRESS_FILE = "making", "reached.txt"
_GRID = 3  # places along each side of a texel
SLICE_S = 30.0


def run_btf_slice(
    context: BatchContext,
    report: ProgressCallback,
    is_canceled: CancelCheck,
    *,
    request: Mapping[str, Any],
    folder: str,
) -> Mapping[str, Any]:
    """Render or read it, compress it, keep it; what was found when it was stopped is still there.

    Args:
        request: the work's. folder: its files, what was sent among them.
    Returns:
        `is_done`: whether it is kept; else it is to be gone on with.
    """
    btf_request, job_folder = BtfRequest.model_validate(request), Path(folder)
    time_slice = _TimeSlice(report, is_canceled, job_folder / _PROGRESS_FILE)
    try:
        record = _make_record(btf_request, job_folder, btfs_path(context.data), time_slice)
    except CancelledError:
        if is_canceled():
            raise
        time_slice.report_result()
        return {"is_done": False}
    with atomic_write(job_folder / RESULT_FILE) as unfinished:
        unfinished.write_text(json.dumps({"material": record.id}))
    return {"is_done": True}


def _make_record(request: BtfRequest, job_folder: Path, btfs_folder: Path, time_slice: _TimeSlice) -> BtfRecord:
    if request.geometry is None:
        limits = Settings()  # of the environment, which is the server's
        with closing(
            SandboxedViewArrays(job_folder / UPLOAD_FILE, limits.import_bytes, limits.import_seconds)
        ) as images:
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
    """Ends after a while, though not before something was found that no turn before it had.

    Args:
        report: called with the share done. is_canceled: asked now and then. path: file that says what turns have
            reached.
    """

    def __init__(self, report: ProgressCallback, is_canceled: CancelCheck, path: Path) -> None:
        self._report, self._cancelled, self._path = report, is_canceled, path
        self._until_s = time.monotonic() + SLICE_S
        self._previous_fraction = float(path.read_text()) if path.exists() else 0.0
        self._fraction = 0.0

    def report(self, fraction: float) -> None:
        """So much is done, of all turns."""
        self._fraction = fraction
        self._report(fraction)

    def is_over(self) -> bool:
        """Whether to stop: for now, or because it is not wanted any more."""
        return self._cancelled() or (self._fraction > self._previous_fraction and time.monotonic() > self._until_s)

    def report_result(self) -> None:
        """Say what was reached."""
        with atomic_write(self._path) as unfinished:
            unfinished.write_text(str(max(self._fraction, self._previous_fraction)))
