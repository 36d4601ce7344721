"""A setting decides whether viewers may comment."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from fastapi.testclient import TestClient
from server_fakes import SIZE
from session_client import Baked

from relume_server.auth.services import AuthServices
from relume_server.settings import Settings


@pytest.fixture
def settings(settings: Settings) -> Settings:
    settings.allow_viewer_comments = True
    return settings


def test_viewers_comment_under_their_own_name_and_change_nothing_else(
    client: TestClient, baked: Baked, bearer: Callable[..., dict[str, str]], access: AuthServices
) -> None:
    vera, path = bearer("view", "Vera"), f"/api/scenes/{baked.scene}/comments"
    pin: dict[str, Any] = {"bake": baked.bake, "view": "front", "x": 1, "y": 2, "size": SIZE, "text": "Too bright"}
    assert client.get("/api/me", headers=vera).json()["allow_viewer_comments"]
    made = client.post(path, json={**pin, "author": "Ann"}, headers=vera)
    assert (made.status_code, made.json()["author"]) == (201, "Vera")
    assert client.post(path, json=pin).status_code == 401
    comment_url = f"{path}/{made.json()['id']}"
    assert client.patch(comment_url, json={"resolved": True}, headers=vera).status_code == 403
    assert client.delete(comment_url, headers=vera).status_code == 403
    changes = [(line.who, line.what) for line in access.audit.list() if line.status < 300]
    assert changes == [("Vera", f"POST {path}")]
