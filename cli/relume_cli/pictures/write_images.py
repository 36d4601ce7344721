"""Render images and animations of a bake."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from relume_cli.pictures.files import save
from relume_cli.pictures.plans import VIDEO
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
    source: RenderSource,
    look: Look,
    path: Path,
    exr: ExrOptions,
    report: Callable[[float], None],
    camera: Camera | None = None,
) -> None:
    """Render the exact image of a look, and write it.

    Args:
        source: a bake. look: complete. path: path of the file. exr: options for EXR files.
        report: called with the fraction done. camera: of a free camera; None: that of the view.
    """

    def render(shown_look: Look, progress: Callable[[float], None], *, for_display: bool = False) -> NDArray[Any]:
        from relume.output.render_image import render_image

        view = source.transfer.views[source.view]
        return render_image(
            source.transfer,
            source.view,
            shown_look,
            progress=progress,
            for_display=for_display,
            camera_and_size=None if camera is None else (camera, (view.width, view.height)),
            static_views=source.static_views(shown_look),
        )

    if path.suffix.lower() == ".exr":
        _write_exr(source, look, path, exr, report, camera, render)
    else:
        save(path, render(look, report, for_display=True), look)


def _write_exr(
    source: RenderSource,
    look: Look,
    path: Path,
    exr: ExrOptions,
    report: Callable[[float], None],
    camera: Camera | None,
    render: Callable[[Look, Callable[[float], None]], NDArray[Any]],
) -> None:
    from relume.live.fixed_camera.protocols import EditAxis
    from relume.output.exr.aovs import AovTracer
    from relume.output.exr.color_space import find_space
    from relume.output.exr.export import AovPass, export_exr
    from relume.output.exr.layers import make_layers
    from relume.output.exr.metadata import Provenance, build_attributes

    view = source.transfer.views[source.view]
    layers = make_layers(exr.layering, look, has_indirect=EditAxis.BOUNCES in source.transfer.axes)
    space = find_space(exr.color_space)
    size = view.width, view.height
    camera = camera or view.camera
    aovs = AovPass(AovTracer.from_look(source.load_scene(), look), camera, size) if exr.aovs else None
    origin = Provenance(source.scene.id, source.scene.name, source.bake.id)
    export_exr(
        path,
        render,
        look,
        layers,
        build_attributes(origin, camera, size, look, layers, space),
        exr.precision,
        report,
        space,
        aovs,
    )


def write_animation(
    source: RenderSource,
    planned_file: PlannedFile,
    animation_plan: AnimationPlan,
    exr: ExrOptions,
    report: ReportProgress,
) -> None:
    """Write the missing frames of an animation, or a video of them.

    Args:
        source: an opened bake; a free-camera one if the camera or the object rotates. planned_file: a look and its
            path, or keyframes. animation_plan: frames and subject. exr: options for EXR files.
        report: called with the fraction done, within frames as well.
    """
    from relume_server.batch.frame_sequence import look_at_frame
    from relume_server.io.video import write_video

    animation, cameras = check_animation_plan(source, planned_file, animation_plan)
    folder, num_frames = planned_file.frames[0].parent, len(planned_file.frames)
    folder.mkdir(exist_ok=True)
    for number, (index, file) in enumerate(zip(animation_plan.frame_indices, planned_file.frames, strict=True)):
        if not file.exists():
            report_frame = report_part(report, number, num_frames, f"frame {number + 1} of {num_frames}")
            look = look_at_frame(animation, source.view, source.transfer, index)
            write_picture(source, look, file, exr, report_frame, cameras[index])
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
