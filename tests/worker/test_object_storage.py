"""Scenes and bakes in object storage: one machine bakes, another opens, and local copies respect the cache limit."""

from __future__ import annotations

import gc
import json
import os
import shutil
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import boto3
import obstore
import pytest
import zarr
from fake_method import RECIPE, FakeMethod, tiny_scene
from moto.server import ThreadedMotoServer
from test_processes import tree_hash, wait_for
from zarr.storage import ObjectStore

from relume.core.errors import ParameterError, StorageError
from relume.scene.scene_folder import load_scene
from relume.store.bake_protocol import Recipe
from relume.store.reader import Reader, open_store
from relume.store.run_bake import bake_in_process
from relume_server.errors import make_problem
from relume_worker.backup.create import create_backup
from relume_worker.backup.repository import BackupRepository
from relume_worker.paths import scene_path
from relume_worker.runner import TAKEN_OVER_MESSAGE
from relume_worker.scenes import delete_scene, register_scene
from relume_worker.service import BakeService
from relume_worker.status import BakeStatus
from relume_worker.storage import fetch_if_missing, get_storage, open_cached
from relume_worker.storage.remote import ObjectStorage

SCENE = tiny_scene()


@pytest.fixture(scope="module")
def s3() -> Iterator[str]:
    """An S3-compatible endpoint."""
    server = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    yield f"http://{host}:{port}"
    server.stop()


@pytest.fixture(params=["s3", pytest.param("a shared folder", marks=pytest.mark.slow)])
def storage(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ObjectStorage:
    """The storage of `RELUME_STORAGE`, empty."""
    url = f"file://{tmp_path / 'shared'}"
    if request.param == "s3":
        keys = {"AWS_ENDPOINT_URL": request.getfixturevalue("s3"), "AWS_REGION": "us-east-1"}
        for name, value in {**keys, "AWS_ACCESS_KEY_ID": "key", "AWS_SECRET_ACCESS_KEY": "secret"}.items():
            monkeypatch.setenv(name, value)
        bucket = f"bucket{abs(hash(request.node.nodeid)) % 10**12}"
        boto3.client("s3", endpoint_url=keys["AWS_ENDPOINT_URL"], region_name="us-east-1").create_bucket(Bucket=bucket)
        url = f"s3://{bucket}/team"
    monkeypatch.setenv("RELUME_STORAGE", url)
    configured = get_storage()
    assert configured is not None
    return configured


@pytest.fixture
def shared_ledger(tmp_path: Path) -> str:
    """A ledger outside all data folders."""
    return f"sqlite:///{tmp_path / 'ledger.db'}"


def machine(tmp_path: Path, name: str, url: str) -> BakeService:
    """A machine with its own data folder."""
    return BakeService(tmp_path / name, url, methods={"fake": FakeMethod()})


def bake(service: BakeService, recipe: Recipe = RECIPE) -> Path:
    """Bake and return the path of the store."""
    with service.subscribe(service.submit(SCENE.id, recipe)) as changes:
        assert list(changes)[-1].state == "ready"
    return service.store_path(service.submit(SCENE.id, recipe))


def test_one_machine_imports_another_bakes_and_the_first_opens_it(
    tmp_path: Path, storage: ObjectStorage, shared_ledger: str
) -> None:
    with (
        closing(machine(tmp_path, "server", shared_ledger)) as server,
        machine(tmp_path, "worker", shared_ledger) as far,
    ):
        register_scene(server.data_dir, server.ledger, SCENE)
        path = bake(far)
        here = server.store_path(path.stem)
        assert (path.exists(), here.exists()) == (True, False)
        assert server.submit(SCENE.id, RECIPE) == path.stem  # not baked again
        assert server.get(path.stem).state == "ready"
        reader = open_cached(here, open_store)
        assert reader.path == here
        assert tree_hash(here) == tree_hash(path)
        assert load_scene(scene_path(far.data_dir, SCENE.id)).id == SCENE.id
        assert not list(server.data_dir.rglob(".unfinished-*"))


def bake_half(tmp_path: Path, name: str, url: str) -> tuple[BakeStatus, int]:
    """A machine that bakes some tasks and is stopped: the bake's status and the number of its started tasks."""
    log = tmp_path / f"{name}.log"
    with BakeService(tmp_path / name, url, methods={"fake": FakeMethod(delay_s=0.2, log=str(log))}) as service:
        register_scene(service.data_dir, service.ledger, SCENE)
        identity = service.submit(SCENE.id, RECIPE)
        wait_for(log, 4)
        status = service.get(identity)
    return status, len(log.read_text().splitlines())


def is_as_expected(path: Path, tmp_path: Path) -> bool:
    return tree_hash(path) == tree_hash(bake_in_process(FakeMethod(), SCENE, RECIPE, tmp_path / "expected.zarr"))


def test_partial_bake_resumes_on_another_machine(tmp_path: Path, storage: ObjectStorage, shared_ledger: str) -> None:
    bake_half(tmp_path, "first", shared_ledger)
    log = tmp_path / "second.log"
    with BakeService(tmp_path / "second", shared_ledger, methods={"fake": FakeMethod(log=str(log))}) as second:
        done = len(second.ledger.finished_tasks(second.bakes()[0].id))
        assert done >= 2
        path = bake(second)
        assert second.get(path.stem).problem is None
        assert len(log.read_text().splitlines()) == len(second.ledger.finished_tasks(path.stem)) - done
    assert is_as_expected(path, tmp_path)
    assert not list((second.data_dir / "bakes" / "staging").iterdir())
    assert not [item for page in obstore.list(storage._store, "parts/") for item in page]


def test_bake_restarts_with_a_message_if_parts_are_missing(
    tmp_path: Path, storage: ObjectStorage, shared_ledger: str
) -> None:
    status, _ = bake_half(tmp_path, "first", shared_ledger)
    storage.delete(f"parts/{status.id}")
    assert bake_half(tmp_path, "second", shared_ledger)[0].problem == TAKEN_OVER_MESSAGE
    with machine(tmp_path, "first", shared_ledger) as service:  # its local parts do not match the ledger
        assert is_as_expected(bake(service), tmp_path)


def test_stored_bake_is_a_readable_zarr_store(tmp_path: Path, storage: ObjectStorage, shared_ledger: str) -> None:
    with machine(tmp_path, "one", shared_ledger) as service:
        register_scene(service.data_dir, service.ledger, SCENE)
        path = bake(service)
    object_store = ObjectStore(storage._store, read_only=True)
    opened = zarr.open_array(object_store, path=f"bakes/{path.name}/views/0/visibility", mode="r")
    assert (opened[:] == open_store(path).read("views/0/visibility")).all()


def test_closed_bakes_are_evicted_from_the_local_cache(
    tmp_path: Path, storage: ObjectStorage, shared_ledger: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with machine(tmp_path, "one", shared_ledger) as service:
        register_scene(service.data_dir, service.ledger, SCENE)
        recipes = [replace(RECIPE, num_lights=lights) for lights in (24, 25, 26)]
        first = bake(service, recipes[0])
        size = sum(file.stat().st_size for file in first.rglob("*") if file.is_file())
        monkeypatch.setenv("RELUME_STORAGE_CACHE_BYTES", str(int(2.2 * size)))
        opened: Reader | None = open_cached(first, open_store)
        second, third = bake(service, recipes[1]), bake(service, recipes[2])
        assert [path.exists() for path in (first, second, third)] == [True, False, True]  # the first is open
        assert opened is not None
        assert opened.read("views/0/visibility").any()
        del opened
        gc.collect()
        assert open_cached(second, open_store).shape("views/0/visibility")  # fetched again
        assert [path.exists() for path in (first, second, third)] == [False, True, True]


def test_earlier_local_bakes_are_uploaded_at_start(
    tmp_path: Path, storage: ObjectStorage, shared_ledger: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    url = os.environ["RELUME_STORAGE"]
    monkeypatch.delenv("RELUME_STORAGE")
    with machine(tmp_path, "one", shared_ledger) as service:
        register_scene(service.data_dir, service.ledger, SCENE)
        path = bake(service)
    assert not storage.has(f"bakes/{path.name}")
    monkeypatch.setenv("RELUME_STORAGE", url)
    with machine(tmp_path, "one", shared_ledger) as service:
        (storing,) = [thread for thread in service._threads if thread.name == "relume-storage"]
        storing.join(60)
    assert storage.has(f"bakes/{path.name}")
    assert storage.has(f"scenes/{SCENE.id}")


def test_incomplete_or_damaged_uploads_are_not_opened(
    tmp_path: Path, storage: ObjectStorage, shared_ledger: str
) -> None:
    with machine(tmp_path, "one", shared_ledger) as service:
        register_scene(service.data_dir, service.ledger, SCENE)
        path = bake(service)
    name, files = f"bakes/{path.name}", ["zarr.json", "missing"]
    shutil.copytree(path, tmp_path / "copy")
    storage.delete(name)
    with pytest.raises(StorageError):
        storage.put(name, path, files)  # ends before it is complete
    assert not storage.has(name)
    changed = tmp_path / "copy" / "zarr.json"
    storage.put(name, path, ["zarr.json"])
    shutil.rmtree(path)
    changed.write_text(changed.read_text().replace("fake", "fork", 1))
    obstore.put(storage._store, f"{name}/zarr.json", changed)
    with pytest.raises(StorageError, match="is damaged in the object storage"):
        fetch_if_missing(path)
    assert not path.exists()


def test_unavailable_storage_is_reported_and_the_bake_can_resume(
    tmp_path: Path, shared_ledger: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
        monkeypatch.setenv(name, "key")
    monkeypatch.setenv("AWS_ENDPOINT_URL", "http://127.0.0.1:9")
    monkeypatch.setattr("relume_worker.storage.remote.MAX_RETRIES", 0)
    with machine(tmp_path, "one", shared_ledger) as service:
        register_scene(service.data_dir, service.ledger, SCENE)
        monkeypatch.setenv("RELUME_STORAGE", "s3://away/team")
        with service.subscribe(service.submit(SCENE.id, RECIPE)) as changes:
            failed = list(changes)[-1]
        assert failed.state == "failed"
        assert failed.problem == "the object storage cannot be used now; try again later"
        with pytest.raises(StorageError) as failure:
            fetch_if_missing(service.store_path("0" * 16))
        assert make_problem(failure.value).status == 503
        monkeypatch.setenv("RELUME_STORAGE", f"file://{tmp_path / 'shared'}")
        path = bake(service)
    assert (tmp_path / "shared" / "whole" / "bakes" / f"{path.name}.json").exists()
    said = [record.getMessage() for record in caplog.records if "127.0.0.1:9" in record.getMessage()]
    assert len(said) == 1
    assert said[0].startswith("the object storage does not answer (")
    assert "answers again" in caplog.text


def test_deleted_scene_is_deleted_from_the_storage(tmp_path: Path, storage: ObjectStorage, shared_ledger: str) -> None:
    with machine(tmp_path, "one", shared_ledger) as service:
        register_scene(service.data_dir, service.ledger, SCENE)
        path = bake(service)
        assert storage.has(f"scenes/{SCENE.id}")
        delete_scene(service.data_dir, service.ledger, SCENE.id)
    assert not storage.has(f"scenes/{SCENE.id}")
    assert not storage.has(f"bakes/{path.name}")
    assert not storage.fetch(f"bakes/{path.name}", tmp_path / "nothing")


def test_backup_includes_everything_in_the_storage(tmp_path: Path, storage: ObjectStorage, shared_ledger: str) -> None:
    with machine(tmp_path, "one", shared_ledger) as service:
        register_scene(service.data_dir, service.ledger, SCENE)
        shutil.rmtree(bake(service))
        snapshot = create_backup(service.data_dir, service.ledger._engine, BackupRepository(tmp_path / "backups"))
    assert snapshot.left_out == ()


@pytest.mark.parametrize("path", ["../out", "/out", "a//b", ""])
def test_file_lists_with_outside_paths_are_rejected(tmp_path: Path, path: str) -> None:
    (tmp_path / "shared" / "whole" / "scenes").mkdir(parents=True)
    document = {"files": [{"path": path, "bytes": 1, "sha256": "0" * 64}]}
    (tmp_path / "shared" / "whole" / "scenes" / "one.json").write_text(json.dumps(document))
    with pytest.raises(StorageError, match="outside of it"):
        ObjectStorage(f"file://{tmp_path / 'shared'}").fetch("scenes/one", tmp_path / "here")
    assert not (tmp_path / "here").exists()


@pytest.mark.parametrize("url", ["ftp://host/folder", "bucket", "s3://"])
def test_unsupported_storages_are_rejected_with_a_reason(url: str) -> None:
    with pytest.raises(ParameterError, match="RELUME_STORAGE"):
        ObjectStorage(url)
