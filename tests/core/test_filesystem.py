"""Files are complete or absent, whatever happens while they are written."""

import os
import stat
from pathlib import Path

import pytest

from relume.core.errors import DiskFullError, RelumeError
from relume.core.filesystem import UNFINISHED, atomic_write, remove_folder
from relume_server.io.import_request import remove_strays


def write(path: Path, raised: BaseException | None = None) -> None:
    with atomic_write(path) as unfinished:
        unfinished.write_bytes(b"new")
        if raised is not None:
            raise raised


def test_a_file_takes_its_name_when_the_block_has_ended(tmp_path: Path) -> None:
    path = tmp_path / "found.JSON"
    path.write_text("old")
    with atomic_write(path) as unfinished:
        unfinished.write_text("new")
        assert (path.read_text(), unfinished.parent, unfinished.suffix) == ("old", tmp_path, ".json")
        assert list(tmp_path.glob(UNFINISHED)) == [unfinished]
    assert path.read_text() == "new"
    assert list(tmp_path.iterdir()) == [path]


def test_the_file_mode_follows_the_umask(tmp_path: Path) -> None:
    plain, ours = tmp_path / "plain", tmp_path / "ours"
    plain.touch()
    with atomic_write(ours) as unfinished:
        unfinished.touch()
    assert stat.S_IMODE(ours.stat().st_mode) == stat.S_IMODE(plain.stat().st_mode)


@pytest.mark.parametrize("raised", [ValueError("half"), KeyboardInterrupt()])
def test_a_failure_leaves_the_old_file_and_nothing_else(tmp_path: Path, raised: BaseException) -> None:
    path = tmp_path / "a.bin"
    path.write_bytes(b"old")
    with pytest.raises(type(raised)):
        write(path, raised)
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_errors_of_image_libraries_tell_a_full_disk_and_no_path(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They have no number, and name the unfinished file."""
    error = OSError(f"Failed write: {tmp_path}")
    with pytest.raises(RelumeError, match=r"a\.exr cannot be written \(OSError\)") as raised:
        write(tmp_path / "a.exr", error)
    assert not isinstance(raised.value, DiskFullError)
    monkeypatch.setattr("relume.core.filesystem._FULL_BYTES", 1 << 62)
    with pytest.raises(DiskFullError):
        write(tmp_path / "a.exr", error)


@pytest.mark.parametrize("call", ["fsync", "replace"])
def test_a_full_disk_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: str) -> None:
    def no_space(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, call, no_space)
    with pytest.raises(DiskFullError, match=r"a\.bin cannot be written.*free some space"):
        write(tmp_path / "a.bin")
    assert not list(tmp_path.iterdir())


def test_a_missing_folder_is_reported(tmp_path: Path) -> None:
    with pytest.raises(RelumeError, match="check the folder"):
        write(tmp_path / "nowhere" / "a.bin")


def test_a_folder_is_removed_atomically(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "kept.zarr"
    folder.mkdir()
    (folder / "one").write_text("1")
    exists: list[bool] = []
    monkeypatch.setattr(
        "shutil.rmtree", lambda path, **_: exists.append(folder.exists() or not (path / "one").exists())
    )
    remove_folder(folder)  # as after a crash
    assert exists == [False]
    remove_strays(tmp_path.parent, older_than_s=3600)
    assert len(list(tmp_path.glob(UNFINISHED))) == 1
    monkeypatch.undo()
    remove_strays(tmp_path.parent, older_than_s=-1)
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(FileNotFoundError):
        remove_folder(folder)
