"""Backup and restore for both databases; an interrupted backup or restore is never taken as complete."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest
from fake_method import RECIPE, FakeMethod, tiny_scene
from postgres import Cluster
from test_processes import tree_hash

from relume.core.errors import BackupError
from relume.scene.scene_folder import load_scene
from relume.store.reader import open_store
from relume_server.persistence.look_store import LookStore
from relume_worker.backup.create import create_backup
from relume_worker.backup.repository import BackupRepository
from relume_worker.backup.restore import restore
from relume_worker.database import open_database
from relume_worker.ledger import Ledger
from relume_worker.paths import bake_path, scene_path
from relume_worker.scenes import delete_scene, list_scenes, register_scene
from relume_worker.service import BakeService
from relume_worker.status import BakeStatus

SCENE = tiny_scene()


@pytest.fixture
def repository(tmp_path: Path) -> BackupRepository:
    return BackupRepository(tmp_path / "backups")


def open_service(data: Path, url: str) -> BakeService:
    return BakeService(data, url, methods={"fake": FakeMethod()})


def bake(service: BakeService) -> BakeStatus:
    with service, service.subscribe(service.submit(SCENE.id, RECIPE)) as changes:
        return list(changes)[-1]


def fill(data: Path, url: str) -> None:
    """Create a scene, a finished bake, a saved look, the image of a render, and files that are not backed up."""
    service = open_service(data, url)
    register_scene(data, service.ledger, SCENE)
    LookStore(service.ledger.sessions).put("red", "{}", None, None)
    status = bake(service)
    assert status.state == "ready"
    (data / "renders" / "one").mkdir(parents=True)
    (data / "renders" / "one" / "0000.png").write_bytes(b"a picture")
    for path in ("thumbnails/a.png", "upload-x/b.glb", f"bakes/{status.id}.zarr/derived/c.npy", ".unfinished-d"):
        (data / path).parent.mkdir(exist_ok=True)
        (data / path).write_bytes(b"not worth keeping")


@pytest.fixture(scope="module")
def filled_sqlite(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """A filled data directory and its ledger, for tests to copy."""
    folder = tmp_path_factory.mktemp("filled")
    fill(folder / "data", url := f"sqlite:///{folder / 'relume.db'}")
    return folder, url


@pytest.fixture(scope="module")
def filled_postgresql(tmp_path_factory: pytest.TempPathFactory, postgresql: Cluster) -> tuple[Path, str]:
    folder = tmp_path_factory.mktemp("filled")
    fill(folder / "data", url := postgresql.new_database())
    return folder, url


@pytest.fixture(params=["sqlite", "postgresql"])
def ledger_url(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    """A copy of a filled ledger; its data directory is copied into `tmp_path`."""
    folder, url = request.getfixturevalue(f"filled_{request.param}")
    shutil.copytree(folder / "data", tmp_path / "data")
    if request.param == "postgresql":
        return str(request.getfixturevalue("postgresql").new_database(like=url))
    for file in folder.glob("relume.db*"):
        shutil.copy(file, tmp_path)
    return f"sqlite:///{tmp_path / 'relume.db'}"


@pytest.fixture
def data(tmp_path: Path, ledger_url: str) -> Path:
    """A data directory for one test."""
    return tmp_path / "data"


def back_up(
    data: Path, url: str, repository: BackupRepository, **options: Callable[[int], Callable[[int], None]]
) -> str:
    engine = open_database(url)
    try:
        snapshot = create_backup(data, engine, repository, **options)
    finally:
        engine.dispose()
    assert snapshot.left_out == ()
    return snapshot.name


@pytest.mark.parametrize("into", ["sqlite", "postgresql"])
def test_everything_is_restored_into_either_database(
    data: Path, ledger_url: str, repository: BackupRepository, tmp_path: Path, postgresql: Cluster, into: str
) -> None:
    back_up(data, ledger_url, repository)
    elsewhere = tmp_path / "elsewhere"
    url = f"sqlite:///{elsewhere / 'relume.db'}" if into == "sqlite" else postgresql.new_database()
    restore(repository, None, elsewhere, url)
    with closing(open_service(data, ledger_url)) as old, closing(open_service(elsewhere, url)) as new:
        assert new.bakes() == old.bakes()
        (status,) = new.bakes()
        assert new.ledger.finished_tasks(status.id) == old.ledger.finished_tasks(status.id)
        assert LookStore(new.ledger.sessions).list() == LookStore(old.ledger.sessions).list() != []
        assert new.submit(SCENE.id, RECIPE) == status.id
        assert new.get(status.id).state == "ready"
        assert len(open_store(bake_path(elsewhere, status.id)).shape("views/0/visibility")) == 2
        assert load_scene(scene_path(elsewhere, SCENE.id)).id == SCENE.id
    assert (elsewhere / "renders" / "one" / "0000.png").read_bytes() == b"a picture"
    folders = {path.relative_to(elsewhere).parts[0] for path in elsewhere.rglob("*") if b"not worth" in read(path)}
    assert folders == set()
    assert not list(elsewhere.rglob(".unfinished-*"))


def read(path: Path) -> bytes:
    return path.read_bytes() if path.is_file() else b""


def test_second_backup_copies_only_new_files(data: Path, ledger_url: str, repository: BackupRepository) -> None:
    first = back_up(data, ledger_url, repository)
    before = {path: path.stat().st_mtime_ns for path in (repository.folder / "files").rglob("*") if path.is_file()}
    with closing(open_service(data, ledger_url)) as service:
        register_scene(data, service.ledger, other := tiny_scene("another"))
    second = back_up(data, ledger_url, repository)
    after = {path: path.stat().st_mtime_ns for path in (repository.folder / "files").rglob("*") if path.is_file()}
    new = {file.sha256 for file in repository.read(second).all} - {file.sha256 for file in repository.read(first).all}
    assert {path.name for path in set(after) - set(before)} == new
    assert before.items() <= after.items()
    paths = {file.path for file in repository.read(second).files} - {file.path for file in repository.read(first).files}
    assert paths == {f"scenes/{other.id}/scene.json", f"scenes/{other.id}/arrays.npz"}


def test_backup_is_complete_despite_concurrent_changes(
    data: Path, ledger_url: str, repository: BackupRepository, tmp_path: Path
) -> None:
    ended = threading.Event()
    with closing(open_service(data, ledger_url)) as service:

        def add_and_delete() -> None:
            k = 0
            while not ended.is_set():
                k += 1
                register_scene(data, service.ledger, tiny_scene(f"scene {k}"))
                if k % 2:
                    delete_scene(data, service.ledger, tiny_scene(f"scene {k}").id)

        thread = threading.Thread(target=add_and_delete)
        thread.start()
        try:
            snapshot = create_backup(data, service.ledger._engine, repository)
        finally:
            ended.set()
            thread.join()
    elsewhere, url = tmp_path / "elsewhere", f"sqlite:///{tmp_path / 'elsewhere.db'}"
    restore(repository, None, elsewhere, url)
    with closing(Ledger(open_database(url))) as ledger:
        for record in list_scenes(ledger):
            if not any(record.id in sentence for sentence in snapshot.left_out):
                assert load_scene(scene_path(elsewhere, record.id)).id == record.id
        assert SCENE.id in {record.id for record in list_scenes(ledger)}


KILLED = """
import os, signal, sys
from pathlib import Path
from relume_worker.backup.restore import restore
from relume_worker.backup.repository import BackupRepository
from relume_worker.backup.create import create_backup
from relume_worker.database import open_database

count = [0]
def tell(done):
    count[0] += 1
    if count[0] == 12:
        os.kill(os.getpid(), signal.SIGKILL)

what, data, url, repository = sys.argv[1], Path(sys.argv[2]), sys.argv[3], BackupRepository(Path(sys.argv[4]))
if what == "backup":
    create_backup(data, open_database(url), repository, lambda total: tell)
else:
    restore(repository, None, data, url, lambda total: tell)
"""


def kill(action: str, data: Path, url: str, repository: BackupRepository) -> None:
    """Run an action in a separate process that is killed in the middle of a file."""
    done = subprocess.run([sys.executable, "-c", KILLED, action, str(data), url, str(repository.folder)], check=False)
    assert done.returncode == -signal.SIGKILL


def test_killed_backup_leaves_no_snapshot_and_the_next_reuses_its_files(
    data: Path, ledger_url: str, repository: BackupRepository
) -> None:
    kill("backup", data, ledger_url, repository)
    assert repository.names() == []
    with pytest.raises(BackupError, match="contains no backup"):
        repository.read()
    copied = {path.name for path in (repository.folder / "files").rglob("*") if path.is_file() and path.name[0] != "."}
    assert len(copied) > 5
    assert list((repository.folder / "files").rglob(".unfinished-*"))
    back_up(data, ledger_url, repository)
    snapshot = repository.read()
    assert list(repository.find_damaged(snapshot, lambda done: None)) == []
    reused = copied & {file.sha256 for file in snapshot.files}
    assert len(reused) == len(copied) - 1  # all except the earlier copy of the ledger
    assert not [path for path in repository.folder.rglob("*") if path.name.startswith(".")]


def test_killed_restore_is_unusable_and_resumes(
    data: Path, ledger_url: str, repository: BackupRepository, tmp_path: Path
) -> None:
    first = back_up(data, ledger_url, repository)
    back_up(data, ledger_url, repository)
    elsewhere, url = tmp_path / "elsewhere", f"sqlite:///{tmp_path / 'elsewhere.db'}"
    kill("restore", elsewhere, url, repository)
    with pytest.raises(BackupError, match="run relume restore again, which resumes"):
        open_service(elsewhere, url)
    with pytest.raises(BackupError, match="resume that one"):
        restore(repository, first, elsewhere, url)
    restore(repository, None, elsewhere, url)
    with closing(open_service(elsewhere, url)) as service:
        (status,) = service.bakes()
        store = f"bakes/{status.id}.zarr"
        (data / store / "derived" / "c.npy").unlink()
        (data / store / "derived").rmdir()
        assert tree_hash(elsewhere / store) == tree_hash(data / store)
    assert not list(elsewhere.rglob(".unfinished-*"))


def test_damaged_files_are_omitted_and_reported(data: Path, ledger_url: str, repository: BackupRepository) -> None:
    (store,) = (data / "bakes").glob("*.zarr")
    shard = store / "views" / "0" / "visibility" / "c" / "3" / "0"
    shard.write_bytes(bytes(shard.stat().st_size))
    with closing(Ledger(engine := open_database(ledger_url))):
        snapshot = create_backup(data, engine, repository)
    assert f"bakes/{store.name} is damaged; delete it, and bake or import it again" in snapshot.left_out
    assert not any("bakes/" in file.path for file in snapshot.files)
    assert any("scenes/" in file.path for file in snapshot.files)


def test_damaged_backup_is_detected_and_the_next_is_complete(
    data: Path, ledger_url: str, repository: BackupRepository
) -> None:
    back_up(data, ledger_url, repository)
    file = next(file for file in repository.read().files if file.path.startswith("scenes/"))
    repository.content_path(file.sha256).write_bytes(bytes(file.num_bytes))
    assert list(repository.find_damaged(repository.read(), lambda done: None)) == [file]
    repository.quarantine(file)
    back_up(data, ledger_url, repository)
    assert list(repository.find_damaged(repository.read(), lambda done: None)) == []


def test_damaged_bake_does_not_affect_others_in_a_backup(
    data: Path, ledger_url: str, repository: BackupRepository, tmp_path: Path
) -> None:
    back_up(data, ledger_url, repository)
    file = next(file for file in repository.read().files if "/visibility/c/" in file.path)
    repository.content_path(file.sha256).write_bytes(bytes(file.num_bytes))
    elsewhere, url = tmp_path / "elsewhere", f"sqlite:///{tmp_path / 'elsewhere.db'}"
    _, damaged = restore(repository, None, elsewhere, url)
    assert damaged == [f"{file.content_key} is damaged in the backup: bake or import it again"]
    assert not (elsewhere / file.content_key).exists()
    assert load_scene(scene_path(elsewhere, SCENE.id)).id == SCENE.id
    with closing(open_service(elsewhere, url)) as service:
        (status,) = service.bakes()
        assert service.submit(SCENE.id, RECIPE) == status.id
        assert service.get(status.id).state == "queued"  # a new request bakes it again


def test_damaged_ledger_is_not_restored(
    data: Path, ledger_url: str, repository: BackupRepository, tmp_path: Path
) -> None:
    back_up(data, ledger_url, repository)
    ledger = repository.read().ledger
    repository.content_path(ledger.sha256).write_bytes(bytes(ledger.num_bytes))
    elsewhere = tmp_path / "elsewhere"
    with pytest.raises(BackupError, match=r"the database is damaged in the backup"):
        restore(repository, None, elsewhere, f"sqlite:///{elsewhere / 'relume.db'}")
    assert (elsewhere / "restoring.json").exists()


def test_nothing_is_overwritten(data: Path, ledger_url: str, repository: BackupRepository, tmp_path: Path) -> None:
    back_up(data, ledger_url, repository)
    with pytest.raises(BackupError, match="is not empty"):
        restore(repository, None, data, f"sqlite:///{tmp_path / 'new.db'}")
    empty = tmp_path / "empty"
    with pytest.raises(BackupError, match="is not empty"):
        restore(repository, None, empty, ledger_url)
    assert list(empty.iterdir()) == []
    with pytest.raises(BackupError, match="something other than relume backups"):
        back_up(data, ledger_url, BackupRepository(data))


@pytest.mark.parametrize("ledger_url", ["sqlite"], indirect=True)
def test_snapshot_with_outside_paths_is_rejected(
    data: Path, ledger_url: str, repository: BackupRepository, tmp_path: Path
) -> None:
    name = back_up(data, ledger_url, repository)
    file = repository.folder / "snapshots" / f"{name}.json"
    document = json.loads(file.read_text())
    for path in ("../out", "/etc/out", "scenes/../../out", "a//b", "", "a\0b"):
        document["files"][0]["path"] = path
        file.write_text(json.dumps(document))
        with pytest.raises(BackupError, match="not a snapshot of relume"):
            restore(repository, None, tmp_path / "elsewhere", f"sqlite:///{tmp_path / 'new.db'}")
        assert not (tmp_path / "elsewhere").exists(), path
