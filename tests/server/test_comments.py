"""Comments: text pinned to a pixel, with a snapshot of the picture."""

from __future__ import annotations

import asyncio
import base64
import io
from collections.abc import Collection, Mapping
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from coroutines import run_in_thread
from fastapi.testclient import TestClient
from PIL import Image
from problems import parse_problem
from server_fakes import SIZE
from session_client import ROOM_FIELDS, Baked, open_session

from relume.core.errors import DiskFullError
from relume_server.collaboration.comment_sync import CommentSync
from relume_server.persistence import comment_store


def image(size: tuple[int, int] = (640, 384), form: str = "JPEG") -> str:
    written = io.BytesIO()
    Image.fromarray(np.full((size[1], size[0], 3), 90, np.uint8)).save(written, form)
    return base64.b64encode(written.getvalue()).decode()


@pytest.fixture
def path(baked: Baked) -> str:
    return f"/api/scenes/{baked.scene}/comments"


@pytest.fixture
def pin(baked: Baked) -> dict[str, Any]:
    return {"bake": baked.bake, "view": "front", "x": 12, "y": 40, "size": SIZE, "text": "Too bright here"}


def test_comment_is_saved_listed_resolved_reopened_and_deleted(
    client: TestClient, path: str, pin: dict[str, Any]
) -> None:
    sent = {**pin, "text": "  Too <b>bright</b>\nhere ", "author": "Ann", "picture": image()}
    answer = client.post(path, json=sent)
    assert answer.status_code == 201
    made = answer.json()
    assert answer.headers["location"] == f"{path}/{made['id']}"
    assert (made["text"], made["author"], made["resolved"], made["x"], made["size"]) == (
        "Too <b>bright</b>\nhere", "Ann", False, 12, list(SIZE),
    )  # fmt: skip
    client.post(path, json={**pin, "text": "And here"})
    first, second = client.get(path).json()
    assert first == made
    assert (second["text"], second["author"], second["picture"]) == ("And here", "Guest", None)
    picture = client.get(made["picture"])
    assert picture.headers["content-type"] == "image/webp"
    with Image.open(io.BytesIO(picture.content)) as stored_image:
        assert (stored_image.format, stored_image.size) == ("WEBP", (320, 192))

    comment_url = f"{path}/{made['id']}"
    assert client.patch(comment_url, json={"resolved": True}).status_code == 204
    settled = client.get(path).json()[0]
    assert (settled["resolved"], settled["resolved_by"]) == (True, "somebody")
    client.patch(comment_url, json={"resolved": False})
    assert not client.get(path).json()[0]["resolved"]
    assert client.delete(comment_url).status_code == 204
    assert [each["text"] for each in client.get(path).json()] == ["And here"]
    assert parse_problem(client.delete(comment_url))["status"] == 404
    assert parse_problem(client.patch(comment_url, json={"resolved": True}))["status"] == 404
    assert parse_problem(client.get(made["picture"]))["status"] == 404


def test_comments_are_deleted_with_their_scene(
    client: TestClient, baked: Baked, path: str, pin: dict[str, Any]
) -> None:
    client.post(path, json=pin)
    store = client.app.state.services.comments  # type: ignore[attr-defined]
    assert len(store.list(baked.scene)) == 1
    client.delete(f"/api/scenes/{baked.scene}")
    assert store.list(baked.scene) == []
    assert parse_problem(client.get(path))["status"] == 404


WRONG: list[tuple[dict[str, Any], str]] = [
    ({"text": "  "}, "give text"),
    ({"text": "a\x00b"}, "control characters"),
    ({"text": "a" * 2001}, "2000"),
    ({"author": "\n"}, "printable"),
    ({"x": 160}, "a pixel"),
    ({"view": "top"}, "front"),
    ({"bake": "0" * 16}, "no bake"),
    ({"picture": "no"}, "Base64"),
    ({"picture": base64.b64encode(b"<svg/>").decode()}, "PNG, JPEG or WebP"),
    ({"picture": image((16, 16), "GIF")}, "PNG, JPEG or WebP"),
    ({"picture": image((1025, 16))}, "at most 1024"),
    ({"picture": image()[:-400]}, "PNG, JPEG or WebP"),
    ({"camera": {"to_world": [0.0] * 16, "yfov": 40.0}}, "to_world"),
]


def test_invalid_comments_are_rejected_with_a_reason(client: TestClient, path: str, pin: dict[str, Any]) -> None:
    for wrong, word in WRONG:
        answer = client.post(path, json={**pin, **wrong})
        assert parse_problem(answer)["status"] in (404, 422), wrong
        assert word in answer.text
    assert client.get(path).json() == []


def test_comments_per_scene_are_limited(
    client: TestClient, path: str, pin: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(comment_store, "MAX_PER_SCENE", 1)
    client.post(path, json=pin)
    assert parse_problem(client.post(path, json=pin))["status"] == 503


def test_participants_are_notified(client: TestClient, baked: Baked, path: str, pin: dict[str, Any]) -> None:
    with open_session(client, baked.bake, opening=ROOM_FIELDS) as ann:
        ann.text("hello")
        made = client.post(path, json=pin).json()
        assert ann.text("comments") == {"type": "comments"}
        client.delete(f"{path}/{made['id']}")
        ann.text("comments")


def test_rooms_are_notified_of_comments_on_another_server(
    client: TestClient, baked: Baked, pin: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    services = client.app.state.services  # type: ignore[attr-defined]
    news = CommentSync(services.live.rooms, services.comments.marks, services.threads.queries)

    def look() -> None:
        client.portal.call(news.refresh)  # type: ignore[union-attr]

    # the server's own loop polls at most once
    monkeypatch.setattr("relume_server.collaboration.comment_sync.POLL_INTERVAL_S", 1e9)
    notified: list[str] = []
    monkeypatch.setattr(services.live.rooms, "notify_comment", notified.append)
    with open_session(client, baked.bake, opening=ROOM_FIELDS) as ann:
        ann.text("hello")
        look()
        other = comment_store.CommentStore(services.comments._sessions)
        made = other.add(baked.scene, pin, "There", "Bob", None)
        look()
        look()
        assert notified == [baked.scene]
        other.resolve(baked.scene, made.id, "Bob")
        look()
        other.resolve(baked.scene, made.id, None)
        look()
        other.delete(baked.scene, made.id)
        look()
        look()
        assert notified == [baked.scene] * 4


def test_outage_is_resolved_by_a_query_and_not_by_the_end_of_all_rooms(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("relume_server.collaboration.comment_sync.POLL_INTERVAL_S", 0.0)
    polls = [{"lost"}, set(), set(), {"scene"}]
    num_messages: list[int] = []

    def scenes() -> set[str]:
        num_messages.append(len(caplog.records))
        if not polls:
            raise asyncio.CancelledError
        return polls.pop(0)

    def marks(names: Collection[str]) -> Mapping[str, object]:
        if "lost" in names:
            raise DiskFullError("the database")
        return dict.fromkeys(names, 1)

    with ThreadPoolExecutor(1) as threads, pytest.raises(asyncio.CancelledError):
        run_in_thread(CommentSync(SimpleNamespace(scenes=scenes), marks, threads).run())  # type: ignore[arg-type]
    assert num_messages == [0, 1, 1, 1, 2]
    assert caplog.records[-1].getMessage() == "new comments cannot be read: resolved"
