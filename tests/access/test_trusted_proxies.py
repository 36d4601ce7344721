"""What a trusted proxy says: where a call comes from, and, where settings ask for that, who calls."""

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

from relume_server.auth.exposure import check_openness
from relume_server.auth.proxies import RESOLVE_INTERVAL_S, Proxies
from relume_server.auth.services import AuthServices
from relume_server.errors import OpennessError
from relume_server.settings import Settings

Bearer = Callable[..., dict[str, str]]


@pytest.fixture
def settings(settings: Settings) -> Settings:
    settings.trusted_proxies = ["10.0.0.0/8"]
    return settings


def proxy(client: TestClient, address: str = "10.1.2.3") -> TestClient:
    return TestClient(client.app, client=(address, 1), base_url="http://testserver")


def test_of_a_proxy_whose_addresses_count_nobody_is_known_by_name(client: TestClient) -> None:
    said = {"X-Forwarded-User": "Ann", "X-Forwarded-For": "192.0.2.7"}
    assert proxy(client).get("/api/scenes", headers=said).status_code == 401


def test_the_line_that_the_proxy_adds_counts_not_the_clients_own(
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

    def test_of_several_lines_the_proxys_own_counts(self, client: TestClient) -> None:
        lines = [("X-Forwarded-User", "Root"), ("X-Forwarded-User", "Ann")]
        assert proxy(client).get("/api/me", headers=lines).json()["name"] == "Ann"

    def test_whom_a_proxy_calls_ann_uses_up_nothing_of_who_has_anns_token(
        self, client: TestClient, bearer: Bearer, access: AuthServices
    ) -> None:
        said, token = {"X-Forwarded-User": "Ann"}, bearer("edit", "Ann")
        answers = [proxy(client).get("/api/me", headers=said) for _ in range(4)]
        assert [answer.status_code for answer in answers] == [200, 200, 200, 429]
        assert answers[0].json()["name"] == "Ann"
        assert client.get("/api/me", headers=token).status_code == 200
        with access.quotas.session("proxy:Ann"), access.quotas.session("Ann"):
            assert access.quotas.num_sessions == 2

    def test_other_people_read_the_name_alone(self, client: TestClient, baked: Baked, settings: Settings) -> None:
        settings.proxy_roles["Ann"] = "edit"
        pin = {"bake": baked.bake, "view": "front", "x": 1, "y": 2, "size": SIZE, "text": "Too bright"}
        path = f"/api/scenes/{baked.scene}/comments"
        made = proxy(client).post(path, json=pin, headers={"X-Forwarded-User": "Ann"})
        assert (made.status_code, made.json()["author"]) == (201, "Ann")

    def test_no_token_is_called_as_a_proxy_calls_people(self, access: AuthServices) -> None:
        with pytest.raises(Exception, match="does not begin with proxy:"):
            access.tokens.add("proxy:Ann", "edit")

    def test_a_token_that_is_called_as_an_address_is_counted_apart_from_it(
        self, client: TestClient, bearer: Bearer
    ) -> None:
        assert [client.get("/api/me").status_code for _ in range(4)] == [200, 200, 200, 429]
        assert client.get("/api/me", headers=bearer("view", "testclient")).status_code == 200


def test_a_name_is_looked_up_again_when_its_proxy_calls_from_elsewhere(monkeypatch: pytest.MonkeyPatch) -> None:
    now_s, address = 0.0, "10.9.9.9"
    lookups: list[str] = []

    async def found(_: Any, name: str, *args: object, **more: object) -> list[Any]:
        lookups.append(name)
        if not address:
            raise socket.gaierror("no such name")
        return [(socket.AF_INET, socket.SOCK_STREAM, 0, "", (address, 0))]

    proxies = Proxies(["relight-proxy.relume.svc", "192.0.2.1"], lambda: now_s)
    monkeypatch.setattr(asyncio.BaseEventLoop, "getaddrinfo", found)

    async def trusts(peer: str) -> bool:
        await proxies.resolve(peer)
        return proxies.has(peer)

    assert run_in_thread(trusts("192.0.2.1"))
    assert lookups == []  # it is known without
    assert run_in_thread(trusts("10.9.9.9"))
    address = "10.9.9.8"
    assert not run_in_thread(trusts("10.9.9.8"))  # asked too lately
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
    def test_settings_that_let_in_more_than_they_sound_like_are_refused(self, given: Any, said: str) -> None:
        with pytest.raises(OpennessError, match=said):
            check_openness(Settings(**given))

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
    def test_others_are_not(self, given: Any) -> None:
        check_openness(Settings(**given))

    @pytest.mark.parametrize("text", ["10.0.0.0/33", "a b", "-x", "", "10.0.0"])
    def test_what_is_no_place_of_a_proxy_is_refused(self, text: str) -> None:
        with pytest.raises(ValueError, match=r"an address such as 10\.0\.0\.5"):
            Settings(trusted_proxies=[text])


def test_without_a_login_all_are_one_client_whatever_proxies_there_are() -> None:
    assert Settings(trusted_proxies=["10.0.0.5"], max_queued=8).max_queued_per_client == 8
