"""A server with login, and clients for each role."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from fastapi.testclient import TestClient
from server_fixtures import ack_seconds, baked, client, control, empty_ledger
from server_fixtures import settings as open_settings

from relume_server.auth.services import AuthServices
from relume_server.settings import Settings

__all__ = ["ack_seconds", "baked", "client", "control", "empty_ledger", "open_settings"]


@pytest.fixture
def settings(open_settings: Settings) -> Settings:
    open_settings.login = True
    return open_settings


@pytest.fixture
def access(client: TestClient) -> AuthServices:
    return client.app.state.services.access


@pytest.fixture
def bearer(access: AuthServices) -> Callable[..., dict[str, str]]:
    """Authorization headers for a role."""

    def headers(role: str, name: str | None = None, **more: Any) -> dict[str, str]:
        return {"Authorization": f"Bearer {access.tokens.add(name or role, role, **more)}"}

    return headers
