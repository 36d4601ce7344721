"""Free disk space."""

from __future__ import annotations

import shutil
from pathlib import Path


def free_bytes(folder: Path) -> int:
    """Free space on the disk of a folder, in bytes."""
    return shutil.disk_usage(folder).free
