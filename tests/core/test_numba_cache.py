"""Folders of compiled kernels: keyed by their sources, shared by checkouts, private to the user, with a fallback."""

from __future__ import annotations

import os
import shutil
import stat
import subprocess
import sys
import time
from pathlib import Path

import pytest

from relume.core import numba_cache
from relume.core.numba_cache import cache_folder, kernel_sources

SOURCES = {
    "__init__": "",
    "kernel": "import numba as nb\nfrom package.inner import helper\nfrom package.inner.plain import SIZE\n",
    "inner/__init__": "",
    "inner/helper": "from numba import njit\nfrom package.inner.scale import SCALE\n",
    "inner/plain": "from package.inner.numbers import SIZE\n",
    "inner/scale": "SCALE = 2\n",
    "inner/numbers": "SIZE = 1\n",
    "inner/unused": "import numba as nb\n",
}


@pytest.fixture
def package(tmp_path):
    for name, text in SOURCES.items():
        path = tmp_path / "package" / f"{name}.py"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return tmp_path / "package"


@pytest.fixture
def user_cache(tmp_path, monkeypatch):
    """The user's cache folder of this test; the process switches back afterwards."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    cache_folder.cache_clear()
    yield tmp_path / "relume" / "numba"
    cache_folder.cache_clear()


def test_kernel_sources_include_callees_and_modules_of_constants(package):
    sources = {
        path.relative_to(package).with_suffix("").as_posix() for path in kernel_sources(package / "kernel.py", package)
    }
    assert sources == {"kernel", "inner/__init__", "inner/helper", "inner/plain", "inner/scale"}


_COMPILE = """
import sys
sys.path.insert(0, sys.argv[1])
from relume.math import zernike
from relume.core.numba_cache import module_folder
from pathlib import Path
print(module_folder(Path(zernike.__file__)))

"""


def _folder_of(checkout: Path, cache: Path) -> Path:
    environment = {**os.environ, "XDG_CACHE_HOME": str(cache)}
    code = [sys.executable, "-c", _COMPILE, str(checkout)]
    output = subprocess.run(code, env=environment, capture_output=True, text=True, check=True)
    return Path(output.stdout.split()[0])


def test_checkouts_share_compiled_kernels_until_a_source_changes(tmp_path):
    original = Path(numba_cache.__file__).parents[1]
    checkouts = [tmp_path / "one", tmp_path / "two"]
    for checkout in checkouts:
        shutil.copytree(original, checkout / "relume", ignore=shutil.ignore_patterns("__pycache__"))
    first, second = (_folder_of(checkout, tmp_path / "cache") for checkout in checkouts)
    assert first == second
    assert first.is_dir()
    changed = checkouts[1] / "relume" / "math" / "zernike.py"
    changed.write_text(changed.read_text() + "# corrected\n")
    assert _folder_of(checkouts[1], tmp_path / "cache") != first


def test_compiled_kernels_are_in_the_folder_of_their_module(user_cache):
    code = (
        "import numpy as np\n"
        "from relume.image_io.ocio.sampling import apply_lut\n"
        "apply_lut(np.zeros((65, 65, 65, 3), np.uint16), np.zeros((1, 3), np.float32))\n"
    )
    subprocess.run([sys.executable, "-c", code], env={**os.environ}, check=True)
    (folder,) = user_cache.rglob("image_io.ocio.sampling-*")
    assert list(folder.glob("*.nbc"))
    assert stat.S_IMODE(folder.stat().st_mode) & 0o022 == 0


def test_importing_relume_imports_no_numba():
    code = "import sys, os, relume; print('numba' in sys.modules, os.environ['NUMBA_CACHE_LOCATOR_CLASSES'])"
    output = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    imported, locators = output.stdout.split()
    assert imported == "False"
    assert locators.startswith("relume.core.numba_cache.KernelLocator,")


def test_functions_outside_relume_use_numbas_own_cache():
    assert numba_cache.KernelLocator.from_function(lambda: None, __file__) is None


def test_unusable_user_cache_falls_back_to_a_temporary_folder(tmp_path, monkeypatch, user_cache):
    (tmp_path / "file").write_text("in the way")
    (tmp_path / "tmp").mkdir()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "tmp"))
    folder = cache_folder()
    assert folder.parent.parent == tmp_path / "tmp"
    cache_folder.cache_clear()
    assert cache_folder() == folder


def test_a_folder_writable_by_others_is_not_used(tmp_path, monkeypatch, user_cache):
    # files of a kernel cache are executed: those of other users must not be
    ours = cache_folder()
    cache_folder.cache_clear()
    ours.chmod(0o777)
    (tmp_path / "tmp").mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "tmp"))
    assert tmp_path / "tmp" in cache_folder().parents


def _kernels(folder: Path, name: str, days: float) -> Path:
    made = folder / name
    made.mkdir(parents=True, mode=0o700)
    (made / "kernel.nbi").write_bytes(b"code")
    used = time.time() - days * 86_400
    os.utime(made, (used, used))
    return made


def test_folders_unused_for_a_month_are_deleted_with_the_next_new_folder(user_cache):
    caches = cache_folder()
    old, recent = (
        _kernels(caches, "trace.old-0123456789abcdef", 31),
        _kernels(caches, "light.tiles-fedcba9876543210", 29),
    )
    foreign = _kernels(caches, "notes", 400)
    linked = caches / "linked-aaaaaaaaaaaaaaaa"
    linked.symlink_to(foreign)
    made = _folder_of(Path(numba_cache.__file__).parents[2], user_cache.parent.parent)
    assert made.is_dir()
    assert not old.exists()
    assert (recent / "kernel.nbi").exists()
    assert (foreign / "kernel.nbi").exists()
    assert linked.is_symlink()


def test_a_folder_in_use_is_marked_and_not_deleted(user_cache):
    checkout = Path(numba_cache.__file__).parents[2]
    present = _folder_of(checkout, user_cache.parent.parent)
    os.utime(present, (0, 0))
    old = _kernels(cache_folder(), "trace.old-0123456789abcdef", 400)
    assert _folder_of(checkout, user_cache.parent.parent) == present
    assert time.time() - present.stat().st_mtime < 86_400
    assert old.exists()
