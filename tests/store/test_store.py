"""Stores: values are read back, equal input gives equal files, and damage never becomes zeros."""

import hashlib
import json
import shutil
import threading
from pathlib import Path

import numpy as np
import pytest

from relume.core.errors import ChunkDamagedError, SchemaVersionError, StoreDeletedError, StoreError, StoreNotFoundError
from relume.store import schema
from relume.store.bake_protocol import ArraySpec
from relume.store.publish import manifest_digests, publish
from relume.store.reader import open_store
from relume.store.writer import StoreWriter, create_store

ROWS = 100
SPEC = ArraySpec("views/front/visibility", (ROWS, 7), "uint8", (8, 7), (32, 7))


def verify_manifest(path: Path) -> None:
    """Compare every file of a published store with its SHA-256. Raises ChunkDamagedError."""
    for name, sha256 in manifest_digests(path).items():
        with (path / name).open("rb") as stream:
            if hashlib.file_digest(stream, "sha256").hexdigest() != sha256:
                raise ChunkDamagedError(name, "its SHA-256 differs from the manifest")


def bits() -> np.ndarray:
    values = np.random.default_rng(5).integers(0, 256, (ROWS, 7), dtype=np.uint8)
    values[32:64] = 0  # a shard of zeros
    return values


def build(folder: Path, order: tuple[int, ...] = (0, 32, 64, 96)) -> Path:
    staging, target = folder / "staging", folder / "store"
    writer = create_store(staging, {"method": "fake", "num_lights": 7})
    writer.create_array(SPEC)
    for start in order:
        writer.write(SPEC.path, bits()[start : start + 32], start)
    writer.write_whole("views/front/depth", np.linspace(0, 1, 5000, dtype=np.float32))
    publish(staging, target)
    return target


def shards(store: Path) -> list[Path]:
    return sorted(p for p in (store / SPEC.path / "c").rglob("*") if p.is_file())


def tree_hash(folder: Path) -> str:
    digest = hashlib.sha256()
    for file in sorted(p for p in folder.rglob("*") if p.is_file()):
        digest.update(str(file.relative_to(folder)).encode() + b"\0" + file.read_bytes())
    return digest.hexdigest()


def test_a_reopened_store_has_the_written_values(tmp_path: Path) -> None:
    reader = open_store(build(tmp_path))
    assert reader.attributes["num_lights"] == 7
    assert reader.shape(SPEC.path) == (ROWS, 7)
    np.testing.assert_array_equal(reader.read(SPEC.path), bits())
    np.testing.assert_array_equal(reader.read(SPEC.path, 30, 97), bits()[30:97])
    np.testing.assert_array_equal(reader.read("views/front/depth"), np.linspace(0, 1, 5000, dtype=np.float32))


def test_arrays_without_a_plan_have_shards_of_several_chunks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(schema, "UNANNOUNCED_CHUNK_BYTES", 4000)
    values = np.random.default_rng(1).random((70_000, 1), np.float32)
    create_store(tmp_path / "s", {}).write_whole("depth", values)
    publish(tmp_path / "s", tmp_path / "t")
    assert sum(p.is_file() for p in (tmp_path / "t" / "depth" / "c").rglob("*")) == 5
    np.testing.assert_array_equal(open_store(tmp_path / "t").read("depth"), values)


def test_same_input_gives_the_same_files_in_any_order_of_writing(tmp_path: Path) -> None:
    first, second = build(tmp_path / "a"), build(tmp_path / "b", (96, 32, 0, 64))
    assert tree_hash(first) == tree_hash(second)


def test_shards_of_zeros_are_files_too(tmp_path: Path) -> None:
    assert len(shards(build(tmp_path))) == 4


def test_leftovers_of_an_interrupted_write_are_not_published(tmp_path: Path) -> None:
    clean = tree_hash(build(tmp_path / "a"))
    staging = tmp_path / "b" / "staging"
    create_store(staging, {"method": "fake", "num_lights": 7}).create_array(SPEC)
    (staging / SPEC.path / "c" / "0").mkdir(parents=True)
    (staging / SPEC.path / "c" / "0" / "0.1234.partial").write_bytes(b"half")
    assert tree_hash(build(tmp_path / "b")) == clean


def test_readers_in_several_threads_agree(tmp_path: Path) -> None:
    reader, wrong = open_store(build(tmp_path)), []

    def read(start: int) -> None:
        for _ in range(10):
            if not np.array_equal(reader.read(SPEC.path, start, start + 40), bits()[start : start + 40]):
                wrong.append(start)

    threads = [threading.Thread(target=read, args=(start,)) for start in (0, 20, 40, 60)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert wrong == []


def test_flipped_byte_is_damage(tmp_path: Path) -> None:
    store = build(tmp_path)
    data = bytearray(shards(store)[0].read_bytes())
    data[20] ^= 0xFF
    shards(store)[0].write_bytes(data)
    with pytest.raises(ChunkDamagedError, match="views/front/visibility is damaged"):
        open_store(store).read(SPEC.path)
    with pytest.raises(ChunkDamagedError):
        verify_manifest(store)
    np.testing.assert_array_equal(open_store(store).read(SPEC.path, 32, 100), bits()[32:])


@pytest.mark.parametrize("keep", [0, 10, -1])
def test_a_truncated_shard_is_damage_on_opening_and_on_reading(tmp_path: Path, keep: int) -> None:
    store = build(tmp_path)
    reader = open_store(store)
    shards(store)[2].write_bytes(shards(store)[2].read_bytes()[:keep])
    with pytest.raises(ChunkDamagedError):
        open_store(store)
    with pytest.raises(ChunkDamagedError):
        reader.read(SPEC.path)


def test_missing_shard_is_damage_not_zeros(tmp_path: Path) -> None:
    store = build(tmp_path)
    reader = open_store(store)
    shards(store)[1].unlink()
    with pytest.raises(ChunkDamagedError, match="missing"):
        reader.read(SPEC.path)
    with pytest.raises(ChunkDamagedError):
        open_store(store)


def test_a_store_deleted_under_a_reader_is_deleted_not_damaged(tmp_path: Path) -> None:
    store = build(tmp_path)
    opened, fresh = open_store(store), open_store(store)
    opened.read(SPEC.path, 0, 32)
    shutil.rmtree(store)
    for reader in (opened, fresh):
        with pytest.raises(StoreDeletedError, match="deleted while it was open"):
            reader.read(SPEC.path)


def test_unfinished_bake_is_not_published(tmp_path: Path) -> None:
    writer = create_store(tmp_path / "staging", {})
    writer.create_array(SPEC)
    writer.write(SPEC.path, bits()[:32], 0)
    with pytest.raises(ChunkDamagedError):
        publish(tmp_path / "staging", tmp_path / "store")
    with pytest.raises(StoreNotFoundError):
        open_store(tmp_path / "store")
    with pytest.raises(StoreNotFoundError):
        open_store(tmp_path / "staging")


def edit_json(path: Path, **changes: object) -> None:
    """Change metadata and its size in the manifest, as an attacker would."""
    store = next(parent for parent in path.parents if (parent / "manifest.json").exists())
    path.write_text(json.dumps({**json.loads(path.read_text()), **changes}))
    manifest = json.loads((store / "manifest.json").read_text())
    for entry in manifest["files"]:
        entry["bytes"] = (store / entry["path"]).stat().st_size
    (store / "manifest.json").write_text(json.dumps(manifest))


def test_another_schema_version_is_rejected(tmp_path: Path) -> None:
    store = build(tmp_path)
    edit_json(store / "zarr.json", attributes={"schema_version": 99})
    with pytest.raises(SchemaVersionError, match="99"):
        open_store(store)


@pytest.mark.parametrize(
    "changes",
    [
        {"shape": [10**15, 7]},
        {"shape": [-1, 7]},
        {"shape": [10**6, 7]},
        {"shape": ["x", 7]},
        {"shape": []},
        {"data_type": "object"},
        {"chunk_grid": {"name": "regular", "configuration": {"chunk_shape": [10**12, 7]}}},
        {"codecs": []},
        {"codecs": [{"name": "bytes"}]},
    ],
)
def test_absurd_metadata_is_rejected_before_allocation(tmp_path: Path, changes: dict[str, object]) -> None:
    store = build(tmp_path)
    edit_json(store / SPEC.path / "zarr.json", **changes)
    with pytest.raises(StoreError):
        open_store(store)


@pytest.mark.parametrize("field", ["codecs", "index_codecs"])
@pytest.mark.parametrize(
    "names",
    [
        ["bytes", "gzip", "crc32c"],
        ["bytes", "numcodecs.zfpy"],
        ["transpose", "bytes", "zstd", "crc32c"],
        ["bytes", "zstd"],  # without a checksum
        [],
        None,
    ],
)
def test_unknown_codecs_are_not_used(tmp_path: Path, field: str, names: list[str] | None) -> None:
    store = build(tmp_path)
    document = json.loads((store / SPEC.path / "zarr.json").read_text())
    configuration = document["codecs"][0]["configuration"]
    configuration[field] = None if names is None else [{"name": name, "configuration": {}} for name in names]
    edit_json(store / SPEC.path / "zarr.json", codecs=document["codecs"])
    with pytest.raises(StoreError, match=r"other codecs|unreadable metadata"):
        open_store(store)


@pytest.mark.parametrize(
    "text", ["", "[]", "{", '{"files": 3}', '{"files": [{"path": "../x", "bytes": 1}]}', "[" * 9999]
)
def test_an_unreadable_manifest_is_rejected(tmp_path: Path, text: str) -> None:
    store = build(tmp_path)
    (store / "manifest.json").write_text(text)
    with pytest.raises(StoreError):
        open_store(store)


@pytest.mark.parametrize("path", ["../x", "/x", "a//b", "a/../b", ".x", "a/c/b", "", "a b", "zarr.json"])
def test_array_paths_stay_inside_the_store(tmp_path: Path, path: str) -> None:
    writer = create_store(tmp_path, {})
    with pytest.raises(StoreError):
        writer.write_whole(path, np.zeros(3, np.float32))


def test_partial_shards_are_rejected(tmp_path: Path) -> None:
    writer = create_store(tmp_path, {})
    writer.create_array(SPEC)
    with pytest.raises(StoreError, match="split a shard"):
        writer.write(SPEC.path, bits()[:16], 0)
    with pytest.raises(StoreError, match="do not fit"):
        writer.write(SPEC.path, bits()[:32].astype(np.float32), 0)
    with pytest.raises(StoreError, match="not created"):
        StoreWriter(tmp_path).write("other", bits(), 0)


def test_object_arrays_are_rejected(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match="numbers only"):
        create_store(tmp_path, {}).write_whole("x", np.array([{}], dtype=object))


def test_empty_arrays_survive(tmp_path: Path) -> None:
    create_store(tmp_path / "s", {}).write_whole("views/back/depth", np.zeros((0, 3), np.float32))
    publish(tmp_path / "s", tmp_path / "t")
    assert open_store(tmp_path / "t").read("views/back/depth").shape == (0, 3)
