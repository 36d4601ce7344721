"""Frames of batch renders: painted one by one into files, and packed."""

from __future__ import annotations

import shutil
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from relume.exr.attributes import Origin, attributes_of
from relume.exr.layers import layers_for
from relume.exr.picture import Progress, export_exr
from relume.exr.space import space_called
from relume.imageio.files import write_image
from relume.imageio.shrink import shrink
from relume.picture.jobs import Cancelled
from relume.picture.transfer import Axis, Opened
from relume.replacing import UNFINISHED, replacing
from server.apart.animation import eyes_of, look_of
from server.apart.workshop import Workshop
from server.files.video import write_video
from server.library.ports import F32
from server.wire.renders import RenderRequest

if TYPE_CHECKING:
    from relume.scene.model import Camera

_LAYERS = ".layers-*"  # folders beside a picture that is being written


def paint_frame(
    shop: Workshop,
    tell: Progress,
    cancelled: Cancelled,
    *,
    request: Mapping[str, Any],
    index: int,
    path: str,
    scene_name: str,
) -> Mapping[str, Any]:
    """Paint one picture of a batch.

    Args:
        request: the batch's body. index: of the picture. path: of its file, which appears whole.
        scene_name: that people read in the file.
    """
    asked, target = RenderRequest.model_validate(request), Path(path)
    _tidy(target.parent)
    transfer = shop.transfer(asked.bake)
    camera = eyes_of(asked, asked.view, transfer)[index]
    view = transfer.views[asked.view]
    eye = None if camera is None else (camera, asked.size or (view.width, view.height))

    def render(look: Any, progress: Progress) -> F32:
        image = shop.library.render(
            transfer, asked.view, look, progress=progress, for_display=asked.format != "exr",
            cancelled=cancelled, eye=eye, exact=asked.exact,
        )  # fmt: skip
        return image if asked.size is None or eye is not None else shrink(image, asked.size)

    look = look_of(asked, asked.view, transfer, index)
    if asked.format == "exr":
        _export(target, render, look, transfer, asked, camera or view.camera, scene_name, tell)
    else:
        write_image(target, render(look, tell), look.display.exposure, look.display.tone_map)
    return {}


def _tidy(folder: Path) -> None:
    """Remove what a killed process left: of a batch one picture is painted at a time."""
    for stray in folder.glob(_LAYERS):
        shutil.rmtree(stray, ignore_errors=True)
    for unfinished in folder.glob(UNFINISHED):
        unfinished.unlink(missing_ok=True)


def _export(
    path: Path,
    render: Any,
    look: Any,
    transfer: Opened,
    request: RenderRequest,
    camera: Camera,
    scene_name: str,
    progress: Progress,
) -> None:
    view = transfer.views[request.view]
    layers = layers_for(request.layers, look, reflects=Axis.BOUNCES in transfer.axes)
    origin = Origin(transfer.scene_id, scene_name, request.bake)
    size = request.size or (view.width, view.height)
    space = space_called(request.color_space)
    attributes = attributes_of(origin, camera, size, look, layers, space)
    export_exr(path, render, look, layers, attributes, request.precision, progress, space)


def pack(
    shop: Workshop,
    tell: Progress,
    cancelled: Cancelled,
    *,
    frames: Sequence[Sequence[str]],
    archive: str,
    video: str | None,
    fps: int,
) -> Mapping[str, Any]:
    """Pack a finished batch.

    Args:
        frames: path of each picture, and what it is called in the archive. archive: file of all of them.
        video: file of a video of them, or None. fps: its frames a second.
    """
    if video is not None:
        target = Path(video)
        write_video(target.parent, fps, target, cancelled)
    with replacing(Path(archive)) as file, zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as packed:
        for path, name in frames:
            packed.write(path, name)
    return {}
