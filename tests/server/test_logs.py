"""Log lines and their context, as text and as JSON."""

from __future__ import annotations

import asyncio
import json
import logging
import urllib.request
import warnings
from collections.abc import Iterator
from typing import Any

import pytest
from coroutines import run_in_thread
from fastapi.testclient import TestClient
from running_server import running_server
from server_fakes import Control
from session_client import Baked, open_session
from websockets.sync.client import connect

from relume_cli.serve import announce
from relume_server.settings import Settings
from relume_server.telemetry.logs.context import BAKE, REQUEST, USER
from relume_server.telemetry.logs.setup import Format, set_up

log = logging.getLogger("server.somewhere")


@pytest.fixture(autouse=True)
def _as_it_was() -> Iterator[None]:
    root, others = logging.getLogger(), [logging.getLogger(name) for name in ("uvicorn.error", "websockets")]
    before, levels = root.handlers, [logger.level for logger in (root, *others)]
    yield
    root.handlers = before
    for logger, level in zip((root, *others), levels, strict=True):
        logger.setLevel(level)  # clears the loggers' level caches


def logged(capsys: pytest.CaptureFixture[str], form: Format, say: Any) -> str:
    set_up(form, "warning")  # asyncio logs below that level
    say()
    return capsys.readouterr().err


def test_json_lines_have_context(capsys: pytest.CaptureFixture[str]) -> None:
    def say() -> None:
        REQUEST.set("r1")
        BAKE.set("b1")
        try:
            raise ValueError("why")
        except ValueError:
            log.exception("it “failed”\nfor %s", "Ann")

    line = json.loads(logged(capsys, "json", lambda: run_in_thread(asyncio.to_thread(say))))
    assert line.pop("time").endswith("+00:00")
    assert "ValueError: why" in line.pop("trace")
    assert (line.pop("level"), line.pop("logger")) == ("error", "server.somewhere")
    assert line == {"message": "it “failed”\nfor Ann", "request": "r1", "bake": "b1"}


def test_listening_address_is_logged_in_json(capsys: pytest.CaptureFixture[str]) -> None:
    said = logged(capsys, "json", lambda: announce("relume listens on http://127.0.0.1:8420/", "json"))
    assert json.loads(said)["message"] == "relume listens on http://127.0.0.1:8420/"
    said = logged(capsys, "plain", lambda: announce("relume listens on http://127.0.0.1:8420/", "plain"))
    assert said == "relume listens on http://127.0.0.1:8420/\n"


def test_plain_lines_end_with_context(capsys: pytest.CaptureFixture[str]) -> None:
    def say() -> None:
        log.warning("nothing is known")
        USER.set("Ann")
        log.warning("the user is")

    said = logged(capsys, "plain", lambda: run_in_thread(asyncio.to_thread(say)))
    assert said == "WARNING server.somewhere: nothing is known\nWARNING server.somewhere: the user is [user=Ann]\n"


def test_no_library_bypasses_the_log_format(client: TestClient, capsys: pytest.CaptureFixture[str]) -> None:
    set_up("plain", "info")
    client.get("/%0aERROR%20server%3a%20all%20is%20lost%1b[2J%e2%80%ae")
    said = [line for line in capsys.readouterr().err.splitlines() if "all" in line]
    assert said
    assert all(line.startswith("INFO ") and line.isprintable() for line in said)


def test_traceback_is_complete_and_indented(capsys: pytest.CaptureFixture[str]) -> None:
    def say() -> None:
        try:
            raise ValueError("why\nERROR server: all is lost\x1b[2J")
        except ValueError:
            log.exception("it failed\r\nERROR server: so did this")

    first, *trace = logged(capsys, "plain", say).splitlines()
    assert first == r"ERROR server.somewhere: it failed\r\nERROR server: so did this"
    assert all(line.startswith("    ") and line.isprintable() for line in trace)
    assert r"    ERROR server: all is lost\x1b[2J" in trace


def test_library_warnings_use_the_log_format(capsys: pytest.CaptureFixture[str]) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        logging.captureWarnings(False)  # as in a process before set_up
        said = logged(capsys, "json", lambda: warnings.warn("overflow", RuntimeWarning, stacklevel=1))
        logging.captureWarnings(False)
    assert "overflow" in json.loads(said)["message"]


def test_requests_and_sessions_are_logged_without_tokens(
    client: TestClient, baked: Baked, capsys: pytest.CaptureFixture[str]
) -> None:
    set_up("json", "info")
    client.get("/livez?resume=secret", headers={"X-Request-ID": "r7"})
    with open_session(client, baked.bake, opening={"resume": "secret"}, headers={"X-Request-ID": "r8"}) as session:
        hello = session.text("hello")
        session.exact(0)
    # without the test client's lines
    said = [line for line in capsys.readouterr().err.splitlines() if '"relume_server.' in line]
    assert "secret" not in "".join(said)
    lines = {line["request"]: line for line in map(json.loads, said)}
    assert (lines["r7"]["method"], lines["r7"]["path"], lines["r7"]["status"]) == ("GET", "/livez", 200)
    assert (lines["r8"]["session"], lines["r8"]["bake"]) == (hello["session"], baked.bake)


@pytest.mark.parametrize("level", ["debug", "info"])
def test_no_logger_writes_secrets(
    settings: Settings, control: Control, capsys: pytest.CaptureFixture[str], level: str
) -> None:
    """With the real server, whose libraries log connections."""
    set_up("json", level)
    settings.login = True
    secret = "s3cret" * 4
    with running_server(settings, control) as running:
        token = running.app.state.services.access.tokens.add("Ann", "admin")
        path = f"{running.baked_url()}?room_prefix={secret[:8]}"
        headers = {"Authorization": f"Bearer {token}", "Cookie": f"relume_token={token}"}
        opening = {"type": "open", "room": secret, "participant_token": secret, "resume": secret, "name": secret}
        with connect(path, subprotocols=["relume.v2"], additional_headers=headers, proxy=None) as session:
            session.send(json.dumps(opening))
            hello = json.loads(session.recv())
        with connect(f"{running.baked_url()}?resume={secret}", subprotocols=["relume.v2"], proxy=None) as refused:
            refused.close()
        url = f"http://127.0.0.1:{running.port}/livez?resume={secret}"
        with urllib.request.urlopen(urllib.request.Request(url, headers=headers)) as answer:
            assert answer.status == 200
    said = capsys.readouterr().err
    assert '"path": "/livez"' in said
    for each in (secret, token, hello["resume"], hello["room"]["participant_token"], hello["room"]["view_token"]):
        assert each not in said
