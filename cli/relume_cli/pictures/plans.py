"""Plan the files of `relume render`, and check them before hours of work."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from relume.core.errors import Description, ParameterError
from relume.output.file_names import FileFields, file_names, parse_template
from relume_cli.pictures.files import FORMATS, check_display_view, check_output

if TYPE_CHECKING:
    from relume.look import Look
    from relume.look.interpolate import InterpolationMode
    from relume.scene.model import Camera
    from relume_cli.pictures.looks import NamedLook

FRAME = "{frame"
VIDEO = ".mp4"
NO_FOLDERS = (*FORMATS, ".mov", ".avi", ".webm", ".mkv", ".gif", ".jpg", ".jpeg", ".tif", ".tiff")
TurntableSubject = Literal["camera", "object", "environment"]
Between = Literal["straight", "map", "map_low"]


class AnimationPlan(NamedTuple):
    """An animation: a turntable of one look, or the way from look to look.

    Attributes:
        frames: number of frames. subject: what rotates, once; None for an animation of looks.
        between: how materials move from look to look. fps: frames per second of a video.
        step: each step-th frame is rendered.
    """

    frames: int
    subject: TurntableSubject | None
    between: Between = "straight"
    fps: int = 25
    step: int = 1

    @property
    def frame_indices(self) -> range:
        """Frames that are rendered."""
        return range(0, self.frames, self.step)

    @property
    def interpolation(self) -> InterpolationMode:
        """The mode of `relume.look.interpolate`."""
        return "parameters" if self.between == "straight" else self.between


class PlannedFile(NamedTuple):
    """One image file, or the frames of an animation.

    Attributes:
        look: name. documents: as given, perhaps partial; several are the keyframes of an animation.
        view: name. path: of the file, or of the video, folder or first frame. frames: of an animation, in order.
        camera: of a free camera; None: that of the view.
    """

    look: str
    documents: tuple[dict[str, Any], ...]
    view: str
    path: Path
    frames: tuple[Path, ...] = ()
    camera: Camera | None = None


def make_animation_plan(
    turntable: int | None,
    subject: TurntableSubject | None,
    frames: int | None,
    between: Between | None,
    fps: int | None,
    step: int | None,
) -> AnimationPlan | None:
    """Make the plan of an animation. Raises ParameterError if an option needs one and there is none, or another."""
    if turntable is not None and frames is not None:
        raise ParameterError("--frames", frames, "it without --turntable")
    if turntable is None and subject is not None:
        raise ParameterError("--rotate", subject, "it with --turntable N")
    if frames is None and between is not None:
        raise ParameterError("--between", between, "it with --frames N")
    if turntable is not None:
        _check_num_frames("--turntable", turntable, 1)
        return AnimationPlan(turntable, subject or "camera", fps=fps or 25, step=step or 1)
    if frames is not None:
        _check_num_frames("--frames", frames, 2)
        return AnimationPlan(frames, None, between or "straight", fps or 25, step or 1)
    if fps is not None:
        raise ParameterError("--fps", fps, "it with --turntable N or --frames N")
    if step is not None:
        raise ParameterError("--step", step, "it with --turntable N or --frames N")
    return None


def _check_num_frames(option: str, num_frames: int, fewest: int) -> None:
    from relume_server.schemas.renders import MAX_FRAMES

    if not fewest <= num_frames <= MAX_FRAMES:
        raise ParameterError(option, num_frames, f"{fewest} to {MAX_FRAMES:,} frames")


def check_target(output: Path, animation_plan: AnimationPlan | None) -> None:
    """Raise ParameterError if the output cannot be written."""
    suffix = output.suffix.lower()
    if animation_plan is None or FRAME in output.name:
        if suffix == VIDEO:
            allowed = "the name of an image, or --turntable N or --frames N for a video, without {frame}"
            raise ParameterError("--output", str(output), allowed)
        check_output(output)
        return
    if suffix in NO_FOLDERS:
        allowed = f"a folder for the numbered frames, a name with {{frame:04}}, or a name ending in {VIDEO}"
        raise ParameterError("--output", str(output), allowed)
    if not output.parent.is_dir():
        raise ParameterError("--output", str(output), "a path in a folder that exists")
    if suffix == VIDEO:
        from relume_server.io.video import check_encoder

        check_encoder()


def check_frames(planned_file: PlannedFile, *, resumes: bool) -> None:
    """Raise ParameterError if frames of another animation would remain, or their folder is a file."""
    folder = planned_file.frames[0].parent
    if folder.exists() and not folder.is_dir():
        raise ParameterError("--output", str(folder), "a folder for the numbered frames")
    if not resumes and any(path.exists() for path in planned_file.frames):
        raise ParameterError("--output", str(planned_file.path), "names of new files, or --resume to keep its frames")


def plan_files(
    looks: Sequence[NamedLook],
    output: Path,
    animation_plan: AnimationPlan | None,
    fields: FileFields,
    views: Sequence[str],
) -> list[PlannedFile]:
    """Assign a file to each look in each view, or one animation to each view.

    Args:
        looks: all looks. output: as given; its name is a template, see `relume.output.file_names`.
        animation_plan: checked by `check_keyframes`.
        fields: of all files, with the number of the first. views: names.
    Raises:
        ParameterError: two images would be written to one file.
    """
    template = parse_template("--output", output.name)
    if animation_plan is None:
        shots = [(view, look, fields.frame + k) for view in views for k, look in enumerate(looks)]
        files = [fields._replace(view=view, look=look.name, frame=frame) for view, look, frame in shots]
        return [
            PlannedFile(look.name, (look.document,), view, output.with_name(name))
            for (view, look, _), name in zip(shots, file_names(template, files), strict=True)
        ]
    look_name = " to ".join(dict.fromkeys((looks[0].name, looks[-1].name)))
    documents = tuple(look.document for look in looks)
    numbers = [fields.frame + k for k in animation_plan.frame_indices]
    of_views = [fields._replace(view=view, look=look_name) for view in views]
    if template.has_field("frame"):
        files = [each._replace(frame=number) for each in of_views for number in numbers]
        paths = [output.with_name(name) for name in file_names(template, files)]
        groups = [paths[k : k + len(numbers)] for k in range(0, len(paths), len(numbers))]
        return [
            PlannedFile(look_name, documents, view, group[0], tuple(group))
            for view, group in zip(views, groups, strict=True)
        ]
    targets = [output.with_name(name) for name in file_names(template, of_views)]
    return [
        PlannedFile(look_name, documents, view, target, _frames_in_folder(target, numbers))
        for view, target in zip(views, targets, strict=True)
    ]


def _frames_in_folder(target: Path, numbers: Sequence[int]) -> tuple[Path, ...]:
    """Files of numbered frames; those of a video are numbered from 0, next to it until it is complete."""
    if target.suffix.lower() == VIDEO:
        folder = target.with_name(target.name + ".frames")
        return tuple(folder / f"{k:04d}.png" for k in range(len(numbers)))
    return tuple(target / f"{number:04d}.png" for number in numbers)


def check_keyframes(num_looks: int, animation_plan: AnimationPlan) -> None:
    """Raise ParameterError if an animation has too many or too few looks."""
    value = Description(f"a list of {num_looks} looks" if num_looks > 1 else "one look")
    if animation_plan.subject is not None:
        if num_looks > 1:
            raise ParameterError("--look", value, "one look with --turntable")
    elif not 2 <= num_looks <= animation_plan.frames:
        raise ParameterError("--look", value, "two or more looks with --frames, at most one per frame")


def complete_plan(planned_file: PlannedFile, default: dict[str, Any]) -> list[Look]:
    """Return the complete looks of a file. Raises ParameterError with the name of the file's look."""
    from relume_cli.data_folder import complete_look

    looks = []
    for number, document in enumerate(planned_file.documents, 1):
        number_text = f", number {number}" if len(planned_file.documents) > 1 else ""
        looks.append(complete_look(document, default, f"look {planned_file.look!r}{number_text}"))
        check_display_view((planned_file.frames or (planned_file.path,))[0], looks[-1])
    return looks
