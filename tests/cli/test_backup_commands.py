"""Commands that upgrade, back up and restore a ledger, and workers."""

from __future__ import annotations

import json
import os
import sqlite3
import stat
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from relume_cli.main import main
from relume_cli.tokens import open_access
from relume_worker.database import open_database
from relume_worker.database.upgrading import latest_revision
from relume_worker.ledger import Ledger
from relume_worker.paths import bake_path

RELUME = [sys.executable, "-m", "relume_cli.main"]
BEFORE = (Path(__file__).parents[1] / "worker" / "before_revisions.sql").read_text(encoding="utf-8")


@pytest.fixture
def data(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A data folder from before schema revisions; the files of its scene and bake are missing."""
    folder = tmp_path / "data"
    folder.mkdir()
    with closing(sqlite3.connect(folder / "relume.db")) as connection:
        connection.executescript(BEFORE)
    monkeypatch.setenv("RELUME_DATA", str(folder))
    return folder


def test_upgrade_prints_its_steps(data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["db", "upgrade"]) == 0
    said = capsys.readouterr().out.splitlines()
    assert said[0] == "0001: The tables before revisions were introduced"
    assert main(["db", "upgrade"]) == 0
    assert capsys.readouterr().out.splitlines() == said[-1:] == [f"the database is at revision {latest_revision()}"]


def test_backup_lists_missing_files_and_is_restored(
    data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    backups = str(tmp_path / "backups")
    assert main(["backup", backups]) == 1
    said = capsys.readouterr()
    assert said.err.count("is missing in the data directory, although the database names it") == 2
    assert main(["backup", backups, "--verify"]) == 0
    assert "0 of 1 files are damaged" in capsys.readouterr().err
    assert main(["restore", backups, "--snapshot", said.out.strip(), "--data", str(tmp_path / "new")]) == 0
    with closing(sqlite3.connect(tmp_path / "new" / "relume.db")) as connection:
        assert connection.execute("SELECT name FROM looks").fetchall() == [("red",)]


@pytest.mark.parametrize(
    ("more", "said"), [([], "valid: token Ann, edit"), (["--revoke-tokens"], "revoked: token Ann, edit")]
)
def test_tokens_restored_from_a_backup_are_listed_or_revoked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], more: list[str], said: str
) -> None:
    old, backups, new = (str(tmp_path / name) for name in ("old", "backups", "new"))
    assert main(["token", "add", "Ann", "--role", "edit", "--data", old]) == 0
    token = capsys.readouterr().out.strip()
    assert main(["backup", backups, "--data", old]) == 0
    assert main(["token", "revoke", "Ann", "--data", old]) == 0
    assert main(["restore", backups, "--data", new, *more]) == 0
    assert said in capsys.readouterr().err
    assert (open_access(Path(new)).tokens.authenticate(token) is None) == bool(more)


def test_stored_files_are_private_to_their_user(tmp_path: Path) -> None:
    data, backups = tmp_path / "data", tmp_path / "backups"
    before = os.umask(0o022)
    try:
        assert main(["token", "add", "Ann", "--data", str(data)]) == 0
        assert main(["backup", str(backups), "--data", str(data)]) == 0
        assert main(["restore", str(backups), "--data", str(tmp_path / "new")]) == 0
        assert os.umask(0o022) == 0o022  # other files of a shell command keep the user's umask
    finally:
        os.umask(before)
    folders = [data, backups, tmp_path / "new"]
    files = [*data.glob("relume.db*"), *backups.rglob("*"), *(tmp_path / "new").rglob("*")]
    assert {stat.S_IMODE(path.stat().st_mode) for path in folders} == {0o700}
    assert files
    assert {stat.S_IMODE(path.stat().st_mode) & 0o077 for path in files} == {0}


def test_backups_are_printed_as_json(data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def read_json(*words: str) -> dict[str, Any]:
        assert main([*words, "--json"]) in (0, 1)
        document: dict[str, Any] = json.loads(capsys.readouterr().out)
        return document

    backups = str(tmp_path / "backups")
    assert read_json("db", "upgrade")["revision"] == latest_revision()
    made = read_json("backup", backups)
    assert (made["files"], len(made["left_out"])) == (0, 2)
    assert read_json("backup", backups, "--verify") == {"name": made["name"], "files": 1, "damaged": []}
    assert read_json("restore", backups, "--data", str(tmp_path / "new"))["name"] == made["name"]


def test_failed_restore_prints_one_line(data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["restore", str(tmp_path / "nothing"), "--data", str(tmp_path / "new")]) == 1
    said = capsys.readouterr().err.strip()
    assert said.startswith("relume: ")
    assert "contains no backup; make one with: relume backup" in said
    assert "\n" not in said


def test_worker_bakes_queued_jobs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RELUME_DATA", str(tmp_path / "server"))
    monkeypatch.setenv("RELUME_DATABASE", f"sqlite:///{tmp_path / 'ledger.db'}")
    monkeypatch.setenv("RELUME_STORAGE", f"file://{tmp_path / 'shared'}")
    assert main(["import", "--built-in", "cornell_box"]) == 0
    assert main(["bake", "Cornell box", "--method", "direct", "--size", "24x16", "--lights", "100", "--no-watch"]) == 0
    worker = subprocess.Popen([*RELUME, "worker", "--processes", "1", "--data", str(tmp_path / "far")])
    try:
        with closing(Ledger(open_database(f"sqlite:///{tmp_path / 'ledger.db'}"))) as ledger:
            deadline = time.monotonic() + 120
            while (status := ledger.bakes()[0]).state in ("queued", "running") and time.monotonic() < deadline:
                time.sleep(0.1)
            assert status.state == "ready"
    finally:
        worker.terminate()
        assert worker.wait(30) == 0
    assert not bake_path(tmp_path / "server", status.id).exists()
    assert main(["render", "Cornell box", "--output", str(tmp_path / "box.png")]) == 0
    assert bake_path(tmp_path / "server", status.id).exists()
