"""Large JSON documents, which are parsed on the event loop: of editors, one at a time."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Callable

import pytest
from coroutines import run_in_thread
from fastapi.testclient import TestClient
from starlette.types import Receive, Scope, Send

from relume_server.auth.roles import KEY, Caller, Role
from relume_server.io.large_documents import DOCUMENTS_AT_ONCE, LargeDocumentMiddleware
from relume_server.request_limits import MAX_JSON_BYTES

Bearer = Callable[..., dict[str, str]]
LARGE = str(MAX_JSON_BYTES + 1)


@pytest.mark.parametrize(("role", "status"), [("view", 413), ("edit", 422)])
@pytest.mark.parametrize("is_chunked", [False, True])
def test_only_editors_send_large_documents(
    client: TestClient, bearer: Bearer, role: str, status: int, is_chunked: bool
) -> None:
    body = b'{"x": "' + b"1" * MAX_JSON_BYTES + b'"}'
    headers = {"content-type": "application/json"} | bearer(role)
    answer = client.post("/api/renders/looks", content=iter([body]) if is_chunked else body, headers=headers)
    assert answer.status_code == status


@pytest.mark.parametrize(
    ("path", "length", "expected"),
    [
        ("/api/renders/looks", LARGE, {"Ann": 1, "Bob": 1}),
        ("/api/renders", None, {"Ann": 1, "Bob": 1}),
        ("/api/renders", str(MAX_JSON_BYTES), {"Ann": 3, "Bob": 3}),
        ("/api/bakes", None, {"Ann": 3, "Bob": 3}),
    ],
)
def test_large_documents_of_one_user_are_parsed_one_after_another(
    path: str, length: str | None, expected: dict[str, int]
) -> None:
    active, peak = Counter[str](), Counter[str]()

    async def app(scope: Scope, receive: Receive, send: Send) -> None:
        user = scope[KEY].name
        active[user] += 1
        peak[user] = max(peak[user], active[user])
        await asyncio.sleep(0)
        active[user] -= 1

    async def send_all() -> None:
        middleware = LargeDocumentMiddleware(app, max_per_user=1, weights={})
        headers = [] if length is None else [(b"content-length", length.encode())]
        scope = {"type": "http", "method": "POST", "path": path, "headers": headers}
        calls = [scope | {KEY: Caller(name, Role.EDIT, "", "token")} for name in ["Ann", "Bob"] * 3]
        await asyncio.gather(*(middleware(call, None, None) for call in calls))  # type: ignore[arg-type]

    run_in_thread(send_all())
    assert DOCUMENTS_AT_ONCE > 2
    assert peak == expected
