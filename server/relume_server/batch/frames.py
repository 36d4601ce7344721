"""Frames of batch renders: rendered one by one into files, and packed."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from relume.core.filesystem import atomic_write
from relume.image_io.downsample import downsample
from relume.image_io.write_image import write_image
from relume.live.fixed_camera.jobs import CancelCheck
from relume.live.fixed_camera.protocols import EditAxis
from relume.output.contact_sheet import write_contact_sheet
from relume.output.exr.color_space import find_space
from relume.output.exr.export import AovPass, Progress, export_exr
from relume.output.exr.layers import make_layers
from relume.output.exr.metadata import Provenance, build_attributes
from relume_server.batch.context import BatchContext
from relume_server.batch.frame_sequence import cameras_of, look_at_frame
from relume_server.io.video import write_video
from relume_server.runtime.protocols import F32
from relume_server.schemas.renders import QueuedRender

if TYPE_CHECKING:
    from relume.scene.model import Camera


def paint_frame(
    context: BatchContext,
    report: Progress,
    is_canceled: CancelCheck,
    *,
    request: Mapping[str, Any],
    index: int,
    path: str,
    scene_name: str,
) -> Mapping[str, Any]:
    """Render one image of a batch.

    Args:
        context: context of the process. report, is_canceled: callbacks.
        request: body of the batch, of one view. index: index of the frame.
        path: path of its file, which appears when it is complete.
        scene_name: stored in the file.
    """
    render_request, target = QueuedRender.model_validate(request), Path(path)
    ((bake, view_name),) = render_request.bake_views
    transfer = context.transfer(bake)
    camera = cameras_of(render_request, view_name, transfer)[index]
    view = transfer.views[view_name]
    camera_and_size = None if camera is None else (camera, render_request.size or (view.width, view.height))

    def render(look: Any, progress: Progress) -> F32:
        image = context.library.render(
            transfer, view_name, look, progress=progress, for_display=render_request.format != "exr",
            is_canceled=is_canceled, camera_and_size=camera_and_size, exact=render_request.quality == "exact",
        )  # fmt: skip
        return (
            image
            if render_request.size is None or camera_and_size is not None
            else downsample(image, render_request.size)
        )

    look = look_at_frame(render_request, view_name, transfer, index)
    if render_request.format == "exr":
        size = render_request.size or (view.width, view.height)
        _export(target, render, look, context, render_request, camera or view.camera, size, scene_name, report)
    else:
        write_image(target, render(look, report), look.display.transform)
    return {}


def _export(
    path: Path,
    render: Any,
    look: Any,
    context: BatchContext,
    request: QueuedRender,
    camera: Camera,
    size: tuple[int, int],
    scene_name: str,
    progress: Progress,
) -> None:
    transfer = context.transfer(request.bake)
    layers = make_layers(request.layers, look, has_indirect=EditAxis.BOUNCES in transfer.axes)
    origin = Provenance(transfer.scene_id, scene_name, request.bake)
    space = find_space(request.color_space)
    attributes = build_attributes(origin, camera, size, look, layers, space)
    aovs = AovPass(context.library.aov_tracer(transfer, look), camera, size) if request.aovs else None
    export_exr(path, render, look, layers, attributes, request.precision, progress, space, aovs)


def pack(
    context: BatchContext,
    report: Progress,
    is_canceled: CancelCheck,
    *,
    frames: Sequence[Sequence[str]],
    archive: str,
    video: str | None,
    fps: int,
    sheet: Mapping[str, Any] | None,
) -> Mapping[str, Any]:
    """Pack a finished batch.

    Args:
        context: context of the process. report, is_canceled: callbacks.
        frames: path and archive name of each image. archive: file to write.
        video: video file to write, or None. fps: its frames per second.
        sheet: `path`, archive `name` and `labels` of the contact sheet to write, or None.
    """
    if video is not None:
        target = Path(video)
        write_video(target.parent, fps, target, is_canceled)
    if sheet is not None:
        write_contact_sheet([Path(path) for path, _ in frames], sheet["labels"], Path(sheet["path"]), is_canceled)
    with atomic_write(Path(archive)) as file, zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as archive_zip:
        for path, name in frames:
            archive_zip.write(path, name)
        if sheet is not None:
            archive_zip.write(sheet["path"], sheet["name"])
    return {}
