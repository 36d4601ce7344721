"""HEAD for every GET, and status 304 for unchanged content."""

from typing import Any

import pytest
from fastapi.testclient import TestClient
from server_fakes import Control
from session_client import Baked
from test_comparisons import is_done, wait_until

SAFE = ("content-security-policy", "x-content-type-options", "x-request-id")


@pytest.fixture
def rendered(client: TestClient, baked: Baked) -> str:
    request = {"bake": baked.bake, "view": "front", "looks": [{}], "format": "png"}
    url = client.post("/api/renders", json=request).headers["location"]
    assert wait_until(client, url, is_done)["state"] == "ready"
    return str(url)


@pytest.fixture
def urls(client: TestClient, baked: Baked, rendered: str) -> list[str]:
    """Files and JSON with a validator."""
    assert client.put("/api/looks/a", json={}).status_code == 201
    made = [f"{rendered}/frames/0", f"{rendered}/archive.zip", f"/api/scenes/{baked.scene}/thumbnail.webp"]
    lists = ["/api/materials", "/api/models", "/api/openapi.json", "/api/scenes", "/api/bakes", rendered]
    return [*made, *lists, "/api/looks/a"]


def test_unchanged_content_is_not_sent_again(client: TestClient, urls: list[str]) -> None:
    for url in urls:
        first = client.get(url)
        assert first.status_code == 200, url
        etag = first.headers["etag"]
        for etags in (etag, f'"other", {etag}', f"W/{etag}", "*"):
            again = client.get(url, headers={"If-None-Match": etags})
            assert (again.status_code, again.content) == (304, b""), (url, etags)
            assert again.headers["etag"] == etag
            assert "content-length" not in again.headers
            assert all(name in again.headers for name in SAFE)
        assert client.get(url, headers={"If-None-Match": '"other"'}).content == first.content
        if (modified := first.headers.get("last-modified")) is not None:
            assert client.get(url, headers={"If-Modified-Since": modified}).status_code == 304, url
            early = {"If-Modified-Since": "Thu, 01 Jan 1970 00:00:00 GMT"}
            assert client.get(url, headers=early).status_code == 200
            changed = {"If-None-Match": '"other"', "If-Modified-Since": modified}
            assert client.get(url, headers=changed).status_code == 200, "a date says less than a tag"
        for nonsense in ("yesterday", "", "Thu, 99 Foo 1970"):
            assert client.get(url, headers={"If-Modified-Since": nonsense}).status_code == 200


def test_changed_content_is_sent(client: TestClient, baked: Baked) -> None:
    before = client.get("/api/looks").headers["etag"]
    assert client.put("/api/looks/b", json={}).status_code == 201
    assert client.get("/api/looks", headers={"If-None-Match": before}).json()[0]["name"] == "b"


def test_head_answers_as_get_does_without_the_body(client: TestClient, urls: list[str], baked: Baked) -> None:
    for url in (*urls, "/livez", "/readyz", "/metrics", f"/api/bakes/{baked.bake}", "/api/me", "/api/renders/nothing"):
        get, head = client.get(url), client.head(url)
        assert (head.status_code, head.content) == (get.status_code, b""), url
        assert head.headers["content-type"] == get.headers["content-type"]
        if url not in ("/metrics",):  # it counts this call
            assert head.headers["content-length"] == str(len(get.content)), url
        if "etag" in get.headers:
            assert client.head(url, headers={"If-None-Match": get.headers["etag"]}).status_code == 304


def test_head_of_an_event_stream_ends(client: TestClient, control: Control, baked: Baked) -> None:
    head = client.head(f"/api/bakes/{baked.bake}/events")
    assert (head.status_code, head.content) == (200, b"")
    assert head.headers["content-type"].startswith("text/event-stream")


def test_range_requests_still_work(client: TestClient, rendered: str) -> None:
    whole = client.get(f"{rendered}/frames/0").content
    response: Any = client.get(f"{rendered}/frames/0", headers={"Range": "bytes=2-5"})
    assert (response.status_code, response.content) == (206, whole[2:6])
