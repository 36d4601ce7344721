"""Takes a backup while everything goes on: the ledger first, then the files that it names and all others.

Scenes and stores are on the disk before the ledger names them, and never change. What the ledger's copy names and the
disk no longer has was deleted in between: then all is taken anew, which costs little, as nothing is copied twice.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path
from time import gmtime, strftime

from sqlalchemy import Engine, select

from relume.store.schema import MANIFEST_NAME
from worker.backup.contents import Found, contents
from worker.backup.ledger_copy import copy_ledger
from worker.backup.shelf import COPIES, Kept, Shelf, Snapshot, Tell, digest_of
from worker.database.models import BakeRow, SceneRow
from worker.database.opening import connect
from worker.database.upgrading import newest_revision
from worker.storage import is_elsewhere

ATTEMPTS = 3

Begin = Callable[[int], Tell]
"""Told how many bytes there are to deal with; returns whom to tell of progress."""


def back_up(data_dir: Path, ledger: Engine, shelf: Shelf, begin: Begin = lambda total: lambda done: None) -> Snapshot:
    """Add a snapshot to a folder of backups. Interrupted, it leaves none; the next goes on with what was copied.

    Args:
        data_dir: what to back up. ledger: that belongs to it.
        shelf: the folder of backups, made where it is missing.
        begin: hears of progress.
    Returns:
        The snapshot; `left_out` says what should be in it.
    Raises:
        BackupError: the folder holds something else. DiskFullError: there is no room for it.
    """
    with shelf.alone():
        snapshot = _take(data_dir, ledger, shelf, begin)
        shelf.write(snapshot)
    return snapshot


def _take(data_dir: Path, ledger: Engine, shelf: Shelf, begin: Begin) -> Snapshot:
    known = _known(shelf)
    for attempt in range(ATTEMPTS):
        with tempfile.TemporaryDirectory(dir=shelf.folder, prefix=COPIES) as folder:
            copy = Path(folder) / "ledger.db"
            copy_ledger(ledger, copy)
            named, kept_ledger = _named(copy), _keep_ledger(copy, shelf)
        files, problems = _keep_files(data_dir, shelf, known, begin)
        lacking = {path for path in named - {kept.path for kept in files} if not is_elsewhere((data_dir / path).parent)}
        if not lacking or attempt == ATTEMPTS - 1:
            break
        known = {kept.path: kept for kept in files}
    problems += [f"{path} is not in the data directory, though the ledger names it" for path in sorted(lacking)]
    return Snapshot(_new_name(shelf), version("relume"), newest_revision(), kept_ledger, tuple(files), tuple(problems))


def _known(shelf: Shelf) -> dict[str, Kept]:
    """Files of the newest snapshot by path."""
    names = shelf.names()
    return {kept.path: kept for kept in shelf.read(names[-1]).files} if names else {}


def _named(copy: Path) -> set[str]:
    """A file of every scene and finished bake that a ledger names."""
    engine = connect(f"sqlite:///{copy}")
    with engine.connect() as connection:
        scenes = connection.scalars(select(SceneRow.id))
        named = {f"scenes/{scene}/scene.json" for scene in scenes}
        ready = connection.scalars(select(BakeRow.id).where(BakeRow.state == "ready"))
        named |= {f"bakes/{bake}.zarr/{MANIFEST_NAME}" for bake in ready}
    engine.dispose()
    return named


def _keep_ledger(copy: Path, shelf: Shelf) -> Kept:
    sha256, stat = digest_of(copy, lambda done: None), copy.stat()
    shelf.keep(copy, sha256, lambda done: None)
    return Kept("relume.db", stat.st_size, sha256, stat.st_mtime_ns)


def _keep_files(data_dir: Path, shelf: Shelf, known: dict[str, Kept], begin: Begin) -> tuple[list[Kept], list[str]]:
    """What was kept of the data directory, and what could not be."""
    found = list(contents(data_dir))
    tell = begin(sum(file.num_bytes for file in found))
    kept: list[Kept] = []
    damaged: set[str] = set()
    for file in found:
        try:
            one = _keep(data_dir, file, shelf, known.get(file.path), tell)
        except FileNotFoundError:  # deleted since
            continue
        if one is not None:
            kept.append(one)
        else:
            damaged.add("/".join(file.path.split("/")[:2]))
    whole = [one for one in kept if one.thing not in damaged]
    return whole, [f"{name} is damaged: delete it, and bake or import it again" for name in sorted(damaged)]


def _keep(data_dir: Path, file: Found, shelf: Shelf, known: Kept | None, tell: Tell) -> Kept | None:
    """Keep a file; None where its content is not what it should be."""
    is_known = known is not None and (known.num_bytes, known.mtime_ns) == (file.num_bytes, file.mtime_ns)
    for _ in range(ATTEMPTS):
        sha256 = file.sha256 or (known.sha256 if known is not None and is_known else None)
        if sha256 is None:
            sha256 = digest_of(data_dir / file.path, lambda done: None)
        if shelf.keep(data_dir / file.path, sha256, tell):
            return Kept(file.path, shelf.path_of(sha256).stat().st_size, sha256, file.mtime_ns)
        if file.sha256 is not None:
            return None
        is_known = False  # it has changed meanwhile
    return None


def _new_name(shelf: Shelf) -> str:
    """The time; a number with it where there is one of this second."""
    time, taken = strftime("%Y%m%dT%H%M%SZ", gmtime()), shelf.names()
    names: Sequence[str] = [time, *(f"{time}-{k}" for k in range(1, 100))]
    return next(name for name in names if name not in taken)
