"""Webhooks: allowed hosts, signatures, retries; nothing reaches a private address."""

from __future__ import annotations

import hashlib
import hmac
import ipaddress
import json
import socket
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import pytest
from fastapi.testclient import TestClient
from pydantic import ValidationError
from session_client import Baked
from test_comparisons import is_done, wait_until

from relume.core.errors import ParameterError
from relume_server.jobs import webhooks as module
from relume_server.jobs.webhooks import WebhookHosts, Webhooks, is_public
from relume_server.settings import Settings

SECRET = "0123456789abcdef"


class Target:
    """A server that records its messages and answers with the given statuses, the last one for ever."""

    def __init__(self, *statuses: int) -> None:
        self.statuses, self.messages = list(statuses), list[tuple[str, dict[str, str], bytes]]()
        target = self

        class Handler(BaseHTTPRequestHandler):
            def do_POST(self) -> None:
                body = self.rfile.read(int(self.headers["Content-Length"]))
                status = target.statuses[min(len(target.messages), len(target.statuses) - 1)]
                target.messages.append((self.path, dict(self.headers), body))
                self.send_response(status)
                self.send_header("Location", f"http://127.0.0.1:{target.port}/elsewhere")
                self.end_headers()

            do_GET = do_POST  # noqa: N815

            def log_message(self, *_: Any) -> None:
                pass

        self._server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.port = self._server.server_port
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    def close(self) -> None:
        self._server.shutdown()
        self._server.server_close()


@pytest.fixture
def open_target() -> Iterator[Callable[..., Target]]:
    targets: list[Target] = []

    def open_one(*statuses: int) -> Target:
        targets.append(Target(*statuses))
        return targets[-1]

    yield open_one
    for target in targets:
        target.close()


@pytest.fixture(autouse=True)
def _quick_retries(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "RETRY_DELAYS_S", (0.01, 0.01, 0.01))


def deliver(hosts: Sequence[str], url: str) -> None:
    """Send a message and wait for its end."""
    webhooks = Webhooks(hosts, SECRET)
    webhooks._deliver(url, b"{}")
    webhooks.close()


@pytest.fixture
def settings(settings: Settings) -> Settings:
    return Settings(**{**dict(settings), "webhook_hosts": ["127.0.0.0/8", "localhost"], "webhook_secret": SECRET})


@pytest.mark.parametrize("fails", [False, True])
def test_a_render_that_has_ended_is_announced_with_a_signature(
    client: TestClient, baked: Baked, open_target: Callable[..., Target], fails: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = open_target(500, 204)
    if fails:
        monkeypatch.setattr("relume_server.batch.frames.write_image", lambda *_: 1 / 0)
    webhook = f"http://127.0.0.1:{target.port}/hook?farm=1"
    request = {"bake": baked.bake, "view": "front", "looks": [{}], "format": "png", "webhook": webhook, "name": "Shot"}
    url = client.post("/api/renders", json=request).headers["location"]
    state = wait_until(client, url, is_done)["state"]
    deadline = time.monotonic() + 20
    while len(target.messages) < 2 and time.monotonic() < deadline:
        time.sleep(0.01)
    (_, _, first), (path, headers, body) = target.messages
    assert (path, headers["Host"], first) == ("/hook?farm=1", f"127.0.0.1:{target.port}", body)
    message = json.loads(body)
    assert (message["event"], message["state"], message["url"]) == ("render.ended", "failed" if fails else "ready", url)
    assert (message["name"], message["state"], message["total"], bool(message["problem"])) == ("Shot", state, 1, fails)
    time_s, digest = (part.split("=")[1] for part in headers["X-Relume-Signature"].split(","))
    assert abs(int(time_s) - time.time()) < 60
    assert digest == hmac.new(SECRET.encode(), f"{time_s}.".encode() + body, hashlib.sha256).hexdigest()


@pytest.mark.parametrize(
    "webhook",
    [
        "http://evil.example/x", "http://10.0.0.1/", "http://169.254.169.254/latest", "http://[::1]/", "file:///etc/passwd",
        "ftp://localhost/", "http://user:pass@localhost/", "http://localhost@evil.example/", "http://localhost#@a/",
        "http:///x", "localhost", "http://localhost:99999/", "http://localhost/\r\nX: y", "http://local host/", "",
        "http://localhost\\@evil.example/", "http://2130706433/", "http://0x7f.1/", "http://[::ffff:10.0.0.1]/",
    ],
)  # fmt: skip
def test_other_addresses_are_rejected(client: TestClient, baked: Baked, webhook: str) -> None:
    request = {"bake": baked.bake, "view": "front", "looks": [{}], "format": "png", "webhook": webhook}
    answer = client.post("/api/renders", json=request)
    assert answer.status_code == 422
    assert "webhook is" in answer.json()["detail"]


def test_without_hosts_there_are_no_webhooks_and_hosts_need_a_secret() -> None:
    with pytest.raises(ParameterError, match="RELUME_WEBHOOK_HOSTS"):
        Webhooks([], SECRET).check("https://hooks.example.com/")
    Webhooks([], SECRET).check(None)
    Webhooks(["hooks.example.com"], SECRET).check("https://Hooks.Example.com.:8443/x")
    with pytest.raises(ValidationError, match="at least 16 characters, because RELUME_WEBHOOK_HOSTS is set"):
        Settings(webhook_hosts=["hooks.example.com"], webhook_secret="short")


def test_a_name_with_a_private_address_gets_nothing(
    open_target: Callable[..., Target], caplog: pytest.LogCaptureFixture
) -> None:
    target = open_target(204)
    url = f"http://localhost:{target.port}/"
    deliver(["localhost"], url)
    assert target.messages == []
    assert "not public and not in RELUME_WEBHOOK_HOSTS" in caplog.text
    deliver(["localhost", "127.0.0.1", "::1"], f"http://127.0.0.1:{target.port}/")
    assert len(target.messages) == 1


def test_a_name_is_resolved_once_and_all_its_addresses_count(
    open_target: Callable[..., Target], monkeypatch: pytest.MonkeyPatch
) -> None:
    target, answers, real = open_target(204), [["127.0.0.1"], ["10.0.0.1"]], socket.getaddrinfo

    def resolve(host: str, port: int, *arguments: Any, **options: Any) -> list[Any]:
        if host != "hook.example":
            return real(host, port, *arguments, **options)
        addresses = answers.pop(0)
        return [(socket.AF_INET, socket.SOCK_STREAM, 6, "", (address, port)) for address in addresses]

    monkeypatch.setattr(module.socket, "getaddrinfo", resolve)
    deliver(["hook.example", "127.0.0.1"], f"http://hook.example:{target.port}/")
    assert target.messages[0][1]["Host"] == f"hook.example:{target.port}"
    assert answers == [["10.0.0.1"]]
    answers[:] = [["93.184.216.34", "127.0.0.1"]] * 4
    deliver(["hook.example"], f"http://hook.example:{target.port}/")
    assert (len(target.messages), answers) == (1, [])


def test_redirects_are_not_followed(open_target: Callable[..., Target], caplog: pytest.LogCaptureFixture) -> None:
    target = open_target(302)
    deliver(["127.0.0.1"], f"http://127.0.0.1:{target.port}/")
    assert [path for path, _, _ in target.messages] == ["/"] * 4
    assert "status 302, redirects are not followed" in caplog.text


def test_a_target_that_hangs_or_drips_is_given_up(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(module, "TIMEOUT_S", 0.1)
    monkeypatch.setattr(module, "RETRY_DELAYS_S", ())
    ended = threading.Event()
    with socket.create_server(("127.0.0.1", 0)) as server:

        def drip() -> None:
            connection, _ = server.accept()
            with connection:
                while not ended.wait(0.02):
                    try:
                        connection.send(b"H")
                    except OSError:
                        return

        thread = threading.Thread(target=drip, daemon=True)
        thread.start()
        deliver(["127.0.0.1"], f"http://127.0.0.1:{server.getsockname()[1]}/")
        ended.set()
        thread.join(5)
    assert "a webhook of 127.0.0.1 was not accepted" in caplog.text


@pytest.mark.parametrize(
    ("address", "expected"),
    [
        ("93.184.216.34", True), ("127.0.0.1", False), ("10.1.2.3", False), ("169.254.169.254", False),
        ("100.64.0.1", False), ("0.0.0.0", False), ("224.0.0.1", False), ("255.255.255.255", False),
        ("2606:2800:220:1::1", True), ("::1", False), ("fe80::1", False), ("fd00::1", False), ("::ffff:8.8.8.8", False),
        ("2002:7f00:1::", False), ("64:ff9b::7f00:1", False), ("2001:0:1::", False), ("ff02::1", False),
    ],
)  # fmt: skip
def test_public_addresses(address: str, expected: bool) -> None:
    assert is_public(ipaddress.ip_address(address)) is expected
    assert WebhookHosts.parse([]).allows_address(ipaddress.ip_address(address)) is expected
