"""`relume render --turntable`: numbered frames of a scene, or of its light, from all sides."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from relume.errors import ParameterError

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from rich.progress import Progress, TaskID

    from relume.look import Look
    from relume.picture.transfer import Opened
    from relume.scene.model import Camera
    from server.wire.renders import Animation


def check_frames(output: Path, num: int, resumes: bool) -> None:
    """Raise ParameterError before hours of work where frames could not be written, or others are there."""
    from server.wire.renders import MAX_FRAMES

    if not 1 <= num <= MAX_FRAMES:
        raise ParameterError("--turntable", num, f"1 to {MAX_FRAMES} frames")
    if output.exists() and not output.is_dir():
        raise ParameterError("--output", output.name, "a folder, which the numbered frames go into")
    if not output.parent.is_dir():
        raise ParameterError("--output", str(output), "a folder in a folder that exists")
    if not resumes and any(output.glob("*.png")):
        raise ParameterError("--output", output.name, "an empty folder; --resume goes on with what is there")


def render_turntable(transfer: Opened, view_name: str, asked: Animation, output: Path, stills: Any) -> None:
    """Write 0000.png, 0001.png, … into a folder, but for those that are there; says how far it is.

    Args:
        transfer: an opened bake, whose eyes move where the way needs it. view_name: where the eye begins.
        asked: what the frames show. output: the folder.
        stills: makes the frames exact where eyes move; None: they look as while the eye moves.
    """
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    from cli.picture import save
    from relume.render.image import render_image
    from server.apart.animation import check_animation, look_of

    cameras = check_animation(asked, view_name, transfer)
    output.mkdir(exist_ok=True)
    view = transfer.views[view_name]

    def frame(camera: Camera | None, shown: Look, tell: Callable[[float], None]) -> NDArray[Any]:
        eye = None if camera is None else (camera, (view.width, view.height))
        return render_image(transfer, view_name, shown, progress=tell, for_display=True, eye=eye, stills=stills)

    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        bar = progress.add_task("frames", total=asked.num_frames)
        for index, camera in enumerate(cameras):
            path, shown = output / f"{index:04d}.png", look_of(asked, view_name, transfer, index)
            if not path.exists():
                tell = partial(_advance, progress, bar, index)
                save(path, frame(camera, shown, tell), shown)
            progress.update(bar, completed=index + 1)


def _advance(progress: Progress, bar: TaskID, index: int, share: float) -> None:
    progress.update(bar, completed=index + share)
