"""A call with an idempotency key acts once, on repetition and across servers."""

import threading
from typing import Any

import pytest
from fastapi.testclient import TestClient
from problems import parse_problem
from session_client import Baked
from sqlalchemy import func, select, update

from relume_server.auth.tables import AuditRow
from relume_server.idempotency import _Digest
from relume_server.persistence import idempotency
from relume_server.persistence.idempotency import Answer, IdempotencyStore
from relume_server.persistence.tables import IdempotencyRow
from relume_worker.database.clock import epoch_s

OBJ = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


def keyed(key: str) -> dict[str, str]:
    return {"Idempotency-Key": key}


@pytest.fixture
def render(baked: Baked) -> dict[str, Any]:
    return {"bake": baked.bake, "view": "front", "format": "png", "looks": [{}]}


def test_repeated_call_gets_the_same_response(client: TestClient, render: dict[str, Any]) -> None:
    first, again = (client.post("/api/renders", json=render, headers=keyed("one")) for _ in range(2))
    assert (again.status_code, again.content, again.headers["location"]) == (
        first.status_code, first.content, first.headers["location"],
    )  # fmt: skip
    assert again.headers["content-type"] == "application/json"
    assert "idempotency-replayed" not in first.headers
    assert again.headers["idempotency-replayed"] == "true"
    assert len(client.get("/api/renders").json()) == 1
    other = client.post("/api/renders", json=render, headers=keyed("two"))
    assert other.headers["location"] != first.headers["location"]
    assert client.post("/api/renders", json=render).status_code == 202
    assert len(client.get("/api/renders").json()) == 3
    with client.app.state.services.bakes.ledger.sessions() as session:
        lines = session.scalar(select(func.count()).select_from(AuditRow).where(AuditRow.what == "POST /api/renders"))
    assert lines == 3


def test_different_call_with_the_same_key_is_rejected(client: TestClient, render: dict[str, Any], baked: Baked) -> None:
    assert client.post("/api/renders", json=render, headers=keyed("one")).status_code == 202
    other = client.post("/api/renders", json={**render, "format": "exr"}, headers=keyed("one"))
    assert other.status_code == 422
    assert parse_problem(other)["type"].endswith("key-reused")
    elsewhere = client.post("/api/comparisons", json=render, headers=keyed("one"))
    assert parse_problem(elsewhere)["type"].endswith("key-reused")
    assert client.get("/api/comparisons").json() == []


def test_rejected_call_may_be_retried(client: TestClient, render: dict[str, Any]) -> None:
    wrong = {**render, "view": "back"}
    assert client.post("/api/renders", json=wrong, headers=keyed("one")).status_code == 422
    assert client.post("/api/renders", json=render, headers=keyed("one")).status_code == 202


@pytest.mark.parametrize("key", ["", "with blank", "x" * 201, "\xe9"])
def test_invalid_keys_are_rejected(client: TestClient, render: dict[str, Any], key: str) -> None:
    answer = client.post("/api/renders", json=render, headers={"Idempotency-Key": key.encode("latin-1")})
    assert answer.status_code == 422
    assert parse_problem(answer)["detail"].startswith("Idempotency-Key is ")
    assert client.get("/api/renders").json() == []


def test_forms_are_equal_under_any_boundary(client: TestClient) -> None:
    def send(content: bytes, boundary: str) -> Any:
        head = f'--{boundary}\r\nContent-Disposition: form-data; name="scene"; filename="a.obj"\r\n\r\n'
        body = head.encode() + content + f"\r\n--{boundary}--\r\n".encode()
        kind = {"Content-Type": f"multipart/form-data; boundary={boundary}"}
        return client.post("/api/scenes", content=body, headers={**kind, **keyed("a-scene")})

    first, again = send(OBJ, "one"), send(OBJ, "another")
    assert first.status_code == again.status_code == 201, first.text
    assert again.headers["idempotency-replayed"] == "true"
    assert again.json() == first.json()
    assert len(client.get("/api/scenes").json()) == 1
    assert send(OBJ + b"v 2 2 2\n", "another").status_code == 422


def test_calls_without_a_body_and_with_an_unread_body(client: TestClient, baked: Baked) -> None:
    for body in (None, b"{}"):
        url, key = f"/api/scenes/{baked.scene}/comments", keyed(f"a comment {body is None}".replace(" ", "-"))
        pin = {"bake": baked.bake, "view": "front", "x": 1, "y": 2, "size": [160, 96], "text": "a"}
        answers = [client.post(url, json=pin, headers=key) for _ in range(2)]
        assert [answer.status_code for answer in answers] == [201, 201]
        assert answers[0].json()["id"] == answers[1].json()["id"]
        resumed = [client.post("/api/renders/0123456789abcdef/resume", content=body, headers=key) for _ in range(2)]
        assert all(parse_problem(answer)["type"].endswith("key-reused") for answer in resumed)


def test_pending_call_is_not_repeated(
    client: TestClient, render: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    renders, is_at_it, may_go_on = client.app.state.services.renders, threading.Event(), threading.Event()
    submit = renders.submit

    def slow(*arguments: Any, **keywords: Any) -> str:
        is_at_it.set()
        assert may_go_on.wait(30)
        return str(submit(*arguments, **keywords))

    monkeypatch.setattr(renders, "submit", slow)
    answers: list[Any] = []
    first = threading.Thread(
        target=lambda: answers.append(client.post("/api/renders", json=render, headers=keyed("one")))
    )
    first.start()
    assert is_at_it.wait(30)
    meanwhile = client.post("/api/renders", json=render, headers=keyed("one"))
    assert meanwhile.status_code == 409
    assert (parse_problem(meanwhile)["type"][-11:], meanwhile.headers["retry-after"]) == ("in-progress", "1")
    may_go_on.set()
    first.join(30)
    assert answers[0].status_code == 202
    again = client.post("/api/renders", json=render, headers=keyed("one"))
    assert again.json()["id"] == answers[0].json()["id"]


@pytest.fixture
def store(client: TestClient) -> IdempotencyStore:
    idempotency_store: IdempotencyStore = client.app.state.services.idempotency
    return idempotency_store


ANSWER = Answer(201, "/api/scenes/0", "application/json", b"{}")


def test_keys_are_per_client_and_expire(client: TestClient, store: IdempotencyStore) -> None:
    assert store.claim("ann", "one", "a") is None
    store.end("ann", "one", ANSWER)
    assert store.claim("bob", "one", "b") is None
    before = store.claim("ann", "one", "a")
    assert before is not None
    assert before.answer == ANSWER
    with client.app.state.services.bakes.ledger.sessions.begin() as session:
        session.execute(update(IdempotencyRow).values(created=epoch_s() - idempotency.RETENTION_S - 1))
    assert store.claim("ann", "one", "a") is None


def test_call_of_a_dead_server_is_repeated(client: TestClient, store: IdempotencyStore) -> None:
    assert store.claim("ann", "one", "a") is None
    with client.app.state.services.bakes.ledger.sessions.begin() as session:
        host_id, _, nonce, number = session.scalars(select(IdempotencyRow.owner)).one().split("/")
        session.execute(update(IdempotencyRow).values(owner=f"{host_id}/{2**22 + 1}/{nonce}/{number}"))
    assert store.claim("ann", "one", "a") is None
    with client.app.state.services.bakes.ledger.sessions.begin() as session:
        session.execute(update(IdempotencyRow).values(created=epoch_s() - idempotency.ABANDONED_S - 1))
    assert store.claim("ann", "one", "a") is None


def test_oldest_responses_are_evicted_and_large_ones_become_redirects(
    client: TestClient, store: IdempotencyStore, monkeypatch: pytest.MonkeyPatch, render: dict[str, Any]
) -> None:
    monkeypatch.setattr(idempotency, "MAX_EACH", 3)
    for key in "abcde":
        assert store.claim("ann", key, key) is None
        store.end("ann", key, ANSWER)
    assert store.claim("ann", "e", "e") is not None
    assert store.claim("ann", "a", "a") is None
    monkeypatch.setattr(idempotency, "MAX_BODY_BYTES", 10)
    first, again = (
        client.post("/api/renders", json=render, headers=keyed("one"), follow_redirects=False) for _ in range(2)
    )
    assert (again.status_code, again.headers["location"]) == (303, first.headers["location"])


def test_form_digest_does_not_depend_on_chunks() -> None:
    def digest(boundary: bytes, *parts: bytes) -> str:
        new_digest = _Digest(boundary)
        for chunk in parts:
            new_digest.add(chunk)
        return new_digest.hex()

    def body(boundary: bytes, text: bytes = b"text") -> bytes:
        return b"--" + boundary + b"\r\na\r\n--" + boundary + text + b"\r\n--" + boundary + b"--"

    whole = digest(b"xyz", body(b"xyz"))
    for at in range(len(body(b"xyz"))):
        assert digest(b"xyz", body(b"xyz")[:at], body(b"xyz")[at:]) == whole
    assert digest(b"other", *(bytes([byte]) for byte in body(b"other"))) == whole
    assert digest(b"xyz", body(b"xyz", b"texts")) != whole
