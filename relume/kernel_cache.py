"""Where compiled kernels are kept: one folder per state of the sources, chosen before Numba compiles anything.

Numba's own cache notices a change in the file of a kernel, but not in the files of the functions that it calls, so a
kernel could run on with a helper that has since been corrected. The folder's name is therefore a hash over all kernel
sources; the files inside are written by Numba, which tolerates several processes. A process that starts marks its
folder as used, and one that makes a new folder removes those that nobody has used for a month.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import stat
import sys
import time
from contextlib import suppress
from pathlib import Path

import platformdirs

_PACKAGE = Path(__file__).parent
UNUSED_S = 30 * 86_400.0


def kernel_hash(package: Path = _PACKAGE) -> str:
    """Hash over names and contents of the sources under `package` that import Numba, and over the interpreter."""
    digest = hashlib.sha256(sys.version.encode())
    for path in sorted(package.rglob("*.py")):
        source = path.read_bytes()
        if b"import numba" in source or b"from numba" in source:
            digest.update(path.relative_to(package).as_posix().encode() + b"\0" + source + b"\0")
    return digest.hexdigest()[:16]


def _is_private(folder: Path) -> bool:
    """Whether we may write here and nobody else may: the cache holds code that is run."""
    status = folder.lstat()
    if not stat.S_ISDIR(status.st_mode) or not os.access(folder, os.W_OK):
        return False
    return os.name == "nt" or (status.st_uid == os.getuid() and not status.st_mode & (stat.S_IWGRP | stat.S_IWOTH))


def _make_private(folder: Path) -> bool:
    """Make `folder` and its parent if they are not there; False where they cannot be ours alone."""
    try:
        folder.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        folder.mkdir(mode=0o700, exist_ok=True)
        return _is_private(folder.parent) and _is_private(folder)
    except OSError:
        return False


def cache_folder(name: str) -> Path:
    """The folder for one state of the sources, made if need be: in the user's cache, else a temporary one."""
    folder = platformdirs.user_cache_path("relume") / "numba" / name
    if _make_private(folder):
        return folder
    import tempfile  # half of this module's import time, and seldom needed

    user = os.getuid() if hasattr(os, "getuid") else "user"
    folder = Path(tempfile.gettempdir()) / f"relume-numba-{user}" / name
    return folder if _make_private(folder) else Path(tempfile.mkdtemp(prefix="relume-numba-"))


def remove_unused(folder: Path, older_than_s: float = UNUSED_S) -> None:
    """Delete the siblings of a cache folder that no process has started with for so long; errors leave them there."""
    for sibling in folder.parent.iterdir():
        if sibling == folder or not re.fullmatch("[0-9a-f]{16}", sibling.name):
            continue
        with suppress(OSError):  # another process may be removing it too
            if _is_private(sibling) and time.time() - sibling.stat().st_mtime > older_than_s:
                shutil.rmtree(sibling)


def use_kernel_cache() -> None:
    """Point Numba at the folder of the present sources, in this process and in those it starts."""
    name = kernel_hash()
    chosen = cache_folder(name)
    with suppress(OSError):
        # Where it is empty the sources have changed: a good moment, and a rare one.
        if chosen.name == name and not any(chosen.iterdir()):
            remove_unused(chosen)
        os.utime(chosen)
    folder = str(chosen)
    os.environ["NUMBA_CACHE_DIR"] = folder  # read when Numba is imported; importing it here would cost half a second
    numba = sys.modules.get("numba")
    if numba is not None:
        numba.config.CACHE_DIR = folder
