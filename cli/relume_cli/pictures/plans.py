"""Plan the files of `relume render`, and check them before hours of work."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from relume.core.errors import Description, ParameterError
from relume_cli.pictures.files import FORMATS, check_display_view, check_output

if TYPE_CHECKING:
    from relume.look import Look
    from relume_cli.pictures.looks import NamedLook

LOOK = "{look}"
VIDEO = ".mp4"
NO_FOLDERS = (*FORMATS, ".mov", ".avi", ".webm", ".mkv", ".gif", ".jpg", ".jpeg", ".tif", ".tiff")
TurntableSubject = Literal["camera", "object", "environment"]


class TurntablePlan(NamedTuple):
    """A turntable: frames per revolution, what rotates, and frames per second of a video."""

    frames: int
    subject: TurntableSubject = "camera"
    fps: int = 25


class PlannedFile(NamedTuple):
    """One image file, or folder of frames.

    Attributes:
        look: name. document: as given, perhaps partial. path: path of the file or folder.
    """

    look: str
    document: dict[str, Any]
    path: Path


def make_turntable_plan(frames: int | None, subject: TurntableSubject | None, fps: int | None) -> TurntablePlan | None:
    """Make the turntable plan. Raises ParameterError if an option needs a turntable and there is none."""
    from relume_server.schemas.renders import MAX_FRAMES

    if frames is None:
        for option, value in (("--rotate", subject), ("--fps", fps)):
            if value is not None:
                raise ParameterError(option, value, "it with --turntable N")
        return None
    if not 1 <= frames <= MAX_FRAMES:
        raise ParameterError("--turntable", frames, f"1 to {MAX_FRAMES:,} frames")
    return TurntablePlan(frames, subject or "camera", fps or 25)


def check_target(output: Path, turntable_plan: TurntablePlan | None, *, resumes: bool) -> None:
    """Raise ParameterError if the output cannot be written."""
    suffix = output.suffix.lower()
    if turntable_plan is None:
        if suffix == VIDEO:
            raise ParameterError("--output", str(output), "the name of an image, or --turntable N for a video")
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
    """Folder of a turntable's frames; for a video it is next to it, and deleted when the video is complete."""
    return output.with_name(output.name + ".frames") if output.suffix.lower() == VIDEO else output


def plan_files(looks: Sequence[NamedLook], output: Path, turntable_plan: TurntablePlan | None) -> list[PlannedFile]:
    """Assign a file to each look.

    Args:
        looks: all looks. output: as given; {look} stands for the name of each. turntable_plan: needs exactly one look.
    Raises:
        ParameterError: several looks would be written to one file.
    """
    if len(looks) > 1 and turntable_plan is not None:
        raise ParameterError("--look", Description(f"a list of {len(looks)} looks"), "one look with --turntable")
    if len(looks) > 1 and LOOK not in output.name:
        raise ParameterError(
            "--output", str(output), f"a file name with {LOOK} in it, because there are {len(looks)} looks"
        )
    planned_files = [PlannedFile(look.name, look.document, _output_path(look.name, output)) for look in looks]
    for number, planned_file in enumerate(planned_files):
        if planned_file.path in (earlier.path for earlier in planned_files[:number]):
            raise ParameterError(
                "--look", planned_file.look, f"looks of different names; two would become {planned_file.path}"
            )
    return planned_files


def complete_plan(planned_file: PlannedFile, default: dict[str, Any]) -> Look:
    """Return the complete look of a file. Raises ParameterError with the name of the look."""
    from relume_cli.data_folder import complete_look

    look = complete_look(planned_file.document, default, f"look {planned_file.look!r}")
    check_display_view(planned_file.path, look)
    return look


def _output_path(look: str, output: Path) -> Path:
    if LOOK not in output.name:
        return output
    from relume_server.io.downloads import safe_stem

    return output.with_name(output.name.replace(LOOK, safe_stem(look)))
