"""Range requests on file downloads."""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any, cast

import pytest
from anyio.from_thread import start_blocking_portal
from fastapi import FastAPI
from fastapi.testclient import TestClient

from relume_server import errors
from relume_server.api.session import _accept
from relume_server.io.downloads import Download

DATA = bytes(range(100))


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    path, app = tmp_path_factory.mktemp("downloads") / "a.bin", FastAPI()
    path.write_bytes(DATA)
    errors.install(app, lambda path: [])

    @app.get("/file", response_class=Download)
    def get_file() -> Download:
        return Download(path)

    with TestClient(app) as client:
        yield client


@pytest.mark.parametrize(
    ("asked", "given"),
    [
        ("bytes=3-5", DATA[3:6]),
        ("bytes=90-", DATA[90:]),
        ("bytes=90-999", DATA[90:]),
        ("bytes=-7", DATA[-7:]),
        ("Bytes = 0-0", DATA),  # units contain no spaces
        ("bytes=0-0", DATA[:1]),
    ],
)
def test_requested_range_is_returned(client: TestClient, asked: str, given: bytes) -> None:
    answer = client.get("/file", headers={"Range": asked})
    assert (answer.status_code, answer.content) == (200 if given == DATA else 206, given)


@pytest.mark.parametrize(
    "asked", ["bytes=5-1", "bytes=abc", "items=0-5", "bytes=", "bytes=1", "bytes=0-1,5-4", "x", "bytes=0-" + "9" * 5000]
)
def test_invalid_ranges_are_ignored(client: TestClient, asked: str) -> None:
    answer = client.get("/file", headers={"Range": asked})
    assert (answer.status_code, answer.content) == (200, DATA)


@pytest.mark.parametrize("asked", ["bytes=100-", "bytes=-0", "bytes=999999999999999999999999999-"])
def test_range_beyond_the_end_is_a_problem(client: TestClient, asked: str) -> None:
    answer = client.get("/file", headers={"Range": asked})
    assert (answer.status_code, answer.headers["content-range"]) == (416, "bytes */100")
    assert answer.headers["content-type"] == "application/problem+json"
    assert answer.json()["type"] == "urn:relume:problem:range"
    assert "100 bytes" in answer.json()["detail"]


def test_client_that_disconnects_during_accept_is_not_an_error() -> None:
    async def accept(subprotocol: str | None) -> None:
        raise OSError("gone")

    socket = SimpleNamespace(accept=accept, scope={"subprotocols": []})
    with start_blocking_portal() as portal:  # a browser's loop may run in this thread
        portal.call(_accept, cast("Any", None), cast("Any", socket), "0" * 16)
