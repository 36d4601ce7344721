"""Saved looks: order of looks, order of their entries, and thumbnails."""

from __future__ import annotations

import base64
import io
from typing import Any

import pytest
from fastapi.testclient import TestClient
from PIL import Image

NEW = {"If-None-Match": "*"}


def put(client: TestClient, name: str, look: dict[str, Any], **params: str) -> dict[str, Any]:
    answer = client.put(f"/api/looks/{name}", json=look, headers=NEW, params=params)
    assert answer.status_code == 201, answer.text
    entry: dict[str, Any] = answer.json()
    assert entry["etag"] == answer.headers["etag"]
    return entry


def by_creation(client: TestClient) -> list[str]:
    return [entry["name"] for entry in sorted(client.get("/api/looks").json(), key=lambda entry: entry["created"])]


def picture(color: str) -> str:
    written = io.BytesIO()
    Image.new("RGB", (400, 300), color).save(written, "PNG")
    return base64.b64encode(written.getvalue()).decode()


def test_looks_keep_their_order_when_changed_renamed_or_restored(client: TestClient) -> None:
    night = put(client, "Night", {"display": {"exposure": 1.0}})
    put(client, "Studio", {})
    put(client, "Dawn", {})
    changed = client.put("/api/looks/Night", json={"display": {}}, headers={"If-Match": night["etag"]})
    assert changed.status_code == 204
    assert by_creation(client) == ["Night", "Studio", "Dawn"]
    assert put(client, "Dusk", {}, created=night["created"])["created"] == night["created"]
    client.delete("/api/looks/Night", headers={"If-Match": "*"})
    assert by_creation(client) == ["Dusk", "Studio", "Dawn"]


NEVER = "yesterday", "2999-01-01T00:00:00+00:00", "0001-01-01T00:00:00+14:00", "2020-01-01"


@pytest.mark.parametrize("created", NEVER)
def test_creation_time_must_be_in_the_past(client: TestClient, created: str) -> None:
    assert client.put("/api/looks/Odd", json={}, headers=NEW, params={"created": created}).status_code == 422
    assert client.get("/api/looks").json() == []


def test_lights_of_a_look_keep_their_order(client: TestClient) -> None:
    lights = {name: {"kind": "point"} for name in ("Key", "Softbox", "Back")}
    put(client, "Lit", {"lights": lights})
    assert list(client.get("/api/looks/Lit").json()["lights"]) == ["Key", "Softbox", "Back"]


def test_thumbnail_belongs_to_one_version(client: TestClient) -> None:
    entry = put(client, "Night & day", {})
    url = "/api/looks/Night%20%26%20day/thumbnail"
    assert entry["thumbnail"] is None
    assert client.get(f"{url}.webp").status_code == 404
    assert client.put(url, json={"picture": picture("red")}).status_code == 428
    assert client.put(url, json={"picture": picture("red")}, headers={"If-Match": '"other"'}).status_code == 412
    assert client.put(url, json={"picture": picture("red")}, headers={"If-Match": entry["etag"]}).status_code == 204
    (listed,) = client.get("/api/looks").json()
    assert listed["etag"] == entry["etag"]
    shown = client.get(listed["thumbnail"])
    assert shown.headers["content-type"] == "image/webp"
    image = Image.open(io.BytesIO(shown.content))
    assert max(image.size) <= 320
    red, green, _ = image.convert("RGB").getpixel((20, 20))  # type: ignore[misc]
    assert red > 200 > 50 > green
    client.put("/api/looks/Night%20%26%20day", json={"display": {}}, headers={"If-Match": entry["etag"]})
    assert client.get("/api/looks").json()[0]["thumbnail"] is None
    assert client.get(listed["thumbnail"]).status_code == 404


@pytest.mark.parametrize("bad", ["", "AAAA", "x" * 350_001])
def test_invalid_thumbnails_are_rejected(client: TestClient, bad: str) -> None:
    entry = put(client, "Night", {})
    refused = client.put("/api/looks/Night/thumbnail", json={"picture": bad}, headers={"If-Match": entry["etag"]})
    assert refused.status_code == 422
    assert client.get("/api/looks").json()[0]["thumbnail"] is None
