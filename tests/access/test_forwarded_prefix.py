"""The prefix at which a proxy publishes the server: only a trusted proxy's word counts."""

from __future__ import annotations

import pytest
from fastapi.testclient import TestClient

from relume_server.auth.identity import COOKIE
from relume_server.auth.services import AuthServices
from relume_server.settings import Settings

SENT = {"X-Forwarded-Prefix": "/hub/relume"}


@pytest.fixture
def settings(settings: Settings) -> Settings:
    settings.trusted_proxies = ["10.0.0.0/8"]
    return settings


def cookie_path(client: TestClient, access: AuthServices, address: str, headers: dict[str, str]) -> str:
    caller = TestClient(client.app, client=(address, 1), base_url="http://testserver")
    answer = caller.post("/api/login", json={"token": access.tokens.add("Ann", "view")}, headers=headers)
    (cookie,) = answer.headers.get_list("set-cookie")
    assert cookie.startswith(f"{COOKIE}=")
    return cookie.partition("Path=")[2].partition(";")[0]


def test_cookie_is_for_the_prefix_of_a_trusted_proxy(client: TestClient, access: AuthServices) -> None:
    assert cookie_path(client, access, "10.1.2.3", SENT) == "/hub/relume"
    caller = TestClient(client.app, client=("10.1.2.3", 1), base_url="http://testserver")
    assert "Path=/hub/relume;" in caller.post("/api/logout", headers=SENT).headers["set-cookie"]


def test_word_of_others_does_not_count(client: TestClient, access: AuthServices) -> None:
    assert cookie_path(client, access, "192.0.2.7", SENT) == "/"


def test_invalid_prefix_counts_as_none(client: TestClient, access: AuthServices) -> None:
    assert cookie_path(client, access, "10.1.2.3", {"X-Forwarded-Prefix": "//other.example"}) == "/"


def test_last_value_is_the_proxys(client: TestClient, access: AuthServices) -> None:
    sent = {"X-Forwarded-Prefix": "/forged, /relume"}
    assert cookie_path(client, access, "10.1.2.3", sent) == "/relume"
