"""Rate limit of token guesses, logins and rejections in the audit log, and cookies."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from fastapi.testclient import TestClient

from relume_server.auth.audit import Audit, Change
from relume_server.auth.rate_limit import bucket_name
from relume_server.auth.services import AuthServices
from relume_server.auth.tokens import TokenStore
from relume_server.settings import Settings

Bearer = Callable[..., dict[str, str]]
GUESS = "relume_{:012x}_x"


@pytest.fixture
def settings(settings: Settings, monkeypatch: pytest.MonkeyPatch) -> Settings:
    settings.requests_at_once = 4  # without RELUME_REQUESTS_PER_SECOND, calls are not counted
    # A bucket that refills during a test would count how fast the machine answers.
    monkeypatch.setattr("relume_server.auth.identity.UNKNOWN_PER_SECOND", 0.001)
    return settings


@pytest.fixture
def lookups(client: TestClient, access: AuthServices, monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """One entry for each token lookup in the database."""
    asked: list[int] = []
    sessions = access.tokens._sessions

    def counted() -> object:
        asked.append(1)
        return sessions()

    monkeypatch.setattr(access.tokens, "_sessions", counted)
    return asked


def test_number_of_looked_up_guesses_is_limited(client: TestClient, lookups: list[int]) -> None:
    answers = [client.get("/api/scenes", headers={"Authorization": f"Bearer {GUESS.format(k)}"}) for k in range(8)]
    assert [answer.status_code for answer in answers[:4]] == [401] * 4
    assert answers[-1].status_code == 429
    assert "too many wrong tokens; wait" in answers[-1].json()["detail"]
    assert len(lookups) == 4
    for k in range(10):
        client.post("/api/login", json={"token": GUESS.format(100 + k)})
    assert len(lookups) == 4


def test_guesses_from_the_same_address_do_not_delay_known_users(
    client: TestClient, bearer: Bearer, monkeypatch: pytest.MonkeyPatch
) -> None:
    ann = bearer("view", "Ann")
    assert client.get("/api/scenes", headers=ann).status_code == 200
    for k in range(8):
        client.get("/api/scenes", headers={"Authorization": f"Bearer {GUESS.format(k)}"})
    monkeypatch.setattr("relume_server.auth.tokens.TOKEN_CACHE_S", -1.0)  # each call is looked up
    assert [client.get("/api/scenes", headers=ann).status_code for _ in range(8)] == [200] * 8


def test_number_of_cached_unknown_tokens_is_bounded(
    access: AuthServices, lookups: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("relume_server.auth.tokens.MAX_UNKNOWN_IDS", 2)
    for k in (0, 0, 1, 2):
        assert access.tokens.authenticate(GUESS.format(k)) is None
    assert len(lookups) == 3
    assert len(access.tokens._unknown_ids) == 2


def test_valid_id_with_a_wrong_secret_is_a_guess(access: AuthServices) -> None:
    tokens: TokenStore = access.tokens
    right = tokens.add("Ann", "view")
    assert not tokens.is_cached(right)
    assert tokens.authenticate(right) is not None
    assert tokens.is_cached(right)
    assert not tokens.is_cached(right[:-1] + ("a" if right[-1] != "a" else "b"))


@pytest.mark.parametrize(
    ("address", "bucket"),
    [
        ("2001:db8:1:2:3:4:5:6", "2001:db8:1:2::/64"),
        ("2001:db8:1:2::ffff", "2001:db8:1:2::/64"),
        ("fe80::1%eth0", "fe80::/64"),
        ("::ffff:192.0.2.7", "192.0.2.7"),
        ("192.0.2.7", "192.0.2.7"),
        ("somewhere", "somewhere"),
    ],
)
def test_ipv6_addresses_count_by_network(address: str, bucket: str) -> None:
    assert bucket_name(address) == bucket


class TestAudit:
    def test_logins_wrong_tokens_and_rejections_are_logged(
        self, client: TestClient, bearer: Bearer, access: AuthServices
    ) -> None:
        token = access.tokens.add("Ann", "edit")
        assert client.post("/api/login", json={"token": token}).status_code == 204
        client.cookies.clear()
        assert client.post("/api/login", json={"token": GUESS.format(1)}).status_code == 401
        wrong = {"Authorization": f"Bearer {GUESS.format(2)}"}
        assert client.get("/api/scenes", headers=wrong).status_code == 401
        assert client.put("/api/looks/a%1b[2Jb", json={}, headers=bearer("view", "Vera")).status_code == 403
        assert client.get("/api/scenes").status_code == 401  # not a login attempt
        lines = [(line.who, line.role, line.what, line.status) for line in reversed(access.audit.list())]
        assert lines == [
            ("Ann", "edit", "POST /api/login", 204),
            ("testclient", "anyone", "POST /api/login", 401),
            ("testclient", "anyone", "GET /api/scenes", 401),
            ("Vera", "view", "PUT /api/looks/a%1B%5B2Jb", 403),
        ]
        assert token not in str(access.audit.list())

    def test_rejections_do_not_evict_changes(self, access: AuthServices) -> None:
        audit = Audit(access.tokens._sessions, 20)
        audit.add(Change("Ann", "edit", "::1", "PUT /api/looks/Red", "/api/looks/Red", 201, "r1"))
        for _ in range(210):
            audit.add(Change("192.0.2.7", "anyone", "192.0.2.7", "POST /api/login", "", 401, "r2"))
        lines = audit.list(1000)
        assert [line.who for line in lines if line.status == 201] == ["Ann"]
        assert 2 <= len(lines) < 110


class TestHttpsOnly:
    @pytest.fixture
    def settings(self, settings: Settings) -> Settings:
        settings.https_only = True
        return settings

    def test_cookies_are_secure_and_hsts_is_set(self, client: TestClient, access: AuthServices) -> None:
        answer = client.post("/api/login", json={"token": access.tokens.add("Ann", "edit")})
        assert "; secure" in answer.headers["set-cookie"].lower()
        assert answer.headers["strict-transport-security"] == "max-age=31536000"


def test_http_is_allowed_otherwise(client: TestClient) -> None:
    assert "strict-transport-security" not in client.get("/livez").headers
