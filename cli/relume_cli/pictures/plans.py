"""Plan the files of `relume render`, and check them before hours of work."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from relume.core.errors import Description, ParameterError
from relume_cli.pictures.files import FORMATS, check_display_view, check_output

if TYPE_CHECKING:
    from relume.look import Look
    from relume.look.interpolate import InterpolationMode
    from relume_cli.pictures.looks import NamedLook

LOOK = "{look}"
VIDEO = ".mp4"
NO_FOLDERS = (*FORMATS, ".mov", ".avi", ".webm", ".mkv", ".gif", ".jpg", ".jpeg", ".tif", ".tiff")
TurntableSubject = Literal["camera", "object", "environment"]
Between = Literal["straight", "map", "map_low"]


class AnimationPlan(NamedTuple):
    """An animation: a turntable of one look, or the way from look to look.

    Attributes:
        frames: number of frames. subject: what rotates, once; None for an animation of looks.
        between: how materials move from look to look. fps: frames per second of a video.
    """

    frames: int
    subject: TurntableSubject | None
    between: Between = "straight"
    fps: int = 25

    @property
    def interpolation(self) -> InterpolationMode:
        """The mode of `relume.look.interpolate`."""
        return "parameters" if self.between == "straight" else self.between


class PlannedFile(NamedTuple):
    """One image file, or folder of frames.

    Attributes:
        look: name. documents: as given, perhaps partial; several are the keyframes of an animation.
        path: path of the file or folder.
    """

    look: str
    documents: tuple[dict[str, Any], ...]
    path: Path


def make_animation_plan(
    turntable: int | None,
    subject: TurntableSubject | None,
    frames: int | None,
    between: Between | None,
    fps: int | None,
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
        return AnimationPlan(turntable, subject or "camera", fps=fps or 25)
    if frames is not None:
        _check_num_frames("--frames", frames, 2)
        return AnimationPlan(frames, None, between or "straight", fps or 25)
    if fps is not None:
        raise ParameterError("--fps", fps, "it with --turntable N or --frames N")
    return None


def _check_num_frames(option: str, num_frames: int, fewest: int) -> None:
    from relume_server.schemas.renders import MAX_FRAMES

    if not fewest <= num_frames <= MAX_FRAMES:
        raise ParameterError(option, num_frames, f"{fewest} to {MAX_FRAMES:,} frames")


def check_target(output: Path, animation_plan: AnimationPlan | None, *, resumes: bool) -> None:
    """Raise ParameterError if the output cannot be written."""
    suffix = output.suffix.lower()
    if animation_plan is None:
        if suffix == VIDEO:
            allowed = "the name of an image, or --turntable N or --frames N for a video"
            raise ParameterError("--output", str(output), allowed)
        check_output(output)
        return
    if suffix in NO_FOLDERS:
        raise ParameterError("--output", str(output), f"a folder for the numbered frames, or a name ending in {VIDEO}")
    if not output.parent.is_dir():
        raise ParameterError("--output", str(output), "a path in a folder that exists")
    if suffix == VIDEO:
        from relume_server.io.video import check_encoder

        check_encoder()
    elif output.exists() and not output.is_dir():
        raise ParameterError("--output", str(output), "a folder for the numbered frames")
    if not resumes and any(frames_folder(output).glob("*.png")):
        raise ParameterError("--output", str(output), "an empty folder, or --resume to keep its frames")


def frames_folder(output: Path) -> Path:
    """Folder of an animation's frames; for a video it is next to it, and deleted when the video is complete."""
    return output.with_name(output.name + ".frames") if output.suffix.lower() == VIDEO else output


def plan_files(looks: Sequence[NamedLook], output: Path, animation_plan: AnimationPlan | None) -> list[PlannedFile]:
    """Assign a file to each look, or one to an animation.

    Args:
        looks: all looks. output: as given; {look} stands for the name of each.
        animation_plan: a turntable needs exactly one look, an animation of looks at least two.
    Raises:
        ParameterError: several looks would be written to one file.
    """
    if animation_plan is not None:
        _check_keyframes(len(looks), animation_plan)
        name = " to ".join(dict.fromkeys((looks[0].name, looks[-1].name)))
        return [PlannedFile(name, tuple(look.document for look in looks), _output_path(name, output))]
    if len(looks) > 1 and LOOK not in output.name:
        raise ParameterError(
            "--output", str(output), f"a file name with {LOOK} in it, because there are {len(looks)} looks"
        )
    planned_files = [PlannedFile(look.name, (look.document,), _output_path(look.name, output)) for look in looks]
    for number, planned_file in enumerate(planned_files):
        if planned_file.path in (earlier.path for earlier in planned_files[:number]):
            raise ParameterError(
                "--look", planned_file.look, f"looks of different names; two would become {planned_file.path}"
            )
    return planned_files


def _check_keyframes(num_looks: int, animation_plan: AnimationPlan) -> None:
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
        check_display_view(planned_file.path, looks[-1])
    return looks


def _output_path(look: str, output: Path) -> Path:
    if LOOK not in output.name:
        return output
    from relume_server.io.downloads import safe_stem

    return output.with_name(output.name.replace(LOOK, safe_stem(look)))
