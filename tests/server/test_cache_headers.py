"""Shared caches do not store responses that require login."""

from __future__ import annotations

import re

import pytest
from fastapi.testclient import TestClient
from session_client import Baked

from relume_server.auth.rules import RULES, SOCKET
from relume_server.settings import Settings


@pytest.fixture
def settings(settings: Settings) -> Settings:
    (settings.client / "assets").mkdir(parents=True)
    (settings.client / "index.html").write_text("<!doctype html>")
    (settings.client / "assets" / "a-1.js").write_text("0")
    return settings


def test_responses_that_need_a_role_are_not_public(client: TestClient, baked: Baked) -> None:
    parameters = {"scene": baked.scene, "bake": baked.bake, "view": "front", "environment": "studio"}
    answers = []
    for path, roles in RULES.items():
        filled = re.sub(r"\{(\w+)\}", lambda match: parameters.get(match[1], "0123456789abcdef"), path)
        if path in ("/livez", "/readyz") or path.endswith("/events"):
            continue
        answers += [client.request(method, filled) for method in roles if method not in (SOCKET, "DELETE")]
    assert sum(answer.status_code == 200 for answer in answers) > 10
    for answer in answers:
        said = answer.headers["cache-control"]
        assert "public" not in said, answer.url
        assert "private" in said or "no-store" in said or "no-cache" in said, answer.url
        assert {"Cookie", "Authorization"} <= set(answer.headers["vary"].split(", ")), answer.url


def test_images_stay_in_the_private_cache(client: TestClient, baked: Baked) -> None:
    said = client.get(f"/api/bakes/{baked.bake}/views/front/materials.png").headers["cache-control"]
    assert said.startswith("private, max-age=")


def test_editor_files_are_public(client: TestClient) -> None:
    answer = client.get("/assets/a-1.js")
    assert answer.headers["cache-control"].startswith("public")
    assert "vary" not in answer.headers
