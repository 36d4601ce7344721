"""Opening of images from untrusted sources with OpenImageIO."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import OpenImageIO as oiio  # noqa: N813  (the name its own documentation gives it)

from relume.core.errors import SceneError

MAX_EXPANSION = 1_000  # deflate compresses zeros 1,032 : 1; photographs do not come near it
FREE_BYTES = 64 << 20  # any file may claim these, however small
oiio.attribute("try_all_readers", 0)  # otherwise a file rejected by its suffix's reader goes to twenty others


@contextmanager
def open_image(
    data: bytes, suffix: str, label: str, options: oiio.ImageSpec | None = None
) -> Iterator[oiio.ImageInput]:
    """Open an image in a private temporary file.

    Args:
        data: contents of the file. suffix: format, determined from the first bytes. label: name in messages.
        options: hints of OpenImageIO's reader.
    Raises:
        SceneError: the file is damaged.
    """
    handle, path = tempfile.mkstemp(suffix=suffix)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
        image = _open(path, options or oiio.ImageSpec())
        if image is None:
            raise SceneError(f"{label} is damaged or not what its first bytes say; export it again")
        try:
            yield image
        finally:
            image.close()
    except UnicodeDecodeError:  # names in the header that are not valid text
        raise SceneError(f"{label} is damaged; export it again") from None
    finally:
        Path(path).unlink()


def _open(path: str, options: oiio.ImageSpec) -> oiio.ImageInput | None:
    image = oiio.ImageInput.open(path, options)
    if image is not None or not clear_error(oiio.geterror).startswith("Subsampled"):
        return image
    oiio.attribute("openexr:core", 0)  # luminance and chroma are decoded only by the older reader
    try:
        image = oiio.ImageInput.open(path, options)
    finally:
        oiio.attribute("openexr:core", 1)
    if image is None:
        clear_error(oiio.geterror)
    return image


def clear_error(take_error: Callable[[], str]) -> str:
    """Return and discard OpenImageIO's stored error message; empty if it contains invalid text."""
    with suppress(UnicodeDecodeError):
        return take_error()
    return ""


def check_claim(claimed_bytes: int, data: bytes, label: str) -> None:
    """Reject headers that claim more pixels than the file could contain: a few bytes may claim gigabytes.

    Args:
        claimed_bytes: size of the pixels. data: contents of the file. label: name of the file in messages.
    Raises:
        SceneError: the header claims too much.
    """
    if claimed_bytes > max(FREE_BYTES, MAX_EXPANSION * len(data)):
        raise SceneError(
            f"{label} claims {claimed_bytes / 1e6:,.0f} MB of pixels and holds {len(data) / 1e6:,.1f} MB; "
            "it is truncated or damaged, export it again"
        )
