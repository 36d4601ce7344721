"""Authentication by a token in a header or a cookie, or by a trusted proxy."""

from __future__ import annotations

import logging
import re
import time
from collections.abc import Callable
from typing import Any

import pytest
from coroutines import run_in_thread
from fastapi.testclient import TestClient
from postgres import make_unavailable_error

from relume.core.errors import DatabaseDamagedError
from relume_server.auth.roles import Caller, Role
from relume_server.auth.rules import RULES, SOCKET
from relume_server.auth.services import AuthServices
from relume_server.settings import Settings

Bearer = Callable[..., dict[str, str]]


def calls(at_least: Role) -> list[tuple[str, str]]:
    """Calls that need at least a role, with their ids filled in."""
    calls_of_role = []
    for path, roles in RULES.items():
        filled = re.sub(r"\{\w+\}", "0123456789abcdef", path)
        calls_of_role += [(method, filled) for method, role in roles.items() if role >= at_least and method != SOCKET]
    return calls_of_role


def me(client: TestClient) -> dict[str, Any]:
    """The caller's identity as the server knows it, without the server's own fields."""
    identity: dict[str, Any] = client.get("/api/me").json()
    assert identity.pop("allow_viewer_comments") is False
    return identity


def test_anonymous_callers_are_rejected_everywhere(client: TestClient) -> None:
    for method, path in calls(Role.VIEW):
        refused = client.request(method, path)
        assert refused.status_code == 401, (method, path)
        assert refused.headers["www-authenticate"] == "Bearer"
        assert refused.json()["type"] == "urn:relume:problem:login"
        assert "a login is required; send a token" in refused.json()["detail"]


def test_viewers_change_nothing(client: TestClient, bearer: Bearer) -> None:
    headers = bearer("view", "Vera")
    for method, path in calls(Role.EDIT):
        refused = client.request(method, path, headers=headers)
        assert refused.status_code == 403, (method, path)
        assert refused.json()["detail"].startswith("Vera has the role view, this needs ")
    assert client.get("/api/scenes", headers=headers).status_code == 200


def test_editors_edit_and_only_admins_read_the_audit(client: TestClient, bearer: Bearer) -> None:
    editor, admin = bearer("edit"), bearer("admin")
    assert client.put("/api/looks/Red", json={}, headers=editor).status_code == 201
    assert client.get("/api/audit", headers=editor).status_code == 403
    assert client.get("/api/audit", headers=admin).status_code == 200


def test_public_routes_stay_public(client: TestClient) -> None:
    for path in ("/livez", "/readyz", "/api/openapi.json"):
        assert client.get(path).status_code == 200
    assert me(client) == {"login": True, "name": "", "role": "anyone", "auth_method": "nobody"}
    assert client.get("/").status_code == 503  # the editor, which is not built here


def test_body_is_not_read_before_authentication(client: TestClient) -> None:
    def body() -> Any:
        raise AssertionError("the body was asked for")
        yield b""

    assert client.post("/api/looks/Red", content=body(), headers={"content-length": "10"}).status_code == 401


@pytest.mark.parametrize(
    "sent", ["nonsense", "relume__", "relume_000000000000_x", "relume_0_0_0", "rélume_1", "x" * 10_000, ""]
)
def test_wrong_tokens_are_rejected(client: TestClient, sent: str) -> None:
    refused = client.get("/api/scenes", headers={"Authorization": f"Bearer {sent}".encode()})
    assert refused.status_code == 401
    assert client.get("/api/scenes", headers={"Cookie": f"relume_token={sent}".encode()}).status_code == 401


def test_secret_authenticates_not_the_id(client: TestClient, bearer: Bearer) -> None:
    token = bearer("edit")["Authorization"]
    other = token[:-1] + ("a" if token[-1] != "a" else "b")
    assert client.get("/api/scenes", headers={"Authorization": token}).status_code == 200
    assert client.get("/api/scenes", headers={"Authorization": other}).status_code == 401


def test_secrets_are_not_stored(access: AuthServices, settings: Settings) -> None:
    secret = access.tokens.add("Ann", "edit").split("_", 2)[2]
    database_bytes = b"".join(path.read_bytes() for path in settings.data.glob("relume.db*"))
    assert b"Ann" in database_bytes
    assert secret.encode() not in database_bytes


def test_tokens_expire_and_are_revoked(
    client: TestClient, access: AuthServices, bearer: Bearer, monkeypatch: Any
) -> None:
    short, long = bearer("edit", "short", days=1), bearer("edit", "long")
    assert client.get("/api/scenes", headers=short).status_code == 200
    now = time.time()
    monkeypatch.setattr("relume_server.auth.tokens.time.time", lambda: now + 86_401)
    assert client.get("/api/scenes", headers=short).status_code == 401
    assert client.get("/api/scenes", headers=long).status_code == 200
    access.tokens.revoke("long")
    assert client.get("/api/scenes", headers=long).status_code == 401


def test_token_that_another_process_revokes_is_soon_rejected(
    client: TestClient, access: AuthServices, bearer: Bearer, monkeypatch: Any
) -> None:
    headers = bearer("edit", "Ann")
    assert client.get("/api/scenes", headers=headers).status_code == 200
    AuthServices(client.app.state.services.looks._sessions, Settings()).tokens.revoke("Ann")
    monkeypatch.setattr("relume_server.auth.tokens.time.monotonic", lambda: time.perf_counter() + 1e9)
    assert client.get("/api/scenes", headers=headers).status_code == 401


def test_browsers_log_in_and_out_with_a_cookie(client: TestClient, access: AuthServices) -> None:
    token = access.tokens.add("Ann", "edit")
    assert client.post("/api/login", json={"token": "relume_000000000000_x"}).status_code == 401
    answer = client.post("/api/login", json={"token": token})
    assert answer.status_code == 204
    cookie = answer.headers["set-cookie"].lower()
    assert "httponly" in cookie
    assert "samesite=strict" in cookie
    assert "secure" not in cookie  # plain HTTP
    assert me(client) == {"login": True, "name": "Ann", "role": "edit", "auth_method": "token"}
    assert client.post("/api/logout").status_code == 204
    assert client.get("/api/me").json()["auth_method"] == "nobody"


@pytest.mark.parametrize("beside", ['prefs={"a":1,"b":2}', "a[b]=1", "a@b=1", "novalue", "name=Zo\xeb", "path=/x"])
def test_cookies_of_other_programs_on_the_host_do_not_hide_the_login(
    client: TestClient, access: AuthServices, beside: str
) -> None:
    cookie = f"{beside}; relume_token={access.tokens.add('Ann', 'edit')}; {beside}".encode("latin-1")
    answer = client.get("/api/me", headers=[(b"cookie", cookie)])
    assert answer.json()["name"] == "Ann"


def test_redirected_requests_are_not_audited_as_changes(
    client: TestClient, access: AuthServices, bearer: Bearer
) -> None:
    headers = bearer("admin")
    assert client.delete("/api/looks/Red/", headers=headers, follow_redirects=False).status_code == 307
    assert not [line for line in access.audit.list() if line.status]


def test_another_site_cannot_use_the_cookie(client: TestClient, access: AuthServices) -> None:
    client.post("/api/login", json={"token": access.tokens.add("Ann", "edit")})
    refused = client.put("/api/looks/Red", json={}, headers={"Origin": "https://evil.example"})
    assert refused.status_code == 403
    assert refused.json()["type"] == "urn:relume:problem:forbidden-origin"


class TestProxy:
    """A proxy at 10.0.0.0/8 that authenticates callers."""

    @pytest.fixture
    def settings(self, settings: Settings) -> Settings:
        settings.trusted_proxies, settings.proxy_roles = ["10.0.0.0/8"], {"Ann": "edit"}
        settings.user_header = "X-Forwarded-User"
        return settings

    def at(self, client: TestClient, address: str) -> TestClient:
        return TestClient(client.app, client=(address, 1), base_url="http://testserver")

    def test_proxy_names_users_and_settings_give_roles(self, client: TestClient) -> None:
        proxy = self.at(client, "10.1.2.3")
        ann = proxy.get("/api/me", headers={"X-Forwarded-User": "Ann"}).json()
        bob = proxy.get("/api/me", headers={"X-Forwarded-User": "Bob"}).json()
        assert (ann["name"], ann["role"], ann["auth_method"]) == ("Ann", "edit", "proxy")
        assert (bob["name"], bob["role"]) == ("Bob", "view")
        assert proxy.get("/api/scenes").status_code == 401

    def test_proxy_sends_names_in_utf_8(self, client: TestClient, settings: Settings) -> None:
        settings.proxy_roles["Zoë"] = "edit"
        for sent in ("Zoë".encode(), "Zoë".encode("latin-1")):
            identity = self.at(client, "10.1.2.3").get("/api/me", headers={b"X-Forwarded-User": sent}).json()
            assert (identity["name"], identity["role"]) == ("Zoë", "edit")

    def test_headers_of_untrusted_peers_are_ignored(self, client: TestClient) -> None:
        for address in ("192.168.0.1", "testclient", ""):
            other = self.at(client, address)
            assert other.get("/api/scenes", headers={"X-Forwarded-User": "Ann"}).status_code == 401
            headers = {"X-Forwarded-User": "Ann", "X-Forwarded-For": "10.1.2.3"}
            assert other.get("/api/scenes", headers=headers).status_code == 401

    def test_client_addresses_come_from_the_proxy(
        self, client: TestClient, bearer: Bearer, access: AuthServices
    ) -> None:
        headers = {"X-Forwarded-For": "1.2.3.4, 192.0.2.7"}  # the client may have forged the first
        for each, name in ((self.at(client, "10.1.2.3"), "Red"), (client, "Blue")):
            each.put(f"/api/looks/{name}", json={}, headers={**headers, **bearer("edit", name)})
        assert [line.address for line in access.audit.list()] == ["testclient", "192.0.2.7"]

    def test_tls_at_the_proxy_makes_cookies_secure(self, client: TestClient, access: AuthServices) -> None:
        token = {"token": access.tokens.add("Ann", "edit")}
        headers = {"X-Forwarded-Proto": "https"}
        behind, direct = (
            each.post("/api/login", json=token, headers=headers).headers["set-cookie"].lower()
            for each in (self.at(client, "10.1.2.3"), client)
        )
        assert "secure" in behind
        assert "secure" not in direct

    def test_token_has_precedence_over_the_proxy(self, client: TestClient, bearer: Bearer) -> None:
        headers = {"X-Forwarded-User": "Ann", **bearer("admin", "Root")}
        assert self.at(client, "10.1.2.3").get("/api/me", headers=headers).json()["name"] == "Root"


def test_names_of_valid_tokens_are_unique(access: AuthServices) -> None:
    access.tokens.add("Ann", "view")
    with pytest.raises(Exception, match="revoke the valid token of this name first"):
        access.tokens.add("Ann", "edit")
    access.tokens.revoke("Ann")
    access.tokens.add("Ann", "edit")
    with pytest.raises(Exception, match="view, edit, admin"):
        access.tokens.add("Bob", "root")
    with pytest.raises(Exception, match="no valid token 'Eve'"):
        access.tokens.revoke("Eve")


def test_damaged_database_rejects_everyone_with_one_log_line(
    client: TestClient, bearer: Bearer, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    headers = bearer("edit")

    def damaged(*_: object) -> None:
        raise DatabaseDamagedError("database disk image is malformed")

    monkeypatch.setattr("relume_server.auth.tokens.TokenStore._fetch", damaged)
    caplog.clear()
    answer = client.get("/api/scenes", headers=headers)
    assert answer.status_code == 503
    assert answer.json()["type"] == "urn:relume:problem:database"
    assert client.get("/livez").status_code == 200
    (line,) = [record for record in caplog.records if record.name.startswith("relume_server.auth")]
    assert "the caller cannot be identified" in line.getMessage()
    assert not line.exc_info


def test_calls_during_a_database_outage_log_nothing(
    client: TestClient, bearer: Bearer, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    headers = bearer("edit")

    def away(*_: object) -> None:
        raise make_unavailable_error("connection refused")

    monkeypatch.setattr("relume_server.auth.tokens.TokenStore._fetch", away)
    for _ in range(3):
        assert client.get("/api/scenes", headers=headers).status_code == 503
    assert not [record for record in caplog.records if record.levelno == logging.ERROR]


def test_open_sessions_continue_during_a_database_outage(access: AuthServices, monkeypatch: pytest.MonkeyPatch) -> None:
    def away(*_: object) -> None:
        raise DatabaseDamagedError("database disk image is malformed")

    monkeypatch.setattr(access.tokens, "is_valid", away)
    assert run_in_thread(access.may_stay(Caller("Ann", Role.EDIT, "", "token", "0123456789ab")))
