"""Trusted proxies: the client's address, and its user name if the settings ask for it."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Callable
from typing import Any

import pytest
from coroutines import run_in_thread
from fastapi.testclient import TestClient
from server_fakes import SIZE
from session_client import Baked

from relume_server.auth.access_check import check_access_settings
from relume_server.auth.proxies import RESOLVE_INTERVAL_S, Proxies
from relume_server.auth.services import AuthServices
from relume_server.errors import UnsafeAccessError
from relume_server.settings import Settings

Bearer = Callable[..., dict[str, str]]


@pytest.fixture
def settings(settings: Settings) -> Settings:
    settings.trusted_proxies = ["10.0.0.0/8"]
    return settings


def proxy(client: TestClient, address: str = "10.1.2.3") -> TestClient:
    return TestClient(client.app, client=(address, 1), base_url="http://testserver")


def test_proxy_trusted_for_addresses_names_no_users(client: TestClient) -> None:
    said = {"X-Forwarded-User": "Ann", "X-Forwarded-For": "192.0.2.7"}
    assert proxy(client).get("/api/scenes", headers=said).status_code == 401


def test_header_of_the_proxy_overrides_that_of_the_client(
    client: TestClient, bearer: Bearer, access: AuthServices
) -> None:
    lines = [("X-Forwarded-For", "1.2.3.4"), ("X-Forwarded-For", "5.6.7.8, 192.0.2.7"), *bearer("edit").items()]
    assert proxy(client).put("/api/looks/Red", json={}, headers=lines).status_code == 201
    assert access.audit.list()[0].address == "192.0.2.7"


class TestNames:
    @pytest.fixture
    def settings(self, settings: Settings) -> Settings:
        settings.user_header, settings.max_sessions_per_user = "X-Forwarded-User", 1
        settings.requests_per_second, settings.requests_at_once = 0.001, 3
        return settings

    def test_last_of_several_headers_is_the_proxys(self, client: TestClient) -> None:
        lines = [("X-Forwarded-User", "Root"), ("X-Forwarded-User", "Ann")]
        assert proxy(client).get("/api/me", headers=lines).json()["name"] == "Ann"

    def test_proxy_user_and_token_of_the_same_name_have_separate_quotas(
        self, client: TestClient, bearer: Bearer, access: AuthServices
    ) -> None:
        said, token = {"X-Forwarded-User": "Ann"}, bearer("edit", "Ann")
        answers = [proxy(client).get("/api/me", headers=said) for _ in range(4)]
        assert [answer.status_code for answer in answers] == [200, 200, 200, 429]
        assert answers[0].json()["name"] == "Ann"
        assert client.get("/api/me", headers=token).status_code == 200
        with access.quotas.session("proxy:Ann"), access.quotas.session("Ann"):
            assert access.quotas.num_sessions == 2

    def test_other_users_see_only_the_name(self, client: TestClient, baked: Baked, settings: Settings) -> None:
        settings.proxy_roles["Ann"] = "edit"
        pin = {"bake": baked.bake, "view": "front", "x": 1, "y": 2, "size": SIZE, "text": "Too bright"}
        path = f"/api/scenes/{baked.scene}/comments"
        made = proxy(client).post(path, json=pin, headers={"X-Forwarded-User": "Ann"})
        assert (made.status_code, made.json()["author"]) == (201, "Ann")

    def test_token_names_cannot_equal_proxy_users(self, access: AuthServices) -> None:
        with pytest.raises(Exception, match="does not begin with proxy:"):
            access.tokens.add("proxy:Ann", "edit")

    def test_token_named_like_an_address_has_a_separate_count(self, client: TestClient, bearer: Bearer) -> None:
        assert [client.get("/api/me").status_code for _ in range(4)] == [200, 200, 200, 429]
        assert client.get("/api/me", headers=bearer("view", "testclient")).status_code == 200


def test_host_name_is_resolved_again_when_the_proxy_address_changes(monkeypatch: pytest.MonkeyPatch) -> None:
    now_s, address = 0.0, "10.9.9.9"
    lookups: list[str] = []

    async def resolve(_: Any, name: str, *args: object, **more: object) -> list[Any]:
        lookups.append(name)
        if not address:
            raise socket.gaierror("no such name")
        return [(socket.AF_INET, socket.SOCK_STREAM, 0, "", (address, 0))]

    proxies = Proxies(["relight-proxy.relume.svc", "192.0.2.1"], lambda: now_s)
    monkeypatch.setattr(asyncio.BaseEventLoop, "getaddrinfo", resolve)

    async def trusts(peer: str) -> bool:
        await proxies.resolve(peer)
        return proxies.has(peer)

    assert run_in_thread(trusts("192.0.2.1"))
    assert lookups == []  # no lookup is needed
    assert run_in_thread(trusts("10.9.9.9"))
    address = "10.9.9.8"
    assert not run_in_thread(trusts("10.9.9.8"))  # the last lookup is too recent
    now_s = RESOLVE_INTERVAL_S
    assert run_in_thread(trusts("10.9.9.8"))
    assert not proxies.has("10.9.9.9")
    now_s, address = 2 * RESOLVE_INTERVAL_S, ""
    assert not run_in_thread(trusts("10.9.9.7"))
    assert lookups == ["relight-proxy.relume.svc"] * 3


class TestStart:
    @pytest.mark.parametrize(
        ("given", "said"),
        [
            ({"user_header": "X-Forwarded-User", "trusted_proxies": ["10.0.0.5"]}, "there is no login"),
            ({"proxy_roles": {"Ann": "edit"}}, "there is no login"),
            ({"proxy_role": "edit"}, "there is no login"),
            ({"login": True, "proxy_roles": {"Ann": "edit"}, "trusted_proxies": ["10.0.0.5"]}, "RELUME_USER_HEADER="),
            ({"login": True, "user_header": "X-Forwarded-User"}, "RELUME_TRUSTED_PROXIES"),
            ({"host": "0.0.0.0"}, "RELUME_LOGIN=true"),
            ({"host": "::"}, "RELUME_LOGIN=true"),
            ({"host": "relight.example.org"}, "RELUME_LOGIN=true"),
        ],
    )
    def test_settings_that_trust_too_much_are_rejected(self, given: Any, said: str) -> None:
        with pytest.raises(UnsafeAccessError, match=said):
            check_access_settings(Settings(**given))

    @pytest.mark.parametrize(
        "given",
        [
            {},
            {"host": "127.0.0.2"},
            {"host": "localhost"},
            {"host": "0.0.0.0", "login": False},
            {"host": "0.0.0.0", "login": True},
            {"login": True, "user_header": "X-User", "trusted_proxies": ["10.0.0.5"], "proxy_role": "edit"},
            {"trusted_proxies": ["10.0.0.5"]},
        ],
    )
    def test_other_settings_are_accepted(self, given: Any) -> None:
        check_access_settings(Settings(**given))

    @pytest.mark.parametrize("text", ["10.0.0.0/33", "a b", "-x", "", "10.0.0"])
    def test_invalid_proxy_addresses_are_rejected(self, text: str) -> None:
        with pytest.raises(ValueError, match=r"an address such as 10\.0\.0\.5"):
            Settings(trusted_proxies=[text])


def test_without_login_all_callers_are_one_client() -> None:
    assert Settings(trusted_proxies=["10.0.0.5"], max_queued=8).max_queued_per_client == 8
