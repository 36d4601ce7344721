"""Paints pictures of an opened bake, and turntables: numbered frames of a scene, or of its light, from all sides."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from cli.pictures.files import save
from cli.pictures.plans import VIDEO, frames_folder
from cli.terminal.progress import Tell, part_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from cli.pictures.files import ExrOptions
    from cli.pictures.plans import Planned, Turn
    from relume.look import Look
    from relume.methods.stills import Stills
    from relume.picture.transfer import Opened
    from relume.scene.model import Camera
    from server.wire.renders import Animation
    from worker.scenes import SceneRecord
    from worker.status import BakeStatus


class Shown(NamedTuple):
    """What is rendered: a bake of a scene, opened, one of its views, and what makes exact pictures of moved eyes."""

    scene: SceneRecord
    bake: BakeStatus
    view: str
    transfer: Opened
    stills: Stills | None


def paint(of: Shown, look: Look, path: Path, exr: ExrOptions, tell: Callable[[float], None]) -> None:
    """Write the exact picture of a look.

    Args:
        of: a bake. look: complete. path: of the file. exr: used where it is one.
        tell: called with the share done.
    """
    from relume.render.image import render_image

    if path.suffix.lower() == ".exr":
        _paint_exr(of, look, path, exr, tell)
        return
    image = render_image(of.transfer, of.view, look, progress=tell, for_display=True, stills=of.stills)
    save(path, image, look)


def _paint_exr(of: Shown, look: Look, path: Path, exr: ExrOptions, tell: Callable[[float], None]) -> None:
    from relume.exr.attributes import Origin, attributes_of
    from relume.exr.layers import layers_for
    from relume.exr.picture import export_exr
    from relume.exr.space import space_called
    from relume.picture.transfer import Axis
    from relume.render.image import render_image

    view = of.transfer.views[of.view]
    layers = layers_for(exr.layering, look, reflects=Axis.BOUNCES in of.transfer.axes)
    space = space_called(exr.color_space)
    origin = Origin(of.scene.id, of.scene.name, of.bake.id)
    export_exr(
        path,
        lambda shown, told: render_image(of.transfer, of.view, shown, progress=told, stills=of.stills),
        look,
        layers,
        attributes_of(origin, view.camera, (view.width, view.height), look, layers, space),
        exr.precision,
        tell,
        space,
    )


def paint_turntable(of: Shown, planned: Planned, turn: Turn, tell: Tell) -> None:
    """Write 0000.png, 0001.png, … into a folder, but for those that are there; or a video of them.

    Args:
        of: an opened bake, whose eyes move where the way needs it. planned: a look, and where it goes.
        turn: how. tell: called with the share done, in frames too.
    """
    from relume.render.image import render_image
    from server.apart.animation import look_of
    from server.files.video import write_video

    asked, cameras = check_turntable(of, planned, turn)
    folder, view = frames_folder(planned.path), of.transfer.views[of.view]
    folder.mkdir(exist_ok=True)

    def frame(camera: Camera | None, shown: Look, told: Callable[[float], None]) -> NDArray[Any]:
        eye = None if camera is None else (camera, (view.width, view.height))
        return render_image(of.transfer, of.view, shown, progress=told, for_display=True, eye=eye, stills=of.stills)

    for index, camera in enumerate(cameras):
        file, shown = folder / f"{index:04d}.png", look_of(asked, of.view, of.transfer, index)
        if not file.exists():
            told = part_of(tell, index, turn.frames, f"frame {index + 1} of {turn.frames}")
            save(file, frame(camera, shown, told), shown)
    if planned.path.suffix.lower() == VIDEO:
        tell(1.0, "making the video")
        write_video(folder, turn.fps, planned.path, lambda: False)
        shutil.rmtree(folder)


def check_turntable(of: Shown, planned: Planned, turn: Turn) -> tuple[Animation, Sequence[Camera | None]]:
    """What the frames show, and from where.

    Args:
        of: an opened bake. planned: a look, and where it goes. turn: how.
    Raises:
        ParameterError: the bake cannot follow.
    """
    from server.apart.animation import check_animation
    from server.wire.renders import Animation, Turntable

    path = Turntable(turntable=turn.frames, turns=turn.turns)
    asked = Animation(bake=of.bake.id, looks=[planned.document], path=path)
    return asked, check_animation(asked, of.view, of.transfer)
