"""Uploaded files under server-chosen names."""

from __future__ import annotations

import shutil
from pathlib import Path

from fastapi import UploadFile

COPY_BYTES = 1 << 20


def save_upload(upload: UploadFile, path: Path) -> Path:
    """Save an upload under `path`; its size was limited while it streamed in."""
    with path.open("wb") as file:
        shutil.copyfileobj(upload.file, file, COPY_BYTES)
    return path


def upload_bytes(*uploads: UploadFile | None) -> int:
    """Total size of uploads, in bytes."""
    return sum(upload.size or 0 for upload in uploads if upload is not None)


def plain_name(filename: str | None) -> str:
    """File name of an upload without folders; empty if no printable characters are left."""
    return _printable(_base_name(filename))


def plain_stem(filename: str | None) -> str:
    """File name of an upload without suffix; empty if no printable characters are left."""
    return _printable(_base_name(filename).rsplit(".", 1)[0])


def _base_name(filename: str | None) -> str:
    return (filename or "").replace("\\", "/").rsplit("/", 1)[-1]


def _printable(name: str) -> str:
    return "".join(c for c in name if c.isprintable()).strip()[:80]
