"""Videos from numbered frames, with the installed program ffmpeg."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

from relume.core.errors import CancelledError, ParameterError, RelumeError
from relume.core.filesystem import atomic_write

_POLL_S = 0.2
_MAX_OUTPUT_CHARS = 300  # characters of the program's output


def check_encoder() -> str:
    """Path of ffmpeg. Raises ParameterError if it is not installed."""
    encoder_path = shutil.which("ffmpeg")
    if encoder_path is None:
        raise ParameterError("format", "mp4", "exr, png or webp; mp4 needs ffmpeg on the server")
    return encoder_path


def write_video(frames: Path, fps: int, target: Path, is_canceled: Callable[[], bool]) -> None:
    """Encode 0000.png, 0001.png, … of a folder as H.264; the file appears when it is complete.

    Colors are Rec. 709, with its matrix and the sRGB curve, and tagged: without tags players guess from the image size.

    Args:
        frames: folder. fps: frames per second. target: file that ends in .mp4.
        is_canceled: polled.
    Raises:
        ParameterError: there is no encoder. CancelledError: `is_canceled` returned true. RelumeError: encoding failed.
    """
    pad_filter = "pad=ceil(iw/2)*2:ceil(ih/2)*2"  # colors are subsampled in both directions
    matrix_filter = "scale=out_color_matrix=bt709:out_range=tv"
    with atomic_write(target) as unfinished:
        command = [
            check_encoder(), "-nostdin", "-y", "-loglevel", "error",
            "-framerate", str(fps), "-i", str(frames / "%04d.png"),
            "-vf", f"{pad_filter},{matrix_filter}", "-c:v", "libx264", "-crf", "16", "-pix_fmt", "yuv420p",
            "-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc", "iec61966-2-1", "-color_range", "tv",
            "-movflags", "+faststart", "-f", "mp4", str(unfinished),
        ]  # fmt: skip
        # no user input but a number
        with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:  # noqa: S603
            while True:
                try:
                    _, output = process.communicate(timeout=_POLL_S)
                    break
                except subprocess.TimeoutExpired:
                    if is_canceled():
                        process.kill()
                        raise CancelledError("the video was canceled") from None
        if process.returncode != 0:
            raise RelumeError(f"ffmpeg could not make the video: {_failure_reason(process.returncode, output)}")


def _failure_reason(code: int, output: str) -> str:
    """Describe the failure of a program by its output, or by its exit code."""
    if code < 0:
        return f"it was killed by signal {-code}, perhaps because memory ran out; free some, then try again"
    return (
        output.strip()[-_MAX_OUTPUT_CHARS:]
        or f"it ended with {code} without output; check the free disk space, then try again"
    )
