"""`relume render --turntable`: numbered frames of a scene from all sides."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from relume.errors import ParameterError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from relume.methods.moving_views import MovingViews
    from relume.scene.model import Camera


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


def render_turntable(transfer: MovingViews, view_name: str, look: Any, output: Path, num: int, stills: Any) -> None:
    """Write 0000.png, 0001.png, … into a folder, but for those that are there; says how far it is.

    Args:
        transfer: an opened bake whose eyes move. view_name: where the eye begins.
        look: that is shown. output: the folder. num: of frames.
        stills: makes the frames exact; None: they look as while the eye moves.
    """
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    from cli.picture import save
    from relume.moving.paths import turntable
    from relume.render.image import render_image

    output.mkdir(exist_ok=True)
    view = transfer.views[view_name]

    def frame(camera: Camera, tell: Callable[[float], None]) -> NDArray[Any]:
        eye = camera, (view.width, view.height)
        return render_image(transfer, view_name, look, progress=tell, for_display=True, eye=eye, stills=stills)

    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        bar = progress.add_task("frames", total=num)
        for index, camera in enumerate(turntable(view.camera, view.bounds, num)):
            path = output / f"{index:04d}.png"
            if not path.exists():
                save(path, frame(camera, lambda share, k=index: progress.update(bar, completed=k + share)), look)  # type: ignore[misc]
            progress.update(bar, completed=index + 1)
