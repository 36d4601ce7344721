"""Event streams: they are counted, and end when the caller's access ends."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import replace

import pytest
from fastapi.testclient import TestClient
from session_client import Baked, open_session

from relume_server.auth import quotas
from relume_server.auth.identity import Identity
from relume_server.auth.quotas import Quotas
from relume_server.auth.roles import Caller, Role
from relume_server.auth.services import AuthServices
from relume_server.settings import Settings
from relume_worker.jobs.job import QuotaError
from relume_worker.service import BakeService
from relume_worker.status import BakeStatus

Bearer = Callable[..., dict[str, str]]
ANN = Caller("Ann", Role.EDIT, "10.0.0.1", "proxy")


@pytest.fixture(autouse=True)
def _quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("relume_server.auth.services.TOKEN_CACHE_S", 0.05)
    monkeypatch.setattr("relume_server.auth.tokens.TOKEN_CACHE_S", 0.0)
    monkeypatch.setattr("relume_server.api.bakes.EVENT_POLL_S", 0.05)


@pytest.fixture
def checks(client: TestClient, baked: Baked, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The bake never ends; each authorization check is recorded here."""
    bakes: BakeService = client.app.state.services.bakes  # type: ignore[attr-defined]
    get, checks = bakes.get, list[str]()

    def runs(bake: str) -> BakeStatus:
        checks.append(bake)
        return replace(get(bake), state="running")

    monkeypatch.setattr(bakes, "get", runs)
    return checks


def named_by_a_proxy(monkeypatch: pytest.MonkeyPatch) -> None:
    async def caller(*_: object) -> Caller:
        return ANN

    monkeypatch.setattr(Identity, "caller", caller)


def test_streams_are_limited_per_caller(access: AuthServices) -> None:
    bob, unnamed, elsewhere = (
        Caller("Bob", Role.VIEW, "10.0.0.1", "token"),
        *(Caller("", Role.ADMIN, address, "open") for address in ("10.0.0.1", "10.0.0.2")),
    )
    for caller in (ANN, bob, unnamed, elsewhere):
        check_bound(access.quotas, caller)


def check_bound(user_quotas: Quotas, caller: Caller) -> None:
    held = [user_quotas.stream(caller) for _ in range(quotas.MAX_STREAMS_EACH)]
    for each in held:
        each.__enter__()
    with pytest.raises(QuotaError, match="limit of 32 event streams"), user_quotas.stream(caller):
        pass
    held[0].__exit__(None, None, None)
    with user_quotas.stream(caller):
        pass


def test_excess_streams_are_rejected(client: TestClient, baked: Baked, access: AuthServices, bearer: Bearer) -> None:
    ann = bearer("view", "Ann")
    with ExitStack() as held:
        for _ in range(quotas.MAX_STREAMS_EACH):
            held.enter_context(access.quotas.stream(ANN))
        refused = client.get(f"/api/bakes/{baked.bake}/events", headers=ann)
        assert (refused.status_code, refused.json()["type"]) == (429, "urn:relume:problem:quota")
    assert client.get(f"/api/bakes/{baked.bake}/events", headers=ann).status_code == 200
    assert client.get(f"/api/bakes/{'0' * 16}/events", headers=ann).status_code == 404
    check_bound(access.quotas, ANN)  # all were released at their end


def test_stream_ends_when_the_token_is_revoked(
    client: TestClient, baked: Baked, access: AuthServices, bearer: Bearer, checks: list[str]
) -> None:
    ann = bearer("view", "Ann")
    with ThreadPoolExecutor() as beside:
        stream = beside.submit(client.get, f"/api/bakes/{baked.bake}/events", headers=ann)
        while len(checks) < 3:
            time.sleep(0.01)
        assert not stream.done()
        access.tokens.revoke("Ann")
        assert "event: bake" in stream.result().text


def test_streams_of_proxy_users_need_the_proxy(
    client: TestClient, baked: Baked, checks: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    named_by_a_proxy(monkeypatch)
    monkeypatch.setattr("relume_server.api.bakes.PROXY_REVALIDATION_S", 0.2)
    assert "event: bake" in client.get(f"/api/bakes/{baked.bake}/events").text


class TestSession:
    @pytest.fixture
    def settings(self, settings: Settings) -> Settings:
        settings.drain_seconds = 0.2
        return settings

    def test_sessions_of_proxy_users_need_the_proxy(
        self, client: TestClient, baked: Baked, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        named_by_a_proxy(monkeypatch)
        monkeypatch.setattr("relume_server.session.session.PROXY_REVALIDATION_S", 0.05)
        with open_session(client, baked.bake) as session:
            hello = session.text("hello")
            assert session.text("server_draining")["seconds"] == 0.2
            with open_session(client, baked.bake, opening={"resume": hello["resume"]}) as again:
                assert again.text("hello")["resumed"]
            with pytest.raises(ConnectionError) as ended:
                session.text("never")
        assert ended.value.args[0] == 4401
