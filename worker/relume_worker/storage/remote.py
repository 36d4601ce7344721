"""Object storage: S3 or compatible, or a folder shared by machines.

scenes/<id>/…       files, as in the data directory
bakes/<id>.zarr/…   a Zarr store that other programs can open
parts/<id>/…        partial results of unfinished bakes, see `relume_worker.storage.partial_uploads`
whole/<name>.json   index of such a folder: files with size and SHA-256; written last, so it exists only if complete
"""

from __future__ import annotations

import hashlib
import json
import logging
import os
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from datetime import timedelta
from functools import lru_cache
from pathlib import Path
from typing import Any

import obstore
from obstore.exceptions import BaseError
from obstore.store import from_url

from relume.core.errors import ParameterError, StorageError
from relume.core.filesystem import atomic_write
from relume_worker.database.failures import Outage

SCHEMES = ("s3://", "file://")
NUM_THREADS = 4
MAX_RETRIES, RETRY_S = 6, 20
PIECE_BYTES = 8 << 20
MAX_INDEX_BYTES = 64 << 20

log = logging.getLogger(__name__)
storage_outage = Outage(log, "the object storage")


class ObjectStorage:
    """A location in object storage. Thread-safe."""

    def __init__(self, url: str) -> None:
        """
        Args:
            url: s3://bucket/prefix, or file:///folder; keys and endpoint from AWS_… variables.
        Raises:
            ParameterError: it is neither.
        """
        if not url.startswith(SCHEMES):
            raise ParameterError("RELUME_STORAGE", url, "a URL such as s3://bucket/prefix or file:///folder")
        options: dict[str, Any] = {"mkdir": True} if url.startswith("file") else _s3_options()
        try:
            self._store = from_url(url, **options)
        except (BaseError, ValueError, OSError) as error:
            reason = str(error).partition("\n")[0][:200]  # the library's own details follow
            raise ParameterError("RELUME_STORAGE", url, f"a URL that works ({reason})") from None

    def put(self, name: str, folder: Path, files: Sequence[str]) -> None:
        """Upload a folder under a name atomically; replaces an existing one.

        Args:
            name: such as scenes/<id>. folder: folder with the files.
            files: paths in the folder.
        Raises:
            StorageError: the storage does not answer, or refuses.
        """
        with _translate_errors(), ThreadPoolExecutor(NUM_THREADS) as threads:

            def put(file: str) -> dict[str, Any]:
                path = folder / file
                with path.open("rb") as stream:
                    sha256 = hashlib.file_digest(stream, "sha256").hexdigest()
                obstore.put(self._store, f"{name}/{file}", path)
                return {"path": file, "bytes": path.stat().st_size, "sha256": sha256}

            entries = list(threads.map(put, files))
            obstore.put(self._store, _index(name), json.dumps({"files": entries}).encode())

    def has(self, name: str) -> bool:
        """True if a folder is there and complete. Raises StorageError."""
        with _translate_errors():
            try:
                obstore.head(self._store, _index(name))
            except FileNotFoundError:
                return False
        return True

    def fetch(self, name: str, folder: Path) -> bool:
        """Fetch a folder, verifying each file; files of an interrupted fetch are kept.

        Args:
            name: name of the uploaded folder. folder: folder to fetch into; created if missing.
        Returns:
            True if there is one of that name.
        Raises:
            StorageError: the storage does not answer, or its data are damaged.
        """
        with _translate_errors(), ThreadPoolExecutor(NUM_THREADS) as threads:
            entries = self._entries(name)
            if entries is None:
                return False
            list(threads.map(lambda entry: self._fetch(name, folder, *entry), entries))
        return True

    def put_files(self, name: str, folder: Path, files: Sequence[str]) -> None:
        """Upload some files of a folder under a name, without an index.

        Args:
            name: such as parts/<id>. folder: folder with the files. files: paths in the folder.
        Raises:
            StorageError: the storage does not answer, or refuses.
        """
        if not files:  # without a request nothing is known of the storage
            return
        with _translate_errors(), ThreadPoolExecutor(NUM_THREADS) as threads:
            list(threads.map(lambda file: obstore.put(self._store, f"{name}/{file}", folder / file), files))

    def fetch_files(self, name: str, folder: Path) -> None:
        """Fetch all files under a name without an index. Raises StorageError."""
        with _translate_errors(), ThreadPoolExecutor(NUM_THREADS) as threads:
            keys = [item["path"] for page in obstore.list(self._store, f"{name}/") for item in page]
            files = [key.partition(f"{name}/")[2] for key in keys]
            if any({"", ".", ".."} & set(file.split("/")) for file in files):
                raise StorageError(f"{name} in the object storage names files outside of it")
            list(threads.map(lambda file: self._stream(f"{name}/{file}", folder / file), files))

    def put_document(self, name: str, document: Any) -> None:
        """Upload JSON under a name. Raises StorageError."""
        with _translate_errors():
            obstore.put(self._store, f"{name}.json", json.dumps(document).encode())

    def document(self, name: str) -> Any:
        """JSON under a name; None if there is none. Raises StorageError."""
        with _translate_errors():
            try:
                return json.loads(bytes(obstore.get(self._store, f"{name}.json").bytes()))
            except FileNotFoundError:
                return None
            except ValueError as error:
                raise StorageError(f"{name} in the object storage is unreadable") from error

    def num_bytes(self, name: str) -> int:
        """Size of a folder in bytes; 0 if there is none. Raises StorageError."""
        with _translate_errors():
            return sum(size for _, size, _ in self._entries(name) or ())

    def delete(self, name: str) -> None:
        """Delete a folder, if it exists. Raises StorageError."""
        with _translate_errors():
            keys = [_index(name), *(item["path"] for page in obstore.list(self._store, f"{name}/") for item in page)]
            for key in keys:  # the index first: a partly deleted folder does not exist
                try:
                    obstore.delete(self._store, key)
                except FileNotFoundError:
                    continue

    def _entries(self, name: str) -> list[tuple[str, int, str]] | None:
        try:
            index_object = obstore.get(self._store, _index(name))
        except FileNotFoundError:
            return None
        if index_object.meta["size"] > MAX_INDEX_BYTES:
            raise StorageError(f"the list of {name} in the object storage is too long to be relume's")
        try:
            files = json.loads(bytes(index_object.bytes()))["files"]
            entries = [(str(entry["path"]), int(entry["bytes"]), str(entry["sha256"])) for entry in files]
        except (ValueError, KeyError, TypeError) as error:
            raise StorageError(f"the list of {name} in the object storage is unreadable") from error
        if any({"", ".", ".."} & set(path.split("/")) for path, _, _ in entries):
            raise StorageError(f"the list of {name} in the object storage names files outside of it")
        return entries

    def _fetch(self, name: str, folder: Path, file: str, num_bytes: int, sha256: str) -> None:
        target = folder / file
        if target.exists() and target.stat().st_size == num_bytes:
            return
        self._stream(f"{name}/{file}", target, sha256)

    def _stream(self, key: str, target: Path, sha256: str | None = None) -> None:
        """Fetch one file, which appears when complete; verified if its digest is known."""
        target.parent.mkdir(parents=True, exist_ok=True)
        digest = hashlib.sha256()
        with atomic_write(target) as unfinished:
            with unfinished.open("wb") as stream:
                for piece in obstore.get(self._store, key).stream(min_chunk_size=PIECE_BYTES):
                    digest.update(piece)
                    stream.write(piece)
            if sha256 not in (None, digest.hexdigest()):
                raise StorageError(f"{key} is damaged in the object storage; delete the bake and bake again")


def _s3_options() -> dict[str, Any]:
    """S3 options; an endpoint without TLS is allowed if it is configured."""
    is_plain = os.environ.get("AWS_ENDPOINT_URL", "").startswith("http://")
    waits = {"connect_timeout": timedelta(seconds=5), "timeout": timedelta(minutes=10)}
    return {
        "retry_config": {"max_retries": MAX_RETRIES, "retry_timeout": timedelta(seconds=RETRY_S)},
        "client_options": {**waits, "allow_http": is_plain},
    }


def _index(name: str) -> str:
    return f"whole/{name}.json"


@contextmanager
def _translate_errors() -> Iterator[None]:
    """Translate errors into general messages; the storage's own, which contain URLs, are logged once."""
    began_s = time.monotonic()
    try:
        yield
    except (BaseError, FileNotFoundError) as error:  # in the index, but missing
        first_line = str(error).split("\n")[0]  # the rest is for debugging
        storage_outage.report_failure(StorageError(first_line), began_s)
        raise StorageError("the object storage cannot be used now; try again later") from error
    storage_outage.report_recovered(began_s)


@lru_cache(maxsize=4)
def _open_storage(url: str) -> ObjectStorage:
    return ObjectStorage(url)


def get_storage() -> ObjectStorage | None:
    """Storage of `RELUME_STORAGE`, which worker processes inherit; None if it is not set."""
    url = os.environ.get("RELUME_STORAGE", "")
    return _open_storage(url) if url else None
