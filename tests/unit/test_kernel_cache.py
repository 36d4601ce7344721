"""The folder of compiled kernels: another one for other sources, ours alone, and always somewhere."""

from __future__ import annotations

import os
import stat
import subprocess
import sys
import time
from pathlib import Path

import pytest

from relume import kernel_cache


@pytest.fixture
def package(tmp_path):
    folder = tmp_path / "package"
    (folder / "inner").mkdir(parents=True)
    (folder / "kernel.py").write_text("import numba as nb\n")
    (folder / "inner" / "helper.py").write_text("from numba import njit\n")
    (folder / "plain.py").write_text("x = 1\n")
    return folder


def test_hash_follows_kernel_sources_and_no_others(package):
    first = kernel_cache.kernel_hash(package)
    (package / "plain.py").write_text("x = 2\n")
    assert kernel_cache.kernel_hash(package) == first
    (package / "inner" / "helper.py").write_text("from numba import njit  # corrected\n")
    second = kernel_cache.kernel_hash(package)
    assert second != first
    (package / "kernel.py").rename(package / "other.py")
    assert kernel_cache.kernel_hash(package) != second


def test_importing_relume_points_numba_there_and_imports_no_numba(tmp_path):
    code = "import sys, os, relume; print('numba' in sys.modules, os.environ['NUMBA_CACHE_DIR'])"
    environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path)}
    output = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    imported, folder = output.stdout.split()
    assert imported == "False"
    assert folder == str(tmp_path / "relume" / "numba" / kernel_cache.kernel_hash())
    assert stat.S_IMODE(os.stat(folder).st_mode) & 0o022 == 0


def test_folder_is_the_same_for_every_process(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert kernel_cache.cache_folder("abc") == kernel_cache.cache_folder("abc") == tmp_path / "relume" / "numba" / "abc"


def test_unusable_user_cache_falls_back_to_a_temporary_folder(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("in the way")
    (tmp_path / "tmp").mkdir()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "tmp"))
    folder = kernel_cache.cache_folder("abc")
    assert folder.parent.parent == tmp_path / "tmp"
    assert kernel_cache.cache_folder("abc") == folder


def test_folder_that_others_may_write_to_is_not_used(tmp_path, monkeypatch):
    # what lies in a kernel cache is run: somebody else's must not be
    open_to_all = tmp_path / "relume" / "numba" / "abc"
    open_to_all.mkdir(parents=True)
    open_to_all.chmod(0o777)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    (tmp_path / "tmp").mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "tmp"))
    assert tmp_path / "tmp" in kernel_cache.cache_folder("abc").parents


def _kernels(folder: Path, name: str, days: float) -> Path:
    made = folder / name
    made.mkdir(parents=True, mode=0o700)
    (made / "kernel.nbi").write_bytes(b"code")
    used = time.time() - days * 86_400
    os.utime(made, (used, used))
    return made


def test_folders_unused_for_a_month_go_when_a_new_one_is_made(tmp_path):
    caches = tmp_path / "relume" / "numba"
    old, recent = _kernels(caches, "0123456789abcdef", 31), _kernels(caches, "fedcba9876543210", 29)
    foreign = _kernels(caches, "notes", 400)
    linked = caches / "aaaaaaaaaaaaaaaa"
    linked.symlink_to(foreign)
    environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path)}
    subprocess.run([sys.executable, "-c", "import relume"], env=environment, check=True)
    assert not old.exists()
    assert (recent / "kernel.nbi").exists()
    assert (foreign / "kernel.nbi").exists()
    assert linked.is_symlink()


def test_folder_in_use_is_marked_and_prunes_nothing(tmp_path):
    caches = tmp_path / "relume" / "numba"
    present, old = _kernels(caches, kernel_cache.kernel_hash(), 400), _kernels(caches, "0123456789abcdef", 400)
    environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path)}
    subprocess.run([sys.executable, "-c", "import relume"], env=environment, check=True)
    assert time.time() - present.stat().st_mtime < 86_400
    assert old.exists()
