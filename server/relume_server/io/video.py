"""Videos of numbered frames, by the program ffmpeg, which must be installed where the server runs."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

from relume.core.errors import CancelledError, ParameterError, RelumeError
from relume.core.filesystem import atomic_write

_ASK_S = 0.2
_MAX_OUTPUT_CHARS = 300  # characters of what the program says


def check_encoder() -> str:
    """Path of the program. Raises ParameterError where there is none."""
    encoder_path = shutil.which("ffmpeg")
    if encoder_path is None:
        raise ParameterError("format", "mp4", "exr, png or webp; for mp4 ffmpeg must be installed on the server")
    return encoder_path


def write_video(frames: Path, fps: int, target: Path, is_canceled: Callable[[], bool]) -> None:
    """Encode 0000.png, 0001.png, … of a folder as H.264; the file appears whole or not at all.

    Its colours are those of Rec. 709 by that standard's matrix, with sRGB's curve, and the file says so: of a file that
    does not, players guess by its size.

    Args:
        frames: the folder. fps: frames a second. target: file that ends in .mp4.
        is_canceled: asked now and then.
    Raises:
        ParameterError: there is no encoder. CancelledError: `is_canceled` said so. RelumeError: it failed.
    """
    pad_filter = "pad=ceil(iw/2)*2:ceil(ih/2)*2"  # its colours are halved both ways
    matrix_filter = "scale=out_color_matrix=bt709:out_range=tv"
    with atomic_write(target) as unfinished:
        command = [
            check_encoder(), "-nostdin", "-y", "-loglevel", "error",
            "-framerate", str(fps), "-i", str(frames / "%04d.png"),
            "-vf", f"{pad_filter},{matrix_filter}", "-c:v", "libx264", "-crf", "16", "-pix_fmt", "yuv420p",
            "-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc", "iec61966-2-1", "-color_range", "tv",
            "-movflags", "+faststart", "-f", "mp4", str(unfinished),
        ]  # fmt: skip
        # nothing of it is a user's but a number
        with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:  # noqa: S603
            while True:
                try:
                    _, output = process.communicate(timeout=_ASK_S)
                    break
                except subprocess.TimeoutExpired:
                    if is_canceled():
                        process.kill()
                        raise CancelledError("the video was cancelled") from None
        if process.returncode != 0:
            raise RelumeError(f"ffmpeg could not make the video: {_failure_reason(process.returncode, output)}")


def _failure_reason(code: int, output: str) -> str:
    """What a program says of its failure, or what becomes of it where it says nothing."""
    if code < 0:
        return f"it was ended by signal {-code}, perhaps for want of memory; free some, then ask again"
    return (
        output.strip()[-_MAX_OUTPUT_CHARS:]
        or f"it ended with {code} and said nothing; look into the disk's room, then ask again"
    )
