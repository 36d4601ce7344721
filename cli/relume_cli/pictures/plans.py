"""What `relume render` is to write, checked before hours of work."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from relume.core.errors import ParameterError
from relume_cli.pictures.files import FORMATS, check_display_view, check_output

if TYPE_CHECKING:
    from relume.look import Look
    from relume_cli.pictures.looks import NamedLook

LOOK = "{look}"
VIDEO = ".mp4"
NO_FOLDERS = (*FORMATS, ".mov", ".avi", ".webm", ".mkv", ".gif", ".jpg", ".jpeg", ".tif", ".tiff")
TurntableSubject = Literal["camera", "object", "environment"]


class TurntablePlan(NamedTuple):
    """A turntable: frames once around, what rotates, and frames a second of a video."""

    frames: int
    subject: TurntableSubject = "camera"
    fps: int = 25


class PlannedFile(NamedTuple):
    """One file, or folder of frames.

    Attributes:
        look: what it is called. document: as it was given, perhaps partial. path: of the file or folder.
    """

    look: str
    document: dict[str, Any]
    path: Path


def make_turntable_plan(frames: int | None, subject: TurntableSubject | None, fps: int | None) -> TurntablePlan | None:
    """The turntable that is asked for. Raises ParameterError where there is none, and something is asked of it."""
    from relume_server.schemas.renders import MAX_FRAMES

    if frames is None:
        for option, value in (("--rotate", subject), ("--fps", fps)):
            if value is not None:
                raise ParameterError(option, value, "--turntable N with it")
        return None
    if not 1 <= frames <= MAX_FRAMES:
        raise ParameterError("--turntable", frames, f"1 to {MAX_FRAMES:,} frames")
    return TurntablePlan(frames, subject or "camera", fps or 25)


def check_target(output: Path, turntable_plan: TurntablePlan | None, *, resumes: bool) -> None:
    """Raise ParameterError where what is asked for could not be written there."""
    suffix = output.suffix.lower()
    if turntable_plan is None:
        if suffix == VIDEO:
            raise ParameterError("--output", str(output), "a picture's name; a video needs --turntable N")
        check_output(output)
        return
    if suffix in NO_FOLDERS:
        raise ParameterError("--output", str(output), f"a folder for the numbered frames, or a name ending in {VIDEO}")
    if not output.parent.is_dir():
        raise ParameterError("--output", str(output), "something in a folder that exists")
    if suffix == VIDEO:
        from relume_server.io.video import check_encoder

        check_encoder()
    elif output.exists() and not output.is_dir():
        raise ParameterError("--output", str(output), "a folder, which the numbered frames go into")
    if not resumes and any(frames_folder(output).glob("*.png")):
        raise ParameterError("--output", str(output), "an empty folder; --resume goes on with what is there")


def frames_folder(output: Path) -> Path:
    """Where the frames of a turntable lie; those of a video beside it, until it is made."""
    return output.with_name(output.name + ".frames") if output.suffix.lower() == VIDEO else output


def plan_files(looks: Sequence[NamedLook], output: Path, turntable_plan: TurntablePlan | None) -> list[PlannedFile]:
    """Which look goes where.

    Args:
        looks: all of them. output: as it was given; {look} in it stands for the name of each.
        turntable_plan: a turntable, which is of one look.
    Raises:
        ParameterError: several looks would be written to one file.
    """
    if len(looks) > 1 and turntable_plan is not None:
        raise ParameterError("--look", f"{len(looks)} looks", "one with --turntable")
    if len(looks) > 1 and LOOK not in output.name:
        raise ParameterError("--output", str(output), f"a file name with {LOOK} in it, for the {len(looks)} looks")
    planned_files = [PlannedFile(look.name, look.document, _output_path(look.name, output)) for look in looks]
    for number, planned_file in enumerate(planned_files):
        if planned_file.path in (earlier.path for earlier in planned_files[:number]):
            raise ParameterError(
                "--look", planned_file.look, f"looks of different names: two would be written to {planned_file.path}"
            )
    return planned_files


def complete_plan(planned_file: PlannedFile, default: dict[str, Any]) -> Look:
    """The complete look of a file. Raises ParameterError naming the look."""
    from relume_cli.data_folder import complete_look

    look = complete_look(planned_file.document, default, f"look {planned_file.look!r}")
    check_display_view(planned_file.path, look)
    return look


def _output_path(look: str, output: Path) -> Path:
    if LOOK not in output.name:
        return output
    from relume_server.io.downloads import safe_stem

    return output.with_name(output.name.replace(LOOK, safe_stem(look)))
