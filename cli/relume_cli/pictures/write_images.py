"""Render images and animations of a bake."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from relume_cli.pictures.files import save
from relume_cli.pictures.plans import VIDEO, frames_folder
from relume_cli.terminal.progress import ReportProgress, report_part

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from relume.live.fixed_camera.protocols import OpenBake
    from relume.live.opened.static_view import StaticViewBuilder
    from relume.look import Look
    from relume.scene.model import Camera, Scene
    from relume_cli.pictures.files import ExrOptions
    from relume_cli.pictures.plans import AnimationPlan, PlannedFile
    from relume_server.schemas.renders import Animation
    from relume_worker.scenes import SceneRecord
    from relume_worker.status import BakeStatus


class RenderSource(NamedTuple):
    """A bake of a scene, opened, one of its views, and functions that load the scene, and the builder of static views;
    None to have none.
    """

    scene: SceneRecord
    bake: BakeStatus
    view: str
    transfer: OpenBake
    load_scene: Callable[[], Scene]
    find_static_views: Callable[[], StaticViewBuilder] | None

    def static_views(self, look: Look) -> StaticViewBuilder | None:
        """Return the builder of static views if the exact image of a look needs one."""
        from relume.output.render_image import needs_tracing

        if self.find_static_views is None or not needs_tracing(self.transfer, look):
            return None
        return self.find_static_views()


def write_picture(
    source: RenderSource, look: Look, path: Path, exr: ExrOptions, report: Callable[[float], None]
) -> None:
    """Render the exact image of a look, and write it.

    Args:
        source: a bake. look: complete. path: path of the file. exr: options for EXR files.
        report: called with the fraction done.
    """
    from relume.output.render_image import render_image

    if path.suffix.lower() == ".exr":
        _write_exr(source, look, path, exr, report)
        return
    image = render_image(
        source.transfer, source.view, look, progress=report, for_display=True, static_views=source.static_views(look)
    )
    save(path, image, look)


def _write_exr(source: RenderSource, look: Look, path: Path, exr: ExrOptions, report: Callable[[float], None]) -> None:
    from relume.live.fixed_camera.protocols import EditAxis
    from relume.output.exr.aovs import AovTracer
    from relume.output.exr.color_space import find_space
    from relume.output.exr.export import AovPass, export_exr
    from relume.output.exr.layers import make_layers
    from relume.output.exr.metadata import Provenance, build_attributes
    from relume.output.render_image import render_image

    view = source.transfer.views[source.view]
    layers = make_layers(exr.layering, look, has_indirect=EditAxis.BOUNCES in source.transfer.axes)
    space = find_space(exr.color_space)
    size = view.width, view.height
    aovs = AovPass(AovTracer.from_look(source.load_scene(), look), view.camera, size) if exr.aovs else None
    origin = Provenance(source.scene.id, source.scene.name, source.bake.id)
    export_exr(
        path,
        lambda layer_look, layer_progress: render_image(
            source.transfer,
            source.view,
            layer_look,
            progress=layer_progress,
            static_views=source.static_views(layer_look),
        ),
        look,
        layers,
        build_attributes(origin, view.camera, size, look, layers, space),
        exr.precision,
        report,
        space,
        aovs,
    )


def write_animation(
    source: RenderSource, planned_file: PlannedFile, animation_plan: AnimationPlan, report: ReportProgress
) -> None:
    """Write the missing frames 0000.png, 0001.png, … into a folder, or a video of them.

    Args:
        source: an opened bake; a free-camera one if the camera or the object rotates. planned_file: a look and its
            path, or keyframes. animation_plan: frames and subject.
        report: called with the fraction done, within frames as well.
    """
    from relume.output.render_image import render_image
    from relume_server.batch.frame_sequence import look_at_frame
    from relume_server.io.video import write_video

    animation, cameras = check_animation_plan(source, planned_file, animation_plan)
    folder, view = frames_folder(planned_file.path), source.transfer.views[source.view]
    folder.mkdir(exist_ok=True)

    def frame(camera: Camera | None, frame_look: Look, report_frame: Callable[[float], None]) -> NDArray[Any]:
        camera_and_size = None if camera is None else (camera, (view.width, view.height))
        return render_image(
            source.transfer,
            source.view,
            frame_look,
            progress=report_frame,
            for_display=True,
            camera_and_size=camera_and_size,
            static_views=source.static_views(frame_look),
        )

    for index, camera in enumerate(cameras):
        file, frame_look = folder / f"{index:04d}.png", look_at_frame(animation, source.view, source.transfer, index)
        if not file.exists():
            report_frame = report_part(
                report, index, animation_plan.frames, f"frame {index + 1} of {animation_plan.frames}"
            )
            save(file, frame(camera, frame_look, report_frame), frame_look)
    if planned_file.path.suffix.lower() == VIDEO:
        report(1.0, "encoding the video")
        write_video(folder, animation_plan.fps, planned_file.path, lambda: False)
        shutil.rmtree(folder)


def check_animation_plan(
    source: RenderSource, planned_file: PlannedFile, animation_plan: AnimationPlan
) -> tuple[Animation, Sequence[Camera | None]]:
    """Return the animation, and the camera of each frame (None: the baked one).

    Args:
        source: an opened bake. planned_file: a look or keyframes, and the path. animation_plan: frames and subject.
    Raises:
        ParameterError: the bake does not support it.
    """
    from relume_server.batch.frame_sequence import check_animation
    from relume_server.schemas.renders import Animation, Turntable

    frames, subject = animation_plan.frames, animation_plan.subject
    animation = Animation(
        bake=source.bake.id,
        looks=list(planned_file.documents),
        frames=frames,
        interpolation=animation_plan.interpolation,
        path=None if subject is None else Turntable(turntable=frames, rotate=subject),
    )
    return animation, check_animation(animation, source.view, source.transfer)
